"""How a launch's camera samples are spread over pixels and lookups: places in a pixel, and what is written into
CAMERA_PARAMETERS."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .spectrum_choice import PilotRender

TAPS_PER_PIXEL = 1.2
"""Lookups of one sample; colours between two of them are not resolved, so the more samples there are, the closer they
are."""
LOOKS = 4
"""Lookups of a sample at what is seen directly."""
PRIMARY_SAMPLES = LOOKS
"""Lookups of one sample at what is seen directly: outlines and textures there cost a tenth of what glass costs."""
PRIMARY_SAMPLES_UNTIL = 64
"""Samples of a pixel above which outlines and textures are smooth with one lookup each."""
SURVEY_TAKES, SURVEY_KEPT = 1, 2
"""What a sample's parameters say of it: it is one of a survey, or even pixels keep what a survey found."""
SURVEY_SAMPLES = 2
"""Samples of so many lookups each that show, before a still's first sample, which pixels are even."""
_GOLDEN = 0.6180339887498949
"""Steps of the most even sequence over [0, 1): the golden ratio's inverse."""
_PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])
"""Those over a square, inverse powers of the plastic number: Roberts' R2."""
_SURVEY_GRID = (4, 2)
"""Columns and rows of a survey's lookups in a pixel: SURVEY_SAMPLES · LOOKS together."""


def is_in_strips(samples: int, offset: int) -> bool:
    """Whether samples share the pixel in upright strips. Two or three squares of the same area do not fill it: what is
    small and bright, and letters, would count twice or not at all. With more, outlines want different heights."""
    return offset == 0 and samples in (2, 3)


def cells_of(samples: int) -> tuple[int, int]:
    """Columns and rows of equal cells that a pixel is cut into, each of which holds one place of `pixel_lattice`;
    (0, 0): there are none such."""
    power = samples.bit_length() - 1
    return (0, 0) if samples != 1 << power else (1 << (power + 1) // 2, 1 << power // 2)


def pixel_lattice(samples: int, offset: int) -> np.ndarray:
    """(samples, 2) places in a pixel, shifted as a whole from launch to launch.

    Every row and every column of the pixel cut into `samples` holds one sample, so that edges of any slant are filtered
    well, and the first launch's are centred on the pixel's middle, so that the picture does not move. Powers of two are
    a (0, m, 2)-net (Sobol's, with digital shifts), so that each sample has a cell of `cells_of` to itself; others a
    golden-ratio lattice."""
    if is_in_strips(samples, offset):
        return np.column_stack([(np.arange(samples) + 0.5) / samples, np.full(samples, 0.5)])
    shift = offset * _PLASTIC
    index = np.arange(samples)
    power = samples.bit_length() - 1
    if samples == 1 << power:
        # Sobol's second dimension of the reversed index, whose first is the index itself: samples of one band, every
        # second, fourth … of them, are a net as well.
        turned, direction = np.zeros(samples, np.int64), samples >> 1
        for bit in range(power):
            turned ^= (index >> (power - 1 - bit) & 1) * direction
            direction ^= direction >> 1
        fine = np.floor((shift + 0.5 / samples) % 1.0 * (1 << 30)).astype(np.int64)
        return ((np.column_stack([index, turned]) << (30 - power)) ^ fine) / float(1 << 30)
    rank = np.argsort(np.argsort((0.5 + index * _GOLDEN) % 1.0))
    return ((np.column_stack([index, rank]) + 0.5) / samples + shift) % 1.0


def looks_lattice(samples: int, offset: int) -> np.ndarray:
    """(samples, LOOKS, 2) places in a pixel at which the samples of `pixel_lattice` look up what is seen directly: one
    lattice all together, distributed so that each sample's are round it."""
    looks, places = pixel_lattice(LOOKS * samples, offset), pixel_lattice(samples, offset)
    in_strips = is_in_strips(samples, offset)
    columns, rows = cells_of(samples)
    if columns and not in_strips:
        # Each sample's cell holds as many looks, for these are a net as well: no search, and no import of scipy.
        of_sample, of_look = (np.floor(lattice * (columns, rows)) @ (rows, 1) for lattice in (places, looks))
        of_cell = np.argsort(of_look, kind="stable").reshape(samples, LOOKS)
        return looks[of_cell[of_sample.astype(int)]]
    away = looks - np.repeat(places, LOOKS, axis=0)[:, None]
    away = (away + 0.5) % 1.0 - 0.5
    if in_strips:
        away[..., 1] = 0.0
    from scipy.optimize import linear_sum_assignment

    _, chosen = linear_sum_assignment((away**2).sum(axis=-1))
    return looks[chosen].reshape(samples, LOOKS, 2)


def spread_samples(parameters: np.ndarray, samples: int, offset: int, bands: int) -> None:
    """Spread `samples` samples after `offset`, in so many bands of the spectrum."""
    parameters["sample_side"] = 1.0 / np.sqrt(samples + offset)
    if is_in_strips(samples, offset):
        parameters["pixel_width"], parameters["pixel_height"] = samples**-0.5, samples**0.5
    # Where samples are of one band each, fewer of them share a pixel in that band.
    parameters["band_side"] = min(1.0, np.sqrt(bands / (samples + offset)))
    parameters["taps_per_pixel"] = TAPS_PER_PIXEL * (samples + offset) ** 0.25


def looks_of(samples: int, wanted: int, single: bool) -> int:
    """Lookups of a sample at what is seen directly, where a pixel gets so many samples and `wanted` lookups in each."""
    return 1 if samples > PRIMARY_SAMPLES_UNTIL or single else wanted


def spread_alone(parameters: np.ndarray) -> None:
    """Spread one sample that represents all of its pixel."""
    parameters["sample_side"] = parameters["band_side"] = 1.0
    parameters["taps_per_pixel"] = TAPS_PER_PIXEL
    parameters["within_pixel"] = 0.5


def spread_pilot(parameters: np.ndarray, look: PilotRender, samples: int, pixel_side: float) -> None:
    """Spread samples of a pilot's coarse picture, in which a pixel of the picture that will take `samples` samples has
    this side."""
    parameters["dithered"] = parameters["counts_turns"] = 0
    parameters["sample_side"] = parameters["band_side"] = 1.0
    parameters["pixel_width"] = parameters["pixel_height"] = pixel_side
    parameters["taps_per_pixel"] = TAPS_PER_PIXEL * samples**0.25
    # Within the picture's pixel, which is a small part of the grid's.
    parameters["within_pixel"] = 0.5 + (look.place - 0.5) * pixel_side


def spread_survey(parameters: np.ndarray) -> Iterator[None]:
    """Spread the samples of a survey, one after the other."""
    parameters["survey"], parameters["survey_gain"] = SURVEY_TAKES, 1.0 / SURVEY_SAMPLES
    # The lookups tile the pixel: what they are averaged over is then all of it, and nothing twice.
    columns, rows = _SURVEY_GRID
    parameters["sample_side"], parameters["cells"] = SURVEY_SAMPLES**-0.5, 0.0
    parameters["pixel_width"], parameters["pixel_height"] = np.sqrt(rows / columns), np.sqrt(columns / rows)
    tiles = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    looks = ((tiles + 0.5) / _SURVEY_GRID).reshape(SURVEY_SAMPLES, -1, 4)
    for index, places in enumerate(looks):
        parameters["sample_index"] = index
        parameters["looks"] = places
        yield
