"""The objects of a bare mesh file: its parts, what they are made of, and which way they stand.

A part is what the file calls an object, unless it is only a piece of one: groups that share a vertex are one surface (a
bottle with a material for its rim), and a group that faces inward is the cavity of what holds it; both are joined,
since half a surface is no solid.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..gems.facet_design import SUFFIX as DESIGN_SUFFIX
from ..gems.opened_design import object_of_design
from ..geometry.mesh import Mesh
from ..geometry.mesh_health import connected_roots, forms_of, weld_map
from ..materials.dielectric import DEFAULT_GLASS
from ..naming import Names, listed
from ..scene import Dielectric, Material, SceneObject
from ..scene_objects import checked_mesh
from ..staging import Y_UP_TO_Z_UP, Staging, guessed_up, with_glass
from .mesh_io import load_grouped_mesh
from .mesh_raw import Groups
from .obj_materials import read_materials


def objects_of_mesh(path: Path, staging: Staging, notes: list[str]) -> list[SceneObject]:
    """The parts of a mesh file in a z-up world, as `staging` wishes; what was guessed or mended goes to `notes`.

    Parts are glass where the file's materials say so, and the others diffuse. Where none says so, as in most files, all
    of it is made of glass, since nobody opens a mesh here to see it grey. Raises UserError for what cannot be read.
    """
    if path.suffix.lower() == DESIGN_SUFFIX:
        return with_glass([object_of_design(path, staging, notes)], staging, path.name, [""])
    whole, groups = load_grouped_mesh(path)
    parts = parts_of_mesh(whole, groups)
    libraries = () if groups is None else groups.libraries
    materials = _materials(path, parts, libraries, bool(staging.glass), notes)
    meshes = _prepared(path, parts, materials, staging, notes)
    if staging.up is None:
        up, reason = guessed_up(whole, path.suffix.lower())
        notes.append(f"{path.name} does not say which way is up: {up} was taken, for {reason}; --up y or z says it.")
    else:
        up = staging.up
    matrix = Y_UP_TO_Z_UP if up == "y" else np.eye(4)
    objects = [SceneObject(mesh.name, mesh, material, matrix) for mesh, material in zip(meshes, materials, strict=True)]
    return with_glass(objects, staging, path.name, [part.material or "" for part in parts])


def _materials(
    path: Path, parts: list[MeshPart], libraries: tuple[str, ...], is_asked: bool, notes: list[str]
) -> list[Material]:
    """What each part is made of; `is_asked`: the user says which glass."""
    by_name = read_materials(path, libraries, notes)
    known = [by_name.get(part.material or "") for part in parts]
    names = [part.mesh.name for part in parts]
    if any(material is not None and material.transmits for material in known):
        made = [Dielectric.usual() if material is None else material.material() for material in known]
        forms = iter(forms_of([part.mesh for part, each in zip(parts, made, strict=True) if each.transmits]))
        made = [material.changed(thin=next(forms) == "sheet") if material.transmits else material for material in made]
        glass = [name for name, material in zip(names, made, strict=True) if material.transmits]
        sentence = (
            f"its materials make glass of {listed(glass)}; dispersion, of which they know nothing, is {DEFAULT_GLASS}'s"
        )
        notes.insert(0, f"{path.name}: {sentence}.")
        return made
    if not is_asked:
        opaque = ", though its materials are opaque" if any(known) else ""
        which = (
            f"{path.name} is a bare mesh: it was" if len(parts) == 1 else f"{path.name}: all {len(parts)} parts were"
        )
        notes.insert(0, f"{which} made of {DEFAULT_GLASS}{opaque}; --glass takes another{_example(names)}.")
    return [Dielectric.usual()] * len(parts)


def _example(names: list[str]) -> str:
    return "" if len(names) == 1 else f", for one part too ({names[0]}=N-SF11); it holds {listed(names)}"


def _prepared(
    path: Path, parts: list[MeshPart], materials: list[Material], staging: Staging, notes: list[str]
) -> list[Mesh]:
    """Their meshes, mended, with the normals that `staging` wishes."""
    meshes = []
    for part, material in zip(parts, materials, strict=True):
        found: list[str] = []
        mesh = checked_mesh(part.mesh, found)
        notes += [note for note in found if material.is_solid or not note.startswith("open mesh")]
        meshes.append(staging.settled(mesh, notes, path.name, is_bare=True))
    return meshes


T = TypeVar("T")


@dataclass(frozen=True)
class MeshPart:
    """One solid."""

    mesh: Mesh
    material: str | None
    """Name of the material that most of its triangles have."""


def parts_of_mesh(mesh: Mesh, groups: Groups | None) -> list[MeshPart]:
    """The solids of a file's `mesh`; the whole where the file names no parts."""
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
        parts.append(MeshPart(replace(mesh.part(triangles), name=name), _commonest(own, groups.materials)))
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
