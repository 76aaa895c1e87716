"""A convex polygon cut by a straight line: compiled [Sutherland, Hodgman 1974]."""

from __future__ import annotations

from .compiling import part


@part
def clip(polygon, count, scratch, a_u, a_v, c):
    """Keep a . p + c >= 0 of a convex polygon, in place; the number of corners left."""
    kept = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        h_i = a_u * polygon[i, 0] + a_v * polygon[i, 1] + c
        h_j = a_u * polygon[j, 0] + a_v * polygon[j, 1] + c
        if h_i >= 0.0:
            scratch[kept, 0], scratch[kept, 1] = polygon[i, 0], polygon[i, 1]
            kept += 1
        if (h_i >= 0.0) != (h_j >= 0.0):
            s = h_i / (h_i - h_j)
            scratch[kept, 0] = polygon[i, 0] + s * (polygon[j, 0] - polygon[i, 0])
            scratch[kept, 1] = polygon[i, 1] + s * (polygon[j, 1] - polygon[i, 1])
            kept += 1
    for i in range(kept):
        polygon[i, 0], polygon[i, 1] = scratch[i, 0], scratch[i, 1]
    return kept


@part
def clip_labelled(corner, side, count, height, label, spare, spare_side):
    """The part of a convex polygon whose `height`, given at its corners, is not negative, into `spare`; returns its
    corners. `side` names the line of the side that starts at each corner, `label` that of the cut."""
    kept, room = 0, len(spare_side) - 1
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        here, there = height[i], height[j]
        if here >= 0.0 and kept < room:
            spare[kept, 0], spare[kept, 1], spare_side[kept] = corner[i, 0], corner[i, 1], side[i]
            kept += 1
        if (here >= 0.0) != (there >= 0.0) and kept < room:
            at = here / (here - there)
            spare[kept, 0] = corner[i, 0] + at * (corner[j, 0] - corner[i, 0])
            spare[kept, 1] = corner[i, 1] + at * (corner[j, 1] - corner[i, 1])
            spare_side[kept] = label if here >= 0.0 else side[i]
            kept += 1
    return kept
