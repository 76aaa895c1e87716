"""Kinds of light, one class each: this is the list of them.

A new kind is a file here and its name in `LIGHT_KINDS`; the scene file, saving, glTF, the panel, presets and
animation follow from what the class declares. Where it shines as no kind does yet, it also wants its emission in
`shaders/light/emit.comp` with its domain in `passes/emission_domain.py`, its direct light in `shaders/lib/lights.glsl`,
and both again in the two references (`reference/photon_emit.py`, `reference/camera_lights.py`).
"""

from __future__ import annotations

from .area import AreaLight
from .collimated import CollimatedLight
from .directional import DirectionalLight
from .ies import IesLight
from .light import Light
from .point import PointLight
from .spot import SpotLight

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
