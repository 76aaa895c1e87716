"""Lattices over what beams leave to photons: where each ray starts, how it changes, what it carries.

The rays of a piece are what photons of the emission lattice would be after the same events, with the same derivatives;
only that the lattice covers the piece alone, and that its cells end at the piece's edges. A ray carries what its
part of the piece holds, so no light is lost at an edge, and its footprint is as wide as that part.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.optics.spectral_tables import CumulativeSpectrum
from . import piece_kernel
from .piece_cells import BODY, COLUMNS
from .piece_measure import PIECE, contents, room_for
from .polygons import BeamPieces

_WORD = float(1 << 32)
_CHUNK = 2048
"""Pieces that a thread takes at once."""
_ROOM = 1024
"""For cells of a piece and for rays, at first."""


@dataclass(frozen=True)
class PieceRays:
    """Rays on their way, float64; lengths in GPU units, the same unit as the pieces'."""

    piece: np.ndarray
    """int (n,), which of the pieces."""
    number: np.ndarray
    """int (n,), on its piece's lattice."""
    position: np.ndarray
    """(n, 3), on the surface left last."""
    direction: np.ndarray
    """(n, 3), unit."""
    dposition: np.ndarray
    """(n, 3, 3): by one spacing along the cell's two axes, and by x."""
    ddirection: np.ndarray
    """(n, 3, 3) likewise."""
    band: np.ndarray
    """(n, 3): x_lo, x_anchor, x_hi."""
    throughput: np.ndarray
    """(n, 3): there, weight of the light's spectral power."""
    flux_w: np.ndarray
    """(n,)."""

    def __len__(self) -> int:
        return len(self.piece)


