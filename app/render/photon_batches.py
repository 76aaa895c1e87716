"""Rays of a batch through the scene, and what landed into maps: traced, kept, splatted and counted, with pauses."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np

from ..base.memory import available_bytes
from ..features.features import Features
from ..gpu.context import Context
from ..gpu.dispatch_budget import DISPATCH_S, DispatchBudget
from ..passes.lattice_slice import Parts, every, points_of
from ..passes.map_atlas import MapAtlas
from ..passes.trace import SPLIT_THRESHOLD, Batch, Sent, TracePass, queue_class
from .light_maps import LightMaps
from .light_plan import SMALLEST_BATCH, LightPlan
from .light_stats import LightStats
from .photon_records import PhotonRecords, RoundOf
from .shown_spectra import ShownSpectra, ShownTables
from .splatting import Splatting

MIN_RAYS = 1 << 10
"""Rays of a batch that are not divided further, however slow the device is."""
LONGEST_SHARE = 0.5
"""What the longest dispatch takes of a batch's time, where rays are followed for several events in one."""
Keep = Callable[["moderngl.Buffer", int, int, RoundOf], None]
"""Takes records: (their buffer, how many, bytes of one, where they belong)."""


@dataclass(frozen=True)
class Deposit:
    """Where photons go, and how they are drawn there."""

    maps: LightMaps
    stats: LightStats
    smoothing: float
    """Standard deviation of a footprint in lattice spacings."""


