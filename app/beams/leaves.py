"""What a search keeps: the outline of a beam where it ends, in the coordinates of what it ends on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .rays import PARALLEL, advance, at_x, dot, follow, jit
from .search import medium


class Leaves(NamedTuple):
    """Rows of finished beams, with room to spare; `count` says how much is used."""

    count: np.ndarray
    """int64 (3,): leaves, edges, corners."""
    head: np.ndarray
    """int64 (L, 8): kind, facet it ends on (-1: none), facet left last, object first met, depth, mask, edges, corners."""
    x: np.ndarray
    """(L, 3)."""
    density: np.ndarray
    """(L, 3): weight with what roulette gave, per unit of the target's area."""
    centre: np.ndarray
    """(L, 2): in the target's coordinates."""
    slope: np.ndarray
    """(L, 2): relative change of the density along them."""
    flux: np.ndarray
    """(L,)."""
    ray: np.ndarray
    """(L, 2, 3, 3, 3): position and direction about q = the beam's centre; of pieces and open leaves."""
    edge: np.ndarray
    """(E, 3, 3): a_u, a_v, c at the three places; |a| = 1."""
    soft: np.ndarray
    """(E,): half width of the penumbra, target's lengths."""
    corner: np.ndarray
    """(H, 2): of the polygons at all places."""


def empty_leaves(leaves: int) -> Leaves:
    """Room for so many."""
    return Leaves(
        np.zeros(3, np.int64),
        np.empty((leaves, 8), np.int64),
        np.empty((leaves, 3)),
        np.empty((leaves, 3)),
        np.empty((leaves, 2)),
        np.zeros((leaves, 2)),
        np.empty(leaves),
        np.empty((leaves, 2, 3, 3, 3)),
        np.empty((8 * leaves + 256, 3, 3)),
        np.zeros(8 * leaves + 256),
        np.empty((24 * leaves + 512, 2)),
    )


@jit
def has_room(leaves):
    """Whether one more of any size fits."""
    n = leaves.count
    return (
        n[0] + 1 < leaves.head.shape[0] and n[1] + 128 < leaves.edge.shape[0] and n[2] + 256 < leaves.corner.shape[0]
    )


@jit
def grown(leaves):
    """The same with twice the room."""
    a, e, h = leaves.count[0], leaves.count[1], leaves.count[2]
    n, m, k = 2 * leaves.head.shape[0], 2 * leaves.edge.shape[0] + 256, 2 * leaves.corner.shape[0] + 384
    head, x, density = np.empty((n, 8), np.int64), np.empty((n, 3)), np.empty((n, 3))
    centre, slope, flux = np.empty((n, 2)), np.zeros((n, 2)), np.empty(n)
    ray, edge, corner = np.empty((n, 2, 3, 3, 3)), np.empty((m, 3, 3)), np.empty((k, 2))
    soft = np.zeros(m)
    soft[:e] = leaves.soft[:e]
    head[:a], x[:a], density[:a] = leaves.head[:a], leaves.x[:a], leaves.density[:a]
    centre[:a], slope[:a], flux[:a], ray[:a] = leaves.centre[:a], leaves.slope[:a], leaves.flux[:a], leaves.ray[:a]
    edge[:e], corner[:h] = leaves.edge[:e], leaves.corner[:h]
    return Leaves(leaves.count, head, x, density, centre, slope, flux, ray, edge, soft, corner)


@jit
def plane_map(facets, facet, position, direction, out):
    """Where a bundle meets a receiver, in the coordinates of its map: out = [[r_u, r_v], [d/dq_u], [d/dq_v]]; returns the
    distance and the determinant."""
    at, towards = position.copy(), direction.copy()
    distance, _, _ = advance(at, towards, facets[facet].plane)
    frame = facets[facet].frame
    for w in range(2):
        for c in range(3):
            out[c, w] = dot(at[c], frame[1 + w])
        out[0, w] -= dot(frame[0], frame[1 + w])
    return distance, out[1, 0] * out[2, 1] - out[1, 1] * out[2, 0]


