"""Lights as the camera's reference meets them, compiled in float64: from a surface point, and where a ray runs into
one.

Written from the scene's own quantities (`model.scene.Light`); a light's disc or rectangle is no
geometry: rays pass through it and gain its radiance. Where the environment lights a diffuse surface, half of a path's
directions are drawn by the cosine, half by the environment's brightness, each weighted by the density of both together
(balance heuristic: Veach and Guibas 1995).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..model.scene import Light, Scene
from ..model.vectors import frame_about
from .compiling import inlined
from .photon_emit import concentric_disc, search, shone, spot_falloff
from .vectors import angle_between, combined, cross, dot, length, minus, moved, negated, over

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
        frame = frame_about(axis, light.tangent)
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
def _on_aperture(lights, i, offset):
    """Whether a point, relative to the light's middle, is within its disc or rectangle seen along the axis."""
    u, v = lights.half_u[i], lights.half_v[i]
    a, b = dot(offset, u) / dot(u, u), dot(offset, v) / dot(v, v)
    return a * a + b * b <= 1.0 if lights.is_disc[i] else max(abs(a), abs(b)) <= 1.0


@inlined
def sample_light(lights, i, place, a, b):
    """(unit direction to the light, distance, irradiance across it per unit of the light's quantity).

    `a`, `b` in [0, 1) choose the place on a light of some extent.
    """
    axis, u, v = lights.axis[i], lights.half_u[i], lights.half_v[i]
    kind = lights.kind[i]
    if kind == DIRECTIONAL:
        s, t = concentric_disc(a, b)
        toward = combined(1.0, axis, s, u, t, v)
        return over(negated(toward), length(toward)), np.inf, 1.0
    way = minus(lights.position[i], place)
    if kind == COLLIMATED:
        along = -dot(way, axis)
        lit = along > 0.0 and _on_aperture(lights, i, negated(way))
        return negated(axis), along, 1.0 if lit else 0.0
    if kind == AREA:
        s, t = 2.0 * a - 1.0, 2.0 * b - 1.0
        if lights.is_disc[i]:
            s, t = concentric_disc(a, b)
        way = combined(1.0, way, s, u, t, v)
    distance = max(length(way), 1e-300)
    toward = over(way, distance)
    if kind == AREA:
        return toward, distance, lights.measure[i] * max(-dot(toward, axis), 0.0) / (distance * distance)
    back = negated(toward)
    shining = spot_falloff(lights.cone[i], angle_between(back, axis))
    if lights.profile[i] >= 0:
        shining *= shone(lights.tables, lights.profile[i], axis, u, v, back)
    return toward, distance, shining / (distance * distance)


@inlined
def light_seen(lights, i, place, d, far):
    """Radiance per unit of the light's quantity that a ray gains on its way up to `far` (infinite: it met nothing)."""
    axis = lights.axis[i]
    facing = dot(d, axis)
    if facing >= 0.0:
        return 0.0
    if lights.kind[i] == DIRECTIONAL:
        if lights.measure[i] == 0.0 or far < np.inf:
            return 0.0
        aside = moved(d, -facing, axis)
        inside = dot(aside, aside) < facing * facing * dot(lights.half_u[i], lights.half_u[i])
        return lights.measure[i] if inside else 0.0
    if lights.kind[i] != AREA:
        return 0.0
    way = minus(lights.position[i], place)
    distance = dot(way, axis) / facing
    if distance <= 0.0 or distance >= far:
        return 0.0
    return 1.0 if _on_aperture(lights, i, moved(negated(way), distance, d)) else 0.0


class EnvironmentDraw(NamedTuple):
    """Running sums of an environment's brightness."""

    lights: bool
    """Whether it lights what is diffuse."""
    rows: np.ndarray
    """float64 (H + 1,): 0 to 1, over rows of texels."""
    columns: np.ndarray
    """float64 (H, W + 1): likewise within each row."""
    density: np.ndarray
    """float64 (H, W): probability per steradian."""
    to_local: np.ndarray
    """float64 (3, 3): the environment's frame."""


