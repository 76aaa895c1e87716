"""A polariser or a wave plate: a thin sheet that lets light polarised along its axis through, and otherwise light
polarised across it less, later, or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ..fields import Animated, Direction, Number, Row
from ..optics.glass import Dispersion
from ..vectors import Vec3
from .grating import WAVELENGTH, check_sheet
from .material import Material

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh

MAX_RETARDANCE_NM = 1e5


def _share(attribute: str, default: float, label: str, which: str) -> Number:
    """A share of the light polarised in one way."""
    tip = f"Share of the light polarised {which} that passes."
    row = Row(label, tip, 0.0, 1.0, default, "%.3f", is_slider=True)
    return Number(attribute, default, at_least=0.0, at_most=1.0, row=row, animated=Animated(tip[:-1]))


_RETARDANCE = Number(
    "retardance_nm",
    0.0,
    unit="nm",
    optional=True,
    at_least=-MAX_RETARDANCE_NM,
    at_most=MAX_RETARDANCE_NM,
    row=Row(
        "Retardance",
        "How far light polarised across the axis falls behind light along it: a quarter of a wavelength makes a "
        "quarter-wave plate, where all passes across the axis too.",
        0.0,
        2000.0,
        format="%.1f",
        is_slider=True,
    ),
    animated=Animated("How far light across the axis falls behind, nm"),
)


@dataclass(frozen=True)
class Polariser(Material):
    """A sheet with the same medium on both sides, which reflects nothing; what does not pass is absorbed."""

    transmittance: float = 1.0
    """Share of light polarised along the axis that passes."""
    crossed_transmittance: float = 0.0
    """The same across it."""
    retardance_nm: float = 0.0
    """How far what passes across the axis falls behind, in wavelengths' own unit."""
    axis: Vec3 = (1.0, 0.0, 0.0)
    """A unit vector in the object's own coordinates; what of it lies across a ray counts."""

    kind: ClassVar = "polariser"
    title: ClassVar = "Polariser"
    gpu_code: ClassVar = 6
    parts: ClassVar = (
        _share("transmittance", 1.0, "Along the axis", "along the axis"),
        _share("crossed_transmittance", 0.0, "Across the axis", "across the axis"),
        _RETARDANCE,
        Direction("axis", (1.0, 0.0, 0.0)),
    )
    is_specular: ClassVar = True
    is_polariser: ClassVar = True
    why_no_beams: ClassVar = "it polarises"

    @property
    def dispersion(self) -> Dispersion | None:
        """The wavelength, where that decides what passes."""
        return WAVELENGTH if self.retardance_nm else None

    def words(self) -> str:
        """What it does to light."""
        along, across, late = self.transmittance, self.crossed_transmittance, self.retardance_nm
        return f"polariser {along:.3g}:{across:.3g}" + (f", retardance {late:g} nm" if late else "")

    def content(self) -> tuple[object, ...]:
        """All its numbers."""
        return (self.transmittance, self.crossed_transmittance, self.retardance_nm, *self.axis)

    def is_like(self, other: Material) -> bool:
        """Numbers may differ, but for what needs bands of the spectrum."""
        return isinstance(other, Polariser) and (self.retardance_nm != 0.0) == (other.retardance_nm != 0.0)

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Thin sheets only, in which the axis lies."""
        check_sheet(mesh, self.axis, "polariser", "axis", name, file_name)
