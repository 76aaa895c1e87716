"""Directions towards what is bright of the environment, for paths that go on from a diffuse surface.

Half of them are drawn by the cosine, half by the environment's brightness, each weighed by the density of both together
(balance heuristic: Veach and Guibas 1995)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Scene
from .compiling import inlined
from .photon_emit import search


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
    """Of the scene's environment; of one texel where it lights nothing."""
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
def draw_direction(drawn, nx, ny, nz, a, b):
    """(unit direction (3), cosine over π times its density) for light that falls on a surface with this normal, by two
    numbers in [0, 1); weight 0 where it comes from behind."""
    height, width = drawn.density.shape
    m = drawn.to_local
    if not drawn.lights:
        dx, dy, dz = draw_by_cosine(nx, ny, nz, a, b)
        return dx, dy, dz, 1.0
    if a < 0.5:
        dx, dy, dz = draw_by_cosine(nx, ny, nz, 2.0 * a, b)
    else:
        a = 2.0 * a - 1.0
        row = search(drawn.rows, a)
        along = (a - drawn.rows[row]) / (drawn.rows[row + 1] - drawn.rows[row])
        sums = drawn.columns[row]
        column = search(sums, b)
        across = (b - sums[column]) / (sums[column + 1] - sums[column])
        top, bottom = math.cos(math.pi * row / height), math.cos(math.pi * (row + 1) / height)
        z = top + along * (bottom - top)
        flat = math.sqrt(max(1.0 - z * z, 0.0))
        azimuth = 2.0 * math.pi * (0.5 - (column + across) / width)
        x, y = flat * math.cos(azimuth), flat * math.sin(azimuth)
        dx = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z
        dy = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z
        dz = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z
    cosine = dx * nx + dy * ny + dz * nz
    if cosine <= 0.0:
        return dx, dy, dz, 0.0
    lx = m[0, 0] * dx + m[0, 1] * dy + m[0, 2] * dz
    ly = m[1, 0] * dx + m[1, 1] * dy + m[1, 2] * dz
    lz = m[2, 0] * dx + m[2, 1] * dy + m[2, 2] * dz
    column = min(int((0.5 - math.atan2(ly, lx) / (2.0 * math.pi)) * width), width - 1)
    row = min(int(math.atan2(math.sqrt(lx * lx + ly * ly), lz) / math.pi * height), height - 1)
    by_cosine = cosine / math.pi
    return dx, dy, dz, by_cosine / (0.5 * by_cosine + 0.5 * drawn.density[row, max(column, 0)])


@inlined
def draw_by_cosine(nx, ny, nz, a, b):
    """Unit direction (3) about a unit normal, as likely as its cosine, by two numbers in [0, 1)."""
    # Any two directions across the normal.
    if abs(nz) < 0.9:
        ux, uy, uz = ny, -nx, 0.0
    else:
        ux, uy, uz = 0.0, nz, -ny
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    radius, angle = math.sqrt(a), 2.0 * math.pi * b
    s, t, height = radius * math.cos(angle), radius * math.sin(angle), math.sqrt(1.0 - a)
    return s * ux + t * vx + height * nx, s * uy + t * vy + height * ny, s * uz + t * vz + height * nz
