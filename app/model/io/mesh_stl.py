"""STL, binary and ASCII. Its facet normals are ignored: the winding says the same and is less often wrong."""

from __future__ import annotations

import re

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh_health import weld_map
from .mesh_raw import RawMesh, as_float64

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
