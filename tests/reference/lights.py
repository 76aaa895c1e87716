"""Float64 reference of shaders/lib/lights.glsl: lights as a surface point sees them, and as a ray meets them.

`lights` are records of `spectrasplat.passes.camera.CAMERA_LIGHT`, one a row; points and directions are (N, 3).
"""

from __future__ import annotations

import numpy as np
from spectrasplat.reference.emission import concentric_disc, spot_falloff
from spectrasplat.reference.optics import dot, unit

Array = np.ndarray
POINT, DIRECTIONAL, COLLIMATED, AREA = range(4)
FAR = 1e30
"""Distance of the sun, as float32 has it."""


def sample_light(lights: Array, position: Array, uniform: Array) -> tuple[Array, Array, Array]:
    """Towards the light (N, 3), distance (N,), irradiance across that direction per unit of the light's quantity (N,).

    `uniform`: (N, 2) in the unit square."""
    light = _Fields(lights)
    kind = lights["kind"]
    tilt = concentric_disc(uniform)
    sun = -unit(light.axis + tilt[:, :1] * light.half_u + tilt[:, 1:] * light.half_v)
    in_beam, along = _aperture(light, position)
    place = np.where(light.is_disc[:, None], tilt, 2.0 * uniform - 1.0)
    spread = np.where((kind == AREA)[:, None], place, 0.0)
    way = light.position + spread[:, :1] * light.half_u + spread[:, 1:] * light.half_v - position
    distance = np.linalg.norm(way, axis=-1)
    toward = way / np.where(distance > 0.0, distance, 1.0)[:, None]
    square = np.where(distance > 0.0, distance, 1.0) ** 2
    emitted = np.where(
        kind == AREA,
        light.measure * np.maximum(-dot(toward, light.axis), 0.0),
        spot_falloff(-toward, light.axis, light.cone[:, 0], light.cone[:, 1]),
    )
    diverging = (kind == POINT) | (kind == AREA)
    return (
        np.where(diverging[:, None], toward, np.where((kind == DIRECTIONAL)[:, None], sun, -light.axis)),
        np.where(diverging, distance, np.where(kind == DIRECTIONAL, FAR, along)),
        np.where(
            diverging,
            emitted / square,
            np.where(kind == DIRECTIONAL, 1.0, (in_beam & (along > 0.0)).astype(np.float64)),
        ),
    )


def stretch_seen(offset: Array, half_side: Array, blur: Array) -> Array:
    """How much of a stretch of half width `half_side` a soft look at `offset` from its middle sees: (N,).

    A trapezoid over `offset` whose sides are 2 `blur` wide; its area is the stretch's, however wide the look."""
    offset, half_side, blur = np.broadcast_arrays(np.abs(offset), half_side, blur)
    # Up to `foot` something is seen, from `top` inwards all that ever is.
    foot = np.maximum(half_side, blur) + blur
    top = np.where(blur > half_side, 0.0, half_side - blur)
    height = np.where(blur > half_side, half_side / np.maximum(blur, 1e-300), 1.0)
    return height * _falling(offset, top, foot)


def disc_seen(offset: Array, blur: Array) -> Array:
    """The same for a disc of radius 1 and a round look: a frustum of height 1 and the disc's volume, or a cone where
    none has it: (N,)."""
    offset, blur = np.broadcast_arrays(offset, blur)
    # Volume of a frustum between radii m - b and m + b: π (m² + b²/3); of a cone of foot 2b and height h: 4π h b²/3.
    frustum = 3.0 - blur**2 > 3.0 * blur**2
    middle = np.where(frustum, np.sqrt(np.maximum(1.0 - blur**2 / 3.0, 0.0)), blur)
    height = np.where(frustum, 1.0, 3.0 / (4.0 * np.maximum(blur, 0.5) ** 2))
    return height * _falling(offset, middle - blur, middle + blur)


def softened(blur: Array) -> Array:
    """Half width of a look, in those of a light: as it is up to a quarter, twice as wide from a half on."""
    return np.interp(blur, [0.0, 0.25, 0.5, 1e9], [1.0, 1.0, 2.0, 2.0]) * blur


def light_seen(lights: Array, position: Array, direction: Array, far: Array, width: Array) -> Array:
    """Radiance per unit of the light's quantity that a ray meets within `far`: (N,).

    `width` (N, 2): diameter of what the ray stands for, at its start and per unit of distance: edges are as soft."""
    light = _Fields(lights)
    kind = lights["kind"]
    # The sun: tangent of the angle to its middle, in radii.
    cosine = -dot(direction, light.axis)
    tangent = np.linalg.norm(np.cross(direction, light.axis), axis=-1) / np.maximum(cosine, 1e-9)
    radius = np.maximum(np.linalg.norm(light.half_u, axis=-1), 1e-300)
    before = (cosine > 0.0) & (far >= FAR * (1.0 - 1e-6))
    sun = np.where(
        before, light.measure * disc_seen(np.minimum(tangent / radius, 1e6), softened(0.5 * width[:, 1] / radius)), 0.0
    )
    facing = dot(direction, light.axis)
    distance = dot(light.position - position, light.axis) / np.where(facing == 0.0, 1.0, facing)
    off = position + distance[:, None] * direction - light.position
    size_u, size_v = radius, np.maximum(np.linalg.norm(light.half_v, axis=-1), 1e-300)
    u, v = dot(off, light.half_u) / size_u, dot(off, light.half_v) / size_v
    blur = 0.5 * np.maximum(width[:, 0] + distance * width[:, 1], 0.0)
    disc = disc_seen(np.hypot(u, v) / size_u, softened(blur / size_u))
    soft_u, soft_v = size_u * softened(blur / size_u), size_v * softened(blur / size_v)
    rectangle = stretch_seen(u, size_u, soft_u) * stretch_seen(v, size_v, soft_v)
    ahead = (kind == AREA) & (facing < 0.0) & (distance > 0.0) & (distance < far)
    return np.where(kind == DIRECTIONAL, sun, np.where(ahead, np.where(light.is_disc, disc, rectangle), 0.0))


def _falling(offset: Array, top: Array, foot: Array) -> Array:
    """1 up to `top`, 0 from `foot` on, straight between; a step where both are the same."""
    span = foot - top
    slope = np.where(span > 0.0, (foot - offset) / np.where(span > 0.0, span, 1.0), np.where(offset < foot, 1.0, 0.0))
    return np.clip(slope, 0.0, 1.0)


class _Fields:
    """A light's members in float64."""

    def __init__(self, lights: Array) -> None:
        for name in ("position", "axis", "half_u", "half_v", "measure", "cone"):
            setattr(self, name, lights[name].astype(np.float64))
        self.is_disc = lights["is_disc"] != 0


def _aperture(light: _Fields, point: Array) -> tuple[Array, Array]:
    """Whether points, seen along the axis, lie on the disc or rectangle, and how far beyond it."""
    offset = point - light.position
    lengths_u, lengths_v = (np.maximum(dot(half, half), 1e-300) for half in (light.half_u, light.half_v))
    u, v = dot(offset, light.half_u) / lengths_u, dot(offset, light.half_v) / lengths_v
    return np.where(light.is_disc, u * u + v * v <= 1.0, np.maximum(np.abs(u), np.abs(v)) <= 1.0), dot(
        offset, light.axis
    )
