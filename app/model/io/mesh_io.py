"""Mesh files in and out: PLY, OBJ, STL and faceting designs, with one sentence for everything in a file that is wrong.

The readers are our own rather than trimesh's: that one takes an OBJ's face 0 for its last
vertex, splits vertices where a normal differs (which opens solids), and costs half a
second to import.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ...base import files
from ...base.errors import UserError
from ...base.paths import MESH_SUFFIXES
from ..gems.facet_design import SUFFIX as DESIGN_SUFFIX
from ..gems.facet_design import read_asc
from ..geometry.mesh import Mesh, make_mesh
from ..geometry.mesh_health import welded_corners
from ..geometry.mesh_normals import with_smooth
from .mesh_raw import Groups, RawMesh

MAX_COORDINATE = 1e30
"""As for numbers in a scene file: far enough from where squares and float32 overflow."""


def load_mesh(path: str | os.PathLike[str], smooth: bool | float | None = None, name: str | None = None) -> Mesh:
    """Read a mesh file chosen by its suffix; polygons are cut into fans.

    `smooth`: None takes the file's normals, flat where it has none; False is flat; True
    averages over every edge; a number is a crease angle in degrees. Raises UserError for a
    missing, unreadable, truncated or contradictory file. Call `mesh_health.repair` on the
    result: nothing is mended here, except that an STL's triangles are welded (the format
    has no shared vertices).
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise UserError(f"{path}: unknown mesh format '{suffix}'; use one of {', '.join(MESH_SUFFIXES)}")
    if smooth is not None and not isinstance(smooth, bool) and not 0.0 <= smooth <= 180.0:
        raise UserError(f"{path}: smooth must be true, false or a crease angle from 0 to 180 degrees, not {smooth:g}")
    return with_smooth(load_grouped_mesh(path, name)[0], smooth)


def load_grouped_mesh(path: Path, name: str | None = None) -> tuple[Mesh, Groups | None]:
    """As `load_mesh` with the file's own normals, and the parts that the file names where its format can."""
    if path.suffix.lower() == DESIGN_SUFFIX:
        return read_asc(path).mesh(name or path.stem, str(path)), None
    raw = _read(path)
    mesh = make_mesh(name or path.stem, raw.vertices, raw.triangles, raw.corner_normals, raw.uv, str(path))
    if len(far := np.flatnonzero((np.abs(mesh.vertices) > MAX_COORDINATE).any(axis=1))):
        raise UserError(
            f"{path}: vertex {far[0]} lies beyond {MAX_COORDINATE:g} units; export the mesh in larger units"
        )
    return mesh, raw.groups


def _read(path: Path) -> RawMesh:
    suffix = path.suffix.lower()
    with files.reading(path, "check the path, which is relative to the scene file"):
        data = files.read_bytes(path, files.DATA_BYTES)
    if not data:
        raise UserError(f"{path}: the file is empty; export the mesh again")
    if suffix == ".ply":
        from .mesh_ply import read_ply

        return read_ply(data, str(path))
    if suffix == ".obj":
        from .mesh_obj import read_obj

        return read_obj(data, str(path))
    from .mesh_raw import read_stl

    return read_stl(data, str(path))


def save_ply(mesh: Mesh, path: str | os.PathLike[str]) -> None:
    """Write a binary PLY with float64 positions, atomically.

    PLY knows normals and texture coordinates by vertex only, so vertices are written once
    for each different set; without either they stay welded.
    """
    from ...base.atomic import atomic_output

    rows, triangles, names = mesh.vertices, mesh.triangles, ["x", "y", "z"]
    more = [each for each in (mesh.corner_normals, mesh.uv) if each is not None]
    if more:
        vertices, triangles = welded_corners([mesh.corners(), *more])
        rows = np.hstack(vertices)
        names += ["nx", "ny", "nz"] * (mesh.corner_normals is not None) + ["s", "t"] * (mesh.uv is not None)
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(rows)}",
        *(f"property double {n}" for n in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with atomic_output(path) as temporary:
        temporary.write_bytes("\n".join(header).encode() + rows.astype("<f8").tobytes() + faces.tobytes())