def environment_draw(scene: Scene) -> EnvironmentDraw:
    """Running sums of the scene's environment; of one texel where it lights nothing."""
    environment = scene.environment
    lights = environment is not None and environment.lights and bool(environment.rgb.any())
    rgb = np.ones((1, 1, 3)) if environment is None or not lights else np.asarray(environment.rgb, float)
    height, width = rgb.shape[:2]
    # What lies between a bright texel and a dark one is not dark.
    bright = rgb.sum(axis=2)
    bright = np.maximum(np.maximum(np.roll(bright, 1, axis=1), np.roll(bright, -1, axis=1)), bright)
    above, below = bright[np.maximum(np.arange(height) - 1, 0)], bright[np.minimum(np.arange(height) + 1, height - 1)]
    bright = np.maximum(np.maximum(above, below), bright) + 0.01 * bright.mean()
    polar = np.linspace(0.0, math.pi, height + 1)
    solid = (np.cos(polar[:-1]) - np.cos(polar[1:])) * 2.0 * math.pi / width
    power = bright * solid[:, None]
    rows = np.concatenate([[0.0], np.cumsum(power.sum(axis=1))])
    columns = np.concatenate([np.zeros((height, 1)), np.cumsum(power, axis=1)], axis=1)
    frame = np.eye(3) if environment is None else np.array(environment.world_to_local, float)
    return EnvironmentDraw(lights, rows / rows[-1], columns / columns[:, -1:], bright / power.sum(), frame)


@inlined
def draw_direction(drawn, n, a, b):
    """(unit direction, cosine over π times its density) for light that falls on a surface with this normal, by two
    numbers in [0, 1); weight 0 where it comes from behind."""
    height, width = drawn.density.shape
    m = drawn.to_local
    if not drawn.lights:
        return draw_by_cosine(n, a, b), 1.0
    if a < 0.5:
        d = draw_by_cosine(n, 2.0 * a, b)
    else:
        a = 2.0 * a - 1.0
        row = search(drawn.rows, a)
        along = (a - drawn.rows[row]) / (drawn.rows[row + 1] - drawn.rows[row])
        sums = drawn.columns[row]
        column = search(sums, b)
        aside = (b - sums[column]) / (sums[column + 1] - sums[column])
        top, bottom = math.cos(math.pi * row / height), math.cos(math.pi * (row + 1) / height)
        z = top + along * (bottom - top)
        flat = math.sqrt(max(1.0 - z * z, 0.0))
        azimuth = 2.0 * math.pi * (0.5 - (column + aside) / width)
        d = combined(flat * math.cos(azimuth), m[0], flat * math.sin(azimuth), m[1], z, m[2])
    cosine = dot(d, n)
    if cosine <= 0.0:
        return d, 0.0
    lx, ly, lz = dot(m[0], d), dot(m[1], d), dot(m[2], d)
    column = min(int((0.5 - math.atan2(ly, lx) / (2.0 * math.pi)) * width), width - 1)
    row = min(int(math.atan2(math.sqrt(lx * lx + ly * ly), lz) / math.pi * height), height - 1)
    by_cosine = cosine / math.pi
    return d, by_cosine / (0.5 * by_cosine + 0.5 * drawn.density[row, max(column, 0)])


@inlined
def draw_by_cosine(n, a, b):
    """Unit direction about a unit normal, as likely as its cosine, by two numbers in [0, 1)."""
    # Any two directions across the normal.
    u = (n[1], -n[0], 0.0) if abs(n[2]) < 0.9 else (0.0, n[2], -n[1])
    u = over(u, length(u))
    radius, angle = math.sqrt(a), 2.0 * math.pi * b
    return combined(radius * math.cos(angle), u, radius * math.sin(angle), cross(n, u), math.sqrt(1.0 - a), n)
