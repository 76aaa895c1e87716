"""CPU reference of the queue between two trace steps (shaders/queue_*.comp): whose children go on, and in which order.

In each chunk of 64 rays first the refracted children (odd slots), then the reflected ones (even slots), both in the
order of their parents; photons in the order of their parents.
"""

from __future__ import annotations

import numpy as np

CHUNK = 64


def children(what: np.ndarray) -> np.ndarray:
    """Slots of living children, uint32, from `Outcome.what` (N,) of rays 0 to N-1."""
    listed = []
    for first in range(0, len(what), CHUNK):
        parent = np.arange(first, min(first + CHUNK, len(what)))
        part = what[parent]
        listed += [2 * parent[(part & 2) != 0] + 1, 2 * parent[(part & 1) != 0]]
    return np.concatenate(listed).astype(np.uint32) if listed else np.zeros(0, np.uint32)


def photons(what: np.ndarray) -> np.ndarray:
    """Rays that left a photon, in order."""
    return np.flatnonzero(what & 4).astype(np.uint32)


def ended_flux(outcomes: np.ndarray, categories: int) -> np.ndarray:
    """float64 (categories,): where flux ended, from OUTCOME records; what starts there does not count."""
    ends = (outcomes["what"] & 8) == 0
    category = (outcomes["what"] >> 16) & 0xFF
    return np.bincount(category[ends], outcomes["flux_w"][ends].astype(np.float64), categories)[:categories]


def fallbacks(outcomes: np.ndarray, kinds: int) -> np.ndarray:
    """Counts of the fall-backs, by bit from 8."""
    return np.array([np.count_nonzero(outcomes["what"] & (1 << (8 + k))) for k in range(kinds)])
