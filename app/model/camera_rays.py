"""A camera's frame and rays in float64, for fitting maps and for tests; the camera pass makes its rays in GLSL."""

from __future__ import annotations

import numpy as np

from .scene import Camera


def camera_frame(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit right, up and forward of a camera, float64 (3,) each."""
    forward = np.asarray(camera.target, float) - np.asarray(camera.position, float)
    forward /= np.linalg.norm(forward)
    up = np.asarray(camera.up, float)
    right = _cross(forward, up)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(up):  # looking along `up`: any upright will do
        right = _cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right /= np.linalg.norm(right)
    return right, _cross(right, forward), forward


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two vectors: numpy's own, made for arrays of them, takes ten times as long, some times in every frame."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def camera_rays(camera: Camera, picture: tuple[int, int], grid: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions (grid, grid, 3), world, of rays spread over the whole picture to its edges."""
    right, up, forward = camera_frame(camera)
    x, y = np.meshgrid(np.linspace(-1, 1, grid), np.linspace(-1, 1, grid))
    aspect = picture[0] / picture[1]
    position = np.asarray(camera.position, float)
    if camera.kind == "orthographic":
        half = 0.5 * camera.vertical_extent
        origins = position + half * (aspect * x[..., None] * right + y[..., None] * up)
        return origins, np.broadcast_to(forward, origins.shape).copy()
    half = np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    directions = forward + half * (aspect * x[..., None] * right + y[..., None] * up)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.broadcast_to(position, directions.shape).copy(), directions
