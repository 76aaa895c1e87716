"""The camera's geometry: from the picture to a ray, and from a point to the picture, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Camera
from ..model.scene_camera import camera_frame
from .compiling import compiled, inlined
from .vectors import dot, length, minus, mixed_of, moved, negated, over


class Viewpoint(NamedTuple):
    """The camera: a pixel is found by projection, row 0 on top."""

    position: np.ndarray
    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    half_width: float
    """Picture's middle to its right border: at distance one (pinhole) or on the film (orthographic)."""
    half_height: float
    orthographic: bool
    width: int
    height: int
    lens_radius: float
    focus_distance: float
    """Distance of the plane of focus, along `forward`."""


def viewpoint(camera: Camera, width: int, height: int, centre: np.ndarray) -> Viewpoint:
    """The camera about the world position `centre`, the origin of a `PhotonScene`'s arrays."""
    orthographic = camera.kind == "orthographic"
    half = 0.5 * camera.vertical_extent if orthographic else np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    return Viewpoint(
        np.asarray(camera.position, float) - centre,
        *camera_frame(camera),
        float(half * width / height),
        float(half),
        orthographic,
        width,
        height,
        float(camera.lens_radius),
        float(camera.plane_of_focus),
    )


@inlined
def camera_ray(camera, column, row):
    """(origin, unit direction) through the picture's point, pixels from its upper left corner."""
    x = camera.half_width * (2.0 * column / camera.width - 1.0)
    y = camera.half_height * (1.0 - 2.0 * row / camera.height)
    aside = mixed_of(x, camera.right, y, camera.up)
    if camera.orthographic:
        forward = camera.forward[0], camera.forward[1], camera.forward[2]
        return moved(camera.position, 1.0, aside), forward
    d = moved(camera.forward, 1.0, aside)
    return (camera.position[0], camera.position[1], camera.position[2]), over(d, length(d))


@inlined
def lens_ray(camera, column, row, a, b):
    """`camera_ray` from the place on the thin lens that two numbers in [0, 1) draw: both meet in the plane of focus."""
    o, d = camera_ray(camera, column, row)
    if camera.lens_radius <= 0.0:
        return o, d
    radius, angle = camera.lens_radius * math.sqrt(a), 2.0 * math.pi * b
    shift = mixed_of(radius * math.cos(angle), camera.right, radius * math.sin(angle), camera.up)
    reach = camera.focus_distance / dot(d, camera.forward)
    d = mixed_of(reach, d, -1.0, shift)
    return moved(o, 1.0, shift), over(d, length(d))


@compiled
def project(camera, place):
    """(row, column, film area per area across the way to the camera, toward the camera, its distance); row −1: not
    seen.

    The factor is 1/(d² cos³) for a pinhole and 1 for an orthographic camera; on a film at distance one.
    """
    unseen = -1, -1, 0.0, (0.0, 0.0, 0.0), 0.0
    r = minus(place, camera.position)
    depth = dot(r, camera.forward)
    if depth <= 0.0:
        return unseen
    x, y = dot(r, camera.right), dot(r, camera.up)
    if camera.orthographic:
        factor, distance, toward = 1.0, depth, negated(camera.forward)
    else:
        x, y = x / depth, y / depth
        distance = length(r)
        cosine = depth / distance
        factor = 1.0 / (distance * distance * cosine * cosine * cosine)
        toward = over(negated(r), distance)
    column = math.floor(0.5 * (1.0 + x / camera.half_width) * camera.width)
    row = math.floor(0.5 * (1.0 - y / camera.half_height) * camera.height)
    if column < 0 or column >= camera.width or row < 0 or row >= camera.height:
        return unseen
    return int(row), int(column), factor, toward, distance
