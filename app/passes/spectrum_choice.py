"""How the camera's pass samples the spectrum of a picture: in how many bands, or wavelength by wavelength.

A pilot renders a coarse grid of the picture's own pixels and compares the errors of each way: chance, which falls with
the samples, and what one band's middle decides for all of it, which does not."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass
from math import ceil, log2, pi

import numpy as np

from ..model.optics.colorimetry import VISIBLE_NM
from ..model.scene import SceneObject

MIN_SAMPLES = 8
"""With fewer, a pilot would cost more than it brings: one band."""
MAX_BANDS = 32
SAMPLES_A_BAND = 8
"""Samples that every band must keep, to smooth an outline."""
PHASE_A_BAND = 0.45
"""Change of a wave plate's phase over a band, rad: what interferes is straight between a band's three places."""
_COLUMNS = 50
"""Columns of a pilot's picture."""
SINGLE_SPEED = 4
"""Samples of one wavelength that take about as long as one of a band: three to eight, as the scene has it."""
_SURE = 2.0
"""Standard errors that a bias must be known to be there by."""
_MOST = 10.0
"""Most that one pixel counts, as a squared relative error: a few bright ones must not speak for the picture."""


@dataclass(frozen=True)
class Spectrum:
    """How samples see the spectrum."""

    bands: int = 1
    """Stretches the spectrum is cut into; a sample is of one of them, and a picture is whole after that many."""
    single: bool = False
    """Samples are of one random wavelength each, without columns."""

    @property
    def words(self) -> str:
        """Words for a summary."""
        if self.single:
            return "of one wavelength each"
        return "of the whole spectrum" if self.bands == 1 else f"in {self.bands} bands"

    def samples(self, budget: int) -> int:
        """Samples a pixel that a budget of so many of one band buys, whole turns of the bands: as many or a few more,
        and more of single wavelengths."""
        return SINGLE_SPEED * budget if self.single else -(-budget // self.bands) * self.bands


@dataclass(frozen=True)
class PilotRender:
    """One picture that the pilot needs."""

    spectrum: Spectrum
    seed: int = 1
    place: float = 0.5
    """In each pixel, across and down."""


Lookups = Generator[PilotRender, np.ndarray, Spectrum]


def bands_of_plates(objects: Iterable[SceneObject]) -> int:
    """How many bands wave plates ask for at least, all in a row: 1 where there are none."""
    retardance_nm = sum(abs(thing.material.retardance_nm) for thing in objects)
    phase_rad = 2.0 * pi * retardance_nm * (1.0 / VISIBLE_NM[0] - 1.0 / VISIBLE_NM[-1])
    return min(1 << max(ceil(log2(max(phase_rad / PHASE_A_BAND, 1.0))), 0), MAX_BANDS)


def choosing_spectrum(samples: int, may_be_single: bool, least: int = 1) -> Lookups:
    """Yields pictures it wants, is sent them (H, W, C), and returns what is best for `samples` samples a pixel, of
    `least` bands or more."""
    chosen = Spectrum(least)
    if samples < MIN_SAMPLES:
        return chosen
    coarse = (yield PilotRender(chosen, 1)), (yield PilotRender(chosen, 2))
    moved = yield PilotRender(chosen, 3, place=0.85)
    variance = 0.5 * difference(coarse[0], moved)
    # Twice as many bands, as long as that changes more than the noise that remains anyway.
    while True:
        finer = Spectrum(2 * chosen.bands)
        pictures = (yield PilotRender(finer, 4)), (yield PilotRender(finer, 5))
        bias = sure_bias(coarse, pictures)
        if bias <= variance / samples or finer.bands > MAX_BANDS or finer.bands * SAMPLES_A_BAND > samples:
            break
        chosen, coarse = finer, pictures
    if may_be_single and bias > variance / samples:
        alone = variance + difference(coarse[0], (yield PilotRender(Spectrum(single=True))))
        if alone / (SINGLE_SPEED * samples) < variance / samples + bias:
            return Spectrum(single=True)
    return chosen


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Mean squared relative difference of two pictures (H, W, C) of equal standing, chance included."""
    return float(np.minimum(_relative(a - b, a - b, (a, b)), _MOST).mean())


def sure_bias(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> float:
    """Squared relative difference of what two ways of sampling expect, from two independent pictures (H, W, C) each;
    chance cancels in the product of both differences. Less what it may be by accident, and never below 0."""
    product = np.clip(_relative(a[0] - b[0], a[1] - b[1], (*a, *b)), -_MOST, _MOST)
    error = product.std() / np.sqrt(product.size)
    return max(float(product.mean() - _SURE * error), 0.0)


def grid_of(width: int, height: int) -> tuple[int, int]:
    """Columns and rows of the pilot's pictures. llvmpipe compiles a program anew for sides that are powers of two."""
    columns = min(width, _COLUMNS)
    rows = max(1, round(columns * height / width))
    return columns, rows + (rows & (rows - 1) == 0)


def _relative(first: np.ndarray, second: np.ndarray, pictures: tuple[np.ndarray, ...]) -> np.ndarray:
    """Product of two differences (H, W, C) over the square of the pixel, (H, W); a tenth of the mean counts as dark."""
    size = sum(np.abs(picture).sum(axis=-1) for picture in pictures) / len(pictures)
    floor = 0.1 * np.mean(size) + 1e-30
    return (first * second).sum(axis=-1) * first.shape[-1] / (size**2 + floor**2)
