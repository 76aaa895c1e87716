"""A mesh file's parts as solids of their own: what the file calls an object, unless it is only a piece of one.

Groups that share a vertex are one surface (a bottle with a material for its rim), and a group that faces inward is
the cavity of what holds it; both are joined, since half a surface is no solid.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..geometry.mesh import Mesh
from ..geometry.mesh_health import connected_roots, weld_map
from ..unique_names import Names
from .mesh_raw import Groups

T = TypeVar("T")


@dataclass(frozen=True)
class MeshPart:
    """One solid."""

    mesh: Mesh
    material: str | None
    """Name of the material that most of its triangles have."""


def parts_of_mesh(mesh: Mesh, groups: Groups | None) -> list[MeshPart]:
    """The solids of a file's `mesh`; the whole where the file tells none apart."""
    if groups is None:
        return [MeshPart(mesh, None)]
    if len(groups.names) == 1:
        return [MeshPart(mesh, groups.materials[0])]
    of_triangle = _solids(mesh, groups)
    order = np.argsort(of_triangle, kind="stable")
    pieces = np.split(order, np.flatnonzero(np.diff(of_triangle[order])) + 1)
    areas = mesh.areas()
    pieces = [triangles for triangles in pieces if areas[triangles].any()]  # helpers of modellers: points and lines
    if len(pieces) < 2:
        return [MeshPart(mesh, _commonest(groups.of_triangle, groups.materials))]
    names, parts = Names(), []
    for triangles in pieces:
        own = groups.of_triangle[triangles]
        name = names.unique(_commonest(own, groups.names) or mesh.name)
        parts.append(MeshPart(_piece(mesh, triangles, name), _commonest(own, groups.materials)))
    return parts


def _solids(mesh: Mesh, groups: Groups) -> np.ndarray:
    """For each triangle (T,) the lowest group of its solid."""
    _, place = weld_map(mesh.vertices)
    corners = np.stack([place[mesh.triangles].ravel(), np.repeat(groups.of_triangle, 3)], axis=1)
    met = np.unique(corners, axis=0)
    same = met[1:, 0] == met[:-1, 0]  # neighbours in the list that are two groups at one vertex
    root = connected_roots(met[:-1, 1][same], met[1:, 1][same], len(groups.names))
    return _with_cavities(mesh, root[groups.of_triangle])


def _with_cavities(mesh: Mesh, of_triangle: np.ndarray) -> np.ndarray:
    """Solids that face inward joined to the smallest one that holds them."""
    numbers, compact = np.unique(of_triangle, return_inverse=True)
    compact = compact.reshape(-1)
    corners = mesh.corners()
    low, high = np.full((len(numbers), 3), np.inf), np.full((len(numbers), 3), -np.inf)
    np.minimum.at(low, compact, corners.min(axis=1))
    np.maximum.at(high, compact, corners.max(axis=1))
    # Tetrahedra with a common tip in the middle of each (divergence theorem).
    apex = corners[:, 0] - 0.5 * (low + high)[compact]
    volumes = np.bincount(compact, np.einsum("ij,ij->i", apex, mesh.area_vectors()) / 3.0)
    target = np.arange(len(numbers))
    for cavity in np.flatnonzero(volumes < 0.0):
        holds = (volumes > 0.0) & (low <= low[cavity]).all(axis=1) & (high >= high[cavity]).all(axis=1)
        if holds.any():
            target[cavity] = np.argmin(np.where(holds, volumes, np.inf))
    return target[compact]


def _commonest(of_triangle: np.ndarray, values: Sequence[T]) -> T:
    return values[Counter(of_triangle.tolist()).most_common(1)[0][0]]


def _piece(mesh: Mesh, triangles: np.ndarray, name: str) -> Mesh:
    kept, number = np.unique(mesh.triangles[triangles], return_inverse=True)
    return replace(
        mesh,
        name=name,
        vertices=mesh.vertices[kept],
        triangles=number.reshape(-1, 3).astype(np.int32),
        corner_normals=None if mesh.corner_normals is None else mesh.corner_normals[triangles],
        uv=None if mesh.uv is None else mesh.uv[triangles],
    )
