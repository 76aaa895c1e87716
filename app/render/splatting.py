"""Photon records into caustic maps, in parts so small that a caller that draws meanwhile keeps its frame rate."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

import moderngl

from ..gpu import shader
from ..gpu.context import Context
from ..gpu.dispatch_budget import DISPATCH_S, DispatchBudget
from ..passes.footprint import Photons, SplatSpectra
from ..passes.map_atlas import MapAtlas
from ..passes.splat import CHUNK, FLUSH_SHARE
from ..passes.splat_sums import ROWS, Accumulate
from .light_maps import LightMaps
from .shown_spectra import ShownSpectra, ShownTables

FLUSH_AHEAD = 0.9
"""Share of the photons after which a splat pass sums its maps up by itself."""
FIRST_SUMMED = 256
"""Rows of a map that are summed up at first, before it is known how long they take."""
FIRST_SPLATTED, SMALLEST_PART, LARGEST_PART = 1 << 18, 1 << 10, 1 << 22
"""Photons that a GPU splats at once: at first, and when it is known how long they take."""
SOFTWARE_PART = 1 << 12
"""What a software renderer splats between two pauses of a frame."""
UNSEEN_S = 0.25
"""What that may take where no frames are shown meanwhile: an eighth of what drivers end."""
SUMMING_SECONDS = 0.01
"""What one part of it may take."""


class Splatting:
    """Adds photons to maps as `shown` has them."""

    def __init__(self, context: Context, shown: ShownSpectra, in_frames: bool) -> None:
        """`in_frames`: it takes little of every frame."""
        self._context = context
        self._shown = shown
        queued = context.traits.work_is_queued
        in_parts = in_frames and not queued
        self._accumulate = Accumulate(context.ctx) if in_parts else None
        """Where maps of several textures are summed up one by one before they have to be, as all together take longer
        than a frame."""
        self._most = SOFTWARE_PART if in_parts else 1 << 30
        self.dispatch_seconds = DISPATCH_S if in_frames else UNSEEN_S
        """What a part may take where the device queues work, as the last ones have shown. Elsewhere parts stay, as sums
        in another order are rounded otherwise."""
        self._part: DispatchBudget | None = None
        if queued:
            self._part = DispatchBudget(FIRST_SPLATTED, SMALLEST_PART, LARGEST_PART)

    def steps(
        self,
        photons: moderngl.Buffer,
        count: int,
        maps: LightMaps,
        tables: ShownTables,
        smoothing: float,
        stride: int = 1,
        held: tuple[moderngl.Buffer, int] | None = None,
    ) -> Iterator[None]:
        """Add every `stride`-th photon record to `maps`, pausing after every part of them. `count`: of those that are
        added, at most where the device alone knows how many are `held` (`Photons`); `smoothing`: standard deviation of
        a footprint in lattice spacings."""
        atlas = maps.atlas
        if atlas.targets > 1 and atlas.pending + count >= FLUSH_AHEAD * min(
            CHUNK, atlas.size[0] * atlas.size[1] / FLUSH_SHARE
        ):
            yield from self.summing(atlas)
        all_photons = Photons(photons, count, stride=stride, held=held)
        spectra = SplatSpectra(self._shown.variables, tables.tables, self._shown.gains, tables.reindex)
        maps.splatter.footprints.make_room(count)  # at once, as parts become larger
        start = 0
        while start < count:
            part = min(self._part.units if self._part else self._most, count - start)
            with self._context.timers.timing("splat", partial(self._learn, part) if self._part else None):
                maps.splatter.run(all_photons.part(start, part), spectra, atlas, maps.receivers, smoothing)
            start += part
            if start < count:
                yield

    def _learn(self, photons: int, took: float) -> None:
        assert self._part is not None
        self._part.learn(photons, took, self.dispatch_seconds)

    def summing(self, atlas: MapAtlas) -> Iterator[None]:
        """Sum up what is pending with pauses, so that the maps can be shown at once; nothing where that is done at
        once."""
        if self._accumulate is None or not atlas.pending or not atlas.is_drawn:
            return
        atlas.ready_totals()
        height = atlas.size[1]
        dispatch_budget = DispatchBudget(FIRST_SUMMED, ROWS, -(-height // ROWS) * ROWS)
        for scratch, total in zip(atlas.scratch_textures, atlas.total_textures, strict=False):
            row = 0
            while row < height:
                started = time.perf_counter()
                rows = min(dispatch_budget.units, height - row)
                self._accumulate.run_rows(scratch, total, row, rows)
                self._context.finish()
                dispatch_budget.learn(rows, time.perf_counter() - started, SUMMING_SECONDS)
                row += rows
                yield
        atlas.pending = 0

    def release(self) -> None:
        """Free the program."""
        shader.release(self._accumulate)
