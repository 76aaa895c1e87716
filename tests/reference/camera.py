"""Float64 reference of shaders/lib/camera.glsl: from a pixel to the ray through it."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def picture_point(pixel: Array, within_pixel: Array, size: Array) -> Array:
    """(..., 2) in [-1, 1]², x to the right and y upwards, of a place in a pixel whose row 0 is the top."""
    width, height = np.asarray(size, np.float64)[..., 0], np.asarray(size, np.float64)[..., 1]
    column = np.asarray(pixel, np.float64)[..., 0] + within_pixel[..., 0]
    row = np.asarray(pixel, np.float64)[..., 1] + within_pixel[..., 1]
    return np.stack([(2.0 * column - width) / width, (height - 2.0 * row) / height], axis=-1)


def camera_ray(
    position: Array, forward: Array, half_right: Array, half_up: Array, orthographic: Array, picture: Array
) -> tuple[Array, Array]:
    """Origins and unit directions (..., 3). `half_right`, `half_up`: the picture's middle to its border, on the film
    (orthographic) or on the plane at distance one (pinhole); `orthographic`: bool (...)."""
    on_film = picture[..., :1] * half_right + picture[..., 1:] * half_up
    through = forward + on_film
    through = through / np.linalg.norm(through, axis=-1, keepdims=True)
    parallel = np.asarray(orthographic, bool)[..., None]
    return np.where(parallel, position + on_film, position), np.where(parallel, forward, through)
