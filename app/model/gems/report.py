"""All that is found out about a cut stone: figures, tilt curves, pictures as the trade's instruments show them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .figures import (
    ASET_HEAD_DEG,
    UP,
    Cancelled,
    GemFigures,
    Report,
    Stone,
    beside_head,
    face_places,
    figures,
    look,
    returned,
    seen_mean,
    seen_places,
    tilted,
)

SIDE = 512
"""Pixels of a picture's side; …"""
_SAMPLES = 2
"""… each of as many rays along either side."""
TILTS_DEG = np.arange(-30.0, 30.1, 3.0)
_FACE_COUNT = 256
"""Rays along a side for the figures."""
_TILT_COUNT = 72
"""Rays along the side of the square round a tilted stone."""
_FULL_SPREAD_DEG = 2.0
"""Angle between F and C at which the scale of the picture of fire ends."""
_RED, _GREEN, _BLUE = np.array([0.8, 0.01, 0.03]), np.array([0.02, 0.42, 0.08]), np.array([0.05, 0.1, 0.9])
_WHITE, _BLACK = np.ones(3), np.zeros(3)
PICTURES = {
    "aset": "ASET: blue hidden by the head, red from high, green from low, white from behind",
    "ideal-scope": "Ideal-scope: red returned, black hidden by the head, white from behind",
    "brightness": "Brightness under an even sky, with the shadow of a head of 15°",
    "fire": "Fire: angle between F and C of the returned light, from 0° (dark blue) to 2° and more (dark red)",
}


@dataclass(frozen=True)
class TableFire:
    """The light that a stone, table down, throws on a white table two diameters below it, in a beam from above."""

    picture: np.ndarray
    """float32 (512, 512, 3), irradiance in linear Rec.709, ten diameters wide."""
    coloured: float
    """Share of that light that is left once every place's white is taken away."""
    photons: int


@dataclass(frozen=True)
class GemReport:
    """A stone's figures, curves and pictures."""

    stone: Stone
    figures: GemFigures
    tilts_deg: np.ndarray
    """float64 (K,), angles by which the stone is tilted …"""
    tilt_iso: np.ndarray
    """float64 (2, K), … about x and y: light return of an even sky then; NaN where it was stopped before."""
    tilt_cos: np.ndarray
    tilt_head: np.ndarray
    """As `tilt_iso`, with the shadow of the head."""
    pictures: dict[str, np.ndarray]
    """By the names of `PICTURES`: float32 (512, 512, 3), linear Rec.709, y up; none where it was stopped before."""
    table: TableFire | None = None
    """None where it was not asked for, or stopped before."""

    def rows(self) -> tuple[tuple[str, str, str], ...]:
        """Name, value and meaning of its figures."""
        if self.table is None:
            return self.figures.rows()
        share = f"{100.0 * self.table.coloured:.1f} %"
        return (*self.figures.rows(), ("fire on the table", share, "of the light thrown on a table is coloured"))

    def values(self) -> dict[str, Any]:
        """All numbers, for a file."""
        return {
            "stone": self.stone.name,
            "glass": {"name": self.stone.glass.name, "n_d": self.stone.glass.n_d, "n_F_minus_n_C": self.stone.dn},
            "notes": list(self.stone.notes),
            "coloured_on_table": None if self.table is None else self.table.coloured,
            "figures": {key: _number(value) for key, value in vars(self.figures).items()},
            "tilt_deg": self.tilts_deg.tolist(),
            "tilt": {
                f"{name}_about_{axis}": [_number(value) for value in curve]
                for name, curves in (("iso", self.tilt_iso), ("cos", self.tilt_cos), ("iso_head", self.tilt_head))
                for axis, curve in zip("xy", curves, strict=True)
            },
        }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def gem_report(
    stone: Stone,
    head_deg: float = ASET_HEAD_DEG,
    report: Report | None = None,
    cancelled: Cancelled | None = None,
    table: Callable[[Report, Cancelled], TableFire | None] | None = None,
) -> GemReport | None:
    """Find out all about `stone`, the light that it throws on a `table` too where somebody can make that; what is
    missing where that was `cancelled` is NaN or left out, None: all of it.

    Raises `UserError`.
    """
    stopped, own = cancelled or (lambda: False), 1.0 if table is None else 0.6

    def told(share: float, text: str, begun: float = 0.0, ends: float = own) -> None:
        if report is not None:
            report(begun + share * (ends - begun), text)

    found = figures(stone, head_deg, _FACE_COUNT, lambda share, text: told(0.2 * share, text), stopped)
    if found is None:
        return None
    curves = np.full((3, 2, len(TILTS_DEG)), np.nan)
    ways = [(axis, k) for axis in (0, 1) for k in range(len(TILTS_DEG))]
    for i, (axis, k) in enumerate(ways):
        if stopped():
            break
        told(0.2 + 0.3 * i / len(ways), "tilting it")
        curves[:, axis, k] = _tilt(stone, axis, float(TILTS_DEG[k]), head_deg)
    pictures = _pictures(stone, lambda share, text: told(0.5 + 0.5 * share, "pictures"), stopped)
    thrown = None
    if table is not None and not stopped():
        thrown = table(lambda share, text: told(share, text, own, 1.0), stopped)
    return GemReport(stone, found, TILTS_DEG, curves[0], curves[1], curves[2], pictures, thrown)


