"""What light does not enter: a mirror, polished or rough, and a perfect absorber."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from ..fields import Colour, Number, Part
from ..io.scene_table import SceneTable
from ..optics.metals import find_metal, metals
from ..optics.thin_films import Film
from ..texture import TextureReader
from ..vectors import Vec3
from .coating import FILM_INDEX, FILM_NM, Coating, CoatingPart, film_of, film_words
from .dielectric import ROUGHNESS
from .material import Material, colour_words


class MetalPart(Part):
    """`metal`: one whose index is known, or none: an ideal mirror."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Its name."""
        if not table.has("metal"):
            return {"metal": ""}
        return {"metal": find_metal(table.string("metal"), table.where("metal")).name}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """The name."""
        return {"metal": value.metal} if value.metal else {}


@dataclass(frozen=True)
class Mirror(Material):
    """A specular reflector: ideal, with linear Rec.709 reflectance; or of metal, times that."""

    reflectance_rgb: Vec3 = (1.0, 1.0, 1.0)
    metal: str = ""
    coating: Coating | None = None
    film_nm: float = 0.0
    film_index: float = 1.33
    roughness: float = 0.0

    kind: ClassVar = "mirror"
    title: ClassVar = "Mirror"
    gpu_code: ClassVar = 2
    parts: ClassVar = (
        Colour("reflectance_rgb", (1.0, 1.0, 1.0), "reflectance"),
        MetalPart(),
        CoatingPart(),
        FILM_NM,
        FILM_INDEX,
        ROUGHNESS,
    )
    is_specular: ClassVar = True
    is_mirror: ClassVar = True

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """An ideal mirror reflects all, whatever film lies on it."""
        found = super().read(table, textures)
        for key in ("coating", "film_nm"):
            if not found.metal and table.has(key):
                table.fail(key, f"has no effect on an ideal mirror: give 'metal' as well, one of {', '.join(metals())}")
        return found

    @property
    def film(self) -> Film | None:
        """Polished metal is one of no layers."""
        return (film_of(self) or Film(())) if self.metal else None

    @property
    def why_no_beams(self) -> str | None:  # type: ignore[override]
        """Beams know a mirror's colour, whatever the angle."""
        return "it is of metal" if self.metal else "its surface is rough" if self.is_rough else None

    def shown_numbers(self) -> tuple[Number, ...]:
        """Those of a film have no effect on an ideal mirror."""
        return super().shown_numbers() if self.metal else (ROUGHNESS,)

    def content(self) -> tuple[object, ...]:
        """With its roughness, its metal and what lies on it."""
        return *super().content(), self.roughness, self.metal, *(() if self.film is None else (self.film,))

    def words(self) -> str:
        """With its metal and its colour."""
        rough = f", roughness {self.roughness:g}" if self.is_rough else ""
        return f"mirror {self.metal or colour_words(self.reflectance_rgb)}{film_words(self)}{rough}"


@dataclass(frozen=True)
class Black(Material):
    """A perfect absorber."""

    kind: ClassVar = "black"
    title: ClassVar = "Black"
    gpu_code: ClassVar = 0