class PieceLattice:
    """What pieces hold, and their lattices."""

    def __init__(self, pieces: BeamPieces, powers: Sequence[CumulativeSpectrum], measures: Sequence[float]) -> None:
        """`powers` of the lights (`SceneBuffers.light_power`); `measures`: what one unit of each light's q counts
        (scene unit² or sr)."""
        self.pieces = pieces
        starts = np.cumsum([0, *(len(power.x) for power in powers)])
        self._curves = [(power.x.astype(float), np.ascontiguousarray(power.values[:, 3])) for power in powers]
        curve_x = np.concatenate([x for x, _ in self._curves])
        curve_w = np.concatenate([w for _, w in self._curves])
        self._measures = np.array(measures, float)
        self._outlines = np.ascontiguousarray(pieces.edges, float), np.ascontiguousarray(pieces.hulls, float)
        self._records = np.zeros(len(pieces), PIECE)
        for name in ("light", "x_lo", "x_hi", "position", "direction", "weight", "key"):
            self._records[name] = getattr(pieces, name)
        for name, rows in (("edges", pieces.edge_start), ("hull", pieces.hull_start)):
            self._records[name] = np.stack([rows[:-1], rows[1:]], axis=1)

        def measure(first: int) -> None:
            part = self._records[first : first + _CHUNK]
            contents(part, *self._outlines, starts, curve_x, curve_w, *room_for(part))

        _in_threads(measure, 0, len(pieces))

    @property
    def flux_w(self) -> np.ndarray:
        """(M,), W of each piece over its band."""
        return self._records["content"] * self._measures[self.pieces.light]

    def portions(
        self, light: int, count: int, shift: tuple[int, int], key: int, most: int = 1 << 62
    ) -> Iterator[PieceRays]:
        """Lattices with about `count` points over all pieces of `light`, about `most` rays at once.

        Points are shared out by flux per unit of spectral power, and by the bands' widths: no colour is coarser than
        another, as on the emission lattices. Where all are tails, points go by the root of that (where it is dim, the
        weakest are all that there is), and `count` is met within the fourth root of two. Of pieces that would have less
        than one, some are drawn to represent all. `shift` of the lattices modulo 2³², and `key` of what is drawn: of
        one pass."""
        mine, points = self._drawn(light, count, key)
        boost = self._measures[light] / np.minimum(points, 1.0)
        points = np.maximum(points, 1.0)
        running = np.cumsum(points)

        def lay(start: int) -> np.ndarray:
            part = slice(start, start + _CHUNK)
            bodies, found, done = np.empty((_ROOM, BODY)), np.empty((_ROOM, COLUMNS)), np.zeros(3, np.int64)
            room = room_for(self._records)
            while True:
                piece_kernel.rays(
                    self._records,
                    mine[part],
                    points[part],
                    boost[part],
                    *self._outlines,
                    *self._curves[light],
                    shift[0] / _WORD,
                    shift[1] / _WORD,
                    key,
                    *room,
                    bodies,
                    found,
                    done,
                )
                if done[0] == len(mine[part]):
                    return found[: done[1]]
                if done[2]:
                    bodies, done[2] = np.empty((2 * len(bodies), BODY)), 0
                else:
                    found = np.concatenate([found, np.empty_like(found)])

        start = 0
        while start == 0 or start < len(mine):
            before = running[start - 1] if start else 0.0
            end = int(np.searchsorted(running, before + float(most)))
            end = max(end - end % _CHUNK, start + _CHUNK) if end < len(mine) else len(mine)
            yield _joined(_in_threads(lay, start, end))
            start = max(end, 1)

    def _drawn(self, light: int, count: int, key: int) -> tuple[np.ndarray, np.ndarray]:
        """Pieces that have rays, and how many points each would have by rights."""
        pieces, records = self.pieces, self._records
        mine = np.flatnonzero((pieces.light == light) & (records["content"] > 0.0))
        share = records["content"][mine] / records["power"][mine]
        share *= np.where(pieces.x_hi[mine] > pieces.x_lo[mine], pieces.x_hi[mine] - pieces.x_lo[mine], 1.0)
        if len(mine) and pieces.is_tail[mine].all():
            # What does not change from frame to frame shall keep its rays while other pieces do: each piece for itself,
            # by a density that takes steps.
            share = np.sqrt(share)
            points = share * 2.0 ** (np.round(2.0 * np.log2(count / share.sum())) / 2.0)
            kept = _units(pieces.key[mine], key) < points
            return mine[kept], points[kept]
        points = count * share / share.sum() if len(mine) else share
        # Systematic sampling: as many of the small ones as they have points together.
        running = np.cumsum(np.where(points < 1.0, points, 0.0)) + (key & 0xFFFFFFFF) / _WORD
        drawn = np.floor(running) > np.floor(np.concatenate([[(key & 0xFFFFFFFF) / _WORD], running[:-1]]))
        kept = drawn | (points >= 1.0)
        return mine[kept], points[kept]


def _units(keys: np.ndarray, key: int) -> np.ndarray:
    """Numbers in [0, 1) from hashes of paths, int64 (n,), and a pass's `key` [SplitMix64]."""
    state = keys.astype(np.uint64) + np.uint64((key * 0x9E3779B97F4A7C15) & 0xFFFFFFFFFFFFFFFF)
    for turn, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        state = (state ^ (state >> np.uint64(turn))) * np.uint64(factor)
    return ((state ^ (state >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


def _joined(parts: list[np.ndarray]) -> PieceRays:
    """Rays as the kernel writes them."""
    found = np.concatenate([np.zeros((0, COLUMNS)), *parts])
    derivatives = found[:, 6:24].reshape(len(found), 6, 3)
    return PieceRays(
        found[:, 31].astype(np.int64),
        found[:, 32].astype(np.int64),
        found[:, 0:3],
        found[:, 3:6],
        derivatives[:, [0, 1, 4]],
        derivatives[:, [2, 3, 5]],
        found[:, 24:27],
        found[:, 27:30],
        found[:, 30],
    )


def _in_threads(work: Callable[[int], Any], first: int, end: int) -> list[Any]:
    """What `work` returns for every first of `_CHUNK` rows up to `end`, in order."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(work, range(first, end, _CHUNK)))
