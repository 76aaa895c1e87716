"""The search for beams: from one facet that a light sees, through all facets that light meets after it.

Depth first over an explicit stack. A beam flies (`_fly`): the facets ahead cut it into fragments, each of which meets one
facet. A fragment is halved in the spectrum where its outline moves too far, in space where rays are too far from
affine; then it ends on a receiver, or goes on reflected and refracted. Weak children play Russian roulette, whose number
is a hash of the path, so that the same beams live from frame to frame.
"""

from __future__ import annotations

import numpy as np

from .nodes import STATIC, area_of, copy, copy_outline, cut, forget_idle_lines, lay_out
from .rays import advance, at_x, follow, jit

LEAF_RECEIVER, LEAF_PIECE, LEAF_OPEN = 0, 1, 2
_TOUCHES = 1e-7
"""GPU units: surfaces this close are in contact."""
_NARROWEST = 1.0 / 256.0
"""Bands are not halved below this."""
_MOST_FRAGMENTS = 192
(
    SUM_DEPOSITED,
    SUM_HANDED,
    SUM_ABSORBED,
    SUM_ESCAPED,
    SUM_DEPTH,
    SUM_NUMERIC,
    SUM_ROULETTE,
    SUM_BEAMS,
    SUM_LEAVES,
    SUM_ENTERED,
    SUMS,
) = range(11)
"""What a search sums up: flux by where it ended, per unit of spectral power; beams followed; leaves."""


TASK = np.dtype(
    [
        ("power", "i8"),
        ("threshold", "f8"),
        ("seed", "u8"),
        ("depth", "i8"),
        ("density", "f8"),
        ("tolerance", "f8"),
        ("drift", "f8"),
        ("line_share", "f8"),
        ("room", "f8", 3),
        ("sees", "?"),
        ("absorbing", "?"),
    ]
)
"""What one search is to do, besides the scene and the source. `power`: row of the tables, share of the light's power
below x, for importance; `threshold`: power (flux per unit of spectral power) below which a beam plays roulette; `depth`:
most specular events; `density`: flux per unit of q and of spectral power; `tolerance`: error of places on what goes on,
GPU units (from the camera: q); `line_share`: of the light's power, of a band without width; `drift`: how far, in widths of itself, an outline may move over a band; `room`: centre and
half side of a square in q that holds everything; `sees`: beams from the camera, what leaves the facets is kept;
`absorbing`: some medium absorbs."""


