"""The part of its band in which a polygon exists.

A beam whose outline is empty at an end of its band throws a polygon that appears, or vanishes, in between. Its lines are
known for all of the band, so the band can be cut to where something is left, exactly: the polygon then moves less, covers
fewer texels, and a few places of its band show it as it is.
"""

from __future__ import annotations

import numpy as np

from .compiling import jit, part
from .nodes import area_of

PLACES = 17
"""At which a polygon that is empty at an end is looked for."""
_HALVINGS = 8
"""Of a place, to find where it appears or vanishes."""
_ROOM = 128
"""Corners."""


@part
def outline_at(edges, first, last, box, t, corner, spare):
    """The polygon at t in [0, 1] of its band: corners of the rectangle `box` (u0, v0, u1, v1) cut by all its lines;
    returns how many."""
    for c in range(4):
        corner[c, 0] = box[2] if c == 1 or c == 2 else box[0]
        corner[c, 1] = box[3] if c > 1 else box[1]
    n = 4
    for e in range(first, last):
        line = edges[e]
        a, b = line[0] + t * (line[4] - line[0]), line[1] + t * (line[5] - line[1])
        c = line[2] + t * (line[6] - line[2])
        kept = 0
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            here = a * corner[i, 0] + b * corner[i, 1] + c
            there = a * corner[j, 0] + b * corner[j, 1] + c
            if here >= 0.0 and kept < _ROOM - 1:
                spare[kept, 0], spare[kept, 1] = corner[i, 0], corner[i, 1]
                kept += 1
            if (here >= 0.0) != (there >= 0.0) and kept < _ROOM - 1:
                at = here / (here - there)
                spare[kept, 0] = corner[i, 0] + at * (corner[j, 0] - corner[i, 0])
                spare[kept, 1] = corner[i, 1] + at * (corner[j, 1] - corner[i, 1])
                kept += 1
        n = kept
        for i in range(n):
            corner[i, 0], corner[i, 1] = spare[i, 0], spare[i, 1]
        if n < 3:
            return 0
    return n


@part
def border(edges, first, last, box, alive, dead, corner, spare):
    """Place between one where there is a polygon and one where there is none, on the side of the latter."""
    for _ in range(_HALVINGS):
        t = 0.5 * (alive + dead)
        n = outline_at(edges, first, last, box, t, corner, spare)
        if n > 0 and area_of(corner, n) > 0.0:
            alive = t
        else:
            dead = t
    return dead


@jit
def lifetimes(edges, starts, hulls, hull_starts, is_band, corner, spare, lives, areas):
    """For every polygon the part of [0, 1] in which it exists, in `lives` (N, 2), equal where it never does; and its
    area in the middle of that, in `areas`. `corner`, `spare` (128, 2): scratch."""
    box = spare[_ROOM]
    for i in range(len(starts) - 1):
        first, last = starts[i], starts[i + 1]
        low_u = low_v = 1e300
        high_u = high_v = -1e300
        for h in range(hull_starts[i], hull_starts[i + 1]):
            low_u, high_u = min(low_u, hulls[h, 0]), max(high_u, hulls[h, 0])
            low_v, high_v = min(low_v, hulls[h, 1]), max(high_v, hulls[h, 1])
        grow = 1e-6 * (high_u - low_u + high_v - low_v)
        box[0, 0] = low_u - grow
        lives[i, 0], lives[i, 1] = 0.0, 1.0
