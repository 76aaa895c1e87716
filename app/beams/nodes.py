"""Beams on the search's stack: their outlines at three places of a band, and how half-planes cut them.

A node's outline is kept twice: as half-planes, which move with the wavelength, and as polygons at the start, the middle
and the end of the band. A polygon's corner carries the half-plane of the side that starts there.
"""

from __future__ import annotations

import numpy as np

from .rays import PARALLEL, edge_line, emit_straight, follow, jit, meet, total_line

CORNERS, LINES, LEVELS = 84, 96, 160
"""Room for corners of a polygon, half-planes of a beam, facets on its path."""
THIN = 1e-10
"""Width in q below which a polygon is rounding's."""
STATIC, TOTAL = -1, -2
"""Kinds of half-planes besides a facet's edge: one that does not move (an aperture, a cell), and the onset of total
reflection."""
FLY, AT_FACET = 0, 1


NODE = np.dtype(
    [
        # Polygons in q at the three places; `side` names the half-plane of the side that starts at a corner. Where a
        # polygon is empty, `held` entries of `side` name the half-planes that left nothing.
        ("corner", "f8", (3, CORNERS, 2)),
        ("side", "i4", (3, CORNERS)),
        ("corners", "i4", 3),
        ("held", "i4", 3),
        # Half-planes: line[0] + line[1] q_u + line[2] q_v >= 0 at each place, and how to make them again: flight,
        # facet, edge (or STATIC, TOTAL), sign: 1 for the inside of what is met from its inner side, 2 from outside, -1
        # and -2 for what is beyond the edge.
        ("line", "f8", (LINES, 3, 3)),
        ("made", "i4", (LINES, 4)),
        ("lines", "i8"),
        # Rays of the flight that is going on, at the three places, about q = `centre`.
        ("position", "f8", (3, 3, 3)),
        ("direction", "f8", (3, 3, 3)),
        ("weight", "f8", 3),
        ("x", "f8", 3),
        ("centre", "f8", 2),
        # Facets met and specular events so far.
        ("flight", "i8"),
        ("depth", "i8"),
        # The facet that the whole outline meets next, -1: not yet known; whether it reflects everything (`grow`).
        ("facet", "i8"),
        ("total", "i8"),
        # Solids that it is inside of.
        ("mask", "i8"),
        ("path", "i4", (5, LEVELS)),
        # Hash of all choices so far, what roulette gave, curvature last measured.
        ("key", "u8"),
        ("boost", "f8"),
        ("bend", "f8"),
    ]
)
"""A beam on the stack. An array of them is what the functions here call `nodes`."""


@jit
def clip(corner, side, count, line, label, out_corner, out_side):
    """Part of a convex polygon where line >= 0 [Sutherland, Hodgman 1974]; returns its corners."""
    kept = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        here = line[0] + line[1] * corner[i, 0] + line[2] * corner[i, 1]
        there = line[0] + line[1] * corner[j, 0] + line[2] * corner[j, 1]
        if here >= 0.0:
            if kept < CORNERS - 1:
                out_corner[kept, 0], out_corner[kept, 1], out_side[kept] = corner[i, 0], corner[i, 1], side[i]
                kept += 1
        if (here >= 0.0) != (there >= 0.0):
            at = here / (here - there)
            u = corner[i, 0] + at * (corner[j, 0] - corner[i, 0])
            v = corner[i, 1] + at * (corner[j, 1] - corner[i, 1])
            if kept < CORNERS - 1:
                out_corner[kept, 0], out_corner[kept, 1] = u, v
                out_side[kept] = label if here >= 0.0 else side[i]
                kept += 1
    return kept if kept > 2 else 0


@jit
def is_thin(corner, count):
    """Whether a polygon is a line but for rounding."""
    longest = 0.0
    for i in range(1, count):
        longest = max(longest, abs(corner[i, 0] - corner[0, 0]) + abs(corner[i, 1] - corner[0, 1]))
    return abs(area_of(corner, count)) <= THIN * longest