@jit
def mixed(key, word):
    """Hash of a key and one more choice [SplitMix64]."""
    z = key + np.uint64(0x9E3779B97F4A7C15) * (np.uint64(word) + np.uint64(1))
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@jit
def unit(key):
    """A number in [0, 1) from a hash."""
    return float(key >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@jit
def power_of(nodes, i, tables, task):
    """Power of beam i: its area in q times its weight, over its band."""
    best = 0.0
    for a in range(3):
        if nodes[i].corners[a] > 0:
            best = max(best, abs(area_of(nodes[i].corner[a], nodes[i].corners[a])))
    middle = abs(area_of(nodes[i].corner[1], nodes[i].corners[1])) if nodes[i].corners[1] > 0 else 0.0
    area = max(middle, 0.5 * best)
    return area * _per_area(nodes, i, tables, task)


@jit
def _per_area(nodes, i, tables, task):
    band = task.line_share
    if nodes[i].x[2] > nodes[i].x[0]:
        band = at_x(tables, task.power, nodes[i].x[2]) - at_x(tables, task.power, nodes[i].x[0])
    return max(nodes[i].weight[1], 0.25 * max(nodes[i].weight[0], nodes[i].weight[2])) * nodes[i].boost * band * (
        task.density
    )


@jit
def _flux(nodes, i, tables, task):
    """Power of beam i at the middle of its band."""
    if nodes[i].corners[1] == 0:
        return 0.0
    band = task.line_share
    if nodes[i].x[2] > nodes[i].x[0]:
        band = at_x(tables, task.power, nodes[i].x[2]) - at_x(tables, task.power, nodes[i].x[0])
    area = abs(area_of(nodes[i].corner[1], nodes[i].corners[1]))
    return area * nodes[i].weight[1] * nodes[i].boost * band * task.density


@jit
def centroid(corner, count, out):
    """Centre of a polygon's area."""
    area = u = v = 0.0
    for k in range(1, count - 1):
        au, av = corner[k, 0] - corner[0, 0], corner[k, 1] - corner[0, 1]
        bu, bv = corner[k + 1, 0] - corner[0, 0], corner[k + 1, 1] - corner[0, 1]
        twice = au * bv - av * bu
        area += twice
        u += twice * (au + bu) / 3.0
        v += twice * (av + bv) / 3.0
    if abs(area) > 0.0:
        out[0], out[1] = corner[0, 0] + u / area, corner[0, 1] + v / area
    else:
        out[0], out[1] = corner[0, 0], corner[0, 1]


@jit
def recentre(nodes, i):
    """Take the middle of beam i's outline as its centre, about which its rays are written."""
    for a in (1, 0, 2):
        if nodes[i].corners[a] > 0:
            u, v = nodes[i].centre[0], nodes[i].centre[1]
            centroid(nodes[i].corner[a], nodes[i].corners[a], nodes[i].centre)
            u, v = nodes[i].centre[0] - u, nodes[i].centre[1] - v
            for b in range(3):
                for k in range(3):
                    nodes[i].position[b, 0, k] += u * nodes[i].position[b, 1, k] + v * nodes[i].position[b, 2, k]
                    nodes[i].direction[b, 0, k] += u * nodes[i].direction[b, 1, k] + v * nodes[i].direction[b, 2, k]
            return


@jit
def drifts(nodes, i, most):
    """Whether beam i's outline moves over its band by more than `most` of its own width, or exists at one end only."""
    if nodes[i].x[2] - nodes[i].x[0] <= _NARROWEST:
        return False
    there, size, first, last = 0, 0.0, -1, -1
    for a in range(3):
        if nodes[i].corners[a] > 0:
            there += 1
            size = max(size, abs(area_of(nodes[i].corner[a], nodes[i].corners[a])))
            first = a if first < 0 else first
            last = a
    if there < 2:
        return True
    one, other = np.empty(2), np.empty(2)
    centroid(nodes[i].corner[first], nodes[i].corners[first], one)
    centroid(nodes[i].corner[last], nodes[i].corners[last], other)
    moved = np.hypot(other[0] - one[0], other[1] - one[1])
    return moved > most * np.sqrt(size)


@jit
def halve_spectrum(nodes, i, k, at, facets, solids, tables, source, task, spare_corner, spare_side):
    """Cut beam i's band at x = `at`: the lower part stays at i, the upper one goes to k. Returns (is i left, is k)."""
    copy(nodes, i, k)
    forget_idle_lines(nodes, i)
    copy_outline(nodes, i, k)
    lo, hi = nodes[i].x[0], nodes[i].x[2]
    nodes[i].x[1], nodes[i].x[2] = 0.5 * (lo + at), at
    nodes[k].x[0], nodes[k].x[1] = at, 0.5 * (at + hi)
    nodes[i].key, nodes[k].key = mixed(nodes[i].key, 11), mixed(nodes[k].key, 12)
    low = lay_out(nodes, i, facets, solids, tables, source, task.room, spare_corner, spare_side)
    high = lay_out(nodes, k, facets, solids, tables, source, task.room, spare_corner, spare_side)
    return low, high


@jit
def is_curved(nodes, i, facets, solids, tables, source, tolerance, place):
    """How far, in tolerances, beam i's rays at its facet miss the affine map at the corners of its outline."""
    path = nodes[i].path
    plane = facets[nodes[i].facet].plane
    a = 1 if nodes[i].corners[1] > 0 else (0 if nodes[i].corners[0] > 0 else 2)
    position, direction = nodes[i].position[a].copy(), nodes[i].direction[a].copy()
    advance(position, direction, plane)
    exact, towards = np.empty((3, 3)), np.empty((3, 3))
    worst = 0.0
    for c in range(nodes[i].corners[a]):
        q = nodes[i].corner[a, c]
        follow(source, facets, solids, tables, path, nodes[i].flight, nodes[i].x[a], q, exact, towards)
        advance(exact, towards, plane)
        off = 0.0
        for k in range(3):
            u, v = q[0] - nodes[i].centre[0], q[1] - nodes[i].centre[1]
            d = position[0, k] + u * position[1, k] + v * position[2, k] - exact[0, k]
            off += d * d
        worst = max(worst, np.sqrt(off))
    return worst / tolerance


@jit
def halve_space(nodes, i, k, spare_corner, spare_side):
    """Cut beam i across its longer side: one half stays, the other goes to k."""
    low, high = np.full(2, 1e300), np.full(2, -1e300)
    for a in range(3):
        for c in range(nodes[i].corners[a]):
            for w in range(2):
                low[w] = min(low[w], nodes[i].corner[a, c, w])
                high[w] = max(high[w], nodes[i].corner[a, c, w])
    along = 0 if high[0] - low[0] >= high[1] - low[1] else 1
    at = 0.5 * (low[along] + high[along])
    copy(nodes, i, k)
    line, made = np.zeros((3, 3)), np.array([0, 0, STATIC, 1])
    line[:, 0] = -at
    line[:, 1 + along] = 1.0
    cut(nodes, i, line, made, spare_corner, spare_side)
    cut(nodes, k, -line, made, spare_corner, spare_side)
    for j in (i, k):
        forget_idle_lines(nodes, j)
        recentre(nodes, j)
    nodes[i].key, nodes[k].key = mixed(nodes[i].key, 13), mixed(nodes[k].key, 14)


@jit
def medium(solids, mask):
    """Object whose medium a mask stands for, -1: air."""
    if mask == 0:
        return -1
    bit = 0
    while mask > 1:
        mask >>= 1
        bit += 1
    return solids[bit].of_bit


@jit
def facing(facets, facet, direction):
    """Cosine between a direction and a facet's normal."""
    n = facets[facet].plane
    return n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2]


