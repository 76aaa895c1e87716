"""The part of its band in which a polygon exists.

A beam whose outline is empty at an end of its band casts a polygon that appears, or vanishes, in between. Its lines
are known for all of the band, so the band can be cut to where something is left, exactly: the polygon then moves less,
covers fewer texels, and a few places of its band show it as it is. Lines that bound it nowhere are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .clipping import clip_labelled
from .compiling import jit, part
from .nodes import area_of

PLACES = 17
"""Places of the band at which a polygon is sought that is empty at an end."""
LOOKS = 5
"""Places of what exists at which lines are tested, odd."""
_HALVINGS = 8
"""Bisections to find where a polygon appears or vanishes."""
ROOM = 128
"""Corners of an outline."""


SCRATCH = np.dtype(
    [
        ("corner", "f8", (ROOM, 2)),
        ("spare", "f8", (ROOM, 2)),
        ("side", "i8", ROOM),
        ("spare_side", "i8", ROOM),
        ("height", "f8", ROOM),
        ("box", "f8", 4),
    ]
)


@part
def outline_at(edges, first, last, t, scratch):
    """The polygon at t in [0, 1] of its band: corners of the rectangle `box` (u0, v0, u1, v1) cut by all its lines, and
    the line of the side from each to the next (-1: the rectangle's); returns how many."""
    corner, side, spare, spare_side = scratch.corner, scratch.side, scratch.spare, scratch.spare_side
    for c in range(4):
        side[c] = -1
        corner[c, 0] = scratch.box[2] if c == 1 or c == 2 else scratch.box[0]
        corner[c, 1] = scratch.box[3] if c > 1 else scratch.box[1]
    n = 4
    for e in range(first, last):
        line = edges[e]
        a, b = line[0] + t * (line[4] - line[0]), line[1] + t * (line[5] - line[1])
        c = line[2] + t * (line[6] - line[2])
        for i in range(n):
            scratch.height[i] = a * corner[i, 0] + b * corner[i, 1] + c
        n = clip_labelled(corner, side, n, scratch.height, e, spare, spare_side)
        for i in range(n):
            corner[i, 0], corner[i, 1], side[i] = spare[i, 0], spare[i, 1], spare_side[i]
        if n < 3:
            return 0
    return n


@part
def border(edges, first, last, alive, dead, scratch):
    """Place between one where there is a polygon and one where there is none, on the side of the latter."""
    for _ in range(_HALVINGS):
        t = 0.5 * (alive + dead)
        n = outline_at(edges, first, last, t, scratch)
        if n > 0 and area_of(scratch.corner, n) > 0.0:
            alive = t
        else:
            dead = t
    return dead


@part
def is_same(one, other):
    """Whether two lines are one, at both ends of the band: that of an edge between two facets, met as either's."""
    far = 0.0
    for k in range(8):
        far = max(far, abs(one[k] - other[k]))
    return far < 1e-10


@jit
def lifetimes(edges, starts, corners, corner_starts, lives, areas, bounds, kept, kept_ends, scratches):
    """For every polygon the part of its band in which it exists, into `lives` (N, 2) (both 0 where it never does), and
    its area in the middle of that, into `areas` (N,); `bounds` (E,) becomes True for lines that bound something.
    `corners` are those of each polygon at its places; those of what exists go to `kept`, up to `kept_ends` (N + 1,).
    `scratches`: SCRATCH (1,)."""
    scratch = scratches[0]
    box = scratch.box
    step, count = 1.0 / (PLACES - 1), 0
    for i in range(len(starts) - 1):
        first, last = starts[i], starts[i + 1]
        box[0] = box[1] = 1e300
        box[2] = box[3] = -1e300
        for h in range(corner_starts[i], corner_starts[i + 1]):
            for k in range(2):
                box[k], box[2 + k] = min(box[k], corners[h, k]), max(box[2 + k], corners[h, k])
        grow = 1e-6 * (box[2] - box[0] + box[3] - box[1])
        for k in range(2):
            box[k] -= grow
            box[2 + k] += grow
        low = high = -1.0
        for k in range(PLACES):
            t = k * step
            if outline_at(edges, first, last, t, scratch) > 0:
                low = t if low < 0.0 else low
                high = t
                # Most exist everywhere.
                if k == 0 and outline_at(edges, first, last, 1.0, scratch) > 0:
                    high = 1.0
                    break
        lives[i, 0] = lives[i, 1] = areas[i] = 0.0
        if low >= 0.0:
            lives[i, 0] = 0.0 if low <= 0.0 else border(edges, first, last, low, low - step, scratch)
            lives[i, 1] = 1.0 if high >= 1.0 else border(edges, first, last, high, high + step, scratch)
            is_whole = lives[i, 0] <= 0.0 and lives[i, 1] >= 1.0
            for turn in range(LOOKS):
                t = lives[i, 0] + turn / (LOOKS - 1) * (lives[i, 1] - lives[i, 0])
                n = outline_at(edges, first, last, t, scratch)
                if 2 * turn == LOOKS - 1:
                    areas[i] = area_of(scratch.corner, n)
                for c in range(n):
                    if scratch.side[c] >= 0:
                        bounds[scratch.side[c]] = True
                for c in range(0 if is_whole else n):
                    kept[count, 0], kept[count, 1] = scratch.corner[c, 0], scratch.corner[c, 1]
                    count += 1
            for e in range(first, last):
                for f in range(first, e if bounds[e] else first):
                    if bounds[f] and is_same(edges[e], edges[f]):
                        bounds[e] = False
            for h in range(corner_starts[i], corner_starts[i + 1] if is_whole else corner_starts[i]):
                kept[count, 0], kept[count, 1] = corners[h, 0], corners[h, 1]
                count += 1
        kept_ends[i + 1] = count


@dataclass(frozen=True)
class Lifetimes:
    """The parts of their bands in which N polygons exist."""

    bands: np.ndarray
    """(N, 2): first and last place t in [0, 1] of the band; the same where there never is anything."""
    areas: np.ndarray
    """(N,), in the middle between."""
    bounds: np.ndarray
    """bool (E,), lines that bound the polygon somewhere between."""
    starts: np.ndarray
    """int64 (N + 1,), into `corners`."""
    corners: np.ndarray
    """(H, 2), of the polygons at several places between."""


def lifetimes_of(edges: np.ndarray, starts: np.ndarray, corners: np.ndarray, corner_starts: np.ndarray) -> Lifetimes:
    """Lifetimes of polygons by their `edges` (E, 8) (`BeamPolygons`), and `corners` (H, 2) that hold them at all
    places; both with starts (N + 1,)."""
    n = len(starts) - 1
    bands, areas, ends = np.zeros((n, 2)), np.zeros(n), np.zeros(n + 1, np.int64)
    bounds = np.zeros(len(edges), bool)
    kept = np.empty((LOOKS * (len(edges) + 4 * n) + len(corners), 2))
    lifetimes(edges, starts, corners, corner_starts, bands, areas, bounds, kept, ends, np.empty(1, SCRATCH))
    return Lifetimes(bands, areas, bounds, ends, kept[: ends[-1]])
