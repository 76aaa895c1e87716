"""From spectra to colours: observer, illuminant tables, RGB matrices, tinted absorption.

Everything visible lies on `VISIBLE_NM`, 380 to 780 nm at 1 nm, and every integral over
wavelength is the sum over its 401 values, as CIE 15 prescribes; light and camera thus agree
to the last digit. The tables are baked from CIE's by assets/spectra/bake.py.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...base.errors import UserError
from ...base.paths import assets_dir
from ..vectors import frozen

VISIBLE_NM = frozen(np.arange(380.0, 780.5, 1.0))

K_M = 683.002
"""Maximum luminous efficacy of radiation, lm/W (CIE 15; 683 lm/W at 540 THz)."""

_PRIMARIES_XY = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
"""Rec. ITU-R BT.709 (and sRGB) red, green, blue."""


@cache
def cmf_xyz() -> np.ndarray:
    """CIE 1931 2° colour matching functions x̄, ȳ, z̄: float64 (401, 3), read-only."""
    values = np.loadtxt(assets_dir() / "spectra" / "cie_1931_2deg_1nm.csv", delimiter=",")
    return frozen(values[:, 1:])


@cache
def illuminant_table() -> dict[str, np.ndarray]:
    """CIE name -> relative spectral power on `VISIBLE_NM`, float64 (401,), read-only.

    Tabulated ones are interpolated linearly between CIE's 5 nm steps, which is how CIE's own
    1 nm tables are made; A and E are computed from their definitions.
    """
    path = assets_dir() / "spectra" / "cie_illuminants_5nm.csv"
    with path.open(encoding="utf-8") as file:
        file.readline()
        names = file.readline().lstrip("# ").rstrip().split(",")[1:]
        values = np.loadtxt(file, delimiter=",")
    table = {
        name: frozen(np.interp(VISIBLE_NM, values[:, 0], column))
        for name, column in zip(names, values[:, 1:].T, strict=True)
    }
    # CIE 15:2004, eq. 3.1: a Planckian radiator of 2848 K with c2 = 1.435e-2 m K, 100 at 560 nm.
    hot = np.expm1(1.435e7 / (2848.0 * 560.0)) / np.expm1(1.435e7 / (2848.0 * VISIBLE_NM))
    table["A"] = frozen(100.0 * (560.0 / VISIBLE_NM) ** 5 * hot)
    table["E"] = frozen(np.full(401, 100.0))
    return table


@cache
def xyz_to_rgb709_matrix() -> np.ndarray:
    """Linear Rec.709 RGB = M @ XYZ, float64 (3, 3), read-only.

    White is D65 of our own table and observer, so that D65 gives R = G = B to rounding; the
    published sRGB matrix has four digits and a rounded white.
    """
    return frozen(np.linalg.inv(rgb709_to_xyz_matrix()))


@cache
def rgb709_to_xyz_matrix() -> np.ndarray:
    """XYZ = M @ linear Rec.709 RGB, float64 (3, 3), read-only; white has Y = 1."""
    white = illuminant_table()["D65"] @ cmf_xyz()
    x, y = _PRIMARIES_XY.T
    primaries = np.stack([x / y, np.ones(3), (1.0 - x - y) / y])
    return frozen(primaries * np.linalg.solve(primaries, white / white[1]))


def xyz_to_rgb709(xyz: np.ndarray) -> np.ndarray:
    """(..., 3) CIE XYZ to linear Rec.709 RGB; negatives are kept."""
    return np.asarray(xyz) @ xyz_to_rgb709_matrix().T


def rgb709_to_xyz(rgb: np.ndarray) -> np.ndarray:
    """(..., 3) linear Rec.709 RGB to CIE XYZ."""
    return np.asarray(rgb) @ rgb709_to_xyz_matrix().T


@cache
def daylight_per_lumen() -> np.ndarray:
    """Spectral density of D65 whose K_m Σ S ȳ is 1 (a luminance of 1 lm/(sr unit²), say): float64 (401,), read-only."""
    daylight = illuminant_table()["D65"]
    return frozen(daylight / (K_M * (daylight @ cmf_xyz()[:, 1])))


@cache
def rgb_basis() -> np.ndarray:
    """Reflectances of Rec.709 red, green and blue: float64 (401, 3) on `VISIBLE_NM`, in [0, 1], read-only.

    They sum to 1 at every wavelength, and `rgb_basis() @ rgb` under D65 has exactly the linear colour `rgb`, so
    `(rgb_basis() @ rgb) * daylight_per_lumen()` is the spectrum of a radiance `rgb`.

    I. Mallett, C. Yuksel: Spectral Primary Decomposition for Rendering with sRGB Reflectance, EGSR 2019; this table
    is our own solution of their problem, baked by assets/spectra/bake_rgb_basis.py.
    """
    values = np.loadtxt(assets_dir() / "spectra" / "rgb_basis_1nm.csv", delimiter=",")[:, 1:]
    # The file's fifteen digits leave the sum a hair from 1; greys are to be flat.
    return frozen(values / values.sum(axis=1, keepdims=True))


def mirror_reflectance(rgb: tuple[float, float, float], nm: np.ndarray) -> np.ndarray:
    """Spectral reflectance at wavelengths (N,) that gives D65 the linear Rec.709 colour `rgb`, float64 (N,)."""
    return np.interp(nm, VISIBLE_NM, rgb_basis() @ np.asarray(rgb, float))


def attenuation_from_colour(rgb: tuple[float, float, float], distance: float, where: str = "") -> np.ndarray:
    """Absorption coefficient α(λ) on `VISIBLE_NM`, float64 (401,), per unit of `distance`.

    D65 that has travelled `distance` has exactly the linear Rec.709 colour `rgb` (KHR_materials_volume's
    attenuationColor and attenuationDistance), the transmittance there being `rgb_basis() @ rgb`. Channels are clamped
    to 1e-4 … 1: black would need infinite absorption, above 1 is gain. A neutral colour gives a constant, white gives
    0. An infinite distance gives 0 as well.

    Raises `UserError` (opened by `where`) when the distance is not positive or the colour no number.
    """
    who = f"{where}: " if where else ""
    if not distance > 0.0:
        raise UserError(f"{who}attenuation distance is {distance:g}; give a length above 0")
    colour = np.asarray(rgb, dtype=np.float64)
    if colour.shape != (3,) or not np.all(np.isfinite(colour)) or np.any(colour < 0.0):
        raise UserError(f"{who}attenuation colour must be three numbers from 0 to 1, such as [0.8, 0.95, 0.9]")
    colour = np.clip(colour, 1e-4, 1.0)
    if np.all(colour == colour[0]):
        return np.full(401, -np.log(colour[0]) / distance)
    # Its rounding must not make light brighter.
    return -np.log(np.minimum(rgb_basis() @ colour, 1.0)) / distance
