"""Compiles the search for beams, some 40 s the first time, so that nobody waits for it at a first picture:

python -m spectrasplat.beams.compile
"""

from __future__ import annotations

import time

import numpy as np

from ..model.optics.spectral_tables import CumulativeSpectrum
from .convert import hulls_of
from .current import FIRST
from .facets import FACET, SAMPLES, SOLID
from .find import take_stack
from .leaves import Store
from .lifetimes import lifetimes_of
from .piece_lattice import PieceLattice
from .polygons import BeamPieces
from .rays import SOURCE, intensities
from .search import WORK, flux_in, may_touch, power_of
from .steps import run


def warm_up() -> float:
    """Compile everything, or load it where that was done before; returns the seconds that took."""
    start = time.perf_counter()
    stack, work, store = take_stack(), np.zeros(1, WORK), Store()
    tables, obstacles = np.zeros((2, SAMPLES)), np.zeros((0, 2, 3))
    work["top"] = FIRST
    sources = np.zeros(1, SOURCE)
    args = np.zeros(1, FACET), np.zeros(1, SOLID), tables, sources
    run(stack, *args, obstacles, work, store.leaf, store.edge, store.corner)
    power_of(stack, FIRST, tables, work)
    flux_in(stack, FIRST, tables, work)
    may_touch(stack, FIRST, 1.0, obstacles, work)
    intensities(sources, np.zeros((0, 2)), np.zeros(0), *np.zeros((2, 3, 3)))
    ends, corner = np.zeros(1, np.int64), np.zeros((0, 2))
    hulls_of(corner, ends, np.zeros(0), corner, corner, ends.copy(), corner)
    lifetimes_of(np.zeros((0, 8)), ends, corner, ends)
    lattice = PieceLattice(_square(), [CumulativeSpectrum(np.array([0.0, 1.0]), np.eye(2, 4))], [1.0])
    next(lattice.portions(0, 1, (0, 0), 0))
    return time.perf_counter() - start


def _square() -> BeamPieces:
    """What photons carry on, as small as can be."""
    one, corner = np.zeros(1, np.int32), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ray, starts, edges = np.ones((1, 3, 3, 3)), np.array([0, 3], np.int32), np.zeros((3, 6))
    floats = np.zeros(1), np.ones(1), np.zeros((1, 2)), ray, ray, np.ones((1, 3))
    facet = one, one, one > 0, one.astype(np.uint64), one.astype(np.int64), one > 0, one, np.zeros((1, 3, 6))
    return BeamPieces(one, one, one, *floats, *facet, starts, edges, starts, corner)


if __name__ == "__main__":
    print(f"beams: compiled in {warm_up():.1f} s")