@jit
def is_ahead(facets, solids, nodes, i, facet, outward, parallel):
    """Whether beam i may meet a facet along its normal (`outward` 1) or against it (0): a solid's from outside, unless
    it is inside. The rays of a parallel light all have the chief ray's direction, though not at each place of the band."""
    if facets[facet].kind == 0:
        bit = solids[facets[facet].owner].bit
        if (nodes[i].mask >> bit) & 1 != outward:
            return False
    if not parallel:
        return True
    for a in range(3):
        cosine = facing(facets, facet, nodes[i].direction[a, 0])
        if cosine > 0.0 if outward == 1 else cosine < 0.0:
            return True
    return False


@jit
def spread_of(nodes, i, spread):
    """Radius of beam i's rays about the chief ray: spread[0] + distance spread[1]."""
    spread[0] = spread[1] = 0.0
    a0 = 1
    for a in range(3):
        for c in range(nodes[i].corners[a]):
            u = nodes[i].corner[a, c, 0] - nodes[i].centre[0]
            v = nodes[i].corner[a, c, 1] - nodes[i].centre[1]
            off = away = 0.0
            for k in range(3):
                p = nodes[i].position[a, 0, k] + u * nodes[i].position[a, 1, k] + v * nodes[i].position[a, 2, k]
                d = nodes[i].direction[a, 0, k] + u * nodes[i].direction[a, 1, k] + v * nodes[i].direction[a, 2, k]
                p -= nodes[i].position[a0, 0, k]
                d -= nodes[i].direction[a0, 0, k]
                off += p * p
                away += d * d
            spread[0], spread[1] = max(spread[0], np.sqrt(off)), max(spread[1], np.sqrt(away))


@jit
def near_sphere(nodes, i, centre, radius, spread):
    """Whether beam i may touch a ball ahead of it."""
    p, d = nodes[i].position[1, 0], nodes[i].direction[1, 0]
    tx, ty, tz = centre[0] - p[0], centre[1] - p[1], centre[2] - p[2]
    along = tx * d[0] + ty * d[1] + tz * d[2]
    if along < -(radius + spread[0]):
        return False
    off2 = tx * tx + ty * ty + tz * tz - along * along
    reach = radius + spread[0] + spread[1] * (max(along, 0.0) + radius)
    return off2 <= reach * reach


@jit
def near_boxes(nodes, i, length, obstacles, spread):
    """Whether beam i may touch an obstacle within `length`."""
    p, d = nodes[i].position[1, 0], nodes[i].direction[1, 0]
    for b in range(len(obstacles)):
        # Grown by the beam's radius where it passes the box's far side.
        far = 0.0
        for k in range(3):
            far += max(abs(obstacles[b, 0, k] - p[k]), abs(obstacles[b, 1, k] - p[k])) ** 2
        grow = spread[0] + spread[1] * min(np.sqrt(far), length)
        first, last = 0.0, length
        for k in range(3):
            lo, hi = obstacles[b, 0, k] - grow - p[k], obstacles[b, 1, k] + grow - p[k]
            if abs(d[k]) < 1e-12:
                if lo > 0.0 or hi < 0.0:
                    last = -1.0
            else:
                one, other = lo / d[k], hi / d[k]
                first, last = max(first, min(one, other)), min(last, max(one, other))
        if first <= last:
            return True
    return False
