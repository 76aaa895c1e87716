"""What beams' polygons say lands where: their exact areas over cells at single indices, float64.

Written from `beams.polygons` alone, so that the search is held to its own contract; shares no code with what draws.
"""

from __future__ import annotations

import numba
import numpy as np

from .beam_worlds import Grid

_MOST = 256


@numba.njit(cache=True)
def _cut(points, count, a, b, c, out):
    """Part of a polygon where a u + b v + c >= 0; returns its corners."""
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        here = a * points[i, 0] + b * points[i, 1] + c
        there = a * points[j, 0] + b * points[j, 1] + c
        if here >= 0.0:
            out[kept, 0], out[kept, 1] = points[i, 0], points[i, 1]
            kept += 1
        if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
            s = here / (here - there)
            out[kept, 0] = points[i, 0] + s * (points[j, 0] - points[i, 0])
            out[kept, 1] = points[i, 1] + s * (points[j, 1] - points[i, 1])
            kept += 1
    return kept


@numba.njit(cache=True)
def _moments(points, count):
    """Area of a polygon and its first moments."""
    area = mu = mv = 0.0
    for i in range(1, count - 1):
        au, av = points[i, 0] - points[0, 0], points[i, 1] - points[0, 1]
        bu, bv = points[i + 1, 0] - points[0, 0], points[i + 1, 1] - points[0, 1]
        w = 0.5 * (au * bv - av * bu)
        area += w
        mu += w * (points[0, 0] + (au + bu) / 3.0)
        mv += w * (points[0, 1] + (av + bv) / 3.0)
    if area < 0.0:
        area, mu, mv = -area, -mu, -mv
    return area, mu, mv


@numba.njit(cache=True)
def _add(
    x,
    x_lo,
    x_hi,
    density,
    slope,
    centre,
    edge_start,
    edges,
    hull_start,
    hulls,
    chosen,
    from_hulls,
    low,
    side,
    out,
    outside,
    each,
):
    """Add all polygons at spectral coordinate x to the cells `out`."""
    one, two, strip, cell = np.empty((_MOST, 2)), np.empty((_MOST, 2)), np.empty((_MOST, 2)), np.empty((_MOST, 2))
    nu, nv = out.shape
    for p in range(len(x_lo)):
        if not chosen[p]:
            continue
        t = 0.0
        if x_hi[p] > x_lo[p]:
            t = (x - x_lo[p]) / (x_hi[p] - x_lo[p])
            if t < 0.0 or t >= 1.0:
                continue
        elif x >= 0.0 and abs(x - x_lo[p]) > 1e-12:
            continue
        m = 0
        if from_hulls:
            for h in range(hull_start[p], hull_start[p + 1]):
                one[m, 0], one[m, 1] = hulls[h, 0], hulls[h, 1]
                m += 1
        else:
            for k in range(4):
                one[k, 0], one[k, 1] = (1e4 if k == 1 or k == 2 else -1e4), (1e4 if k > 1 else -1e4)
            m = 4
        for e in range(edge_start[p], edge_start[p + 1]):
            a = edges[e, 0] + t * (edges[e, 4] - edges[e, 0])
            b = edges[e, 1] + t * (edges[e, 5] - edges[e, 1])
            c = edges[e, 2] + t * (edges[e, 6] - edges[e, 2])
            m = _cut(one, m, a, b, c, two)
            for k in range(m):
                one[k, 0], one[k, 1] = two[k, 0], two[k, 1]
            if m < 3:
                break
        if m < 3:
            continue
        d = density[p, 0] * (1 - t) * (1 - 2 * t) + density[p, 1] * 4 * t * (1 - t) + density[p, 2] * t * (2 * t - 1)
        area, mu, mv = _moments(one, m)
        whole = d * (area + slope[p, 0] * (mu - area * centre[p, 0]) + slope[p, 1] * (mv - area * centre[p, 1]))
        each[p] += whole
        within = 0.0
        ulo = uhi = one[0, 0]
        for k in range(m):
            ulo, uhi = min(ulo, one[k, 0]), max(uhi, one[k, 0])
        i0, i1 = max(int(np.floor((ulo - low[0]) / side)), 0), min(int(np.floor((uhi - low[0]) / side)), nu - 1)
        for i in range(i0, i1 + 1):
            u = low[0] + i * side
            k = _cut(one, m, 1.0, 0.0, -u, two)
            k = _cut(two, k, -1.0, 0.0, u + side, strip)
            if k < 3:
                continue
            vlo = vhi = strip[0, 1]
            for c in range(k):
                vlo, vhi = min(vlo, strip[c, 1]), max(vhi, strip[c, 1])
            j0, j1 = max(int(np.floor((vlo - low[1]) / side)), 0), min(int(np.floor((vhi - low[1]) / side)), nv - 1)
            for j in range(j0, j1 + 1):
                v = low[1] + j * side
                r = _cut(strip, k, 0.0, 1.0, -v, two)
                r = _cut(two, r, 0.0, -1.0, v + side, cell)
                if r < 3:
                    continue
                area, mu, mv = _moments(cell, r)
                here = d * (area + slope[p, 0] * (mu - area * centre[p, 0]) + slope[p, 1] * (mv - area * centre[p, 1]))
                out[i, j] += here
                within += here
        outside[0] += whole - within


def cells(
    polygons, receiver: int, grid: Grid, x: float = -1.0, from_hulls: bool = False
) -> tuple[np.ndarray, float, np.ndarray]:
    """Flux per unit of spectral power on each cell, that outside of the grid, and that of each polygon. `x`: spectral
    coordinate, -1: every emission line, whatever its own. `from_hulls`: cut the hulls by the edges, as what draws does,
    instead of the whole plane. Edges' softness is not regarded."""
    out, outside, each = np.zeros(grid.shape), np.zeros(1), np.zeros(len(polygons))
    _add(
        float(x),
        polygons.x_lo,
        polygons.x_hi,
        polygons.density,
        polygons.slope,
        polygons.centre,
        polygons.edge_start,
        polygons.edges,
        polygons.hull_start,
        polygons.hulls,
        polygons.receiver == receiver,
        from_hulls,
        np.array(grid.low, float),
        float(grid.side),
        out,
        outside,
        each,
    )
    return out, float(outside[0]), each
