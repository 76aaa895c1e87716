"""Lights as the camera's reference meets them, compiled in float64: from a surface point, and where a ray runs into
one.

Written from the scene's own quantities (`model.scene.Light`); a light's disc or rectangle is no
geometry: rays pass through it and gain its radiance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..model.scene import Light
from .compiling import inlined
from .photon_emission import frame_of
from .photon_emit import concentric_disc, shone, spot_falloff

POINT, DIRECTIONAL, COLLIMATED, AREA = range(4)


class CameraLights(NamedTuple):
    """L lights, positions about the arrays' origin (`photon_scene`)."""

    kind: np.ndarray
    """int32 (L,)."""
    position: np.ndarray
    axis: np.ndarray
    """float64 (L, 3), unit propagation direction."""
    half_u: np.ndarray
    half_v: np.ndarray
    """float64 (L, 3): middle to rim; for a sun, of the length of the tangent of its angular radius."""
    is_disc: np.ndarray
    """bool (L,)."""
    measure: np.ndarray
    """float64 (L,): area (area light); radiance per irradiance (a sun of some size, else 0)."""
    cone: np.ndarray
    """float64 (L, 2): a spot's half angles, rad; beyond π for none."""
    profile: np.ndarray
    """int64 (L,): where its table begins among `tables`, -1 for none."""
    tables: np.ndarray
    """float64: intensities over directions, one light's after the other's (`ies_file.Profile.packed`)."""


def camera_lights(lights: Sequence[Light], centre: np.ndarray) -> CameraLights:
    """The arrays for `lights`, about the world position `centre` (3,)."""
    count = len(lights)
    tables = [light.profile.packed() for light in lights if light.profile is not None]
    packed = CameraLights(
        np.zeros(count, np.int32),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count, np.bool_),
        np.zeros(count),
        np.full((count, 2), 4.0),
        np.full(count, -1),
        np.concatenate([np.zeros(1), *tables]),
    )
    begin = 1
    for i, light in enumerate(lights):
        axis = np.asarray(light.direction, float) / np.linalg.norm(light.direction)
        frame = frame_of(axis, light.tangent)
        half = np.array(light.half_extent)
        packed.kind[i] = light.gpu_code
        packed.is_disc[i] = light.is_disc
        packed.cone[i] = light.cone
        packed.measure[i] = light.area if light.has_extent else 0.0
        if light.angular_radius > 0.0:
            half[:] = math.tan(light.angular_radius)
            packed.measure[i] = 1.0 / (math.pi * math.sin(light.angular_radius) ** 2)
        packed.position[i], packed.axis[i] = np.asarray(light.position, float) - centre, axis
        packed.half_u[i], packed.half_v[i] = half[0] * frame[0], half[1] * frame[1]
        if light.profile is not None:
            packed.profile[i], begin = begin, begin + len(light.profile.packed())
            packed.half_u[i], packed.half_v[i] = light.across
    return packed


@inlined
def _on_aperture(lights, i, x, y, z):
    """Whether a point, given relative to the light's middle, lies within its disc or rectangle seen along the axis."""
    ux, uy, uz = lights.half_u[i, 0], lights.half_u[i, 1], lights.half_u[i, 2]
    vx, vy, vz = lights.half_v[i, 0], lights.half_v[i, 1], lights.half_v[i, 2]
    a = (x * ux + y * uy + z * uz) / (ux * ux + uy * uy + uz * uz)
    b = (x * vx + y * vy + z * vz) / (vx * vx + vy * vy + vz * vz)
    return a * a + b * b <= 1.0 if lights.is_disc[i] else max(abs(a), abs(b)) <= 1.0


@inlined
def sample_light(lights, i, px, py, pz, a, b):
    """(unit direction to the light (3), distance, irradiance across it per unit of the light's quantity).

    `a`, `b` in [0, 1) choose the place on a light of some extent.
    """
    ax, ay, az = lights.axis[i, 0], lights.axis[i, 1], lights.axis[i, 2]
    ux, uy, uz = lights.half_u[i, 0], lights.half_u[i, 1], lights.half_u[i, 2]
    vx, vy, vz = lights.half_v[i, 0], lights.half_v[i, 1], lights.half_v[i, 2]
    kind = lights.kind[i]
    if kind == DIRECTIONAL:
        s, t = concentric_disc(a, b)
        tx, ty, tz = ax + s * ux + t * vx, ay + s * uy + t * vy, az + s * uz + t * vz
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        return -tx / length, -ty / length, -tz / length, np.inf, 1.0
    wx, wy, wz = lights.position[i, 0] - px, lights.position[i, 1] - py, lights.position[i, 2] - pz
    if kind == COLLIMATED:
        along = -(wx * ax + wy * ay + wz * az)
        lit = along > 0.0 and _on_aperture(lights, i, -wx, -wy, -wz)
        return -ax, -ay, -az, along, 1.0 if lit else 0.0
    if kind == AREA:
        s, t = 2.0 * a - 1.0, 2.0 * b - 1.0
        if lights.is_disc[i]:
            s, t = concentric_disc(a, b)
        wx, wy, wz = wx + s * ux + t * vx, wy + s * uy + t * vy, wz + s * uz + t * vz
    distance = max(math.sqrt(wx * wx + wy * wy + wz * wz), 1e-300)
    tx, ty, tz = wx / distance, wy / distance, wz / distance
    facing = -(tx * ax + ty * ay + tz * az)
    if kind == AREA:
        return tx, ty, tz, distance, lights.measure[i] * max(facing, 0.0) / (distance * distance)
    kx, ky, kz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
    angle = math.atan2(math.sqrt(kx * kx + ky * ky + kz * kz), facing)
    shining = spot_falloff(lights.cone[i], angle)
    if lights.profile[i] >= 0:
        shining *= shone(
            lights.tables, lights.profile[i], lights.axis[i], lights.half_u[i], lights.half_v[i], -tx, -ty, -tz
        )
    return tx, ty, tz, distance, shining / (distance * distance)


@inlined
def light_seen(lights, i, px, py, pz, dx, dy, dz, far):
    """Radiance per unit of the light's quantity that a ray gains on its way up to `far` (infinite: it met nothing)."""
    ax, ay, az = lights.axis[i, 0], lights.axis[i, 1], lights.axis[i, 2]
    facing = dx * ax + dy * ay + dz * az
    if facing >= 0.0:
        return 0.0
    if lights.kind[i] == DIRECTIONAL:
        if lights.measure[i] == 0.0 or far < np.inf:
            return 0.0
        kx, ky, kz = dx - facing * ax, dy - facing * ay, dz - facing * az
        tangent2 = lights.half_u[i, 0] ** 2 + lights.half_u[i, 1] ** 2 + lights.half_u[i, 2] ** 2
        return lights.measure[i] if kx * kx + ky * ky + kz * kz < facing * facing * tangent2 else 0.0
    if lights.kind[i] != AREA:
        return 0.0
    wx, wy, wz = lights.position[i, 0] - px, lights.position[i, 1] - py, lights.position[i, 2] - pz
    distance = (wx * ax + wy * ay + wz * az) / facing
    if distance <= 0.0 or distance >= far:
        return 0.0
    return 1.0 if _on_aperture(lights, i, distance * dx - wx, distance * dy - wy, distance * dz - wz) else 0.0
