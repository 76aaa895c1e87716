"""Three numbers as the scene keeps them."""

from __future__ import annotations

from collections.abc import Iterable

Vec3 = tuple[float, float, float]


def vec3(vector: Iterable[float]) -> Vec3:
    """`vector` as plain numbers, no zero of them negative."""
    x, y, z = (float(v) + 0.0 for v in vector)
    return x, y, z
