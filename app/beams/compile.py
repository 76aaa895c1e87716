"""Compiles the search for beams, some 20 s the first time, so that nobody waits for it at a first picture:

python -m spectrasplat.beams.compile
"""

from __future__ import annotations

import time

import numpy as np

from .convert import hulls_of
from .facets import FACET, SAMPLES, SOLID
from .find import take_stack
from .hand import FIRST
from .leaves import Store
from .lifetimes import lifetimes_of
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
    return time.perf_counter() - start


if __name__ == "__main__":
    print(f"beams: compiled in {warm_up():.1f} s")
