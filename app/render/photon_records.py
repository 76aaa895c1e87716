"""Where traced photons go besides the maps: nowhere, or wherever a kind of rendering keeps them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import moderngl

from ..gpu.reindex import Spans
from ..passes.trace import Batch
from .shown_spectra import PassTables, ShownSpectra


@dataclass(frozen=True)
class RoundOf:
    """Where a batch belongs."""

    number: int
    """Pass."""
    index: int
    count: int
    """Round `index` of `count`, each an even sub-lattice."""
    is_last_light: bool


class PhotonRecords(Protocol):
    """Where traced photons go besides the maps, with the spectral tables that belong to them."""

    keeps: bool
    """Every batch has to be counted before it is drawn."""
    takes_tails: bool
    """Photons that carry on weak beams are kept too. Whoever shows photons again has such beams play roulette."""

    @property
    def tables(self) -> PassTables:
        """Tables of the passes that run; `begin` comes first."""

    def begin(self, shown: ShownSpectra, spans: Spans, photons: int) -> None:
        """Passes of `photons` in bands of `spans` follow."""

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """A batch was traced; `photons` holds its records of `stride` bytes until the next."""

    def release(self) -> None:
        """Free everything."""


class NoRecords:
    """`PhotonRecords` for photons that are splatted and forgotten."""

    keeps = takes_tails = False

    def __init__(self) -> None:
        self._tables: PassTables | None = None

    @property
    def tables(self) -> PassTables:
        """Kept as long as the bands stay."""
        assert self._tables is not None, "begin() comes first"
        return self._tables

    def begin(self, shown: ShownSpectra, spans: Spans, photons: int) -> None:
        """See `PhotonRecords`."""
        if self._tables is None or spans != self._tables.spans:
            self.release()
            self._tables = PassTables(shown, spans)

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """Nothing is kept."""

    def release(self) -> None:
        """Free the tables."""
        if self._tables is not None:
            self._tables.forget()
        self._tables = None
