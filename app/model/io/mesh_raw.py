"""What a mesh reader returns before anything is checked, how polygons are cut, and the reader of STL files."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh_health import weld_map


@dataclass(frozen=True)
class Groups:
    """Parts that a file names."""

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


def triangles_of(sizes: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Corner numbers of the triangles of consecutive polygons with `sizes` corners at `positions` (N, 3), int64 (T, 3).

    Polygon k of n corners becomes n - 2 triangles: round its first corner, or ears (Meisters 1975) where some of those
    would lie outside of it; polygons of fewer than three corners vanish.
    """
    sizes = np.asarray(sizes, dtype=np.int64)
    first = np.cumsum(sizes) - sizes
    cuts = np.maximum(sizes - 2, 0)
    root = np.repeat(first, cuts)
    step = np.arange(cuts.sum()) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    triangles = np.stack([root, root + step + 1, root + step + 2], axis=1)
    if (cuts > 1).any():
        polygon = np.repeat(np.arange(len(sizes)), cuts)
        normal = np.zeros((len(sizes), 3))
        with np.errstate(over="ignore", invalid="ignore"):  # of coordinates that are refused later
            a, b, c = positions[triangles].swapaxes(0, 1)
            np.add.at(normal, polygon, area := np.cross(b - a, c - a))
            turned = np.einsum("ij,ij->i", area, normal[polygon]) < -_FLAT * (normal**2).sum(axis=1)[polygon]
        for k in np.unique(polygon[turned]):
            corners = first[k] + np.arange(sizes[k])
            triangles[polygon == k] = corners[_ears(_in_plane(positions[corners], normal[k]))]
    return triangles


def _in_plane(positions: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Positions (N, 3) along the two axes that see most of a polygon, (N, 2), counter-clockwise."""
    axis = int(np.abs(normal).argmax())
    return positions[:, [axis - 2, axis - 1]] * (np.sign(normal[axis]), 1.0)


def _ears(ring: np.ndarray) -> np.ndarray:
    """Triangles (N - 2, 3) of a polygon (N, 2) that runs counter-clockwise; of one that crosses itself, some."""
    left, cut = list(range(len(ring))), []
    while len(left) > 3:
        at = ring[left]
        for i in range(len(left)):
            ear = at[[i - 1, i, (i + 1) % len(left)]]
            along = np.roll(ear, -1, axis=0) - ear
            away = at[:, None] - ear
            left_of = along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0]
            # What is on the rim but no corner of it would be cut off from its neighbours.
            inside = (left_of >= 0.0).all(axis=1) & (away != 0.0).any(axis=2).all(axis=1)
            if left_of[(i + 1) % len(left), 0] > 0.0 and not inside.any():
                break
        cut.append((left[i - 1], left[i], left[(i + 1) % len(left)]))
        del left[i]
    return np.array([*cut, left])


_FLAT = 1e-9
"""Share of a polygon's area by which a triangle of it may face the other way by rounding."""
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER_BYTES = 84


def read_stl(data: bytes, path: str) -> RawMesh:
    """Welded vertices and triangles."""
    promised = int.from_bytes(data[80:_HEADER_BYTES], "little") if len(data) >= _HEADER_BYTES else -1
    held = (len(data) - _HEADER_BYTES) / _FACET.itemsize
    if promised == held >= 0:  # before looking for "solid", with which some binary files begin too
        corners = as_float64(np.frombuffer(data, _FACET, promised, _HEADER_BYTES)["corners"])
    elif re.match(rb"\s*solid\b", data) and b"facet" in data:
        corners = _ascii_corners(data, path)
    else:
        if promised < 0:
            raise UserError(f"{path}: {len(data)} bytes are too few for an STL file; copy or export it again")
        raise UserError(
            f"{path}: the STL header promises {promised} triangles, but the file has room for {held:.6g}; "
            f"copy or export it again"
        )
    kept, number = weld_map(corners.reshape(-1, 3))
    return RawMesh(corners.reshape(-1, 3)[kept], number.reshape(-1, 3))


def _ascii_corners(data: bytes, path: str) -> np.ndarray:
    """Corner positions, float64 (T, 3, 3)."""
    facets = data.count(b"facet normal")
    rows = [line for line in data.splitlines() if b"vertex" in line]
    if not rows or len(rows) != 3 * facets or b"endsolid" not in data:
        raise UserError(
            f"{path}: {facets} facets need {3 * facets} vertices and an endsolid line, but {len(rows)} vertices were "
            f"found; the file is truncated, copy or export it again"
        )
    try:
        values = np.array(b" ".join(rows).replace(b"vertex", b"").split(), dtype=np.float64)
    except ValueError:
        raise UserError(f"{path}: a vertex of the STL file is not three numbers; export the mesh again") from None
    if values.size != 9 * facets:
        raise UserError(f"{path}: a vertex of the STL file is not three numbers; export the mesh again")
    return values.reshape(-1, 3, 3)
