"""A farm of a thousand on paper: the program's own foreman hands out parts to workers that exist in numbers only, with
stragglers and deaths, and its own merge adds a thousand part files in a tree: `python tests/unit/farm_simulation.py`.

Simulated: workers, the clock, what a part takes, who dies. Real: who is given what, when a copy is begun, which results
count, the files of the parts and their merging.
"""

from __future__ import annotations

import heapq
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from spectrasplat.__main__ import main
from spectrasplat.farm import jobs
from spectrasplat.farm.jobs import Foreman, News, Tally, Task
from spectrasplat.render.light_stats import LightStats
from spectrasplat.render.part_file import merged_sums, read_header, write_part
from spectrasplat.render.parts import Part, PartHeader, Share, _plain

PART_S = 60.0
"""What a part takes on a usual worker."""


@dataclass
class SimulatedCrew:
    """Workers with speeds of their own; some attempts are ten times as slow, at some a worker dies."""

    workers: int
    seed: int = 1
    late: float = 0.01
    """Share of attempts that are slow."""
    deaths: float = 0.005
    """Share of attempts whose worker dies; another one begins anew."""
    restart_s: float = 20.0
    now: float = 0.0
    busy_s: float = 0.0
    died: int = 0
    _events: list = field(default_factory=list)
    _queue: list = field(default_factory=list)
    _dropped: set = field(default_factory=set)
    _at: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)
        self._free = list(self._random.lognormal(0.0, 0.15, self.workers))

    def share(self, value: Any) -> None:
        """Nothing: tasks are numbers."""

    def clock(self) -> float:
        """Simulated seconds."""
        return self.now

    def size(self) -> int:
        """All."""
        return self.workers

    def submit(self, task: Task, attempt: int) -> None:
        """Queue it."""
        self._queue.append((task, attempt))

    def drop(self, task: Task, attempt: int) -> None:
        """Its worker is free at once, as one that asks whether its job is wanted."""
        self._dropped.add(attempt)
        if attempt in self._at:
            slowness, began = self._at.pop(attempt)
            self.busy_s += self.now - began
            self._free.append(slowness)

    def news(self, timeout_s: float) -> list[News]:
        """What happens next."""
        told = []
        while self._queue and self._free:
            task, attempt = self._queue.pop(0)
            if attempt not in self._dropped:
                told.append(self._begin(task, attempt, self._free.pop()))
        if told or not self._events:
            return told
        self.now, _, kind, task, attempt, share = heapq.heappop(self._events)
        if kind == "back":
            self._free.append(share)
            return []
        if attempt in self._dropped or attempt not in self._at:
            return []
        if kind == "told":
            return [News(task, attempt, share)]
        slowness, began = self._at.pop(attempt)
        self.busy_s += self.now - began
        if kind == "dies":
            self.died += 1
            self._queue.insert(0, (task, attempt))
            self._push(self.restart_s, "back", task, attempt, slowness)
            return []
        self._free.append(slowness)
        return [News(task, attempt, 1.0, task.call, is_done=True)]

    def _begin(self, task: Task, attempt: int, slowness: float) -> News:
        takes = PART_S * slowness * self._random.lognormal(0.0, 0.1)
        takes *= 10.0 if self._random.random() < self.late else 1.0
        self._at[attempt] = slowness, self.now
        if self._random.random() < self.deaths:
            self._push(takes * self._random.random(), "dies", task, attempt, 0.0)
        else:
            for share in (0.25, 0.5, 0.75):
                self._push(takes * share, "told", task, attempt, share)
            self._push(takes, "done", task, attempt, 1.0)
        return News(task, attempt, 0.0)

    def _push(self, after: float, kind: str, task: Task, attempt: int, share: float) -> None:
        heapq.heappush(self._events, (self.now + after, self._random.random(), kind, task, attempt, share))


class ListedJob:
    """Tasks that are all known from the start; what each brought is listed."""

    guesses: Mapping[str, float] = {"part": 1.0}
    shared = None

    def __init__(self, tasks: Iterable[Task]) -> None:
        self.tasks = list(tasks)
        self.taken: list[tuple[int, Any]] = []

    def begin(self) -> Iterable[Task]:
        """All."""
        return self.tasks

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        """Nothing follows."""
        self.taken.append((task.number, result))
        return ()

    def ahead(self) -> Mapping[str, int]:
        """Nothing is."""
        return {}


