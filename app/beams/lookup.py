"""Which beams light one place of a flat receiver, and in which part of the spectrum: what picking and pulling ask.

For a point, not for a texel: every edge of a polygon gives the interval of the band in which the place lies inside of
it, and the place is lit in what all of them have in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygons import BeamPolygons


@dataclass(frozen=True)
class LitBy:
    """The k polygons that light a place, in their order."""

    polygon: np.ndarray
    """int64 (k,), index among the polygons."""
    x_lo: np.ndarray
    """float64 (k,), spectral coordinate from which on the place is lit."""
    x_hi: np.ndarray
    """float64 (k,), to where; equal to `x_lo` for an emission line."""
    density: np.ndarray
    """float64 (k,), flux per scene unit² there, per unit of the light's spectral power, in the middle of the
    interval; in a penumbra the part of it that arrives."""

    def __len__(self) -> int:
        return len(self.polygon)


def irradiance_at(polygons: BeamPolygons, receiver: int, point: np.ndarray) -> LitBy:
    """The polygons on `receiver` that light `point` (u, v), in the coordinates of its plane's frame."""
    place = np.asarray(point, np.float64)
    starts = polygons.hull_start[:-1]
    if not len(starts):
        return LitBy(np.zeros(0, np.int64), *np.zeros((3, 0)))
    inside = (np.minimum.reduceat(polygons.hulls, starts) <= place) & (
        np.maximum.reduceat(polygons.hulls, starts) >= place
    )
    chosen = np.flatnonzero((polygons.receiver == receiver) & inside.all(axis=1))
    if not len(chosen):
        return LitBy(chosen, *np.zeros((3, 0)))
    counts = np.diff(polygons.edge_start)[chosen].astype(np.int64)
    first = np.cumsum(counts) - counts
    rows = np.repeat(polygons.edge_start[chosen] - first, counts) + np.arange(counts.sum())
    is_line = (polygons.x_hi <= polygons.x_lo)[chosen]

    ends = polygons.edges[rows].reshape(-1, 2, 4)
    ends[:, 1] = np.where(np.repeat(is_line, counts)[:, None], ends[:, 0], ends[:, 1])
    distance, softness = ends[..., :2] @ place + ends[..., 2], np.abs(ends[..., 3])
    begins, stops = _inside(distance + softness)
    begin, stop = np.maximum.reduceat(begins, first), np.minimum.reduceat(stops, first)
    lit = stop > begin
    middle = np.clip(0.5 * (begin + stop), 0.0, 1.0)

    at = np.repeat(middle, counts)[:, None] * [-1.0, 1.0] + [1.0, 0.0]
    soft = np.sum(at * softness, axis=1)
    part = np.clip(0.5 + 0.5 * np.sum(at * distance, axis=1) / np.where(soft > 0.0, soft, 1.0), 0.0, 1.0)
    share = np.minimum.reduceat(np.where(soft > 0.0, part, 1.0), first)
    start, half, end = polygons.density[chosen].T
    t = np.where(is_line, 0.0, middle)
    density = start * (1.0 - t) * (1.0 - 2.0 * t) + half * 4.0 * t * (1.0 - t) + end * t * (2.0 * t - 1.0)
    density *= share * (1.0 + np.sum(polygons.slope[chosen] * (place - polygons.centre[chosen]), axis=1))
    lo, width = polygons.x_lo[chosen], np.where(is_line, 0.0, (polygons.x_hi - polygons.x_lo)[chosen])
    lit &= density > 0.0
    return LitBy(chosen[lit], (lo + begin * width)[lit], (lo + stop * width)[lit], density[lit])


def _inside(ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interval of [0, 1] in which the straight line from `ends[:, 0]` to `ends[:, 1]` is not negative; from 1 to 0
    where it is nowhere."""
    start, end = ends.T
    change = np.where(start == end, 1.0, start - end)
    crossing = np.where(start == end, 0.0, start / change)
    begin = np.where(start >= 0.0, 0.0, np.where(end > 0.0, crossing, 1.0))
    stop = np.where(end >= 0.0, 1.0, np.where(start > 0.0, crossing, 0.0))
    return begin, stop
