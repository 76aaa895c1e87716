"""Photon records kept after they were splatted, so that an edit of what they show needs no tracing.

Slabs are kept by round: the rounds of a pass are even sub-lattices of the whole, so the first few of them
are the same picture, only coarser. A preview shows those while a slider is dragged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..photon_records import RoundOf

if TYPE_CHECKING:
    import moderngl


@dataclass(frozen=True)
class Slab:
    """One light's photons of one round."""

    buffer: moderngl.Buffer
    count: int
    round: int


class PhotonStore:
    """Owns the slabs of one pass, up to a number of bytes."""

    def __init__(self, ctx: moderngl.Context, capacity_bytes: int) -> None:
        self._ctx = ctx
        self.capacity_bytes = capacity_bytes
        self.slabs: list[Slab] = []
        self.rounds = 0
        """Rounds of which everything is here."""
        self.rounds_of_pass = 1
        self._closed = False

    def clear(self) -> None:
        """Forget everything."""
        for slab in self.slabs:
            slab.buffer.release()
        self.slabs = []
        self.rounds, self.rounds_of_pass, self._closed = 0, 1, False

    def drop_unfinished(self) -> None:
        """Forget photons of the round that is not whole yet."""
        for slab in [s for s in self.slabs if s.round >= self.rounds]:
            slab.buffer.release()
            self.slabs.remove(slab)

    def keep(self, photons: moderngl.Buffer, count: int, stride: int, of: RoundOf) -> None:
        """Copy `count` records of a batch, unless the store is full or the batch is not of the first pass."""
        if of.number > 0 or self._closed:
            return
        size = count * stride
        if self.bytes + size > self.capacity_bytes:
            # A round that is not whole is no sub-lattice: it is dropped.
            self.drop_unfinished()
            self._closed = True
            return
        if count:
            buffer = self._ctx.buffer(reserve=size)
            self._ctx.copy_buffer(buffer, photons, size)
            self.slabs.append(Slab(buffer, count, of.index))
        self.rounds_of_pass = of.count
        if of.is_last_light:
            self.rounds = of.index + 1

    @property
    def bytes(self) -> int:
        """Device memory held."""
        return sum(slab.buffer.size for slab in self.slabs)

    @property
    def photons(self) -> int:
        """Records of whole rounds."""
        return sum(slab.count for slab in self.slabs if slab.round < self.rounds)

    def first_rounds(self, photons: int) -> int:
        """How many rounds hold about so many photons: one at least, if there is one."""
        if not self.rounds:
            return 0
        return int(np.clip(photons * self.rounds // max(self.photons, 1), 1, self.rounds))

    def of_rounds(self, first: int, end: int) -> list[Slab]:
        """Slabs of rounds [first, end)."""
        return [slab for slab in self.slabs if first <= slab.round < end]

    def read(self, limit: int, dtype: np.dtype) -> np.ndarray:
        """About `limit` records at most, in whole rounds (one at least), as a numpy array of `dtype`."""
        slabs = self.of_rounds(0, self.first_rounds(limit))
        return np.frombuffer(b"".join(slab.buffer.read() for slab in slabs), dtype)
