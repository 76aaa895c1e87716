"""What is wanted of a file that is opened: which axis is up, which parts are glass of which kind.

Mesh files do not say which axis is up, and few files of the world say that something is glass; so both are guessed,
noted, and may be given (`--up`, `--glass`, and in the window).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal

import numpy as np

from ..base.errors import UserError, suggestion
from .geometry.mesh import Mesh
from .geometry.mesh_normals import ROUND_DEG, with_plausible_normals, with_smooth
from .naming import listed
from .optics import tints
from .optics.index_file import find_glass
from .optics.tints import Tint
from .scene import Absorption, Dielectric, SceneObject
from .vectors import frozen

UpAxis = Literal["y", "z"]
Y_UP_TO_Z_UP = frozen(np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]]))
_USUAL_UP: dict[str, UpAxis] = {".obj": "y", ".stl": "z", ".ply": "z"}
"""What most programs write: OBJ comes from modellers, STL and PLY from printers and scanners."""
_BASE_SHARE = 0.2
"""Share of the footprint that must be flat on the ground for a mesh to be taken to stand on it."""
_THIN = 0.7
"""A mesh this much lower along one axis than along the other lies on its broad side."""


@dataclass(frozen=True)
class Staging:
    """Wishes for a file; empty ones leave it to the file, or to a guess."""

    up: UpAxis | None = None
    glass: tuple[tuple[str | None, str], ...] = ()
    """Object, material or pattern (None: all that is no receiver below the others) and name of its glass, of the
    catalogue or a tint, after "thin " a sheet of it; later ones above."""
    smooth: bool | None = None
    """Whether meshes are round where edges bend by less than `ROUND_DEG`, or flat; None: as their files say."""

    def settled(self, mesh: Mesh, notes: list[str], file: str, is_bare: bool = False) -> Mesh:
        """`mesh` of `file` with the normals that `smooth` wishes, or those of the file where they can be meant."""
        if self.smooth is None:
            return with_plausible_normals(mesh, notes, file, is_bare)
        return with_smooth(mesh, self.smooth and ROUND_DEG)


AS_FOUND = Staging()


def guessed_up(mesh: Mesh, suffix: str) -> tuple[UpAxis, str]:
    """Which axis is up in a mesh of a file with this `suffix`, and why: a few words for a note.

    y or z, whichever has a flat base below it; else the one along which the mesh is much the lower; else what files
    of this kind have most often.
    """
    bases = {axis: _base_share(mesh, column) for axis, column in (("y", 1), ("z", 2))}
    low, high = mesh.bounds()
    _, height_y, height_z = high - low
    axis: UpAxis
    if max(bases.values()) > _BASE_SHARE and min(bases.values()) < 0.7 * max(bases.values()):
        axis = "y" if bases["y"] > bases["z"] else "z"
        return axis, "it has a flat base there"
    if min(height_y, height_z) < _THIN * max(height_y, height_z):
        axis = "y" if height_y < height_z else "z"
        return axis, "it is lowest that way"
    axis = _USUAL_UP.get(suffix, "z")
    return axis, f"most {suffix} files have it so"


def _base_share(mesh: Mesh, column: int) -> float:
    """Share of the footprint across an axis that lies flat at its lowest end, facing down."""
    heights = mesh.vertices[:, column]
    low, high = mesh.bounds()
    extent = high - low
    footprint = float(np.prod(np.delete(extent, column)))
    lying = (heights[mesh.triangles] < low[column] + 1e-3 * extent[column]).all(axis=1)
    if not lying.any() or footprint == 0.0:
        return 0.0
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles[lying]], 1, 0)
    areas = 0.5 * np.cross(b - a, c - a)[:, column]
    return max(-float(areas.sum()), 0.0) / footprint


def with_glass(
    objects: Sequence[SceneObject], staging: Staging, file_name: str, materials: Sequence[str]
) -> list[SceneObject]:
    """`objects`, whose materials have the names `materials` in their file ("": none), with the glasses of `staging`.

    Raises UserError for an object or a glass that does not exist.
    """
    changed = list(objects)
    for name, wish in staging.glass:
        is_thin = wish.casefold().startswith("thin ")
        glass = wish[5:].strip() if is_thin else wish
        tint = tints.tint(glass)
        where = f"--glass {wish}" if name is None else f"--glass {name}={wish}"
        material = Dielectric(find_glass(glass, Path(), where, []) if tint is None else tint.dispersion)
        names = [item.name for item in objects]
        chosen = _bodies(objects) if name is None else _called(name, names, materials)
        if not chosen:
            kinds = [each for each in dict.fromkeys(materials) if each]
            hint = suggestion(name or "", (*names, *kinds)) or ","
            also = f" and the materials {listed(kinds)}" if kinds else ""
            raise UserError(
                f"--glass: {file_name} holds no object '{name}' and no material of that name{hint} it holds "
                f"{listed(names)}{also}"
            )
        for index in chosen:
            item = changed[index]
            # An open part that the file makes a sheet stays one.
            thin = is_thin or (item.material.transmits and item.material.thin and not item.mesh.is_closed)
            made = material if tint is None else tinted(item, tint)
            changed[index] = replace(item, material=made.changed(thin=thin))
    return changed


def _called(name: str, names: Sequence[str], materials: Sequence[str]) -> list[int]:
    """Numbers of the objects that `name` means: the one of that name, else all of which the name, or that of the
    material, matches it as a pattern (`*`, `?`, without regard to case)."""
    if name in names:
        return [names.index(name)]
    pattern = name.casefold()
    return [
        index
        for index, texts in enumerate(zip(names, materials, strict=True))
        if any(text == name or fnmatchcase(text.casefold(), pattern) for text in texts if text)
    ]


def tinted(item: SceneObject, tint: Tint) -> Dielectric:
    """What is usually coloured so, as deep that daylight is half as bright across half of `item`'s narrowest side."""
    points = item.mesh.vertices @ item.object_to_world[:3, :3].T
    depth = 0.5 * float(np.ptp(points, axis=0).min()) or 1.0
    return Dielectric(tint.dispersion, Absorption(frozen(tint.coefficient / depth)))


def _bodies(objects: Sequence[SceneObject]) -> list[int]:
    """All closed solids, or everything where nothing is closed: an open sheet is more likely a table than glass."""
    closed = [index for index, item in enumerate(objects) if item.mesh.is_closed]
    return closed or list(range(len(objects)))


def opaque_note(objects: Sequence[SceneObject]) -> str | None:
    """Why there is no caustic, where nothing is glass, and what to do; None where something is."""
    if any(item.material.transmits for item in objects):
        return None
    names = [item.name for item in objects]
    return (
        "Nothing here is glass, so there is no caustic: the file's materials are opaque. Make it glass with --glass "
        f"diamond, or one part with --glass {names[0]}=N-SF11, in the window with Make glass. "
        f"The file holds {listed(names)}."
    )
