"""Kinds of material, one class each: this is the list of them.

A new kind is a file here and its name in `MATERIAL_KINDS`; the scene file, saving, glTF's extras and reports follow
from what the class declares. Where light meets it as no kind does yet, it also wants a KIND_ in
`shaders/lib/scene.glsl`, what happens there in `shaders/light/trace.comp` and `shaders/camera/camera.comp`, and the
same in the two references (`reference/photon_kernel.py`, `reference/camera_kernel.py`).
"""

from __future__ import annotations

from .absorption import Absorption
from .black import Black
from .dielectric import Dielectric
from .diffuse import Diffuse
from .material import Material
from .mirror import Mirror

MATERIAL_KINDS: dict[str, type[Material]] = {cls.kind: cls for cls in (Dielectric, Mirror, Diffuse, Black)}
"""By their word in a scene file."""

__all__ = ["MATERIAL_KINDS", "Absorption", "Black", "Dielectric", "Diffuse", "Material", "Mirror"]
