"""Three numbers as the scene keeps them, and what is done to vectors and arrays everywhere."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

Vec3 = tuple[float, float, float]


def vec3(vector: Iterable[float]) -> Vec3:
    """`vector` as plain numbers, no zero of them negative."""
    x, y, z = (float(v) + 0.0 for v in vector)
    return x, y, z


def unit(vector: ArrayLike) -> np.ndarray:
    """The unit vector along `vector` (n,), float64."""
    values = np.asarray(vector, np.float64)
    return values / np.linalg.norm(values)


def frozen(array: np.ndarray) -> np.ndarray:
    """`array` in one piece of memory, read-only."""
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
