"""Where photons landed: what maps are fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..gpu import shader

if TYPE_CHECKING:
    import moderngl

    from ..gpu.schema import Struct

CHOSEN = 512
"""Photons that say where all of them land."""
_GROUP = 64
_LANDED = np.dtype([("position", "f4", 3), ("flux_w", "f4"), ("receiver", "u4")])


@dataclass(frozen=True)
class Landings:
    """Pilot photons on one receiver: every place where some wavelength of theirs arrives."""

    positions: np.ndarray
    """float64 (n, 3), GPU space."""
    flux_w: np.ndarray
    """float64 (n,)."""


def by_receiver(photons: np.ndarray) -> dict[int, Landings]:
    """Landings of records that have a position, a flux and a receiver."""
    found = {}
    for receiver in np.unique(photons["receiver"]):
        mine = photons[photons["receiver"] == receiver]
        found[int(receiver)] = Landings(mine["position"].astype(float), mine["flux_w"].astype(float))
    return found


class ChosenLandings:
    """Photons that the device chooses evenly of all, and that are read when it has long done so."""

    def __init__(self, ctx: moderngl.Context, photon: Struct) -> None:
        self._ctx = ctx
        self._program = shader.compute(ctx, "light/landings.comp", {"WORKGROUP": _GROUP}, (photon,))
        self._landed = ctx.buffer(bytes(CHOSEN * _LANDED.itemsize))
        self._count = ctx.buffer(reserve=4)

    def choose(
        self, photons: moderngl.Buffer, count: int, held: tuple[moderngl.Buffer, int] | None, part: int, parts: int
    ) -> None:
        """Choose some of a batch's photons, of `count` or as many as `held` tells (`footprint.Photons`), to stand for
        one of so many equal parts of all."""
        if held is None:
            self._count.write(np.uint32(count).tobytes())
        (buffer, offset), first = held or (self._count, 0), CHOSEN * part // parts
        for binding, bound in enumerate((photons, self._landed, buffer)):
            bound.bind_to_storage_buffer(binding)
        chosen = CHOSEN * (part + 1) // parts - first
        for name, value in (("held_at", offset // 4), ("first", first), ("chosen", chosen)):
            self._program[name].value = value
        self._ctx.memory_barrier()
        self._program.run(-(-chosen // _GROUP))

    def read(self) -> dict[int, Landings]:
        """Where they landed, by receiver."""
        landed = np.frombuffer(self._landed.read(), _LANDED)
        return by_receiver(landed[landed["flux_w"] > 0.0])

    def release(self) -> None:
        """Free everything."""
        shader.release(self._program, self._landed, self._count)