@jit
def lay_leaf(nodes, i, facets, kind, density, leaves):
    """Write beam i's outline behind the last leaf without counting it; returns how far its edges are from moving
    linearly with x (in the target's lengths), and the relative deviation of its density; the first is negative where
    nothing can be drawn."""
    row, first = leaves.count[0], leaves.count[1]
    maps, det = np.zeros((3, 3, 2)), np.ones(3)
    for a in range(3):
        if kind == 0:
            distance, det[a] = plane_map(
                facets, nodes[i].facet, nodes[i].position[a], nodes[i].direction[a], maps[a]
            )
            leaves.density[row, a] = nodes[i].weight[a] * nodes[i].boost * density / max(abs(det[a]), 1e-30)
            if distance < 0.0 or abs(det[a]) < 1e-30:
                leaves.density[row, a] = 0.0
        else:
            maps[a, 0, 0], maps[a, 0, 1] = nodes[i].centre[0], nodes[i].centre[1]
            maps[a, 1, 0] = maps[a, 2, 1] = 1.0
            leaves.density[row, a] = nodes[i].weight[a] * nodes[i].boost * density
    n = nodes[i].lines
    for l in range(n):
        for a in range(3):
            line, m = nodes[i].line[l, a], maps[a]
            value = line[0] + line[1] * nodes[i].centre[0] + line[2] * nodes[i].centre[1]
            d = det[a] if abs(det[a]) > 1e-30 else 1e-30
            au = (line[1] * m[2, 1] - line[2] * m[1, 1]) / d
            av = (line[2] * m[1, 0] - line[1] * m[2, 0]) / d
            c = value - au * m[0, 0] - av * m[0, 1]
            size = max(np.hypot(au, av), 1e-300)
            leaves.edge[first + l, a, 0], leaves.edge[first + l, a, 1] = au / size, av / size
            leaves.edge[first + l, a, 2] = c / size
    corners = leaves.count[2]
    bent = 0.0
    for a in range(3):
        for c in range(nodes[i].corners[a]):
            u = nodes[i].corner[a, c, 0] - nodes[i].centre[0]
            v = nodes[i].corner[a, c, 1] - nodes[i].centre[1]
            pu = maps[a, 0, 0] + u * maps[a, 1, 0] + v * maps[a, 2, 0]
            pv = maps[a, 0, 1] + u * maps[a, 1, 1] + v * maps[a, 2, 1]
            leaves.corner[corners, 0], leaves.corner[corners, 1] = pu, pv
            corners += 1
            if a == 1:
                before = c - 1 if c > 0 else nodes[i].corners[a] - 1
                for l in (nodes[i].side[a, c], nodes[i].side[a, before]):
                    e = leaves.edge[first + l]
                    off = 0.5 * ((e[0, 0] + e[2, 0]) * pu + (e[0, 1] + e[2, 1]) * pv + e[0, 2] + e[2, 2])
                    bent = max(bent, abs(off))
    if nodes[i].corners[1] == 0 and nodes[i].x[2] > nodes[i].x[0]:
        bent = 1e300
    for w in range(2):
        leaves.centre[row, w] = maps[1, 0, w]
        leaves.slope[row, w] = 0.0
    d = leaves.density[row]
    most = max(d[0], max(d[1], d[2]))
    uneven = abs(d[1] - 0.5 * (d[0] + d[2])) / most if most > 0.0 else 0.0
    if most <= 0.0 or corners == leaves.count[2]:
        return -1.0, 0.0
    head = leaves.head[row]
    head[0], head[1], head[6], head[7] = kind, nodes[i].facet if kind == 0 else -1, n, corners - leaves.count[2]
    flight = nodes[i].flight
    head[2] = nodes[i].path[0, flight - 1] if flight > 0 else -1
    head[3] = facets[nodes[i].path[0, 0]].owner if flight > 0 else -1
    head[4], head[5] = nodes[i].depth, nodes[i].mask
    leaves.x[row] = nodes[i].x
    leaves.ray[row, 0] = nodes[i].position
    leaves.ray[row, 1] = nodes[i].direction
    return bent, uneven


@jit
def passes(solids, tables, inside, x, distance):
    """Share of light that goes through so much of a solid's medium; `inside` -1: air."""
    if inside < 0 or solids[inside].tint < 0:
        return 1.0
    return np.exp(-at_x(tables, solids[inside].tint, x) * max(distance, 0.0))


@jit
def density_slope(nodes, i, facets, solids, tables, source, task, kind, leaves):
    """Set the slope of the leaf just laid, of a diverging light: relative change of weight and spread over the target."""
    if source.kind == PARALLEL and not task.absorbing:
        return
    row = leaves.count[0]
    size = 0.0
    for c in range(nodes[i].corners[1]):
        u, v = nodes[i].corner[1, c, 0] - nodes[i].centre[0], nodes[i].corner[1, c, 1] - nodes[i].centre[1]
        size = max(size, np.hypot(u, v))
    if size <= 0.0 or nodes[i].weight[1] <= 0.0:
        return
    step = 0.5 * size
    position, direction, m = np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 2))
    change, at = np.zeros(2), np.zeros(2)
    inside = medium(solids, nodes[i].mask)
    for w in range(2):
        values = np.zeros(2)
        for sign in range(2):
            at[0], at[1] = nodes[i].centre[0], nodes[i].centre[1]
            at[w] += step * (2 * sign - 1)
            values[sign] = follow(
                source, facets, solids, tables, nodes[i].path, nodes[i].flight, nodes[i].x[1], at, position, direction
            )
            if kind == 0:
                distance, det = plane_map(facets, nodes[i].facet, position, direction, m)
                values[sign] /= max(abs(det), 1e-30)
                if task.absorbing:
                    values[sign] *= passes(solids, tables, inside, nodes[i].x[1], distance)
        total = values[0] + values[1]
        change[w] = (values[1] - values[0]) / (step * total) if total > 0.0 else 0.0
    if kind == 0:
        _, det = plane_map(facets, nodes[i].facet, nodes[i].position[1], nodes[i].direction[1], m)
        if abs(det) < 1e-30:
            return
        leaves.slope[row, 0] = (change[0] * m[2, 1] - change[1] * m[1, 1]) / det
        leaves.slope[row, 1] = (change[1] * m[1, 0] - change[0] * m[2, 0]) / det
    else:
        leaves.slope[row, 0], leaves.slope[row, 1] = change[0], change[1]