@jit
def area_of(corner, count):
    """Signed area of a polygon; positive counter-clockwise."""
    twice = 0.0
    for i in range(1, count - 1):
        twice += (corner[i, 0] - corner[0, 0]) * (corner[i + 1, 1] - corner[0, 1])
        twice -= (corner[i, 1] - corner[0, 1]) * (corner[i + 1, 0] - corner[0, 0])
    return 0.5 * twice


@jit
def copy_head(nodes, i, k):
    """Everything of beam i but its outline to k."""
    nodes[k].position[:] = nodes[i].position
    nodes[k].direction[:] = nodes[i].direction
    nodes[k].weight[:] = nodes[i].weight
    nodes[k].x[:] = nodes[i].x
    nodes[k].centre[:] = nodes[i].centre
    nodes[k].flight = nodes[i].flight
    nodes[k].depth = nodes[i].depth
    nodes[k].facet = nodes[i].facet
    nodes[k].total = nodes[i].total
    nodes[k].mask = nodes[i].mask
    for r in range(5):
        for level in range(nodes[i].flight + 1):
            nodes[k].path[r, level] = nodes[i].path[r, level]
    nodes[k].key = nodes[i].key
    nodes[k].boost = nodes[i].boost
    nodes[k].bend = nodes[i].bend


@jit
def copy_outline(nodes, i, k):
    """The outline of beam i to k."""
    n = nodes[i].lines
    nodes[k].lines = n
    nodes[k].line[:n] = nodes[i].line[:n]
    nodes[k].made[:n] = nodes[i].made[:n]
    for a in range(3):
        m = nodes[i].corners[a]
        nodes[k].corners[a] = m
        nodes[k].corner[a, :m] = nodes[i].corner[a, :m]
        nodes[k].held[a] = nodes[i].held[a]
        m = m if m > 0 else nodes[i].held[a]
        nodes[k].side[a, :m] = nodes[i].side[a, :m]


@jit
def copy(nodes, i, k):
    """Beam i to k."""
    copy_head(nodes, i, k)
    copy_outline(nodes, i, k)


@jit
def forget_idle_lines(nodes, i):
    """Drop half-planes that bound no polygon of beam i and emptied none."""
    renamed = np.full(LINES, -1, np.int64)
    for a in range(3):
        for c in range(max(nodes[i].corners[a], nodes[i].held[a])):
            renamed[nodes[i].side[a, c]] = 0
    kept = 0
    for line in range(nodes[i].lines):
        if renamed[line] == 0:
            renamed[line] = kept
            if kept != line:
                nodes[i].line[kept] = nodes[i].line[line]
                nodes[i].made[kept] = nodes[i].made[line]
            kept += 1
    nodes[i].lines = kept
    for a in range(3):
        for c in range(max(nodes[i].corners[a], nodes[i].held[a])):
            nodes[i].side[a, c] = renamed[nodes[i].side[a, c]]


@jit
def cut(nodes, i, line, made, spare_corner, spare_side):
    """Cut beam i by one more half-plane, `line` (3, 3) by place; returns whether anything is left."""
    if nodes[i].lines >= LINES - 1:
        forget_idle_lines(nodes, i)
        if nodes[i].lines >= LINES - 1:
            return False
    label = nodes[i].lines
    nodes[i].line[label] = line
    nodes[i].made[label] = made
    nodes[i].lines = label + 1
    left = False
    for a in range(3):
        before = nodes[i].corners[a]
        m = clip(nodes[i].corner[a], nodes[i].side[a], before, line[a], label, spare_corner, spare_side)
        if m > 0 and is_thin(spare_corner, m):
            m = 0
        nodes[i].corners[a] = m
        if m == 0 and before > 0:
            nodes[i].side[a, before] = label
            nodes[i].held[a] = before + 1
        for c in range(m):
            nodes[i].corner[a, c, 0], nodes[i].corner[a, c, 1] = spare_corner[c, 0], spare_corner[c, 1]
            nodes[i].side[a, c] = spare_side[c]
        left = left or m > 0
    return left


