"""Metals, by their complex refractive indices n + ik: measured values, linear between them."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...base.errors import UserError, suggestion
from ...base.paths import assets_dir


@dataclass(frozen=True)
class Metal:
    """n + ik of one metal; fields go in waves as exp(−iωt), so that k > 0 absorbs."""

    name: str
    nm: tuple[float, ...]
    n: tuple[float, ...]
    k: tuple[float, ...]

    def index(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """n + ik, complex128 of the shape of `wavelength_nm`."""
        at = np.asarray(wavelength_nm, float)
        return np.asarray(np.interp(at, self.nm, self.n) + 1j * np.interp(at, self.nm, self.k))


@lru_cache(maxsize=1)
def metals() -> dict[str, Metal]:
    """All by name."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    with (assets_dir() / "spectra" / "metals.csv").open(encoding="utf-8") as file:
        for name, *numbers in csv.reader(line for line in file if not line.startswith("#")):
            rows.setdefault(name, []).append(tuple(map(float, numbers)))
    return {name: Metal(name, *zip(*of, strict=True)) for name, of in rows.items()}


def find_metal(name: str, where: str) -> Metal:
    """The metal of this name. Raises `UserError` that begins with `where`."""
    found = metals().get(name)
    if found is None:
        known = ", ".join(metals())
        raise UserError(f"{where}: '{name}' is no metal that is known{suggestion(name, metals()) or ''}; use {known}")
    return found
