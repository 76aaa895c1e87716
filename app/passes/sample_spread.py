"""How a launch's camera samples are spread over pixels and lookups: what it writes into CAMERA_PARAMETERS."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .pixel_lattice import LOOKS, is_in_strips
from .spectrum_choice import PilotRender

TAPS_PER_PIXEL = 1.2
"""Lookups of one sample; colours between two of them are not resolved, so the more samples there are, the closer they
are."""
PRIMARY_SAMPLES = LOOKS
"""Lookups of one sample at what is seen directly: outlines and textures there cost a tenth of what glass costs."""
PRIMARY_SAMPLES_UNTIL = 64
"""Samples of a pixel above which outlines and textures are smooth with one lookup each."""
SURVEY_TAKES, SURVEY_KEPT = 1, 2
"""What a sample's parameters say of it: it is one of a survey, or even pixels keep what a survey found."""
SURVEY_SAMPLES = 2
"""Samples of so many lookups each that show, before a still's first sample, which pixels are even."""
_SURVEY_GRID = (4, 2)
"""Columns and rows of a survey's lookups in a pixel: SURVEY_SAMPLES · LOOKS together."""


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
