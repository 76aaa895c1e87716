"""What a mesh reader hands over before anything is checked, and the fan that cuts polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Groups:
    """Parts that a file tells apart."""

    of_triangle: np.ndarray
    """int64 (T,), index into the others."""
    names: tuple[str, ...]
    materials: tuple[str | None, ...]
    """Name of each part's material."""
    libraries: tuple[str, ...]
    """Files of materials, as they are named."""


@dataclass(frozen=True)
class RawMesh:
    """Arrays as a file holds them; shapes as in `Mesh`."""

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    groups: Groups | None = None
    """None for a format that knows no parts."""


def as_float64(values: np.ndarray) -> np.ndarray:
    """`values` as float64, also the NaNs of damaged files, over which a plain cast warns."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def fan_corners(sizes: np.ndarray) -> np.ndarray:
    """Corner numbers of the triangles of consecutive polygons with `sizes` corners, int64 (T, 3).

    Polygon k of n corners becomes n - 2 triangles round its first corner; polygons of
    fewer than three corners vanish.
    """
    sizes = np.asarray(sizes, dtype=np.int64)
    first = np.cumsum(sizes) - sizes
    cuts = np.maximum(sizes - 2, 0)
    root = np.repeat(first, cuts)
    step = np.arange(cuts.sum()) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    return np.stack([root, root + step + 1, root + step + 2], axis=1)