@jit
def lay_line(nodes, i, l, a, facets, tables, source, position, direction, centre):
    """Half-plane l of beam i at place a for rays (position, direction) of its flight about q = `centre`."""
    facet, edge, sign = nodes[i].made[l, 1], nodes[i].made[l, 2], nodes[i].made[l, 3]
    line = nodes[i].line[l, a]
    if edge == TOTAL:
        flight = nodes[i].made[l, 0]
        path = nodes[i].path
        total_line(facets, tables, path[2, flight], path[3, flight], facet, nodes[i].x[a], direction, centre, line)
    else:
        edge_line(facets, facet, edge, 1.0 if abs(sign) == 1 else -1.0, position, direction, centre, line)
    if sign < 0:
        for c in range(3):
            line[c] = -line[c]


@jit
def lay_out(nodes, i, facets, solids, tables, source, room, spare_corner, spare_side):
    """Make rays, half-planes and polygons of beam i anew at its three places about its centre; `room`: a square in q
    that holds everything (centre, half side). Returns whether anything is left."""
    path = nodes[i].path
    flights = nodes[i].flight
    n = nodes[i].lines
    moving = False
    for l in range(n):
        moving = moving or nodes[i].made[l, 2] != STATIC
    left = False
    for a in range(3):
        if a > 0 and nodes[i].x[a] == nodes[i].x[a - 1]:
            nodes[i].position[a], nodes[i].direction[a] = nodes[i].position[a - 1], nodes[i].direction[a - 1]
            nodes[i].weight[a] = nodes[i].weight[a - 1]
            for l in range(n):
                nodes[i].line[l, a] = nodes[i].line[l, a - 1]
        else:
            position, direction = nodes[i].position[a], nodes[i].direction[a]
            if moving:
                nodes[i].weight[a] = _follow_with_lines(
                    nodes, i, a, path, flights, facets, solids, tables, source, position, direction
                )
            else:
                nodes[i].weight[a] = follow(
                    source, facets, solids, tables, path, flights, nodes[i].x[a], nodes[i].centre, position, direction
                )
        corner, side = nodes[i].corner[a], nodes[i].side[a]
        for c in range(4):
            corner[c, 0] = room[0] + (room[2] if c == 1 or c == 2 else -room[2])
            corner[c, 1] = room[1] + (room[2] if c > 1 else -room[2])
            side[c] = 0
        m = 4
        nodes[i].held[a] = 0
        for l in range(n):
            before = m
            m = clip(corner, side, m, nodes[i].line[l, a], l, spare_corner, spare_side)
            if m > 0 and is_thin(spare_corner, m):
                m = 0
            for c in range(m):
                corner[c, 0], corner[c, 1], side[c] = spare_corner[c, 0], spare_corner[c, 1], spare_side[c]
            if m == 0:
                side[before] = l
                nodes[i].held[a] = before + 1
                break
        nodes[i].corners[a] = m
        left = left or m > 0
    return left


@jit
def _follow_with_lines(nodes, i, a, path, flights, facets, solids, tables, source, position, direction):
    """`follow`, laying every half-plane on the way in its own flight."""
    from_source = nodes[i].centre
    weight = follow(source, facets, solids, tables, path, 0, nodes[i].x[a], from_source, position, direction)
    n = nodes[i].lines
    for k in range(flights + 1):
        if k == 0 and source.kind != PARALLEL:
            straight, apart = np.empty((3, 3)), np.empty((3, 3))
            emit_straight(source, from_source, straight, apart)
            for l in range(n):
                if nodes[i].made[l, 2] >= 0 and nodes[i].made[l, 0] == 0:
                    lay_line(nodes, i, l, a, facets, tables, source, straight, apart, from_source)
        for l in range(n):
            if k == 0 and source.kind != PARALLEL and nodes[i].made[l, 2] >= 0:
                continue
            if nodes[i].made[l, 2] != STATIC and nodes[i].made[l, 0] == k:
                lay_line(nodes, i, l, a, facets, tables, source, position, direction, from_source)
        if k < flights:
            weight *= meet(facets, solids, tables, path, k, nodes[i].x[a], position, direction)
    return weight

