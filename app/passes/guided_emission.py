"""Emission guided to where light lands: cells of a light's domain from which no photon of its pilots came to a
receiver, because something hides the glass or its light misses every receiver, get few photons.

The few carry what the others would have: a point of a thinned cell is emitted with a known chance, by a Kronecker
sequence in its number, and its weight is one over that chance. So nothing that the pilots missed is lost; it is only
noisier, as after any roulette. Cells next to those whose light landed keep all their points: what a pilot found through
an opening narrower than its spacing, a neighbour might have found too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gpu.records import MASK_SIZE
from .emission_domain import EmissionDomain
from .lattice_slice import GOLDEN
from .pilot import Pilot

_REACH = 2
"""Cells round one whose light landed which keep all their points: a pilot has about one point a cell."""
_DARK_SHARE = 0.1
"""Photons of thinned cells, over those of the others."""
_LEAST_CHANCE = 1.0 / 16.0
"""Least probability of a point to be emitted: a photon of a missed cell carries at most 16 times another."""
_LEAST_GAIN = 1.25
"""Photons saved, at least, that are worth another program."""


def guided(domain: EmissionDomain, pilot: Pilot) -> EmissionDomain:
    """`domain` with the cells thinned none of whose light landed in `pilot`, which traced the whole of it; `domain`
    itself where that saves little or nothing landed."""
    bright = domain.mask & _grown(_cells_that_landed(pilot), _REACH)
    dark = domain.mask & ~bright
    kept, others = int(bright.sum()), int(dark.sum())
    if not kept or not others:
        return domain
    chance = float(np.clip(_DARK_SHARE * kept / others, _LEAST_CHANCE, 1.0))
    if kept + others < _LEAST_GAIN * (kept + chance * others):
        return domain
    return replace(domain, thinned=dark, thinned_chance=chance)


def _cells_that_landed(pilot: Pilot) -> np.ndarray:
    """Cells, bool (MASK_SIZE, MASK_SIZE), that hold a pilot's point some of whose light landed."""
    landed = np.unique(np.concatenate([r["photon_id"] for r in (pilot.whole, *pilot.spectral, *pilot.rim)]))
    points = landed.astype(np.uint64)
    u = points / pilot.lattice_count
    v = (points * np.uint64(GOLDEN) % np.uint64(1 << 32)) / 2.0**32
    cells = np.zeros((MASK_SIZE, MASK_SIZE), bool)
    column, row = (np.minimum((at * MASK_SIZE).astype(int), MASK_SIZE - 1) for at in (u, v))
    cells[row, column] = True
    return cells


def _grown(cells: np.ndarray, reach: int) -> np.ndarray:
    """With all cells at most `reach` columns and rows from one of `cells`."""
    grown = np.zeros_like(cells)
    wide = np.pad(cells, reach)
    rows, columns = cells.shape
    for row in range(2 * reach + 1):
        for column in range(2 * reach + 1):
            grown |= wide[row : row + rows, column : column + columns]
    return grown
