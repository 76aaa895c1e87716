"""What colour a spectrum has: chromaticity and dominant wavelength (CIE 15:2004, sections 7 and 8)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, illuminant_table


@dataclass(frozen=True)
class ColourInfo:
    """Of one spectrum."""

    illuminance: float
    """lm/unit², when the spectrum is an irradiance in W/unit²/nm."""
    x: float
    y: float
    dominant_nm: float | None
    """Wavelength of the spectral colour on the line from D65 through (x, y); None for greys."""
    is_complementary: bool
    """A purple: `dominant_nm` then lies on the other side of white."""
    purity: float
    """Excitation purity: distance from white over that of the border."""


def colour_info(wavelengths_nm: np.ndarray, spectrum: np.ndarray) -> ColourInfo | None:
    """Colour of `spectrum` (n,) at bin centres `wavelengths_nm` (n,), evenly spaced; None when it is dark."""
    at = np.asarray(wavelengths_nm, float)
    density = np.asarray(spectrum, float)
    width = float(at[1] - at[0]) if at.size > 1 else 1.0
    weights = np.stack([np.interp(at, VISIBLE_NM, cmf_xyz()[:, channel]) for channel in range(3)], axis=-1)
    xyz = density @ weights * width
    total = float(xyz.sum())
    if not np.isfinite(total) or total <= 0.0 or xyz[1] <= 0.0:
        return None
    x, y = float(xyz[0] / total), float(xyz[1] / total)
    dominant, is_complementary, purity = _dominant(x, y)
    return ColourInfo(K_M * float(xyz[1]), x, y, dominant, is_complementary, purity)


@cache
def _locus() -> np.ndarray:
    """(x, y) of spectral colours at 1 nm from 400 to 700 nm, where it turns one way only."""
    xyz = cmf_xyz()[20:321]
    return xyz[:, :2] / xyz.sum(axis=1, keepdims=True)


@cache
def _white() -> np.ndarray:
    xyz = illuminant_table()["D65"] @ cmf_xyz()
    return xyz[:2] / xyz.sum()


def _dominant(x: float, y: float) -> tuple[float | None, bool, float]:
    white, toward = _white(), np.array([x, y]) - _white()
    length = float(np.hypot(*toward))
    if length < 0.005:
        return None, False, 0.0
    for is_complementary in (False, True):
        direction = -toward if is_complementary else toward
        found = _crossing(white, direction / length)
        if found is not None:
            wavelength, reach = found
            border = _purple_reach(white, toward / length) if is_complementary else reach
            return wavelength, is_complementary, min(length / border, 1.0)
    return None, False, 0.0


def _crossing(white: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """(wavelength nm, distance from white) where the ray leaves the spectral locus; None where it leaves between its
    ends."""
    relative = _locus() - white
    across = direction[0] * relative[:, 1] - direction[1] * relative[:, 0]
    along = relative @ direction
    changes = np.nonzero((across[:-1] * across[1:] <= 0.0) & (along[:-1] + along[1:] > 0.0))[0]
    if changes.size == 0:
        return None
    i = int(changes[0])
    step = across[i] - across[i + 1]
    share = float(across[i] / step) if step != 0.0 else 0.0
    return 400.0 + i + share, float(along[i] + share * (along[i + 1] - along[i]))


def _purple_reach(white: np.ndarray, direction: np.ndarray) -> float:
    """Distance from white to the line of purples."""
    start, end = _locus()[0] - white, _locus()[-1] - white
    edge = end - start
    denominator = direction[0] * edge[1] - direction[1] * edge[0]
    return abs(float((start[0] * edge[1] - start[1] * edge[0]) / denominator)) if denominator else 1.0
