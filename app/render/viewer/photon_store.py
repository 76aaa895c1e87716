"""Photon records kept after they were splatted, so that an edit of what they show needs no tracing.

Slabs are kept by round: the rounds of a pass are even sub-lattices of the whole, so the first few of them
are the same picture, only coarser. A preview shows those while a slider is dragged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np

from ...gpu.packed_records import read_records
from ...gpu.schema import Struct
from ..photon_records import RoundOf


@dataclass(frozen=True)
class Slab:
    """One light's photons of one round."""

    buffer: moderngl.Buffer
    count: int
    round: int


class PhotonStore:
    """Owns the slabs of one pass, up to a number of bytes."""

    def __init__(self, ctx: moderngl.Context, capacity_bytes: int, in_one: bool = False) -> None:
        """`in_one`: slabs lie one after the other in one buffer, as many as a shader can be given, and are splatted at
        once."""
        self._ctx = ctx
        self._most_in_one = int(ctx.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]) if in_one else 0
        self._used = 0
        """Bytes of the slabs."""
        self.capacity_bytes = capacity_bytes
        self.slabs: list[Slab] = []
        self.rounds = 0
        """Rounds of which everything is here."""
        self.rounds_of_pass = 1
        self._stride = 1
        self._closed = False

    def clear(self) -> None:
        """Forget everything."""
        self.rounds = 0
        self.drop_unfinished()
        self.rounds, self.rounds_of_pass, self._closed = 0, 1, False

    def drop_unfinished(self) -> None:
        """Forget photons of the round that is not whole yet."""
        kept = [slab for slab in self.slabs if slab.round < self.rounds]
        for buffer in {slab.buffer for slab in self.slabs} - {slab.buffer for slab in kept}:
            buffer.release()
        self.slabs, self._used = kept, sum(slab.count for slab in kept) * self._stride

    def keep(self, photons: moderngl.Buffer, count: int, stride: int, of: RoundOf) -> None:
        """Copy `count` records of a batch, unless the store is full or the batch is not of the first pass."""
        if of.number > 0 or self._closed:
            return
        size = count * stride
        if self._used + size > self.capacity_bytes:
            # A round that is not whole is no sub-lattice: it is dropped.
            self.drop_unfinished()
            self._closed = True
            return
        if count:
            self._stride = stride
            buffer, at = self._room(size)
            self._ctx.copy_buffer(buffer, photons, size, write_offset=at)
            self.slabs.append(Slab(buffer, count, of.index))
            self._used += size
        self.rounds_of_pass = of.count
        if of.is_last_light:
            self.rounds = of.index + 1

    def _room(self, size: int) -> tuple[moderngl.Buffer, int]:
        """A buffer, and where in it there is room for so many bytes: behind the last slab, while it may grow."""
        last = self.slabs[-1].buffer if self.slabs else None
        at = sum(slab.count for slab in self.slabs if slab.buffer is last) * self._stride
        if last is None or at + size > self._most_in_one:
            return self._ctx.buffer(reserve=size), 0
        if at + size <= last.size:
            return last, at
        grown = self._ctx.buffer(reserve=min(2 * (at + size), self._most_in_one))
        self._ctx.copy_buffer(grown, last, at)
        self.slabs = [replace(slab, buffer=grown) if slab.buffer is last else slab for slab in self.slabs]
        last.release()
        return grown, at

    @property
    def bytes(self) -> int:
        """Device memory held."""
        return sum(buffer.size for buffer in {slab.buffer for slab in self.slabs})

    @property
    def photons(self) -> int:
        """Records of whole rounds."""
        return sum(slab.count for slab in self.slabs if slab.round < self.rounds)

    def some(self, photons: int) -> tuple[list[Slab], int, float]:
        """About so many records: slabs of whole rounds, of which every n-th record is taken where one round holds more,
        this n, and the share of the pass's photons that they are."""
        rounds = min(max(photons * self.rounds // max(self.photons, 1), 1), self.rounds)
        slabs = self.first_slabs(rounds)
        # Records follow a space-filling curve over the lattice: every n-th of them is nearly a lattice again.
        stride = max(1, sum(slab.count for slab in slabs) // photons)
        return slabs, stride, rounds / self.rounds_of_pass / stride

    def first_slabs(self, rounds: int) -> list[Slab]:
        """Slabs of the first so many rounds, one for all that lie in one buffer."""
        found: dict[moderngl.Buffer, Slab] = {}
        for slab in self.slabs:
            if slab.round < rounds:
                before = found.get(slab.buffer)
                found[slab.buffer] = slab if before is None else replace(slab, count=before.count + slab.count)
        return list(found.values())

    def read(self, limit: int, photon: Struct) -> np.ndarray:
        """About `limit` records, those of `some`."""
        slabs, every, _ = self.some(limit)
        found = [read_records(photon, slab.buffer, slab.count)[::every] for slab in slabs]
        return np.concatenate([np.zeros(0, photon.dtype), *found])
