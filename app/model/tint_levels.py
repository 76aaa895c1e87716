"""How much of the glass that tints most a photon has passed, in steps: the light's spectrum is known behind each.

Between three wavelengths of a band a photon's weight is straight, and a tint is not. Where its spectrum is cut into
bands for that (`tint_bands`), every band has photons of its own, and all footprints are wider. So photons remember how
far they have come through that glass, rounded to one of a few levels, up or down by a sequence over the lattice that
makes neighbours right in the mean; the light's tables hold its spectrum behind every level, exact over all wavelengths.
What is left halves over equal ways, so that light halfway between two levels is less than their mean: how much less,
each level knows (`halfway`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .optics.colorimetry import VISIBLE_NM, cmf_xyz
from .optics.spectral_tables import SpectralAxis
from .optics.spectrum import Spectrum
from .scene import Scene
from .scene_defaults import surroundings_of
from .tint_bands import TOLERANCE, cut_by_tints, ends_of, mean_chord, power_by_nm, tint_curves

LEVELS = 32
"""Steps, as many as a photon's flags hold. Rounding by turns between neighbours is right for all of the light, by power
and brightness (`halfway`); a wavelength whose α is another by δ is wrong by δ(δ + α)Δ²/8. What is left of a step
between neighbours is grain."""
DIAGONALS = 8
"""A way that is usual is at least the body's diagonal by this: the last level is then four diagonals away."""
_NOTHING = 1e-12
"""Share of the light that is none: what of it is brightness has no digits left."""
MAX_LIGHTS = 4
"""Every level of every light has tables of its own: more lights would take more memory than fewer photons save."""
MAX_BANDS = 4
"""The same of spectral bands that other tints need all the same."""


@dataclass(frozen=True)
class TintLevels:
    """The glass whose levels are kept, and the way that is usual in it."""

    coefficient: np.ndarray
    """float64 (401,), absorption on `VISIBLE_NM`, 1/scene unit."""
    usual: float
    """A way that is usual in the body, scene units."""

    @cached_property
    def rate(self) -> float:
        """1/scene unit: a way w lies at level LEVELS · rw / (1 + rw), so that levels are closest where most light is
        left. The absorption's root mean square by brightness; in glass so thin or clear that all ways would share
        the first levels, the reciprocal of the usual way."""
        luminous = cmf_xyz()[:, 1]
        return max(float(np.sqrt(self.coefficient**2 @ luminous / luminous.sum())), 1.0 / self.usual)

    def behind(self, spectrum: Spectrum, level: int) -> Spectrum:
        """What is left of a light at a level."""
        way = level / ((LEVELS - level) * self.rate)
        with np.errstate(under="ignore"):
            kept = np.exp(-self.coefficient * way)
        lines = tuple((nm, power * float(np.interp(nm, VISIBLE_NM, kept))) for nm, power in spectrum.lines)
        return Spectrum(spectrum.density * kept, lines)

    def halfway(self, spectrum: Spectrum) -> np.ndarray:
        """(LEVELS,): the odds for the next level of a photon in the middle between both, so that what is left of the
        light is, in the mean of both, what is left in the middle: of its power and its brightness, each as a share. A
        half where that is the same at both, and of the last level."""
        level = np.arange(2 * LEVELS - 1) / 2.0
        way = level / ((LEVELS - level) * self.rate)
        power = power_by_nm(spectrum)
        with np.errstate(under="ignore"):
            kept = np.exp(-self.coefficient * way[:, None])
            left = np.stack([kept @ power, kept @ (power * cmf_xyz()[:, 1])])
        odds = np.full(LEVELS, 0.5)
        here, middle, there = left[:, :-1:2], left[:, 1::2], left[:, 2::2]
        seen = (middle > _NOTHING * left[:, :1]).all(axis=0)
        shares = [np.where(seen, part / np.where(seen, middle, 1.0), 1.0).sum(axis=0) for part in (here, middle, there)]
        falls = shares[0] - shares[2] > 1e-9
        odds[:-1][falls] = ((shares[0] - shares[1]) / np.where(falls, shares[0] - shares[2], 1.0))[falls]
        return np.clip(odds, 0.02, 0.98)

    def all_behind(self, spectrum: Spectrum) -> list[Spectrum]:
        """What is left at each level."""
        return [self.behind(spectrum, level) for level in range(LEVELS)]


def tint_levels(scene: Scene) -> TintLevels | None:
    """Levels of the glass whose mean chord colours light most; None where none does, or where lights are too many or
    other tints need many bands."""
    if not 0 < len(scene.lights) <= MAX_LIGHTS:
        return None
    most, found = TOLERANCE, None
    for item in scene.objects:
        if item.material.absorption is not None and item.material.is_solid:
            coefficient, chord = item.material.absorption.coefficient, mean_chord(item)
            with np.errstate(under="ignore"):
                colours = float(np.ptp(np.exp(-coefficient * chord)))
            if colours > most:
                usual = max(chord, 2.0 * surroundings_of([item]).radius / DIAGONALS)
                most, found = colours, TintLevels(coefficient, usual)
    if found is None:
        return None
    others, axis = tint_curves(scene, found.coefficient), SpectralAxis.build([])
    spectra = [light.spectral_power for light in scene.lights]
    cuts = [cut_by_tints(ends_of(light, axis), 1, MAX_BANDS + 1, others, light, axis) for light in spectra]
    return found if all(len(edges) - 1 <= MAX_BANDS for edges in cuts) else None