def _tilt(stone: Stone, axis: int, angle_deg: float, head_deg: float) -> tuple[float, float, float]:
    """Light return by ISO and COS, and the first with the head's shadow, of a stone tilted about x or y."""
    from .paths import COSINE

    way = tilted(angle_deg, 0.0) if axis == 0 else tilted(0.0, angle_deg)
    sums = seen_mean(look(stone, seen_places(_TILT_COUNT, way), way, way, head_deg))
    return float(returned(sums)), float(sums[COSINE]), float(beside_head(sums))


# ---- pictures ---------------------------------------------------------------------------------


def _pictures(stone: Stone, report: Report, stopped: Cancelled) -> dict[str, np.ndarray]:
    """Those of `PICTURES`; none where it was stopped."""
    sums = look(stone, face_places(stone, _SAMPLES * SIDE), UP, UP, report=report, cancelled=stopped, least=1e-3)
    return {} if stopped() else {name: shown(sums, name) for name in PICTURES}


def shown(sums: np.ndarray, name: str) -> np.ndarray:
    """The picture of that name out of the sums of `look` at `face_places`, float32 (H, H, 3), linear Rec.709."""
    from ...base.colour_maps import FALSE_COLOUR, sample
    from ...base.tone_map import srgb_eotf
    from .paths import HEAD, HIGH, LEAK, LOW, SPREAD

    head, high, low, leak = (sums[:, column, None] for column in (HEAD, HIGH, LOW, LEAK))
    sees = sums[:, :6].sum(axis=1, keepdims=True) > 0.0
    if name == "aset":
        rgb = head * _BLUE + high * _RED + low * _GREEN + leak * _WHITE
    elif name == "ideal-scope":
        rgb = head * _BLACK + (high + low) * _RED + leak * _WHITE
    elif name == "brightness":
        rgb = beside_head(sums)[:, None] * _WHITE
    else:
        above = returned(sums)
        angle = np.degrees(np.divide(sums[:, SPREAD], above, out=np.zeros(len(sums)), where=above > 0.0))
        rgb = srgb_eotf(sample(FALSE_COLOUR, angle / _FULL_SPREAD_DEG))
    ground = _BLACK if name in ("brightness", "fire") else _WHITE
    rgb = np.where(sees, rgb, ground)
    side = math.isqrt(len(sums)) // _SAMPLES
    return rgb.reshape(side, _SAMPLES, side, _SAMPLES, 3).mean(axis=(1, 3)).astype(np.float32)
