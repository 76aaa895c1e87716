"""Glass, water, gems, crystals: a transparent solid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from ...base.errors import UserError
from ..fields import Animated, Colour, Direction, Flag, Integer, Number, Row
from ..io.scene_table import SceneTable
from ..optics import catalogue, crystals, glass
from ..optics.colorimetry import VISIBLE_NM
from ..optics.glass import Dispersion
from ..optics.thin_films import MAX_VARIED_NM, Film
from ..optics.tints import tint_of
from ..vectors import Vec3
from .absorption import Absorption, AbsorptionPart
from .coating import FILM_FROM_NM, FILM_INDEX, FILM_NM, Coating, CoatingPart, FilmAlong, film_of, film_words
from .dispersion_file import DispersionPart
from .material import Material, colour_words

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh

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
        "How rough all of its surface is: 0 polished, 0.3 frosted or brushed, 1 as matt as may be.",
        format="%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of the surface of glass or a mirror; 0 is polished"),
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
Z_AXIS = (0.0, 0.0, 1.0)
CLEAR = (1.0, 1.0, 1.0)
SHEET_CODE = 5
"""KIND_SHEET of shaders/lib/scene.glsl."""


class _Axis(Direction):
    """`axis`, of crystals alone."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The unit vector."""
        if table.has(self.attribute) and not table.given(("crystal", "ordinary")):
            table.fail(self.attribute, "is a crystal's: give 'crystal', or 'ordinary' and 'extraordinary'")
        return super().read(table)


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
    film_along: Vec3 | None = None
    """Direction, in the object's own coordinates, in which the film's thickness rises to `film_nm` from …"""
    film_from_nm: float = 0.0
    extraordinary: Dispersion | None = None
    """The second index of a uniaxial crystal, whose `dispersion` is the ordinary one; None: it is isotropic."""
    axis: Vec3 = Z_AXIS
    """A crystal's optic axis, a unit vector in the object's own coordinates."""

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
        FILM_FROM_NM,
        FilmAlong(),
        _Axis("axis", Z_AXIS, optional=True),
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
        if self.is_crystal:
            return "it is a crystal, which parts light in two"
        if self.thin:
            return "it is a thin sheet"
        if self.filters:
            return "its surface is coloured"
        if self.film is not None:
            return "a thin film lies on it"
        return "its surface is rough" if self.is_rough else None

    @property
    def is_crystal(self) -> bool:
        """Its indices differ."""
        return self.extraordinary is not None and crystals.is_birefringent(self.dispersion, self.extraordinary)

    def with_gain(self, gain: float, where: str = "") -> Self:
        """A copy whose dispersion, of a crystal both, is `gain` times the material's own. Raises UserError."""
        pair = (self.dispersion, self.extraordinary)
        ordinary, other = (None if d is None else glass.with_gain(d, gain, where) for d in pair)
        return self.changed(dispersion=ordinary, extraordinary=other)

    def shown_numbers(self) -> tuple[Number, ...]:
        """Those of films and of rough surfaces are no crystal's; where it begins, only one has that varies."""
        hidden = () if self.film_along is not None else (FILM_FROM_NM,)
        return () if self.is_crystal else tuple(number for number in super().shown_numbers() if number not in hidden)

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Crystals are solid, polished and bare; a film whose thickness varies is the only one and not too thick."""
        if self.film_along is not None and (self.coating or max(self.film_nm, self.film_from_nm) > MAX_VARIED_NM):
            raise UserError(
                f"{file_name}: object '{name}' has a film whose thickness varies ('film_along'), which may be up to "
                f"{MAX_VARIED_NM:,.0f} nm thick and have no 'coating' under it; make it thinner, or leave 'coating' out"
            )
        faults = {
            "thin": self.thin,
            "roughness": self.roughness > 0.0,
            "coating": self.coating is not None,
            "film_nm": self.film_nm > 0.0 or self.film_along is not None,
        }
        key = next((key for key, holds in faults.items() if holds), None)
        if self.is_crystal and key is not None:
            raise UserError(
                f"{file_name}: object '{name}' is a crystal with '{key}', and light is followed through polished bare "
                f"solids of crystal alone; leave '{key}' out, or take a glass"
            )

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
        other = (self.extraordinary.index(VISIBLE_NM), *self.axis) if self.extraordinary is not None else ()
        return index, self.priority, absorbed, self.thin, *self.transmittance_rgb, self.roughness, *film, *other

    def words(self) -> str:
        """Its glass, and what sets it apart from it."""
        own, other = self.dispersion, self.extraordinary
        words = own.name or f"glass of n_d {own.n_d:.4f}"
        if other is not None:
            words = crystals.named(own, other) or f"crystal of n_o {own.n_d:.4f} and n_e {other.n_d:.4f}"
        words += "" if own.gain == 1.0 else f", {own.gain:g} times as dispersive"
        tint = None if self.absorption is None else tint_of(self.absorption.coefficient)
        words += "" if self.absorption is None else ", absorbing" if tint is None else f", tinted {tint[0].name}"
        words += "" if self.transmittance_rgb == CLEAR else f", surface {colour_words(self.transmittance_rgb)}"
        words += film_words(self)
        words += ", thin" if self.thin else f", roughness {self.roughness:g}" if self.is_rough else ""
        return words + (f", priority {self.priority}" if self.priority else "")
