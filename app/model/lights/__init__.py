"""Kinds of light, one class each: this is the list of them.

A new kind is a class here and its name in `LIGHT_KINDS`; the scene file, saving, glTF, the panel, presets and
animation follow from what the class declares. Where it shines as no kind does yet, CONTRIBUTING.md lists what it also
wants in shaders and references.
"""

from __future__ import annotations

from .directional import DirectionalLight
from .ies import IesLight
from .light import Light
from .outlined import AreaLight, CollimatedLight
from .point import PointLight, SpotLight

LIGHT_KINDS: dict[str, type[Light]] = {
    cls.kind: cls for cls in (PointLight, SpotLight, DirectionalLight, CollimatedLight, AreaLight, IesLight)
}
"""By their word in a scene file."""

__all__ = [
    "LIGHT_KINDS",
    "AreaLight",
    "CollimatedLight",
    "DirectionalLight",
    "IesLight",
    "Light",
    "PointLight",
    "SpotLight",
]
