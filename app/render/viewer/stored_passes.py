"""The photons of a live rendering's passes, kept to be shown again through edited glass."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from ...gpu import shader
from ...gpu.reindex import Spans
from ...passes.trace import Batch
from ..photon_records import RoundOf
from ..shown_spectra import PassTables, ShownSpectra
from .photon_store import PhotonStore


@dataclass
class StoredPass:
    """The stored photons of one pass, with the spectral tables of its plan."""

    store: PhotonStore
    tables: PassTables
    pass_photons: int
    """Photons requested of the pass: the weight that its records carry."""

    def release(self) -> None:
        """Free photons and tables."""
        self.store.clear()
        self.tables.forget()


class StoredPasses:
    """`PhotonRecords` of the pass that runs and of the one before it.

    A pass that has only begun holds fewer photons than the one before it: until it has as many, the older ones stay."""

    keeps, takes_tails = True, False

    def __init__(self, ctx: moderngl.Context, capacity_bytes: int, in_one: bool = False) -> None:
        """`in_one`: see `PhotonStore`."""
        self._ctx, self._in_one = ctx, in_one
        self._capacity_bytes = capacity_bytes
        self.running: StoredPass | None = None
        self._older: StoredPass | None = None

    @property
    def tables(self) -> PassTables:
        """Tables of the pass that runs."""
        assert self.running is not None, "begin() comes first"
        return self.running.tables

    def begin(self, shown: ShownSpectra, spans: Spans, photons: int) -> None:
        """See `PhotonRecords`; the photons of the pass before stay until there are as many new ones."""
        fullest = self.fullest
        for kept in self._passes:
            if kept is not fullest:
                kept.release()
        self._older = fullest
        self.running = StoredPass(
            PhotonStore(self._ctx, self._capacity_bytes, self._in_one), PassTables(shown, spans), photons
        )

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """Store the batch."""
        assert self.running is not None
        self.running.store.keep(photons, batch.photons, stride, of)
        if self._older is not None and self.running.store.photons >= self._older.store.photons:
            self._older.release()
            self._older = None

    @property
    def fullest(self) -> StoredPass | None:
        """The stored photons that show most."""
        return max(self._passes, key=lambda s: s.store.photons, default=None)

    @property
    def _passes(self) -> list[StoredPass]:
        return [kept for kept in (self._older, self.running) if kept is not None]

    def forget_tables(self) -> None:
        """Another glass or light is shown from now on."""
        for kept in self._passes:
            kept.tables.outdate()

    @property
    def bytes(self) -> int:
        """Device memory of the photons."""
        return sum(kept.store.bytes for kept in self._passes)

    def release(self) -> None:
        """Free everything."""
        shader.release(*self._passes)
        self.running = self._older = None