class PhotonBatches:
    """Owns what traces, keeps and splats photons; `trace` and `records` become its own."""

    def __init__(
        self, context: Context, trace: TracePass, shown: ShownSpectra, records: PhotonRecords, in_frames: bool
    ) -> None:
        """`in_frames`: it takes little of every frame, and waits for the device at every pause."""
        self.trace = trace
        self.records = records
        self.splatting = Splatting(context, shown, in_frames)
        self.budget = DispatchBudget(trace.batch, MIN_RAYS, trace.batch)
        """Rays of the next batch."""
        self.dispatch_seconds = DISPATCH_S
        """What the first event of a batch may take where the device queues work: smaller batches follow one that took
        longer."""
        self.portion = trace.batch
        """Rays of a batch at most: what a frame that is shown meanwhile has time for."""
        self._context = context
        self._waits = in_frames or not context.traits.work_is_queued
        self._traced_once = False
        """The first event of all includes compiling."""
        self._is_timed = False
        """A batch has been waited for, and held by the queue."""
        self._sent: list[tuple[Sent, Parts, RoundOf, Deposit]] = []
        """Batches whose photons are drawn and not counted yet."""
        self._held: dict[int, int] = {}
        """Rays of a batch, by its first light, whose paths branch so often that the queues hold no more."""

    @property
    def tables(self) -> ShownTables:
        """The spectral tables of the plan that was begun."""
        return self.records.tables.full

    def begin(self) -> None:
        """Forget what another rendering's photons needed: the same passes are divided in the same way again."""
        self._held.clear()
        self._sent.clear()

    def lattice(self, parts: Parts, of: RoundOf, into: Deposit) -> Iterator[None]:
        """Trace `parts`, keep, splat and count what landed, in slices that the device has shown to manage in time and
        whose paths the queues hold."""
        while parts:
            held = self._held.get(parts[0][0].light, self.trace.batch)
            some, rest = self.trace.fill(parts, min(self.budget.units, self.portion, held))
            its = replace(of, is_last_light=of.is_last_light and not rest)
            parts = rest if (yield from self._batch(some, its, into)) else parts

    def _batch(self, some: Parts, of: RoundOf, into: Deposit) -> Generator[None, None, bool]:
        trace = self.trace
        for piece, _ in some:
            trace.order(piece)  # the processor's work, which would pass for the device's below
        sent = trace.send(some) if self._counts_late else None
        if sent is not None:
            yield
            yield from self.splat(trace.photons, sent.most, into, held=sent.held)
            self._sent.append((sent, some, of, into))
            yield from self.settle(1)
            return True
        rays = trace.rays_of(some)
        batch = yield from self._traced(trace.steps(some), into.stats, rays)
        if batch.overflow and points_of(some) > 1:
            self._held[some[0][0].light] = rays // 2
            return False
        self._is_timed = True
        yield from self._landed(batch, of, into)
        return True

    @property
    def _counts_late(self) -> bool:
        """Nobody wants a batch's numbers while it is traced, and how long one takes is known."""
        return self._is_timed and not self.records.keeps

    def settle(self, left: int = 0) -> Iterator[None]:
        """Count what was sent, but for the last `left` batches. Those that found no room, of which nothing was drawn,
        are traced again in parts."""
        while len(self._sent) > left:
            sent, parts, of, into = self._sent.pop(0)
            started = time.perf_counter()
            batch = sent.batch()
            into.stats.trace_seconds += time.perf_counter() - started
            if batch.overflow:
                self._is_timed = False
                yield from self.lattice(parts, of, into)
            else:
                self._count(batch, into)

    def settled(self) -> None:
        """`settle` without pauses."""
        for _ in self.settle():
            pass

    def carry_on(
        self, rays: np.ndarray, light: int, of: RoundOf, into: Deposit, *, of_tails: bool = False
    ) -> Iterator[None]:
        """`lattice` for `rays` that are on their way already (`TracePass.carry_on`). `of_tails`: photons that carry on
        weak beams, for which a pass has photons besides, and on no lattice of their own that roulette would tear."""
        waiting, threshold = [rays], SPLIT_THRESHOLD if of_tails else self.trace.split_threshold
        while waiting:
            some = waiting.pop()
            batch = yield from self._traced(self.trace.carry_on(some, light, threshold), into.stats, 0)
            if batch.overflow and len(some) > 1:
                waiting += [some[1::2], some[::2]]
                continue
            yield from self._landed(batch, of, into, of_tails=of_tails)

    def _landed(self, batch: Batch, of: RoundOf, into: Deposit, *, of_tails: bool = False) -> Iterator[None]:
        if self.records.takes_tails or not of_tails:
            self.records.keep(self.trace.photons, batch, self.trace.photon.stride, of)
        yield
        yield from self.splat(self.trace.photons, batch.photons, into)
        self._count(batch, into, of_tails)

    @staticmethod
    def _count(batch: Batch, into: Deposit, of_tails: bool = False) -> None:
        into.stats.photons += 0 if of_tails else batch.emitted_photons
        into.stats.splats += batch.photons
        into.stats.tally.merge(batch.tally.without_beams)

    def _traced(
        self, tracing: Generator[None, None, Batch], stats: LightStats, rays: int
    ) -> Generator[None, None, Batch]:
        queued, is_first = self._context.traits.work_is_queued, True
        started = time.perf_counter()
        while True:
            try:
                if self._waits:
                    with self._context.timers.timing("trace"):
                        next(tracing)
                else:
                    next(tracing)
            except StopIteration as finished:
                batch: Batch = finished.value
                break
            if queued and (self._waits or is_first):
                self._context.finish()
            took, is_compiled = time.perf_counter() - started, self._traced_once
            stats.trace_seconds += took
            if queued and is_first and rays and is_compiled:
                longest = LONGEST_SHARE if self._context.traits.ray_events else 1.0
                self.budget.learn(rays, longest * took, self.dispatch_seconds)
            is_first, self._traced_once = False, True
            yield
            started = time.perf_counter()
        stats.trace_seconds += time.perf_counter() - started
        return batch

    def splat(
        self,
        photons: moderngl.Buffer,
        count: int,
        into: Deposit,
        tables: ShownTables | None = None,
        held: tuple[moderngl.Buffer, int] | None = None,
    ) -> Iterator[None]:
        """Add photon records to maps, see `Splatting.steps`. `tables` of another plan than the one begun."""
        steps = self.splatting.steps(photons, count, into.maps, tables or self.tables, into.smoothing, held=held)
        yield from self._timed(steps, into.stats)

    def settling(self, atlas: MapAtlas, stats: LightStats) -> Iterator[None]:
        """Sum up what is pending, so that maps can be shown at once."""
        yield from self._timed(self.splatting.summing(atlas), stats)

    def _timed(self, steps: Iterator[None], stats: LightStats) -> Iterator[None]:
        """`steps` of splatting, which are waited for where frames have to be in time."""
        goes_on = True
        while goes_on:
            started = time.perf_counter()
            goes_on = next(steps, self) is not self
            if self._waits:
                self._context.finish()
            stats.splat_seconds += time.perf_counter() - started
            if goes_on:
                yield

    def release(self) -> None:
        """Free everything."""
        self.trace.release()
        self.records.release()
        self.splatting.release()


def traced_besides(trace: TracePass, seed: int, plans: Sequence[LightPlan], photons: int, keep: Keep) -> Iterator[None]:
    """Trace about `photons` by `plans` that belong to no map of a light pass, for `keep`, pausing after every batch."""
    parts = [plan.part(seed, 0, photons) for plan in plans]
    rounds = trace.rounds(parts)
    for j in range(rounds):

        def kept(batch: Batch, is_last: bool, j: int = j) -> None:
            keep(trace.photons, batch.photons, trace.photon.stride, RoundOf(0, j, rounds, is_last))

        yield from trace.whole(every(rounds, j, parts), kept)
        yield


def batch_size(context: Context, features: Features, given: int | None) -> int:
    """Lattice points in flight at once: `given`, or what the device and its memory have room for."""
    traits, batch = context.traits, given or context.traits.photon_batch
    queue, most_bytes = queue_class(traits), min(traits.photon_queue_bytes, available_bytes() // 8)
    while given is None and batch > SMALLEST_BATCH and queue.bytes_of(features, traits, batch) > most_bytes:
        batch >>= 1
    return min(batch, max(64, queue.most(features, traits, context.limits.storage_block_bytes) // 64 * 64))
