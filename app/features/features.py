"""What a scene needs, as one frozen value from which every program is built.

(Scene, RenderSettings) → Features → defines: nothing else chooses what a program is compiled with, but for the switches
that tell a program's own variants apart (`program_switches`). What is False or 0 here is absent from the program that
runs, not skipped by it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from ..model.scene import Scene
from ..model.settings import RenderSettings
from .facts import Facts
from .program_switches import PROGRAM_SWITCHES
from .receivers import PictureFeatures, ReceiverFeatures
from .row import ROW, Row
from .spectrum import SpectrumFeatures
from .surfaces import SurfaceFeatures


@dataclass(frozen=True, kw_only=True)
class Features(PictureFeatures, ReceiverFeatures, SurfaceFeatures, SpectrumFeatures):
    """The compile-time choices of one rendering: the columns of the table, each with its row."""

    method: str = "srd"
    """How wavelengths are sampled."""

    @staticmethod
    def of(scene: Scene, settings: RenderSettings) -> Features:
        """The features that `scene` needs under `settings`."""
        facts = Facts(scene, settings)
        return Features(method=settings.method, **{name: row.needs(facts) for name, row in ROWS.items()})  # type: ignore[arg-type]

    @property
    def targets(self) -> int:
        """Accumulation targets of four float32: XYZ and radiant power with the maps' channels, or bins alone."""
        return -(-self.bins // 4) if self.bins else 1 + -(-self.map_tents // 4)

    @property
    def has_lobe_columns(self) -> bool:
        """Photons carry how the light of a microfacet spreads beside the spatial columns."""
        return self.rough and self.footprints

    @property
    def columns(self) -> int:
        """Derivatives that a ray carries of its position and direction."""
        return 2 * (self.footprints + self.has_lobe_columns + self.lamp_columns) + self.spectral_groups

    def defines(self, *, of_picture: bool = False) -> dict[str, int]:
        """Preprocessor symbols; a feature that is out is not defined at all, but numbers always are. `of_picture`: of a
        program of the camera, for what it sees as well."""
        found = {"SPECTRAL_GROUPS": self.spectral_groups, "TARGETS": self.targets, "COLUMNS": self.columns}
        found["SLOTS"] = 1 + self.nested_windows
        for name, row in ROWS.items():
            is_used = row.symbol and (of_picture or name not in OF_PICTURES)
            if is_used and (value := int(getattr(self, name))):
                found[row.symbol] = value
        return found | {symbol: 1 for symbol, on in self._derived().items() if on}

    def _derived(self) -> dict[str, bool]:
        """Switches that others decide."""
        return {
            "LOBE_COLUMNS": self.has_lobe_columns,
            # A splat that no wavelength moves is a Gaussian of one colour.
            "ONE_COLOUR": self.point_spectrum or self.spectral_groups == 0,
        }

    def changed(self, **values: Any) -> Features:
        """`replace` for fields whose names are data."""
        return replace(self, **values)

    def explain(self, facts: Facts) -> list[tuple[str, bool, str]]:
        """(feature, compiled in, reason) of every row that has a name, for people."""
        return [
            (row.name, is_in, row.why_words(facts, is_in=is_in))
            for name, row in ROWS.items()
            if row.name
            for is_in in [bool(getattr(self, name))]
        ]


ROWS: dict[str, Row] = {each.name: each.metadata[ROW] for each in fields(Features) if ROW in each.metadata}
"""The table: the row of every field."""
OF_PICTURES = frozenset(each.name for each in fields(PictureFeatures))
"""Fields that no caustic map depends on."""


def all_symbols() -> tuple[str, ...]:
    """Every name that shaders test as a switch, of 0 or 1."""
    of_rows = [row.symbol for row in ROWS.values() if row.symbol]
    return tuple(dict.fromkeys([*of_rows, *Features()._derived(), *PROGRAM_SWITCHES]))
