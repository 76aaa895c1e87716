"""A convex polygon cut by a straight edge: compiled."""

from __future__ import annotations

from .compiling import part


@part
def clip(polygon, count, scratch, a_u, a_v, c):
    """Keep a . p + c >= 0 of a convex polygon, in place; the number of corners left [Sutherland, Hodgman 1974]."""
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
