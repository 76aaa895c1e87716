"""Beams on the search's stack: their outlines at three places of a band, and how half-planes cut them.

A beam's outline is kept twice: as half-planes, which move with the wavelength, and as polygons at the start, the middle
and the end of the band. A polygon's corner carries the half-plane of the side that starts there. Of a band without
width the middle alone is kept.
"""

from __future__ import annotations

import numpy as np

from .clipping import clip_labelled
from .compiling import part
from .polarised import STATE, begin
from .rays import FACET, dot, edge_line, emit, emitted, lengthening, meet, moments, total_line

CORNERS, LINES, LEVELS = 84, 96, 160
"""Room for corners of a polygon, half-planes of a beam, facets on its path."""
SPARE_LINES = LINES // 2
"""Half-planes of a beam up to which those are kept that may bound its outline only at other places than its three."""
THIN = 1e-10
"""Width in q below which a polygon is rounding's."""
STATIC, TOTAL, HALF = -1, -2, -3
"""Kinds of half-planes besides a facet's edge: one that does not move (an aperture, a cell), the onset of total
reflection, and where a beam was cut in halves."""


NODE = np.dtype(
    [
        # Polygons in q at the three places; `side` names the half-plane of the side that starts at a corner. Where a
        # polygon is empty, `held` entries of `side` name the half-planes that left nothing, and all that came later.
        ("corner", "f8", (3, CORNERS, 2)),
        ("side", "i4", (3, CORNERS)),
        ("corners", "i8", 3),
        ("held", "i8", 3),
        # Half-planes: line[0] + line[1] q_u + line[2] q_v >= 0 at each place, and how to make them again: flight,
        # facet, edge (or STATIC, TOTAL, HALF), sign: 1 for the inside of what is met from its inner side, 2 from
        # outside, -1 and -2 for what is beyond the edge.
        ("line", "f8", (LINES, 3, 3)),
        ("made", "i4", (LINES, 4)),
        ("lines", "i8"),
        # Rays of the flight that is going on, at the three places, about q = `centre`, and relative changes of their
        # lengths for `rays.moments`; states of polarisation.
        ("position", "f8", (3, 3, 3)),
        ("direction", "f8", (3, 3, 3)),
        ("growth", "f8", (3, 2)),
        ("weight", "f8", 3),
        ("state", "f8", (3, STATE)),
        ("x", "f8", 3),
        ("centre", "f8", 2),
        # Facets met and specular events so far.
        ("flight", "i8"),
        ("depth", "i8"),
        # The facet that the whole outline meets next, -1: not yet known; whether it reflects everything (`grow`).
        ("facet", "i8"),
        ("total", "i8"),
        # The kind of leaf that it is to end as, -1: it is followed further.
        ("ends", "i8"),
        # Solids that it is inside of.
        ("mask", "i8"),
        ("path", "i4", (LEVELS, 5)),
        # Hash of all choices so far, what roulette gave, curvature last measured.
        ("key", "u8"),
        ("boost", "f8"),
        ("bend", "f8"),
    ]
)
"""A beam on the stack: what functions here call `beam`."""


@part
def first_place(beam):
    """The first of a beam's places."""
    return 0 if beam.x[2] > beam.x[0] else 1


@part
def last_place(beam):
    """One behind the last of a beam's places."""
    return 3 if beam.x[2] > beam.x[0] else 2


@part
def exists_throughout(beam):
    """Whether a beam's outline is empty at none of its places."""
    throughout = True
    for a in range(first_place(beam), last_place(beam)):
        throughout = throughout and beam.corners[a] > 0
    return throughout


@part
def clip(corner, side, count, label, work):
    """Keep the part of a convex polygon where `work.height`, given at its corners, is not negative; returns its
    corners."""
    spare, spare_side = work.spare_corner, work.spare_side
    kept = clip_labelled(corner, side, count, work.height, label, spare, spare_side)
    if kept < 3:
        return 0
    longest = twice = 0.0
    for i in range(1, kept):
        u, v = spare[i, 0] - spare[0, 0], spare[i, 1] - spare[0, 1]
        longest = max(longest, abs(u) + abs(v))
        if i + 1 < kept:
            twice += u * (spare[i + 1, 1] - spare[0, 1]) - v * (spare[i + 1, 0] - spare[0, 0])
    if 0.5 * abs(twice) <= THIN * longest:
        # A line but for rounding.
        return 0
    for i in range(kept):
        corner[i, 0], corner[i, 1], side[i] = spare[i, 0], spare[i, 1], spare_side[i]
    return kept


