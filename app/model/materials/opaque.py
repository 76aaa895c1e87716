"""What light does not enter: a perfect mirror, and a perfect absorber."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..fields import Colour
from ..vectors import Vec3
from .material import Material, colour_words


@dataclass(frozen=True)
class Mirror(Material):
    """A perfect specular reflector with linear Rec.709 reflectance."""

    reflectance_rgb: Vec3 = (1.0, 1.0, 1.0)

    kind: ClassVar = "mirror"
    title: ClassVar = "Mirror"
    gpu_code: ClassVar = 2
    parts: ClassVar = (Colour("reflectance_rgb", (1.0, 1.0, 1.0), "reflectance"),)
    is_specular: ClassVar = True
    is_mirror: ClassVar = True

    def words(self) -> str:
        """With its colour."""
        return f"mirror {colour_words(self.reflectance_rgb)}"


@dataclass(frozen=True)
class Black(Material):
    """A perfect absorber."""

    kind: ClassVar = "black"
    title: ClassVar = "Black"
    gpu_code: ClassVar = 0
