"""CPU reference of shaders/lib/medium.glsl: which solid a ray is in, by sets instead of bits (Schmidt and Budge 2002).

Solids of the stack are known by rank: `order[rank]` is the object, a higher rank wins. NONE stands for air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from spectrasplat.gpu.records import NONE


@dataclass(frozen=True)
class MediumInterface:
    """What a surface separates, and what a ray is inside of behind it."""

    before: int
    after: int
    inside: frozenset[int]
    """Ranks of the stack's solids round the ray behind the surface."""
    object_after: int
    changes: bool


def medium(inside: frozenset[int], alone: int, order: Sequence[int]) -> int:
    """The object whose medium a ray is in: the highest of the stack round it, else the solid outside the stack."""
    return order[max(inside)] if inside else alone


def cross(inside: frozenset[int], alone: int, hit: int, entering: bool, order: Sequence[int]) -> MediumInterface:
    """A ray inside the ranks `inside` and the lone solid `alone` (or NONE) crosses a surface of the object `hit`."""
    if hit not in order:
        before, after = (NONE, hit) if entering else (hit, NONE)
        return MediumInterface(before, after, inside, after, True)
    rank = frozenset([order.index(hit)])
    outside, within = inside - rank, inside | rank
    near, far = (outside, within) if entering else (within, outside)
    before, after = medium(near, NONE, order), medium(far, NONE, order)
    return MediumInterface(before, after, far, alone, before != after)


def index_ratio_slope(n_i: float, n_t: float, dn_i: float, dn_t: float) -> float:
    """Derivative of n_i / n_t where the two indices change by dn_i and dn_t."""
    return dn_i / n_t - n_i * dn_t / n_t**2


def mask_of(inside: frozenset[int]) -> int:
    """One bit a rank."""
    return int(sum(1 << rank for rank in inside))


def linear_row(table: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A table's value at x in [0, 1], clamped, linear between its samples."""
    return np.interp(x, np.linspace(0.0, 1.0, len(table)), np.asarray(table, np.float64))
