"""The search for beams: from one facet that a light sees, through all facets that light meets after it.

Depth first over an explicit stack. A beam flies (`flight.fly`): the facets ahead cut it into fragments, each of which
meets one facet. A fragment is halved in the spectrum where its outline moves too far, in space where rays are too far
from affine; then it ends on a receiver, or is reflected and refracted. Weak children play Russian roulette, whose
number is a hash of the path, so that the same beams live from frame to frame.
"""

from __future__ import annotations

import numpy as np

from .compiling import jit, part
from .facets import MAX_CORNERS
from .nodes import (
    CORNERS,
    HALF,
    LINES,
    area_of,
    copy,
    cut,
    first_place,
    forget_idle_lines,
    heights,
    last_place,
    lay_out,
)
from .polarised import STATE
from .rays import advance, at_x, edge_line, follow

LEAF_RECEIVER, LEAF_PIECE, LEAF_TAIL = 0, 1, 2
"""What reaches a receiver; what photons carry on; what is too weak to be followed as a beam, and is carried on by
photons."""
NARROWEST = 1.0 / 256.0
"""Bands are not halved below this."""
_STEADY = 10.0
"""Widths of itself that an outline of the threshold's power may move over a band, for a `drift` of 1: a beam that moves
past a facet between the three places of its band loses what that facet takes, and one that is halved is sooner too weak
to be followed."""
FRAGMENTS = 192
"""Most facets that a beam is cut by in one flight."""
(
    SUM_DEPOSITED,
    SUM_LEFT,
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


WORK = np.dtype(
    [
        # What is to be done. Row of the tables: share of the light's importance below x; of its watts, the next row.
        ("power", "i8"),
        # Power (flux per unit of spectral power) below which a beam plays roulette.
        ("threshold", "f8"),
        # Above 0: weaker ones are left to photons as tails, and only those below this play roulette.
        ("faint", "f8"),
        ("seed", "u8"),
        # Most specular events.
        ("depth", "i8"),
        # Flux per unit of q and of spectral power.
        ("density", "f8"),
        # Error of places on what is followed further, GPU units.
        ("tolerance", "f8"),
        # How far outlines may move over a band (`drifts`).
        ("drift", "f8"),
        # Share of the light's power in a band without width.
        ("line_share", "f8"),
        # Centre and half side of a square in q that holds everything.
        ("room", "f8", 3),
        # Some glass bends one wavelength more than another: else no outline moves over a band.
        ("disperses", "?"),
        # Some medium absorbs.
        ("absorbing", "?"),
        # Something may take steps over the spectrum that three places do not see.
        ("coloured", "?"),
        # Objects of the scene; sources (more than one: shifted parts of an extended light).
        ("objects", "i8"),
        ("sources", "i8"),
        # How far it is: end of the stack, steps to go; leaves, edges, corners written; sums.
        ("top", "i8"),
        ("steps", "i8"),
        ("count", "i8", 3),
        ("sums", "f8", SUMS),
        # Scratch.
        ("spare_corner", "f8", (CORNERS, 2)),
        ("spare_side", "i4", CORNERS),
        ("height", "f8", CORNERS),
        # Lines of a facet's edges by place, the last: another; which of them cut, how many are laid at each place.
        ("lines", "f8", (MAX_CORNERS + 1, 3, 3)),
        ("cuts", "i8", MAX_CORNERS),
        ("laid", "i8", 3),
        ("renamed", "i8", LINES),
        ("moment", "f8", (4, 3, 6)),
        ("rays", "f8", (4, 3, 3)),
        ("state", "f8", STATE),
        ("map", "f8", (3, 3, 2)),
        ("det", "f8", 3),
        ("point", "f8", 2),
        ("other", "f8", 2),
        ("spread", "f8", 2),
        ("soft", "f8", LINES),
        ("own", "f8", LINES),
        ("hits", "i8", FRAGMENTS),
        ("hidden", "i1", (FRAGMENTS, FRAGMENTS)),
    ]
)
"""One search's task, state and scratch: what compiled functions call `work`. Records instead of many arrays: what numba
compiles takes far less time."""


@part
def mixed(key, word):
    """Hash of a key and one more choice [SplitMix64]."""
    z = key + np.uint64(0x9E3779B97F4A7C15) * (np.uint64(word) + np.uint64(1))
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@part
def unit(key):
    """A number in [0, 1) from a hash."""
    return float(key >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@part
def band_power(beam, tables, work):
    """Importance per unit of q of a beam's band before it met anything, roulette's gain included."""
    share = work.line_share
    if beam.x[2] > beam.x[0]:
        share = at_x(tables, work.power, beam.x[2]) - at_x(tables, work.power, beam.x[0])
    return beam.boost * share * work.density


@part
def band_share(beam, tables, work):
    """Share of the light's power that a beam's band has."""
    if beam.x[2] <= beam.x[0]:
        return work.line_share
    return at_x(tables, work.power + 1, beam.x[2]) - at_x(tables, work.power + 1, beam.x[0])


@part
def power_as(outline, beam, tables, work):
    """Power of a beam with another's outline: its area in q times its weight, over its band."""
    best = most = 0.0
    for a in range(first_place(beam), last_place(beam)):
        if outline.corners[a] > 0:
            best = max(best, area_of(outline.corner[a], outline.corners[a]))
        most = max(most, beam.weight[a])
    middle = area_of(outline.corner[1], outline.corners[1]) if outline.corners[1] > 0 else 0.0
    return max(middle, 0.5 * best) * max(beam.weight[1], 0.25 * most) * band_power(beam, tables, work)


@jit
def power_of(nodes, i, tables, works):
    """Power of beam i."""
    return power_as(nodes[i], nodes[i], tables, works[0])


@part
def passes_at(outline, beam, a):
    """Area in q of an outline times a beam's weight, at place a."""
    if outline.corners[a] == 0:
        return 0.0
    return area_of(outline.corner[a], outline.corners[a]) * beam.weight[a]


@part
def flux_as(outline, beam, tables, work):
    """Flux of a beam with another's outline over its band, per unit of the light's power: a parabola through the three
    places, each half of the band by its own share of the light."""
    middle = passes_at(outline, beam, 1)
    if beam.x[2] <= beam.x[0]:
        return middle * beam.boost * work.line_share * work.density
    low, high = passes_at(outline, beam, 0), passes_at(outline, beam, 2)
    row = work.power + 1
    half = at_x(tables, row, beam.x[1])
    lower, upper = half - at_x(tables, row, beam.x[0]), at_x(tables, row, beam.x[2]) - half
    sum = lower * (5.0 * low + 8.0 * middle - high) + upper * (5.0 * high + 8.0 * middle - low)
    return max(sum, 0.0) / 12.0 * beam.boost * work.density


@part
def flux_of(beam, tables, work):
    """Flux of a beam over its band, per unit of the light's power."""
    return flux_as(beam, beam, tables, work)


@jit
def flux_in(nodes, i, tables, works):
    """`flux_of` beam i."""
    return flux_of(nodes[i], tables, works[0])


@part
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
    out[0], out[1] = corner[0, 0], corner[0, 1]
    if abs(area) > 0.0:
        out[0] += u / area
        out[1] += v / area


@part
def place_of(beam):
    """The middle, or a place where the outline exists."""
    return 1 if beam.corners[1] > 0 else (0 if beam.corners[0] > 0 else 2)


@part
def recentre(beam):
    """Take the middle of a beam's outline as its centre, about which its rays are written."""
    a = place_of(beam)
    if beam.corners[a] == 0:
        return
    u, v = beam.centre[0], beam.centre[1]
    centroid(beam.corner[a], beam.corners[a], beam.centre)
    u, v = beam.centre[0] - u, beam.centre[1] - v
    for b in range(first_place(beam), last_place(beam)):
        p, d = beam.position[b], beam.direction[b]
        for k in range(3):
            p[0, k] += u * p[1, k] + v * p[2, k]
            d[0, k] += u * d[1, k] + v * d[2, k]


@part
def drifts(beam, power, work):
    """Whether a beam's outline moves too far over its band, or exists at one end only. What is strong may move less:
    halving a weak beam costs as much, and spares less error."""
    if not work.disperses or beam.x[2] - beam.x[0] <= NARROWEST:
        return False
    there, size, first, last = 0, 0.0, -1, -1
    for a in range(3):
        if beam.corners[a] > 0:
            there += 1
            size = max(size, area_of(beam.corner[a], beam.corners[a]))
            first = a if first < 0 else first
            last = a
    if there < 2:
        return True
    centroid(beam.corner[first], beam.corners[first], work.point)
    centroid(beam.corner[last], beam.corners[last], work.other)
    u, v = work.other[0] - work.point[0], work.other[1] - work.point[1]
    most = work.drift * _STEADY * work.threshold / power
    return u * u + v * v > most * most * size


@part
def halve_spectrum(beam, other, at, facets, solids, tables, source, work):
    """Cut a beam's band at x = `at`: the lower part stays, the upper one becomes `other`. Returns (is it left, is the
    other)."""
    forget_idle_lines(beam, work)
    copy(beam, other)
    lo, hi = beam.x[0], beam.x[2]
    beam.x[1], beam.x[2] = 0.5 * (lo + at), at
    other.x[0], other.x[1] = at, 0.5 * (at + hi)
    beam.key, other.key = mixed(beam.key, np.int64(11)), mixed(other.key, np.int64(12))
    low = lay_out(beam, facets, solids, tables, source, work)
    return low, lay_out(other, facets, solids, tables, source, work)


@part
def is_curved(beam, facets, solids, tables, source, tolerance, work):
    """How far, in tolerances, a beam's rays at its facet miss the affine map at the corners of its outline."""
    plane = facets[beam.facet].plane
    a = place_of(beam)
    p, towards, exact, direction = work.rays[0], work.rays[1], work.rays[2], work.rays[3]
    for c in range(3):
        for k in range(3):
            p[c, k], towards[c, k] = beam.position[a, c, k], beam.direction[a, c, k]
    advance(p, towards, plane)
    worst = 0.0
    for c in range(beam.corners[a]):
        u, v = beam.corner[a, c, 0], beam.corner[a, c, 1]
        follow(source, facets, solids, tables, beam.path, beam.flight, beam.x[a], u, v, exact, direction, work.state)
        advance(exact, direction, plane)
        u -= beam.centre[0]
        v -= beam.centre[1]
        off = 0.0
        for k in range(3):
            d = p[0, k] + u * p[1, k] + v * p[2, k] - exact[0, k]
            off += d * d
        worst = max(worst, off)
    return np.sqrt(worst) / tolerance


@part
def halve_space(beam, other, work):
    """Cut a beam across its longer side: one half stays, the other becomes `other`. Returns (is it left, is the
    other)."""
    low_u = low_v = 1e300
    high_u = high_v = -1e300
    for a in range(3):
        for c in range(beam.corners[a]):
            u, v = beam.corner[a, c, 0], beam.corner[a, c, 1]
            low_u, high_u = min(low_u, u), max(high_u, u)
            low_v, high_v = min(low_v, v), max(high_v, v)
    along = 0 if high_u - low_u >= high_v - low_v else 1
    at = 0.5 * (low_u + high_u) if along == 0 else 0.5 * (low_v + high_v)
    line = work.lines[MAX_CORNERS]
    for a in range(3):
        line[a, 0] = -at
        line[a, 1 + along], line[a, 2 - along] = 1.0, 0.0
    copy(beam, other)
    zero, half, way = np.int64(0), np.int64(HALF), np.int64(1)
    low = cut(beam, line, 1.0, zero, zero, half, way, work)
    high = cut(other, line, -1.0, zero, zero, half, way, work)
    beam.key, other.key = mixed(beam.key, np.int64(13)), mixed(other.key, np.int64(14))
    recentre(beam)
    recentre(other)
    return low, high


@part
def medium(solids, mask):
    """Object whose medium a mask denotes, -1: air."""
    if mask == 0:
        return -1
    bit = 0
    while mask > 1:
        mask >>= 1
        bit += 1
    return solids[bit].of_bit


@part
def facing(facet, direction):
    """Cosine between a bundle's chief ray and a facet's normal."""
    n = facet.plane
    return n[0] * direction[0, 0] + n[1] * direction[0, 1] + n[2] * direction[0, 2]


@part
def is_ahead(facet, solids, beam, outward, is_parallel):
    """Whether a beam may meet a facet along its normal (`outward` 1) or against it (0): a solid's from outside, unless
    it is inside. The rays of a parallel light all have the chief ray's direction, though not at each place of the
    band."""
    if facet.kind == 0 and (beam.mask >> solids[facet.owner].bit) & 1 != outward:
        return False
    for a in range(first_place(beam), last_place(beam)):
        cosine = facing(facet, beam.direction[a])
        if not is_parallel or (cosine > 0.0 if outward == 1 else cosine < 0.0):
            return True
    return False


@part
def spread_of(beam, spread):
    """Radius of a beam's rays about the chief ray: spread[0] + distance spread[1]."""
    p, d = beam.position, beam.direction
    at = away = 0.0
    for a in range(first_place(beam), last_place(beam)):
        for c in range(beam.corners[a]):
            u, v = beam.corner[a, c, 0] - beam.centre[0], beam.corner[a, c, 1] - beam.centre[1]
            off = apart = 0.0
            for k in range(3):
                x = p[a, 0, k] + u * p[a, 1, k] + v * p[a, 2, k] - p[1, 0, k]
                y = d[a, 0, k] + u * d[a, 1, k] + v * d[a, 2, k] - d[1, 0, k]
                off += x * x
                apart += y * y
            at, away = max(at, off), max(away, apart)
    spread[0], spread[1] = np.sqrt(at), np.sqrt(away)


@part
def near_sphere(beam, centre, radius, spread):
    """Whether a beam may touch a ball ahead of it."""
    p, d = beam.position, beam.direction
    along = off2 = 0.0
    for k in range(3):
        t = centre[k] - p[1, 0, k]
        along += t * d[1, 0, k]
        off2 += t * t
    if along < -(radius + spread[0]):
        return False
    reach = radius + spread[0] + spread[1] * (max(along, 0.0) + radius)
    return off2 - along * along <= reach * reach


@part
def near_boxes(beam, length, obstacles, spread):
    """Whether a beam may touch an obstacle within `length`."""
    p, d = beam.position, beam.direction
    for b in range(len(obstacles)):
        # Grown by the beam's radius where it passes the box's far side.
        far = 0.0
        for k in range(3):
            far += max(abs(obstacles[b, 0, k] - p[1, 0, k]), abs(obstacles[b, 1, k] - p[1, 0, k])) ** 2
        grow = spread[0] + spread[1] * min(np.sqrt(far), length)
        first, last = 0.0, length
        for k in range(3):
            lo, hi = obstacles[b, 0, k] - grow - p[1, 0, k], obstacles[b, 1, k] + grow - p[1, 0, k]
            if abs(d[1, 0, k]) < 1e-12:
                if lo > 0.0 or hi < 0.0:
                    last = -1.0
            else:
                one, other = lo / d[1, 0, k], hi / d[1, 0, k]
                first, last = max(first, min(one, other)), min(last, max(one, other))
        if first <= last:
            return True
    return False


@jit
def may_touch(nodes, i, length, obstacles, works):
    """Whether beam i may touch an obstacle within `length`."""
    spread_of(nodes[i], works[0].spread)
    return near_boxes(nodes[i], length, obstacles, works[0].spread)


@part
def lay_edges(beam, flown, facet, hit, work):
    """Whether a facet, met as `hit` says (`flight.facet_of`) on the flight of beam `flown`, may leave anything of
    an outline. If so its edges are in `work.lines`, and `work.cuts` says which of them cut. `work.moment` holds the
    flight's rays."""
    lo, hi, sign = first_place(flown), last_place(flown), 1.0 if hit >= 0 else -1.0
    for e in range(facet.corners):
        work.cuts[e] = 0
    alive = False
    for a in range(lo, hi):
        missed, e = beam.corners[a] == 0, 0
        while e < facet.corners and not missed:
            line = work.lines[e, a]
            edge_line(facet, e, sign, work.moment[a], flown.centre[0], flown.centre[1], line)
            outside = heights(beam.corner[a], beam.corners[a], line, 1.0, work.height)
            if outside > 0:
                work.cuts[e] = 1
                missed = outside == beam.corners[a]
            e += 1
        work.laid[a] = e
        alive = alive or not missed
    if alive:
        for a in range(lo, hi):
            for e in range(work.laid[a], facet.corners):
                edge_line(facet, e, sign, work.moment[a], flown.centre[0], flown.centre[1], work.lines[e, a])
    return alive
