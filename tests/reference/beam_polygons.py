"""Beam polygons made by hand, and what they deposit in float64: exact polygons in exact texels at single indices.

Nothing is shared with the passes: a polygon at t is cut out of a large square by its edges, then texel by texel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from spectrasplat.beams.polygons import BeamPolygons
from spectrasplat.model.optics.spectral_tables import cumulative


@njit(cache=True)
def _cut(points, count, a, b, c, out):
    """Sutherland and Hodgman 1974: the part of a convex polygon where a x + b y + c >= 0."""
    kept = 0
    for i in range(count):
        p, q = points[i], points[(i + 1) % count]
        hp, hq = a * p[0] + b * p[1] + c, a * q[0] + b * q[1] + c
        if hp >= 0.0:
            out[kept] = p
            kept += 1
        if (hp >= 0.0) != (hq >= 0.0):
            s = hp / (hp - hq)
            out[kept, 0], out[kept, 1] = p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])
            kept += 1
    return kept


@njit(cache=True)
def _area(points, count):
    twice = 0.0
    for i in range(1, count - 1):
        u, v = points[i] - points[0], points[i + 1] - points[0]
        twice += u[0] * v[1] - u[1] * v[0]
    return 0.5 * twice


@njit(cache=True)
def covered(edges, width, height):
    """(height, width): area of the polygon where all `edges` (n, 3) a x + b y + c are >= 0 in every texel."""
    share = np.zeros((height, width))
    one, two = np.zeros((len(edges) + 12, 2)), np.zeros((len(edges) + 12, 2))
    one[0], one[1], one[2], one[3] = (
        np.array([0.0, 0.0]),
        np.array([1.0 * width, 0.0]),
        np.array([1.0 * width, 1.0 * height]),
        np.array([0.0, 1.0 * height]),
    )
    count = 4
    for e in range(len(edges)):
        count = _cut(one, count, edges[e, 0], edges[e, 1], edges[e, 2], two)
        one, two = two, one
    if count < 3:
        return share
    low_x, high_x = one[:count, 0].min(), one[:count, 0].max()
    low_y, high_y = one[:count, 1].min(), one[:count, 1].max()
    row, texel, spare = np.zeros_like(one), np.zeros_like(one), np.zeros_like(one)
    for y in range(int(low_y), min(int(high_y) + 1, height)):
        in_row = _cut(one, count, 0.0, 1.0, -1.0 * y, spare)
        in_row = _cut(spare, in_row, 0.0, -1.0, 1.0 + y, row)
        for x in range(int(low_x), min(int(high_x) + 1, width)):
            inside = _cut(row, in_row, 1.0, 0.0, -1.0 * x, spare)
            inside = _cut(spare, inside, -1.0, 0.0, 1.0 + x, texel)
            share[y, x] = _area(texel, inside)
    return share


def deposited(polygons: BeamPolygons, axis, light, channels, size: tuple[int, int], indices: int = 400) -> np.ndarray:
    """Energy per texel (height, width, columns) of all polygons at `indices` wavelengths a band; texels are GPU units
    and of one scene unit²."""
    width, height = size
    total = np.zeros((height, width, channels.columns))
    curve = cumulative(axis, type(light)(light.density), channels.cell_weights())
    for i in range(len(polygons)):
        rows = polygons.edges[polygons.edge_start[i] : polygons.edge_start[i + 1]]
        lo, hi = polygons.x_lo[i], polygons.x_hi[i]
        if hi > lo:
            t = (np.arange(indices) + 0.5) / indices
            energy = np.diff(curve.at(lo + (hi - lo) * np.linspace(0.0, 1.0, indices + 1)), axis=0)
        else:
            nm, power = np.array(light.lines).T
            line = np.abs(axis.x_of_nm(nm) - lo).argmin()
            t, energy = np.zeros(1), channels.line_weights(nm[line : line + 1]) * power[line]
        start, middle, end = polygons.density[i]
        parabola = start * (1 - t) * (1 - 2 * t) + middle * 4 * t * (1 - t) + end * t * (2 * t - 1)
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        tilt = (
            1.0
            + (x - polygons.centre[i, 0]) * polygons.slope[i, 0]
            + (y - polygons.centre[i, 1]) * polygons.slope[i, 1]
        )
        for at, density, part in zip(t, parabola, energy, strict=True):
            share = covered(rows[:, :3] + at * (rows[:, 4:7] - rows[:, :3]), width, height)
            total += (density * share * tilt)[..., None] * part
    return total


def polygon(
    start: np.ndarray,
    end: np.ndarray | None = None,
    band: tuple[float, float] = (0.0, 1.0),
    density: Sequence[float] = (1.0, 1.0, 1.0),
    slope: Sequence[float] = (0.0, 0.0),
    receiver: int = 0,
) -> BeamPolygons:
    """One polygon whose edges join the counter-clockwise corners `start` (n, 2), and at the band's end `end`."""
    start = np.asarray(start, np.float64)
    end = start if end is None else np.asarray(end, np.float64)
    both = np.concatenate([start, end])
    low, high = both.min(axis=0), both.max(axis=0)
    hull = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    middle = 0.5 * (_lines(start) + _lines(end))
    return BeamPolygons(
        light=np.zeros(1, np.int32),
        receiver=np.full(1, receiver, np.int32),
        source=np.zeros(1, np.int32),
        depth=np.ones(1, np.int32),
        x_lo=np.array([band[0]]),
        x_hi=np.array([band[1]]),
        density=np.array([density], np.float64),
        slope=np.array([slope], np.float64),
        centre=both.mean(axis=0)[None],
        flux=np.array([density[1] * area_of(middle)]),
        edge_start=np.array([0, len(start)], np.int32),
        edges=np.column_stack([_lines(start), np.zeros(len(start)), _lines(end), np.zeros(len(start))]),
        hull_start=np.array([0, 4], np.int32),
        hulls=hull,
        area=np.array([area_of(middle)]),
    )


def area_of(lines: np.ndarray) -> float:
    """Of the polygon that the half-planes (n, 3) cut out of the square from 0 to 4096."""
    one, two = np.zeros((len(lines) + 8, 2)), np.zeros((len(lines) + 8, 2))
    one[:4] = 4096.0 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    count = 4
    for line in lines:
        count = _cut(one, count, *line, two)
        one, two = two, one
    return float(_area(one, count))


def _lines(corners: np.ndarray) -> np.ndarray:
    """(n, 3): a, b, c with the inside at >= 0, |a, b| = 1."""
    along = np.roll(corners, -1, axis=0) - corners
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return np.column_stack([normal, -np.sum(normal * corners, axis=1)])


def regular(
    corners: int, centre: Sequence[float], radius: float, turn: float = 0.0, stretch: float = 1.0
) -> np.ndarray:
    """Corners of a regular polygon, drawn out along x by `stretch` before it is turned."""
    angle = 2.0 * np.pi * np.arange(corners) / corners
    points = radius * np.stack([stretch * np.cos(angle), np.sin(angle)], axis=1)
    c, s = np.cos(turn), np.sin(turn)
    return points @ np.array([[c, s], [-s, c]]) + np.asarray(centre)