@part
def area_of(corner, count):
    """Area of a convex polygon."""
    twice = 0.0
    for i in range(1, count - 1):
        twice += (corner[i, 0] - corner[0, 0]) * (corner[i + 1, 1] - corner[0, 1])
        twice -= (corner[i, 1] - corner[0, 1]) * (corner[i + 1, 0] - corner[0, 0])
    return 0.5 * abs(twice)


@part
def copy_head(beam, other):
    """Everything of a beam but its outline to another."""
    for a in range(3):
        for c in range(3):
            for k in range(3):
                other.position[a, c, k] = beam.position[a, c, k]
                other.direction[a, c, k] = beam.direction[a, c, k]
        other.growth[a, 0], other.growth[a, 1] = beam.growth[a, 0], beam.growth[a, 1]
        for c in range(STATE):
            other.state[a, c] = beam.state[a, c]
        other.weight[a] = beam.weight[a]
        other.x[a] = beam.x[a]
    other.centre[0], other.centre[1] = beam.centre[0], beam.centre[1]
    for level in range(beam.flight + 1):
        for c in range(5):
            other.path[level, c] = beam.path[level, c]
    other.flight = beam.flight
    other.depth = beam.depth
    other.facet = beam.facet
    other.total = beam.total
    other.ends = beam.ends
    other.mask = beam.mask
    other.key = beam.key
    other.boost = beam.boost
    other.bend = beam.bend


@part
def copy_outline(beam, other):
    """The outline of a beam to another."""
    other.lines = beam.lines
    for ln in range(beam.lines):
        for a in range(3):
            for c in range(3):
                other.line[ln, a, c] = beam.line[ln, a, c]
        for c in range(4):
            other.made[ln, c] = beam.made[ln, c]
    for a in range(3):
        other.corners[a], other.held[a] = beam.corners[a], beam.held[a]
        for c in range(beam.corners[a]):
            other.corner[a, c, 0], other.corner[a, c, 1] = beam.corner[a, c, 0], beam.corner[a, c, 1]
        for c in range(max(beam.corners[a], beam.held[a])):
            other.side[a, c] = beam.side[a, c]


@part
def copy(beam, other):
    """A beam to another row of the stack."""
    copy_head(beam, other)
    copy_outline(beam, other)


@part
def forget_idle_lines(beam, work):
    """Drop half-planes that bound no polygon of a beam and are held by none that is empty."""
    renamed = work.renamed
    for ln in range(beam.lines):
        renamed[ln] = -1
    for a in range(3):
        for c in range(max(beam.corners[a], beam.held[a])):
            renamed[beam.side[a, c]] = 0
    kept = 0
    for ln in range(beam.lines):
        if renamed[ln] == 0:
            renamed[ln] = kept
            if kept != ln:
                for a in range(3):
                    for c in range(3):
                        beam.line[kept, a, c] = beam.line[ln, a, c]
                for c in range(4):
                    beam.made[kept, c] = beam.made[ln, c]
            kept += 1
    if kept < beam.lines:
        beam.lines = kept
        for a in range(3):
            for c in range(max(beam.corners[a], beam.held[a])):
                beam.side[a, c] = renamed[beam.side[a, c]]


@part
def heights(corner, count, line, sign, height):
    """sign * line at a polygon's corners; returns how many are outside."""
    outside = 0
    for c in range(count):
        height[c] = sign * (line[0] + line[1] * corner[c, 0] + line[2] * corner[c, 1])
        if not height[c] >= 0.0:
            outside += 1
    return outside


