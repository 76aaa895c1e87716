"""Materials of an OBJ file (Wavefront .mtl): which of them are glass, of which index, and the colour of the others.

Statements are those of Wavefront's specification (Advanced Visualizer manual, appendix B2): `Kd`, `Tf`, `d` or `Tr`,
`Ni`, `illum`; `Pr`, a roughness, is of the extension for physically based materials. Nothing in the format knows
dispersion. What is blended rather than glass (`d` alone) passes light that `d` of its colour filters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from ...base import files
from ..naming import Unshown
from ..optics import glass
from ..scene import Dielectric, Diffuse, Material
from ..vectors import Vec3, vec3

_REFRACTS = (4, 6, 7, 9)
"""Values of `illum` that stand for glass or refraction."""
_LARGEST_INDEX = 4.0
_LIKE_DEFAULT = 0.07
"""Difference of n_d up to which an index is the default's: programs write 1.45 or 1.5 where nobody chose one."""


@dataclass(frozen=True)
class ObjMaterial:
    """What a .mtl file says of a material."""

    colour: Vec3 = (0.8, 0.8, 0.8)
    """Kd, taken as linear Rec.709."""
    dissolve: float | None = None
    """1: opaque; None: not given."""
    transparency: float | None = None
    """`Tr`: what `dissolve` lacks to 1."""
    filter: Vec3 | None = None
    """Tf: share that gets through all of it."""
    index: float = 1.0
    illum: int = 2
    roughness: float = 0.0
    """How rough glass is, 0 to 1."""

    @property
    def transmits(self) -> bool:
        """Whether it is meant to be seen through."""
        return self.illum in _REFRACTS or self.opacity < 0.5

    @property
    def opacity(self) -> float:
        """By `d`, else by `Tr`; but nobody models what cannot be seen: programs that write `Tr 1` mean opaque."""
        if self.dissolve is not None:
            return self.dissolve
        return 1.0 if self.transparency in (None, 1.0) else 1.0 - (self.transparency or 0.0)

    @property
    def transmittance(self) -> Vec3:
        """What gets through."""
        if self.filter is not None and any(self.filter):
            return self.filter
        if self.illum in _REFRACTS:
            return 1.0, 1.0, 1.0
        return vec3(1.0 - self.opacity * (1.0 - c) for c in self.colour)

    def material(self) -> Material:
        """Glass, or a diffuse surface."""
        if not self.transmits:
            return Diffuse(self.colour)
        usual = Dielectric.usual().changed(roughness=self.roughness, transmittance_rgb=self.transmittance)
        if not 1.0 < self.index <= _LARGEST_INDEX or abs(self.index - usual.dispersion.n_d) < _LIKE_DEFAULT:
            return usual
        return usual.changed(dispersion=glass.from_abbe(self.index, usual.dispersion.V_d, f"n_d {self.index:g}"))


def read_materials(obj: Path, libraries: tuple[str, ...], notes: list[str]) -> dict[str, ObjMaterial]:
    """The materials of the files that an OBJ file names, by their names; what cannot be read goes to `notes`."""
    found: dict[str, ObjMaterial] = {}
    for library in libraries:
        path = obj.parent / library
        if not files.may_read(path, obj.parent):
            notes.append(f"{obj.name} names materials in {library}, which {files.OUTSIDE}.")
            continue
        try:
            text = files.read_text(path, files.TABLE_BYTES)
        except (OSError, ValueError) as error:
            notes.append(f"{obj.name} names materials in {library}, which cannot be read ({files.reason_of(error)}).")
            continue
        found |= _materials(text, path.name, notes)
    return found


def _materials(text: str, file: str, notes: list[str]) -> dict[str, ObjMaterial]:
    found: dict[str, ObjMaterial] = {}
    unshown = Unshown()
    name = None
    for number, line in enumerate(text.split("\n"), start=1):
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "newmtl":
            name = " ".join(rest)
            found[name] = ObjMaterial()
        elif name is not None:
            try:
                found[name] = _with(found[name], word, rest)
            except (ValueError, IndexError, OverflowError):
                notes.append(f"{file}: line {number}: '{word}' needs numbers; it was passed over.")
            if (kind := _kind_unshown(word, rest)) is not None:
                unshown.add(f"{file}: {kind}", name)
    for name, material in found.items():
        if not material.transmits and material.opacity < 1.0:
            unshown.add(f"{file}: materials that are half opaque or more (d, Tr) are shown opaque", name)
    notes += unshown.notes()
    return found


def _kind_unshown(word: str, rest: list[str]) -> str | None:
    """What a statement asks for that is not shown."""
    if word.startswith(("map_", "norm")) or word in ("bump", "disp", "decal", "refl"):
        return "textures are not shown, only colours (map_Kd, bump …)"
    if word in _NOT_SHOWN and any(part.lstrip("+-").replace(".", "", 1).strip("0") for part in rest):
        return f"{_NOT_SHOWN[word]} ({word}) is not shown"
    return None


_NOT_SHOWN = {
    "Ke": "light that a surface gives off",
    "Ps": "sheen",
    "Pc": "a clear coat",
    "aniso": "anisotropy",
}
"""Statements without effect here, but at 0."""


def _with(material: ObjMaterial, word: str, rest: list[str]) -> ObjMaterial:
    """`material` after one statement. Raises ValueError or IndexError for one that is damaged."""
    if word in ("Kd", "Tf") and rest[:1] not in (["spectral"], ["xyz"]):
        rgb = [_number(part) for part in rest[:3]]
        r, g, b = (min(max(c, 0.0), 1.0) for c in (rgb if len(rgb) == 3 else 3 * rgb[:1]))
        return replace(material, colour=(r, g, b)) if word == "Kd" else replace(material, filter=(r, g, b))
    if word == "d":
        return replace(material, dissolve=_number(rest[-1]))  # `d -halo 0.5`
    if word == "Tr":
        return replace(material, transparency=_number(rest[0]))
    if word == "Ni":
        return replace(material, index=_number(rest[0]))
    if word == "Pr":
        return replace(material, roughness=min(max(_number(rest[0]), 0.0), 1.0))
    if word == "illum":
        return replace(material, illum=int(rest[0]))
    return material


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
