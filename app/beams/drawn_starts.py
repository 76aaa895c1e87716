"""Draws where camera paths start that carry on what beams have handed over.

Weak beams, and those that meet what is not flat, end as polygons of the picture too (`ScreenPolygons.is_handed`).
Places in those, and wavelengths, are drawn so that every path stands for about the same share of a pixel: strong
polygons send many, most of the weak ones none. The draw is systematic in the order of the search, where neighbours have
met nearly the same facets. What a path weighs makes up for what it was drawn by, so the sum is unbiased.
"""

from __future__ import annotations

import numpy as np

from .clipping import clip
from .compiling import jit
from .screen_polygons import ScreenPolygons
from .screen_starts import ScreenStarts

_PLACES = 5
"""Of a band at which a polygon's area is measured."""
_LEAST = 0.03
"""Share of its hull, at least, that a polygon is drawn by: none that is somewhere in the band may be left out."""
_GENERATORS = 0.8191725134, 0.6710436067, 0.5497004779
"""Kronecker sequence in three dimensions [Roberts 2018]."""


def drawn_starts(
    polygons: ScreenPolygons, size: tuple[int, int], brightness: np.ndarray, share: float, seed: int
) -> ScreenStarts:
    """Draw the paths' starts from handed polygons.

    `brightness`: share of what looks bright below each of equally spaced x, from 0 to 1; `share`: of a pixel, that one
    path stands for, throughput and share of the spectrum counted."""
    grid = np.linspace(0.0, 1.0, len(brightness))
    lo, hi = np.interp(polygons.x_lo, grid, brightness), np.interp(polygons.x_hi, grid, brightness)
    most = int(np.diff(polygons.hull_start).max(initial=0) + np.diff(polygons.edge_start).max(initial=0)) + 2
    scratch = np.empty((2, most, 2))
    shapes = polygons.edge_start, polygons.edges, polygons.hull_start, polygons.hulls, polygons.throughput
    drawn_by = np.empty(len(polygons))
    _measure(*shapes, scratch, drawn_by)
    power = np.cumsum(drawn_by * (hi - lo))
    first, *shifts = np.random.default_rng(seed).random(4)
    total = power[-1] if len(power) else 0.0
    marks = (np.arange(max(int(np.ceil(total / share - first)), 0)) + first) * share
    polygon = np.minimum(np.searchsorted(power, marks, side="right"), max(len(power) - 1, 0))
    number = np.arange(len(marks))
    numbers = np.stack([(number * g + s) % 1.0 for g, s in zip(_GENERATORS, shifts, strict=True)], axis=-1)
    x = np.interp(lo[polygon] + numbers[:, 0] * (hi - lo)[polygon], brightness, grid)
    width = np.maximum((polygons.x_hi - polygons.x_lo)[polygon], 1e-12)
    t = np.clip((x - polygons.x_lo[polygon]) / width, 0.0, 1.0)
    place, weight = np.zeros((len(marks), 2)), np.zeros(len(marks))
    _draw(*shapes, polygon, t, numbers[:, 1:], scratch, place, weight)
    off = place - polygons.centre[polygon]
    weight *= np.maximum(1.0 + np.einsum("si,si->s", polygons.slope[polygon], off), 0.0)
    weight *= share / np.maximum(drawn_by[polygon], 1e-300)
    place = np.clip(place, 0.0, np.array(size) - 1e-6)
    pixel = place[:, 1].astype(int) * size[0] + place[:, 0].astype(int)
    order = np.argsort(pixel, kind="stable")
    order = order[weight[order] > 0.0]
    return ScreenStarts(polygon[order], place[order], x[order], t[order], weight[order])


@jit
def _outline(edge_start, edges, hull_start, hulls, i, t, scratch):
    """Corners of polygon i at t, in the first of `scratch`; returns how many."""
    points, spare = scratch[0], scratch[1]
    n = 0
    for k in range(hull_start[i], hull_start[i + 1]):
        points[n, 0], points[n, 1] = hulls[k, 0], hulls[k, 1]
        n += 1
    for e in range(edge_start[i], edge_start[i + 1]):
        a = edges[e, 0] + t * (edges[e, 3] - edges[e, 0])
        b = edges[e, 1] + t * (edges[e, 4] - edges[e, 1])
        c = edges[e, 2] + t * (edges[e, 5] - edges[e, 2])
        n = clip(points, n, spare, a, b, c)
        if n < 3:
            return 0
    return n


@jit
def _twice(points, k):
    """Twice the area of a triangle of a fan."""
    au, av = points[k, 0] - points[0, 0], points[k, 1] - points[0, 1]
    bu, bv = points[k + 1, 0] - points[0, 0], points[k + 1, 1] - points[0, 1]
    return abs(au * bv - av * bu)


@jit
def _through(throughput, i, t):
    """A polygon's throughput at t."""
    lo, middle, hi = throughput[i, 0], throughput[i, 1], throughput[i, 2]
    return max(lo + t * (4.0 * middle - 3.0 * lo - hi + t * 2.0 * (lo + hi - 2.0 * middle)), 0.0)


@jit
def _measure(edge_start, edges, hull_start, hulls, throughput, scratch, out):
    """Mean of area times throughput over each polygon's band, about."""
    for i in range(len(out)):
        total = most = 0.0
        for k in range(_PLACES):
            t = (k + 0.5) / _PLACES
            through = _through(throughput, i, t)
            most = max(most, through)
            n = _outline(edge_start, edges, hull_start, hulls, i, t, scratch)
            for c in range(1, n - 1):
                total += 0.5 * _twice(scratch[0], c) * through
        hull = 0.0
        first = hull_start[i]
        for k in range(1, hull_start[i + 1] - first - 1):
            hull += 0.5 * _twice(hulls[first:], k)
        out[i] = max(total / _PLACES, _LEAST * hull * most)


@jit
def _draw(edge_start, edges, hull_start, hulls, throughput, polygon, t, numbers, scratch, place, weight):
    """A place, even over the polygon's area at t, for each pair of numbers; area times throughput there."""
    points = scratch[0]
    for s in range(len(polygon)):
        n = _outline(edge_start, edges, hull_start, hulls, polygon[s], t[s], scratch)
        total = 0.0
        for k in range(1, n - 1):
            total += _twice(points, k)
        weight[s] = 0.5 * total * _through(throughput, polygon[s], t[s])
        if total <= 0.0:
            continue
        left, k = numbers[s, 0] * total, 1
        while k < n - 2 and left > _twice(points, k):
            left -= _twice(points, k)
            k += 1
        along = min(max(left / max(_twice(points, k), 1e-300), 0.0), 1.0)
        u = np.sqrt(numbers[s, 1])
        for w in range(2):
            far = points[k, w] + along * (points[k + 1, w] - points[k, w])
            place[s, w] = points[0, w] + u * (far - points[0, w])
