"""Places of camera samples in their pixel."""

from __future__ import annotations

import numpy as np


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
    shift = offset * np.array([0.7548776662466927, 0.5698402909980532])
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
    golden = 0.6180339887498949
    rank = np.argsort(np.argsort((0.5 + index * golden) % 1.0))
    return ((np.column_stack([index, rank]) + 0.5) / samples + shift) % 1.0


LOOKS = 4
"""Lookups of a sample at what is seen directly."""


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
