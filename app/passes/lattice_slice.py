"""Parts of the lattices from which lights emit photons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .emission_domain import EmissionDomain


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

    def split(self, points: int) -> tuple[LatticeSlice, LatticeSlice]:
        """So many points, and those behind them."""
        behind = replace(self, first=self.first + points * self.stride, points=self.points - points)
        return replace(self, points=points), behind


Part = tuple[LatticeSlice, EmissionDomain]
Parts = Sequence[Part]
"""Slices of the lattices of several lights, one of each."""


def every(n: int, first: int, parts: Parts) -> Parts:
    """Every n-th point of each from one on."""
    pieces = [(piece.every(n, first), domain) for piece, domain in parts]
    return [part for part in pieces if part[0].points]


def points_of(parts: Parts) -> int:
    """Of all of them together."""
    return sum(piece.points for piece, _ in parts)
