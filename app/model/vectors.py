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


def frame_about(axis: np.ndarray, guide: ArrayLike | None = None) -> np.ndarray:
    """Right-handed frame with the unit `axis` (3,), rows first, second, axis: the first as near to `guide` as can be,
    without one to the world's axis that is farthest from `axis`."""
    near = np.eye(3)[np.argmin(np.abs(axis))] if guide is None else np.asarray(guide, np.float64)
    first = unit(near - axis * (near @ axis))
    return np.stack([first, np.cross(axis, first), axis])


def frozen(array: np.ndarray) -> np.ndarray:
    """`array` in one piece of memory, read-only."""
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
