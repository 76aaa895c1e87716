"""Kinds of material, one class each: this is the list of them.

A new kind is a class here and its name in `MATERIAL_KINDS`; the scene file, saving, glTF's extras, the inspector's rows
and reports follow from what the class declares. Where light meets it as no kind does yet, CONTRIBUTING.md lists what
it also wants in shaders and references.
"""

from __future__ import annotations

from .absorption import Absorption
from .dielectric import Dielectric
from .diffuse import Diffuse
from .grating import Grating
from .material import Material
from .opaque import Black, Mirror
from .polariser import Polariser
from .slit import Slit

_KINDS = (Dielectric, Mirror, Diffuse, Black, Grating, Slit, Polariser)
MATERIAL_KINDS: dict[str, type[Material]] = {cls.kind: cls for cls in _KINDS}
"""By their word in a scene file."""

__all__ = [
    "MATERIAL_KINDS",
    "Absorption",
    "Black",
    "Dielectric",
    "Diffuse",
    "Grating",
    "Material",
    "Mirror",
    "Polariser",
    "Slit",
]
