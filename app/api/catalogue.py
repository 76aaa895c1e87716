"""Glasses of the catalogue by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import UserError
from ..model.optics import catalogue
from ..model.optics.glass import Dispersion


@dataclass(frozen=True)
class Glass:
    """A transparent material: its refractive index over the wavelength."""

    name: str
    """The name that finds it and no other, such as "Schott N-SF11"."""
    n_d: float
    """Index at the helium line d, 587.56 nm."""
    V_d: float
    """Abbe number (n_d − 1)/(n_F − n_C): small is dispersive."""
    range_nm: tuple[float, float]
    """Where the data hold; beyond, the nearest value is used."""
    source: str
    """Where the data come from."""
    _dispersion: Dispersion

    @overload
    def index(self, wavelength_nm: float) -> float: ...
    @overload
    def index(self, wavelength_nm: ArrayLike) -> NDArray[np.float64]: ...
    def index(self, wavelength_nm: ArrayLike) -> float | NDArray[np.float64]:
        """Refractive index at a wavelength in nm, or at many: float64 of their shape."""
        found = self._dispersion.index(_wavelengths(wavelength_nm))
        return float(found) if np.ndim(found) == 0 else np.asarray(found, np.float64)

    @overload
    def slope(self, wavelength_nm: float) -> float: ...
    @overload
    def slope(self, wavelength_nm: ArrayLike) -> NDArray[np.float64]: ...
    def slope(self, wavelength_nm: ArrayLike) -> float | NDArray[np.float64]:
        """dn/dλ in 1/µm, at a wavelength in nm or at many."""
        found = self._dispersion.derivative(_wavelengths(wavelength_nm))
        return float(found) if np.ndim(found) == 0 else np.asarray(found, np.float64)


def glass(name: str) -> Glass:
    """The glass or material of the catalogue called `name`, without regard to case and blanks: "N-SF11", "hikari:F2",
    "water". Raises `UserError` with the nearest names."""
    if not isinstance(name, str):
        raise UserError(f"a glass is found by its name, not by a {type(name).__name__}: glass('N-BK7'), for example")
    entry = catalogue.find_entry(name)
    found = entry.dispersion
    return Glass(entry.qualified_name, found.n_d, found.V_d, entry.range_nm, entry.source, found)


def glasses(query: str = "") -> list[str]:
    """Names of the glasses whose maker or name contains every word of `query`, best first; of all where it is empty."""
    return [entry.qualified_name for entry in catalogue.search(query)]


def _wavelengths(values: ArrayLike) -> NDArray[np.float64]:
    try:
        nm = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"{values!r} is no wavelength: give nanometres, for example 587.56") from error
    if not (np.isfinite(nm) & (nm > 0.0)).all():
        raise UserError("a wavelength is not above 0: give nanometres, for example 587.56")
    return nm
