"""How dispersive glasses share a photon's spectral columns, and what the spectral tables say of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..features.facts import MAX_GROUPS, dispersive_glasses
from ..features.features import Features
from ..model.optics.glass import Dispersion
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene

SAMPLES = 1025
"""Equally spaced samples of every spectral table over x in [0, 1]; linear interpolation errs below 2e-7 in n."""


@dataclass(frozen=True)
class Groups:
    """How dispersive glasses share the spectral columns of a photon."""

    glasses: tuple[Dispersion, ...]
    """Distinct dispersive glasses."""
    group: tuple[int, ...]
    """Group of each glass."""
    count: int
    by_wavelength: bool
    """The single group's variable is the wavelength (the paper's λ-column)."""

    @staticmethod
    def of(scene: Scene, features: Features) -> Groups:
        glasses = tuple(dispersive_glasses(scene))
        count = features.spectral_groups
        group = tuple(min(i, count - 1) for i in range(len(glasses))) if count else ()
        return Groups(glasses, group, count, features.merged_groups and len(glasses) <= MAX_GROUPS)

    def variables(self, nm: np.ndarray, x: np.ndarray) -> np.ndarray:
        """var_g, float64 (count, n), at places (n,) of the spectrum: n of the glass, or a shared variable."""
        rows = []
        for g in range(self.count):
            members = [glass for glass, owner in zip(self.glasses, self.group, strict=True) if owner == g]
            if self.by_wavelength:
                rows.append(nm / 1000.0)
            elif len(members) == 1:
                rows.append(members[0].index(nm))
            else:
                rows.append(x)
        return np.array(rows).reshape(self.count, len(nm))


def samples_of(axis: SpectralAxis) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, nm, and x of a table's samples."""
    return axis.nm_of_samples(SAMPLES), np.linspace(0.0, 1.0, SAMPLES)


def index_slope(groups: Groups, glass: int | None, nm: np.ndarray, x: np.ndarray) -> np.ndarray:
    """dn/dvar, where `Groups.variables` is taken, of a glass (its number in `groups`) with respect to its group's
    variable: 1 where n is the variable, 0 without a group."""
    if glass is None or not groups.count:
        return np.zeros(len(nm))
    group = groups.group[glass]
    if not groups.by_wavelength and groups.group.count(group) == 1:
        return np.ones(len(nm))
    return np.gradient(groups.glasses[glass].index(nm), groups.variables(nm, x)[group], edge_order=2)
