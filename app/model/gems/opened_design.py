"""A faceting design as an object of a scene: of which material, and standing which way."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..geometry.mesh import note_recipe
from ..materials.dielectric import DEFAULT_GLASS
from ..naming import listed
from ..optics import catalogue
from ..optics.glass import Dispersion, from_abbe
from ..scene import Dielectric, SceneObject
from ..staging import Y_UP_TO_Z_UP, Staging
from .facet_design import FacetDesign, read_asc

_MATERIALS = (
    "fused silica",
    "quartz",
    "beryl",
    "topaz",
    "tourmaline",
    "peridot",
    "spinel",
    "chrysoberyl",
    "sapphire",
    "almandine",
    "YAG",
    "zircon",
    "GGG",
    "cubic zirconia",
    "diamond",
    "moissanite",
    "rutile",
)
"""What designs are made for."""
_NEAR = 0.02
"""Difference of indices that are one: designers write 1.54, 1.62, 1.76."""
_NAMED = 4


def object_of_design(path: Path, staging: Staging, notes: list[str]) -> SceneObject:
    """The stone of the design in a file, table up; what was assumed goes to `notes`. Raises `UserError`."""
    design = read_asc(path)
    mesh = design.mesh(path.stem, str(path))
    if staging.smooth is None:
        note_recipe(mesh, {"mesh": str(path.resolve())})
    else:
        mesh = staging.settled(mesh, notes, path.name)
    if gone := design.cut_away:
        more = f" and {len(gone) - _NAMED} more" if len(gone) > _NAMED else ""
        notes.append(f"{path.name}: nothing is left of {listed(gone[:_NAMED])}{more}, which other facets cut away.")
    material, sentence = material_of(design)
    if not staging.glass:
        notes.append(f"{path.name}: {sentence}; --glass takes another.")
    return SceneObject(mesh.name, mesh, Dielectric(material), Y_UP_TO_Z_UP if staging.up == "y" else np.eye(4))


def material_of(design: FacetDesign) -> tuple[Dispersion, str]:
    """What the stone is made of, isotropic, and a sentence about it: the gem whose index is nearest to the file's."""
    if design.n_d is None:
        return catalogue.find(DEFAULT_GLASS), f"it names no refractive index, so it was made of {DEFAULT_GLASS}"
    wanted = design.n_d
    found = [catalogue.find(name) for name in _MATERIALS]
    n_d, dispersion, name = min(
        zip((d.n_d for d in found), found, _MATERIALS, strict=True), key=lambda each: abs(each[0] - wanted)
    )
    if abs(n_d - wanted) <= _NEAR:
        return dispersion, f"it was made of {name} (n_d {n_d:.3f}), which is nearest to its index of {wanted:g}"
    made = from_abbe(wanted, dispersion.V_d, f"n {wanted:g}")
    return made, f"it was made of a glass of its index {wanted:g}, with the V_d {made.V_d:.1f} of {name}"