@part
def cut(beam, line, sign, flight, facet, edge, way, work):
    """Cut a beam by one more half-plane, sign * `line` (3, 3) by place, made by a flight's meeting a facet's edge (or
    STATIC, TOTAL, HALF) its `way` (1 from inside, 2 from outside); returns whether anything is left."""
    if beam.lines >= LINES - 1:
        forget_idle_lines(beam, work)
        if beam.lines >= LINES - 1:
            for a in range(3):
                beam.held[a] = min(beam.held[a], SPARE_LINES)
            forget_idle_lines(beam, work)
        if beam.lines >= LINES - 1:
            return False
    label = beam.lines
    left = used = some_empty = False
    for a in range(first_place(beam), last_place(beam)):
        before = beam.corners[a]
        if before == 0:
            some_empty = True
            continue
        if heights(beam.corner[a], before, line[a], sign, work.height) == 0:
            left = True
            continue
        used = True
        beam.corners[a] = clip(beam.corner[a], beam.side[a], before, label, work)
        if beam.corners[a] == 0:
            beam.side[a, before] = label
            beam.held[a] = before + 1
        else:
            left = True
    if used or (some_empty and left and beam.lines < SPARE_LINES):
        for a in range(3):
            held = beam.held[a]
            if beam.corners[a] == 0 and 0 < held < CORNERS and beam.side[a, held - 1] != label:
                # Nearer to the places that are left it may be what bounds the outline.
                beam.side[a, held] = label
                beam.held[a] += 1
            for c in range(3):
                beam.line[label, a, c] = sign * line[a, c]
        made = beam.made
        made[label, 0], made[label, 1], made[label, 2], made[label, 3] = (
            flight,
            facet,
            edge,
            way if sign > 0.0 else -way,
        )
        beam.lines = label + 1
    return left


@part
def go_through(beam, a, k, facets, solids, tables):
    """`rays.meet` for a beam's rays at place a. The components of their directions along the facet's normal stay as
    they were: where rays of those lengths meet another plane is as good as affine behind glass, too."""
    plane, direction, share = facets[beam.path[k, FACET]].plane, beam.direction[a], 1.0
    for sign in (1.0, -1.0):
        if sign < 0.0:
            share = meet(facets, solids, tables, beam.path, k, beam.x[a], beam.position[a], direction, beam.state[a])
        along = dot(plane, direction[0])
        for c in range(2):
            beam.growth[a, c] += sign * dot(plane, direction[c + 1]) / (along if abs(along) > 1e-12 else 1e-12)
    return share


@part
def lay_lines(beam, a, flight, facets, tables, work, position, direction):
    """Lay a beam's half-planes of one flight anew at place a, for rays about its centre."""
    ready = False
    for ln in range(beam.lines):
        edge = np.int64(beam.made[ln, 2])
        if edge in (STATIC, HALF) or beam.made[ln, 0] != flight:
            continue
        if not ready:
            moments(position, direction, beam.growth[a], work.moment[3])
            ready = True
        line, way = beam.line[ln, a], beam.made[ln, 3]
        facet = facets[beam.made[ln, 1]]
        if edge == TOTAL:
            path = beam.path
            before, after = np.int64(path[flight, 2]), np.int64(path[flight, 3])
            total_line(facet, tables, before, after, beam.x[a], direction, beam.centre[0], beam.centre[1], line)
        else:
            edge_line(facet, edge, 1.0 if abs(way) == 1 else -1.0, work.moment[3], beam.centre[0], beam.centre[1], line)
        if way < 0:
            for c in range(3):
                line[c] = -line[c]


@part
def lay_out(beam, facets, solids, tables, source, work):
    """Make rays, half-planes and polygons of a beam anew at its places about its centre. Returns whether anything is
    left."""
    room, n, left = work.room, beam.lines, False
    for a in range(3):
        beam.corners[a] = beam.held[a] = 0
    for a in range(first_place(beam), last_place(beam)):
        position, direction = beam.position[a], beam.direction[a]
        weight = 1.0
        for k in range(-1, beam.flight):
            if k >= 0:
                weight *= go_through(beam, a, k, facets, solids, tables)
            else:
                lengthening(source, beam.centre[0], beam.centre[1], beam.growth[a])
                emit(source, beam.centre[0], beam.centre[1], position, direction)
                begin(source, direction, beam.state[a])
                weight = emitted(source, beam.centre[0], beam.centre[1], direction)
            lay_lines(beam, a, k + 1, facets, tables, work, position, direction)
        beam.weight[a] = weight
        corner, side = beam.corner[a], beam.side[a]
        for c in range(4):
            corner[c, 0] = room[0] + (room[2] if c == 1 or c == 2 else -room[2])
            corner[c, 1] = room[1] + (room[2] if c > 1 else -room[2])
            side[c] = 0
        m = 4
        for ln in range(n):
            if heights(corner, m, beam.line[ln, a], 1.0, work.height) == 0:
                continue
            m = clip(corner, side, m, ln, work)
            if m == 0:
                # Any line may bound what is left nearer to the other places.
                beam.held[a] = min(n, CORNERS)
                for other in range(beam.held[a]):
                    side[other] = other
                break
        beam.corners[a] = m
        left = left or m > 0
    return left
