"""The colour of a spectrum: chromaticity, dominant wavelength, purity, temperature (CIE 15:2004, sections 7 to 9).

By colour-science, which takes about a second to import: `ready` does that on a thread.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cache, lru_cache
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, illuminant_table
from ..model.optics.spectrum import blackbody

if TYPE_CHECKING:
    from colour import MultiSpectralDistributions

_GREY = 0.005
"""Distance from white below which there is no hue."""
_MAX_DUV = 0.05
"""Distance from the Planckian locus in CIE 1960 uv above which CIE gives no colour temperature."""
_KELVIN = (1000.0, 1e5)


@dataclass(frozen=True)
class ColourInfo:
    """The colour of one spectrum."""

    illuminance: float
    """lm/unit², when the spectrum is an irradiance in W/unit²/nm."""
    x: float
    y: float
    dominant_nm: float | None
    """Wavelength of the spectral colour on the line from D65 through (x, y), to a nanometre; None for greys."""
    is_complementary: bool
    """A purple: `dominant_nm` is then on the other side of white."""
    purity: float
    """Excitation purity: distance from white over that of the border."""
    temperature_k: float | None
    """Correlated colour temperature, K (CIE 15:2004, 9.5); None where the colour is too far from any black body's."""


def ready() -> bool:
    """Whether `colour_info` answers at once; the first call begins the import, in a thread."""
    thread = _loading()
    return not thread.is_alive()


@cache
def _loading() -> threading.Thread:
    thread = threading.Thread(target=lambda: _described(0.31, 0.32), name="colour-science", daemon=True)
    thread.start()
    return thread


def colour_info(
    wavelengths_nm: np.ndarray, spectrum: np.ndarray, source: np.ndarray | float = 1.0
) -> ColourInfo | None:
    """Colour of `spectrum` (n,) at bin centres `wavelengths_nm` (n,), evenly spaced; None when it is dark.

    `source`: the shape of the light's spectrum within bins, on `VISIBLE_NM`; flat where it is not known or dark.
    """
    at = np.asarray(wavelengths_nm, float)
    density = np.asarray(spectrum, float)
    width = float(at[1] - at[0]) if at.size > 1 else 1.0
    # Means over each bin: in wide ones the middle says too little.
    within = (np.abs(VISIBLE_NM[None] - at[:, None]) <= 0.5 * width) * 1.0
    shaped = within * source
    within = np.where(shaped.sum(axis=1, keepdims=True) > 0.0, shaped, within)
    weights = within @ cmf_xyz() / np.maximum(within.sum(axis=1, keepdims=True), 1e-300)
    xyz = density @ weights * width
    total = float(xyz.sum())
    if not np.isfinite(total) or total <= 0.0 or xyz[1] <= 0.0:
        return None
    x, y = float(xyz[0] / total), float(xyz[1] / total)
    return ColourInfo(K_M * float(xyz[1]), x, y, *_described(x, y))


@lru_cache(maxsize=64)
def _described(x: float, y: float) -> tuple[float | None, bool, float, float | None]:
    """(dominant wavelength, whether it is the complementary one, purity, temperature) of a chromaticity."""
    science, place = _colour_science(), np.array([x, y])
    temperature = _temperature_k(x, y)
    if np.linalg.norm(place - _white()) < _GREY:
        return None, False, 0.0, temperature
    observer = _observer()
    wavelength = float(science.dominant_wavelength(place, _white(), observer)[0])
    purity = float(science.excitation_purity(place, _white(), observer))
    return abs(wavelength), wavelength < 0.0, min(purity, 1.0), temperature


def _temperature_k(x: float, y: float) -> float | None:
    """Temperature of the black body nearest in CIE 1960 uv, by our own tables: D65 has 6,504 K."""
    kelvin, locus = _planckian_locus()
    place = np.array([4.0 * x, 6.0 * y]) / (12.0 * y - 2.0 * x + 3.0)
    start, way = locus[:-1], np.diff(locus, axis=0)
    share = np.clip(((place - start) * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
    away = np.linalg.norm(start + share[:, None] * way - place, axis=1)
    best = int(away.argmin())
    temperature = float(kelvin[best] * (kelvin[best + 1] / kelvin[best]) ** share[best])
    return temperature if away[best] <= _MAX_DUV and kelvin[0] < temperature < kelvin[-1] else None


@cache
def _planckian_locus() -> tuple[np.ndarray, np.ndarray]:
    """Temperatures (n,), 0.5 % apart, and CIE 1960 uv (n, 2) of black bodies."""
    kelvin = np.geomspace(*_KELVIN, 925)
    x, y, z = np.array([blackbody(float(k)).xyz() for k in kelvin]).T
    return kelvin, np.stack([4.0 * x, 6.0 * y], axis=-1) / (x + 15.0 * y + 3.0 * z)[:, None]


def _colour_science() -> ModuleType:
    import colour

    return colour


@cache
def _observer() -> MultiSpectralDistributions:
    """The colour matching functions from 400 to 700 nm, where the spectral locus turns one way only."""
    science = _colour_science()
    return science.MultiSpectralDistributions(cmf_xyz()[20:321], VISIBLE_NM[20:321])


@cache
def _white() -> np.ndarray:
    xyz = illuminant_table()["D65"] @ cmf_xyz()
    return xyz[:2] / xyz.sum()
