"""The objects of a bare mesh file: its parts, what they are made of, and which way they stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..geometry.mesh import Mesh
from ..geometry.mesh_health import forms_of
from ..materials.dielectric import DEFAULT_GLASS
from ..scene import Dielectric, Material, SceneObject
from ..scene_objects import checked_mesh
from ..staging import Y_UP_TO_Z_UP, Staging, guessed_up, listed, with_glass
from .mesh_io import load_grouped_mesh
from .mesh_parts import MeshPart, parts_of_mesh
from .obj_materials import read_materials


def objects_of_mesh(path: Path, staging: Staging, notes: list[str]) -> list[SceneObject]:
    """The parts of a mesh file in a z-up world, as `staging` wishes; what was guessed or mended goes to `notes`.

    Parts are glass where the file's materials say so, and the others diffuse. Where none says so, as in most files, all
    of it is made of glass, since nobody opens a mesh here to see it grey. Raises UserError for what cannot be read.
    """
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
    told = read_materials(path, libraries, notes)
    known = [told.get(part.material or "") for part in parts]
    names = [part.mesh.name for part in parts]
    if any(material is not None and material.transmits for material in known):
        made = [Dielectric.usual() if material is None else material.material() for material in known]
        forms = iter(forms_of([part.mesh for part, each in zip(parts, made, strict=True) if each.transmits]))
        made = [material.changed(thin=next(forms) == "sheet") if material.transmits else material for material in made]
        glass = [name for name, material in zip(names, made, strict=True) if material.transmits]
        said = (
            f"its materials make glass of {listed(glass)}; dispersion, of which they know nothing, is {DEFAULT_GLASS}'s"
        )
        notes.insert(0, f"{path.name}: {said}.")
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