def simulate(crew: SimulatedCrew, parts: int) -> tuple[list[int], Tally, list[float]]:
    """Numbers of the parts as they were taken, what came to pass, and what the bar showed."""
    shown: list[float] = []
    job = ListedJob(Task("part", number, number) for number in range(1, parts + 1))
    tally = Foreman(crew, job).run(lambda share, text: shown.append(share))
    assert tally is not None
    return [number for number, _ in job.taken], tally, shown


@contextmanager
def without_copies() -> Iterator[None]:
    """Within the block nothing is begun a second time."""
    before, jobs.LATE = jobs.LATE, float("inf")
    try:
        yield
    finally:
        jobs.LATE = before


def write_parts(folder: Path, count: int, side: int = 32) -> list[Path]:
    """Files of `count` parts with maps of side² texels whose numbers span many magnitudes."""
    generator, paths = np.random.default_rng(2), []
    stats = _plain(LightStats(photons=1000))
    for index in range(1, count + 1):
        sums = generator.lognormal(0.0, 3.0, (side, side, 4)).astype(np.float32)
        header = PartHeader("simulated", "simulated.toml", "k" * 64, {}, Share(index, count), count, "l" * 64,
                            (side, side), 1, 1000.0, stats, "simulated")  # fmt: skip
        paths.append(folder / f"part{index:04}.ssp")
        write_part(paths[-1], Part(header, [sums]))
    return paths


def merge_tree(folder: Path, paths: list[Path], fan_in: int) -> tuple[Path, int, float]:
    """The file that holds all parts, the levels of the tree, and the seconds of the longest way through it."""
    level, longest = 0, 0.0
    while len(paths) > 1:
        level += 1
        merged, slowest = [], 0.0
        for number in range(0, len(paths), fan_in):
            target, started = folder / f"level{level}_{number // fan_in:04}.ssp", time.perf_counter()
            assert main(["merge", *map(str, paths[number : number + fan_in]), "-o", str(target)]) == 0
            slowest = max(slowest, time.perf_counter() - started)
            merged.append(target)
        paths, longest = merged, longest + slowest
    return paths[0], level, longest


def difference(merged: Path, paths: list[Path]) -> float:
    """Largest difference of the merged sums from the flat float64 sum, over the largest of those."""
    header = read_header(merged)
    assert sorted(header.indices) == list(range(1, len(paths) + 1))
    flat = sum(next(merged_sums([path], header)).astype(np.float64) for path in paths)
    return float(np.abs(next(merged_sums([merged], header)) - flat).max() / flat.max())


if __name__ == "__main__":
    print("workers  parts  late  died  copies  ends after  without copies  work that was wasted")
    for workers, late in ((1000, 0.0), (1000, 0.01), (1000, 0.05), (250, 0.01), (250, 0.05)):
        crew = SimulatedCrew(workers, late=late)
        taken, tally, _ = simulate(crew, 1000)
        assert sorted(taken) == list(range(1, 1001))
        alone = SimulatedCrew(workers, late=late)
        with without_copies():
            simulate(alone, 1000)
        print(
            f"{workers:7}  {1000:5}  {late:4.0%}  {crew.died:4}  {tally.copied:6}  {crew.now:8.0f} s  "
            f"{alone.now:12.0f} s  {max(1.0 - sum(tally.seconds['part']) / crew.busy_s, 0.0):18.1%}"
        )
    side = int(sys.argv[1]) if len(sys.argv) > 1 else 256
    with tempfile.TemporaryDirectory() as name:
        started = time.perf_counter()
        paths = write_parts(Path(name), 1000, side)
        size = sum(path.stat().st_size for path in paths)
        print(
            f"1000 parts of {side}×{side} texels: {size / 1e6:.0f} MB, written in {time.perf_counter() - started:.0f} s"
        )
        for fan_in in (32, 1000):
            started = time.perf_counter()
            merged, levels, longest = merge_tree(Path(name), paths, fan_in)
            print(
                f"fan-in {fan_in}: {levels} levels, {time.perf_counter() - started:.1f} s in all, {longest:.2f} s by "
                f"the longest way; off by {difference(merged, paths):.1e} of the largest sum"
            )
