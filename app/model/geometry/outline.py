"""The outline of what lies in a plane, where it is convex."""

from __future__ import annotations

import numpy as np

_AREA_SLACK = 1e-4
"""Share of the outline's area that triangles may leave open or cover twice."""
_STRAIGHT = 1e-7
"""Share of the outline's longest side squared: a corner that turns by less is none."""


def convex_outline(points: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """Corners (n, 2) of what `triangles` (m, 3) of `points` (k, 2) cover, counter-clockwise; None where that is not
    convex, or covers a place twice."""
    corners = points[triangles]
    covered = 0.5 * float(np.abs(_turn(corners[:, 0], corners[:, 1], corners[:, 2])).sum())
    hull = _hull(points[np.unique(triangles)])
    if len(hull) < 3:
        return None
    x, y = hull.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return hull if abs(covered - area) <= _AREA_SLACK * area else None


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the area of triangles, positive where they turn to the left."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _hull(points: np.ndarray) -> np.ndarray:
    """Corners of the convex hull, counter-clockwise, by two monotone chains (Andrew 1979)."""
    least = _STRAIGHT * float(np.ptp(points, axis=0).max()) ** 2
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    chains: list[np.ndarray] = []
    for run in (order, order[::-1]):
        chain: list[np.ndarray] = []
        for point in run:
            while len(chain) > 1 and float(_turn(chain[-2], chain[-1], point)) <= least:
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)
