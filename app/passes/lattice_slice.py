"""Parts of the lattices from which lights emit photons, and the order in which a batch's points are emitted: along a
Morton curve over the domain.

Neighbours of a Kronecker lattice by number are far apart in space. Rays of one work group that start side by side meet
the same nodes and triangles and take the same branches, which spares a software renderer, which runs eight rays in
step, and a GPU's caches. Shifting the lattice only turns the torus it lies on, so one order serves every pass and every
shift; what a photon is does not depend on it, only its place in the buffer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .emission_domain import EmissionDomain

GOLDEN = 2654435769
"""2^32 / golden ratio: the lattice's second coordinate (shaders/lib/lattice.glsl)."""
_BITS = 12
"""Bits of each coordinate: 4096² cells are more than a batch has points."""
_LEAST_BLOCK, _MOST_BLOCK = 1 << 7, 1 << 12


@dataclass(frozen=True)
class Band:
    """One light's part of the spectral axis in a pass."""

    x_lo: float
    x_hi: float
    x_anchor: float
    power_w: float
    """Radiant power of the band per unit weight."""


@dataclass(frozen=True)
class LatticeSlice:
    """Part of a light's pass: `points` points of each of its sub-lattices (one a band and point on the light)."""

    light: int
    bands: tuple[Band, ...]
    lattice_count: int
    """Points of one whole sub-lattice."""
    first: int
    stride: int
    points: int
    """Lattice points first, first + stride, … of this slice."""
    shift: tuple[int, int]
    shift_light: tuple[int, int]
    shift_spectral: int
    seed: int
    """Key of roulette's draws."""
    light_points: int = 1
    light_place: tuple[float, float] = (0.5, 0.5)
    """Place on an extended light when `light_points` is 1."""
    weight: float = 1.0
    """Factor on every weight; a pass uses its photon count, so that passes add up by size."""
    beam_objects: tuple[int, ...] = ()
    """Objects whose light beams carry: photons that meet one of them first end there (`Features.beams`)."""
    lamp_step: float = 0.0
    """Sides of a footprint over the extent of what each point represents on a lamp (`Features.lamp_columns`);
    0: footprints know of none."""
    stands_for: int = 1
    """Points of the lattice, in a row, whose light each of this slice has."""
    row: tuple[float, float] = (0.0, 0.0)
    """Along it, as long as the standard deviation of their places over that of a footprint."""
    keeps_bands: bool = False
    """Bands stay whole past borders, and their columns are wanted as derivatives, whatever is believed of them where
    light is drawn."""

    @property
    def lattices(self) -> int:
        """Sub-lattices."""
        return len(self.bands) * self.light_points

    @property
    def count(self) -> int:
        """Rays emitted at most."""
        return self.points * self.lattices

    def every(self, n: int, first: int) -> LatticeSlice:
        """Every n-th point from one on."""
        points = len(range(first, self.points, n))
        return replace(self, first=self.first + first * self.stride, stride=n * self.stride, points=points)

    def row_of(self, n: int, first: int, length: int, smoothing: float) -> LatticeSlice:
        """One of the `n` even sub-lattices into which rows of neighbours fall, one after the other: the one in the
        middle of the `length` from the `first` on, which stands for all of these."""
        number, step = self._neighbour(n)
        turns = _wrapped(number * GOLDEN)
        middle = length - 1  # in halves of a step
        index, along, across = first * number + middle * number // 2, self.shift[0], self.shift[1]
        if middle % 2:
            along += number % 2 << 31
            across += turns // 2 - number // 2 * GOLDEN
            index, across = index + (along >> 32), across - (along >> 32) * GOLDEN
        piece = self.every(n, index % n)
        spread = math.sqrt((length**2 - 1) / 12.0) / smoothing
        return replace(
            piece,
            shift=(along % (1 << 32), across % (1 << 32)),
            stands_for=length,
            row=(spread * step[0], spread * step[1]),
        )

    def _neighbour(self, n: int) -> tuple[int, tuple[float, float]]:
        """How many points after another its neighbour is, with no factor in common with `n`, and the step to it."""
        root, before, number, best = math.sqrt(self.lattice_count), 1, 1, (1, (math.inf, 0.0))
        while number <= self.lattice_count:
            step = number / root, root * _wrapped(number * GOLDEN) / 2.0**32
            if math.gcd(number, n) == 1 and math.hypot(*step) < math.hypot(*best[1]):
                best = number, step
            before, number = number, before + number
        return best

    def split(self, points: int) -> tuple[LatticeSlice, LatticeSlice]:
        """So many points, and those behind them."""
        behind = replace(self, first=self.first + points * self.stride, points=self.points - points)
        return replace(self, points=points), behind


def _wrapped(turns: int) -> int:
    """Modulo 2³², about 0."""
    return (turns + (1 << 31)) % (1 << 32) - (1 << 31)


Part = tuple[LatticeSlice, EmissionDomain]
Parts = Sequence[Part]
"""Slices of the lattices of several lights, one of each."""


def every(n: int, first: int, parts: Parts) -> Parts:
    """Every n-th point of each from one on."""
    pieces = [(piece.every(n, first), domain) for piece, domain in parts]
    return [part for part in pieces if part[0].points]


def row_of(n: int, first: int, length: int, smoothing: float, parts: Parts) -> Parts:
    """`LatticeSlice.row_of` of each; `smoothing`: standard deviation of footprints, spacings."""
    pieces = [(piece.row_of(n, first, length, smoothing), domain) for piece, domain in parts]
    return [part for part in pieces if part[0].points]


def points_of(parts: Parts) -> int:
    """Points of all slices together."""
    return sum(piece.points for piece, _ in parts)


def morton_order(points: int, stride: int, lattice_count: int) -> np.ndarray:
    """Permutation uint32 (points,) of 0..points-1: j-th emitted is lattice point `first` + stride · order[j]."""
    index = np.arange(points, dtype=np.uint64) * np.uint64(stride)
    along = (index % np.uint64(lattice_count)) * np.uint64(1 << _BITS) // np.uint64(lattice_count)
    across = (index * np.uint64(GOLDEN) & np.uint64(0xFFFFFFFF)) >> np.uint64(32 - _BITS)
    key = _spread(along.astype(np.uint32)) | _spread(across.astype(np.uint32)) << np.uint32(1)
    return np.argsort(key, kind="stable").astype(np.uint32)


def block_of(points: int) -> int:
    """How many points that follow each other are put in order together: those of a work group then lie in a patch as
    wide as it is high."""
    return min(max(1 << round(0.5 * math.log2(32 * points)), _LEAST_BLOCK), _MOST_BLOCK)


def block_orders(stride: int) -> np.ndarray:
    """`morton_order` within blocks of every size, uint32; that of `block` points begins at its number. A block is a
    narrow strip of the lattice, so its points are ordered along it alone."""
    sizes = [1 << k for k in range(_LEAST_BLOCK.bit_length() - 1, _MOST_BLOCK.bit_length())]
    return np.concatenate([np.zeros(sizes[0], np.uint32), *(morton_order(size, stride, 1 << 32) for size in sizes)])


def _spread(value: np.ndarray) -> np.ndarray:
    """Bits of `value` (uint32, at most 16 of them) moved to the even places."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        value = (value | value << np.uint32(shift)) & np.uint32(mask)
    return value
