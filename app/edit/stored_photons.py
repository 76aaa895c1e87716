"""Photons that the viewer keeps, in world space: what landed where, from where, and where other colours of it land."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..model.optics.glass import LINE_D_NM
from ..model.scene import Scene

_BY_PHOTON = ("position", "dposition_dn", "n_anchor", "flux_w", "source", "receiver", "band_nm", "light")


@dataclass(frozen=True)
class StoredPhotons:
    """What landed where, from where, and where other colours of it land; the first axis of every array counts photons,
    places are in the scene's units, and objects and lights are numbers in the scene's order (instances one by one)."""

    position: np.ndarray
    """(n, 3) world, where the anchor wavelength lands."""
    dposition_dn: np.ndarray
    """(n, groups, 3) world, per unit of each spectral group's variable (the index of its glass)."""
    n_anchor: np.ndarray
    """(n, groups): the variables at the anchor wavelength, by the glass that the photons were traced through."""
    flux_w: np.ndarray
    """(n,) W; as the viewer stores them, times the photons of their pass."""
    source: np.ndarray
    """(n,) scene object that the photon met first; -1 for none."""
    receiver: np.ndarray
    """(n,) scene object it landed on."""
    band_nm: np.ndarray
    """(n, 2) first and last wavelength."""
    light: np.ndarray
    """(n,) index of the light."""
    variables: tuple[Callable[[np.ndarray], np.ndarray], ...]
    """Each group's variable over the wavelength in nm, by the glass that is shown (`Dispersion.index`)."""
    group_of_object: Mapping[int, int]
    """Spectral group of every dispersive glass object."""

    def chosen(self, index: np.ndarray) -> StoredPhotons:
        """Some of the photons."""
        return replace(self, **{name: getattr(self, name)[index] for name in _BY_PHOTON})

    def landing(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Where each photon's light of some wavelengths (w,) lands: (n, w, 3) world."""
        places = np.repeat(self.position[:, None], len(wavelength_nm), axis=1)
        for g, variable in enumerate(self.variables):
            shift = variable(wavelength_nm)[None] - self.n_anchor[:, g, None]
            places += self.dposition_dn[:, g, None] * shift[..., None]
        return places

    def displacement(self, wavelength_nm: float, group: int | None) -> np.ndarray:
        """From the d line's landing point to that of a wavelength, by one group's glass or by all: (n, 3)."""
        groups = range(len(self.variables)) if group is None else [group]
        line = np.array([wavelength_nm, LINE_D_NM])
        return sum(
            (self.dposition_dn[:, g] * float(np.subtract(*self.variables[g](line))) for g in groups),
            np.zeros_like(self.position),
        )


def index_in(scene: Scene, shown: Scene, index: int) -> int | None:
    """Index in `scene` of what is object `index` of the `shown` scene; None for one that is no longer there."""
    if not 0 <= index < len(shown.objects):
        return None
    thing, objects = shown.objects[index], scene.objects
    if len(objects) == len(shown.objects):  # nothing was added or taken away: it may have been edited or renamed
        return index
    by_identity = next((i for i, other in enumerate(objects) if other is thing), None)
    if by_identity is not None:
        return by_identity
    return next((i for i, other in enumerate(objects) if other.name == thing.name), None)


def photons_in(scene: Scene, shown: Scene, photons: StoredPhotons) -> StoredPhotons:
    """Photons of the `shown` scene with the numbers that its objects have in `scene`; -1 for what is gone."""
    found = [index_in(scene, shown, i) for i in range(len(shown.objects))]
    there = np.array([-1 if i is None else i for i in found] + [-1])  # -1, no object, stays -1
    return replace(
        photons,
        source=there[photons.source],
        receiver=there[photons.receiver],
        group_of_object={i: g for k, g in photons.group_of_object.items() if (i := found[k]) is not None},
    )
