"""Glass, water, gems: a transparent solid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from ..fields import Animated, Colour, Flag, Integer, Number, Row
from ..optics import catalogue
from ..optics.colorimetry import VISIBLE_NM
from ..optics.glass import Dispersion
from ..optics.thin_films import Film
from ..optics.tints import tint_of
from ..vectors import Vec3
from .absorption import Absorption, AbsorptionPart
from .coating import FILM_INDEX, FILM_NM, Coating, CoatingPart, film_of, film_words
from .dispersion_file import DispersionPart
from .material import Material, colour_words

DEFAULT_GLASS = "N-BK7"
MAX_PRIORITY = 1_000_000
PRIORITY = Integer("priority", 0, optional=True, at_least=-MAX_PRIORITY, at_most=MAX_PRIORITY)
ROUGHNESS = Number(
    "roughness",
    0.0,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Roughness",
        "How rough all of its surface is ground: 0 polished, 0.3 frosted, 1 as matt as may be.",
        0.0,
        1.0,
        0.0,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a glass's surface; 0 is polished", 0.0, 1.0),
)
THIN = Flag(
    "thin",
    False,
    optional=True,
    row=Row(
        "Thin",
        "A sheet whose thickness does not show, such as a window's: light goes straight through. What it absorbs and "
        "its roughness have no effect then; its colour has.",
    ),
)
CLEAR = (1.0, 1.0, 1.0)
SHEET_CODE = 5
"""KIND_SHEET of shaders/lib/scene.glsl."""


@dataclass(frozen=True)
class Dielectric(Material):
    """A transparent solid, or a thin sheet of its material."""

    dispersion: Dispersion
    absorption: Absorption | None = None
    priority: int = 0
    """Where solids overlap, the higher priority decides; equal ones: the later object."""
    roughness: float = 0.0
    """How rough its whole surface is: 0 is polished, and GGX's width α is the square of it."""
    thin: bool = False
    """A sheet, both of whose faces are met at once: without inside, absorption and roughness."""
    transmittance_rgb: Vec3 = CLEAR
    """Linear Rec.709 share of what enters that leaves a sheet, or a solid on its other side."""
    coating: Coating | None = None
    film_nm: float = 0.0
    film_index: float = 1.33

    kind: ClassVar = "glass"
    title: ClassVar = "Glass"
    gpu_code: ClassVar = 3
    parts: ClassVar = (
        DispersionPart(),
        AbsorptionPart(),
        PRIORITY,
        ROUGHNESS,
        THIN,
        Colour("transmittance_rgb", CLEAR, "colour", optional=True),
        CoatingPart(),
        FILM_NM,
        FILM_INDEX,
    )
    is_specular: ClassVar = True
    transmits: ClassVar = True

    @property
    def met_as(self) -> int:
        """A thin sheet is met in a way of its own."""
        return SHEET_CODE if self.thin else self.gpu_code

    @property
    def film(self) -> Film | None:
        """On its surface, if that is polished; a thin sheet may be one itself."""
        return None if self.is_rough else film_of(self, self.dispersion if self.thin else None)

    @property
    def why_no_beams(self) -> str | None:  # type: ignore[override]
        """Beams know clear polished solids alone."""
        if self.thin:
            return "it is a thin sheet"
        if self.filters:
            return "its surface is coloured"
        if self.film is not None:
            return "a thin film lies on it"
        return "its surface is rough" if self.is_rough else None

    @classmethod
    def usual(cls) -> Self:
        """A solid of the default glass."""
        return cls(catalogue.find(DEFAULT_GLASS))

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """Glass is what a material is unless it says otherwise."""
        values = super().values(path)
        del values["kind"]
        return values

    def content(self) -> tuple[object, ...]:
        """Its index on the visible grid, its priority, what it absorbs and lets through, how rough and thin it is."""
        absorbed = None if self.absorption is None else self.absorption.coefficient
        index = self.dispersion.index(VISIBLE_NM)
        film = () if self.film is None else (self.film,)
        return index, self.priority, absorbed, self.thin, *self.transmittance_rgb, self.roughness, *film

    def words(self) -> str:
        """Its glass, and what sets it apart from it."""
        glass = self.dispersion
        words = glass.name or f"glass of n_d {glass.n_d:.4f}"
        words += "" if glass.gain == 1.0 else f", {glass.gain:g} times as dispersive"
        tint = None if self.absorption is None else tint_of(self.absorption.coefficient)
        words += "" if self.absorption is None else ", absorbing" if tint is None else f", tinted {tint[0].name}"
        words += "" if self.transmittance_rgb == CLEAR else f", surface {colour_words(self.transmittance_rgb)}"
        words += film_words(self)
        words += ", thin" if self.thin else f", roughness {self.roughness:g}" if self.is_rough else ""
        return words + (f", priority {self.priority}" if self.priority else "")
