"""Places of samples and looks in a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.passes.pixel_lattice import LOOKS, cells_of, looks_lattice, pixel_lattice


def rows_and_columns(places: np.ndarray) -> tuple[list[int], list[int]]:
    cells = np.floor(places * len(places) + 1e-9).astype(int)
    return sorted(cells[:, 0]), sorted(cells[:, 1])


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 7, 16])
def test_all_looks_together_tell_outlines_apart(samples):
    """One in each of as many columns and rows as there are: an upright or level edge is known to one of them. (Four
    about each of sixteen samples, all turned alike, fell on seventeen columns.)"""
    looks = looks_lattice(samples, 0)
    assert looks.shape == (samples, LOOKS, 2)
    columns, rows = rows_and_columns(looks.reshape(-1, 2))
    assert columns == rows == list(range(LOOKS * samples))


@pytest.mark.parametrize("offset", [0, 16, 48])
def test_looks_lie_about_their_sample(offset):
    """So that where all of them meet glass, the sample does."""
    off = looks_lattice(16, offset) - pixel_lattice(16, offset)[:, None]
    off = (off + 0.5) % 1.0 - 0.5
    assert np.linalg.norm(off, axis=-1).max() < 0.3
    assert np.linalg.norm(off.mean(axis=1), axis=-1).max() < 0.2


@pytest.mark.parametrize("samples", [4, 8, 16, 32, 64])
@pytest.mark.parametrize("offset", [0, 5, 64])
def test_powers_of_two_have_a_cell_each_and_so_have_their_bands(samples: int, offset: int) -> None:
    """All samples, and every second or fourth of them, which see one band of the spectrum. (Hammersley's order puts
    each band's samples into a quarter of the pixel.)"""
    places = pixel_lattice(samples, offset)
    for bands in (1, 2, 4):
        for first in range(bands):
            of_band = places[first::bands]
            columns, rows = cells_of(len(of_band))
            cells = np.floor(of_band * (columns, rows)).astype(int)
            assert len(np.unique(cells @ (1, 1000))) == len(of_band), (bands, first)
