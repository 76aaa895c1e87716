"""Photon records into caustic maps, in parts so small that a caller that draws meanwhile keeps its frame rate."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from ..gpu import shader
from ..gpu.dispatch_budget import DISPATCH_S, DispatchBudget
from ..passes.accumulate import ROWS, Accumulate
from ..passes.footprint import Photons, SplatSpectra
from ..passes.splat import CHUNK, FLUSH_SHARE
from .light_plan import SMALLEST_BATCH

if TYPE_CHECKING:
    import moderngl

    from ..gpu.context import Context
    from ..passes.map_atlas import MapAtlas
    from .light_maps import LightMaps
    from .shown_spectra import ShownSpectra, ShownTables

FLUSH_AHEAD = 0.9
"""Share of the photons after which a splat pass sums its maps up by itself."""
FIRST_SUMMED = 256
"""Rows of a map that are summed up at first, before it is known how long they take."""
FIRST_SPLATTED, SMALLEST_PART, LARGEST_PART = 1 << 18, 1 << 10, 1 << 22
"""Photons that a GPU splats at once: at first, and when it is known how long they take."""
UNSEEN_S = 0.25
"""What that may take where no frames are shown meanwhile: an eighth of what drivers end."""
SUMMING_SECONDS = 0.01
"""What one part of it may take."""


@dataclass(frozen=True)
class Pace:
    """How a light pass cuts its work."""

    waits: bool
    """Wait for the device at every pause: times are then what the work took, and a budget is kept."""
    splat_part: int = 1 << 30
    """Photons splatted without a pause."""
    sums_in_parts: bool = False
    """Maps of several textures are summed up one by one before it has to be, as all together take longer than a
    frame."""
    min_batch: int = SMALLEST_BATCH
    """Rays in flight, at least. With fewer than `SMALLEST_BATCH` the plan depends on the batch."""
    searches_in_thread: bool = False
    """Beams are searched for in a thread of their own."""

    @staticmethod
    def of(context: Context) -> Pace:
        """For a rendering that is not shown meanwhile."""
        return Pace(not context.traits.work_is_queued)

    @staticmethod
    def within_frames(context: Context) -> Pace:
        """For one that takes little of every frame; extended lights make do with as many points."""
        queued = context.traits.work_is_queued
        return Pace(True, context.traits.viewer_splat_photons, not queued, 1024, True)


class Splatting:
    """Adds photons to maps as `shown` has them; `seconds` counts what it took."""

    def __init__(self, context: Context, shown: ShownSpectra, pace: Pace) -> None:
        self._context = context
        self._shown = shown
        self._pace = pace
        self._accumulate = Accumulate(context.ctx) if pace.sums_in_parts else None
        self.seconds = 0.0
        self.dispatch_seconds = DISPATCH_S if pace.waits else UNSEEN_S
        """What a part may take where the device queues work, as the last ones have shown. Elsewhere parts stay, as sums
        in another order are rounded otherwise."""
        self._part: DispatchBudget | None = None
        if context.traits.work_is_queued:
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
        atlas, part_max = maps.atlas, self._pace.splat_part
        if atlas.targets > 1 and atlas.pending + count >= FLUSH_AHEAD * min(
            CHUNK, atlas.size[0] * atlas.size[1] / FLUSH_SHARE
        ):
            yield from self.summing(atlas)
        all_photons = Photons(photons, count, stride=stride, held=held)
        spectra = SplatSpectra(self._shown.variables, tables.tables, self._shown.gains, tables.reindex)
        start = 0
        while start < count:
            started = time.perf_counter()
            part = min(part_max, self._part.units if self._part else count, count - start)
            with self._context.timers.timing("splat", partial(self._learn, part) if self._part else None):
                maps.splatter.run(all_photons.part(start, part), spectra, atlas, maps.receivers, smoothing)
            if self._pace.waits:
                self._context.finish()
            self.seconds += time.perf_counter() - started
            start += part
            if start < count:
                yield

    def _learn(self, photons: int, took: float) -> None:
        assert self._part is not None
        self._part.learn(photons, took, self.dispatch_seconds)

    def summing(self, atlas: MapAtlas) -> Iterator[None]:
        """Sum up what is pending with pauses, so that the maps can be shown at once; nothing where the pace knows no
        parts."""
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
                if self._pace.waits:
                    self._context.finish()
                took = time.perf_counter() - started
                dispatch_budget.learn(rows, took, SUMMING_SECONDS)
                self.seconds += took
                row += rows
                yield
        atlas.pending = 0

    def release(self) -> None:
        """Free the program."""
        shader.release(self._accumulate)
