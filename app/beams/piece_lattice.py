"""Lattices over what beams leave to photons: where each ray starts, how it changes, what it carries.

The rays of a piece are what photons of the emission lattice would be after the same events, with the same derivatives;
only that the lattice lies over the piece alone, and that its cells end at the piece's edges. A ray carries what its
part of the piece holds, so no light is lost at an edge, and its footprint is as wide as that part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..base.errors import UserError
from ..model.optics.spectral_tables import CumulativeSpectrum
from .polygons import BeamPieces

_WORD = float(1 << 32)


@dataclass(frozen=True)
class PieceRays:
    """Rays on their way, float64; lengths in GPU units, the same unit as the pieces'."""

    piece: np.ndarray
    """int (n,), which of the pieces."""
    number: np.ndarray
    """int (n,), on all the pieces' lattices."""
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
        (scene unit² or sr). Raises UserError without numba."""
        try:
            from . import piece_kernel, piece_measure
        except ImportError as error:
            raise UserError(f"following beams needs numba ({error}); install it with: pip install numba") from error
        self._kernel = piece_kernel
        self.pieces = pieces
        starts = np.cumsum([0, *(len(power.x) for power in powers)])
        self._curves = [(power.x.astype(float), np.ascontiguousarray(power.values[:, 3])) for power in powers]
        curve_x = np.concatenate([x for x, _ in self._curves])
        curve_w = np.concatenate([w for _, w in self._curves])
        self._measures = np.array(measures, float)
        self._edges = (
            pieces.edge_start.astype(np.int64),
            np.ascontiguousarray(pieces.edges, float),
            pieces.hull_start.astype(np.int64),
            np.ascontiguousarray(pieces.hulls, float),
        )
        self._bands = np.ascontiguousarray(pieces.x_lo, float), np.ascontiguousarray(pieces.x_hi, float)
        self._weight = np.ascontiguousarray(pieces.weight, float)
        self._content, self._power = np.zeros(len(pieces)), np.zeros(len(pieces))
        piece_measure.contents(
            *self._bands,
            self._weight,
            *self._edges,
            pieces.light.astype(np.int64),
            starts,
            curve_x,
            curve_w,
            self._content,
            self._power,
        )

    @property
    def flux_w(self) -> np.ndarray:
        """(M,), W of each piece over its band."""
        return self._content * self._measures[self.pieces.light]

    def rays(
        self, light: int, count: int, shift: tuple[int, int], key: int, first: int = 0, stride: int = 1
    ) -> PieceRays:
        """Sub-lattice `first` of `stride` of lattices with about `count` points over all pieces of `light`.

        Points are shared out by flux per unit of spectral power, and by the bands' widths: no colour is coarser than
        another, as on the emission lattices. Of pieces that would have less than one, some are drawn to stand for all.
        `shift` of the lattices modulo 2³², and `key` of what is drawn: of one pass."""
        pieces = self.pieces
        mine = np.flatnonzero((pieces.light == light) & (self._content > 0.0))
        share = self._content[mine] / self._power[mine]
        share *= np.where(pieces.x_hi[mine] > pieces.x_lo[mine], pieces.x_hi[mine] - pieces.x_lo[mine], 1.0)
        points = count * share / share.sum() if len(mine) else share
        # Systematic sampling: as many of the small ones as they have points together.
        running = np.cumsum(np.where(points < 1.0, points, 0.0)) + (key & 0xFFFFFFFF) / _WORD
        drawn = np.floor(running) > np.floor(np.concatenate([[(key & 0xFFFFFFFF) / _WORD], running[:-1]]))
        kept = drawn | (points >= 1.0)
        mine, points = mine[kept], points[kept]
        boost = self._measures[light] / np.minimum(points, 1.0)
        found, owner, number = self._kernel.rays(
            mine,
            np.maximum(points, 1.0),
            boost,
            *self._bands,
            np.ascontiguousarray(pieces.position, float),
            np.ascontiguousarray(pieces.direction, float),
            self._weight,
            *self._edges,
            self._content,
            *self._curves[light],
            shift[0] / _WORD,
            shift[1] / _WORD,
            key,
            first,
            stride,
        )
        n = len(found)
        columns = found[:, 6:24].reshape(n, 6, 3)
        return PieceRays(
            owner,
            number,
            found[:, 0:3],
            found[:, 3:6],
            columns[:, [0, 1, 4]],
            columns[:, [2, 3, 5]],
            found[:, 24:27],
            found[:, 27:30],
            found[:, 30],
        )


def pieces_where(pieces: BeamPieces, chosen: np.ndarray) -> BeamPieces:
    """The pieces where `chosen`, bool (M,), in order."""
    values = {}
    for field in fields(pieces):
        values[field.name] = getattr(pieces, field.name)
        if field.name in ("edges", "hulls"):
            starts = pieces.edge_start if field.name == "edges" else pieces.hull_start
            values[field.name] = values[field.name][np.repeat(chosen, np.diff(starts))]
        elif field.name.endswith("_start"):
            counts = np.diff(values[field.name])[chosen]
            values[field.name] = np.cumsum([0, *counts]).astype(np.int32)
        else:
            values[field.name] = values[field.name][chosen]
    return BeamPieces(**values)
