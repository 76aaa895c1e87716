"""A slit: what light of one wavelength that passes it spreads into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from ..fields import Animated, Direction, Number, Part, Row
from ..io.scene_table import SceneTable
from ..texture import TextureReader
from .grating import Grating

NARROWEST_UM = 1.0
"""Scalar theory knows slits that are wider than the waves."""
_WIDTH = Number(
    "width_um",
    20.0,
    unit="µm",
    above=0.0,
    at_most=1e6,
    row=Row(
        "Width",
        "Width of the slit: light of wavelength λ has its first minimum where sin θ = λ over it.",
        NARROWEST_UM,
        format="%.4g",
    ),
    animated=Animated("Width of a slit, µm", NARROWEST_UM),
)


@dataclass(frozen=True)
class Slit(Grating):
    """An opening as wide as `width_um`, whatever the size of its sheet: a grating of one line and of order 0."""

    orders: tuple[int, ...] = (0,)
    efficiency: tuple[float, ...] = (1.0,)
    grooves: float = 1.0
    width_um: float = 20.0

    kind: ClassVar = "slit"
    title: ClassVar = "Slit"
    parts: ClassVar[tuple[Part, ...]] = (_WIDTH, Direction("direction", (0.0, 1.0, 0.0)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "lines_per_mm", 1e3 / self.width_um)

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """None that is narrower than waves."""
        found = super().read(table, textures)
        if found.width_um < NARROWEST_UM:
            table.fail(
                "width_um",
                f"is {found.width_um:g}: what a slit hardly wider than the waves lets through depends on its edges; "
                f"make it at least {NARROWEST_UM:g}",
            )
        return found

    def words(self) -> str:
        """Its width."""
        return f"slit of {self.width_um:g} µm"
