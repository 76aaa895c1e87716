"""Float64 twin of shaders/lib/lights.glsl: lights as a surface point sees them, and as a ray meets them.

`lights` are records of `app.passes.eye.EYE_LIGHT`, one a row; points and directions are (N, 3).
"""

from __future__ import annotations

import numpy as np

from app.truth.emission_maps import concentric_disc, spot_falloff
from app.truth.optics import dot, unit

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
        np.where(diverging, emitted / square, np.where(kind == DIRECTIONAL, 1.0, (in_beam & (along > 0.0)).astype(np.float64))),
    )


def light_seen(lights: Array, position: Array, direction: Array, far: Array) -> Array:
    """Radiance per unit of the light's quantity that a ray meets within `far`: (N,)."""
    light = _Fields(lights)
    kind = lights["kind"]
    # The sun's disc: directions towards it whose angle to its middle has a smaller tangent than its rim.
    cosine = -dot(direction, light.axis)
    sine = np.linalg.norm(np.cross(direction, light.axis), axis=-1)
    in_sun = (cosine > 0.0) & (sine < cosine * np.linalg.norm(light.half_u, axis=-1))
    sun = np.where(in_sun & (far >= FAR * (1.0 - 1e-6)), light.measure, 0.0)
    facing = dot(direction, light.axis)
    safe = np.where(facing == 0.0, 1.0, facing)
    distance = dot(light.position - position, light.axis) / safe
    on_light, _ = _aperture(light, position + distance[:, None] * direction)
    seen = on_light & (facing < 0.0) & (distance > 0.0) & (distance < far)
    return np.where(kind == DIRECTIONAL, sun, np.where((kind == AREA) & seen, 1.0, 0.0))


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
    return np.where(light.is_disc, u * u + v * v <= 1.0, np.maximum(np.abs(u), np.abs(v)) <= 1.0), dot(offset, light.axis)
