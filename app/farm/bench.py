"""The bench by many workers: a scene is measured whole by one of them, so that whatever disturbs a machine hits all
methods of a scene alike."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..bench.machine import machine
from ..bench.rendering import NothingToMeasure
from ..bench.results import BenchResult, BenchSettings, SceneResult
from ..bench.runner import run_bench
from ..bench.store import PICTURES, Store
from ..gpu.context import create_context
from ..model.scene import Scene
from .cluster import DaskCrew
from .desk import Desk, Report
from .jobs import Foreman, Job
from .weighing import Weighing

_ONE_KIND = ("processor", "renderer")
_MACHINE = "the look at the machine"


class _Unwanted(Exception):
    """The measurement was dropped."""


@dataclass(frozen=True)
class Measured:
    """A scene's results, the pictures by their names, and where it was measured; or why it was not."""

    result: SceneResult | None
    pictures: Mapping[str, bytes]
    machine: Mapping[str, str]
    skipped: str = ""


def look(desk: Desk, settings: BenchSettings, report: Report) -> dict[str, str]:
    """The machine of a worker."""
    with create_context() as context:
        return machine(context)


def measure(
    desk: Desk, settings: BenchSettings, report: Report, name: str, scene: Scene, start_s: float
) -> Measured | None:
    """One scene, in a folder of its own; in a context of its own too, for a program that is compiled already would
    look quick. `start_s`: what a process takes before it has its scene, without its context."""

    def progress(share: float, text: str) -> None:
        report(share)
        if report.unwanted():
            raise _Unwanted

    started = time.perf_counter()
    with create_context() as context, tempfile.TemporaryDirectory(prefix="spectrasplat-bench-") as folder:
        where = machine(context)
        start_s += time.perf_counter() - started
        store = Store(Path(folder), BenchResult("", "", "", where, [], settings))
        try:
            run_bench(context, {name: scene}, store, progress, start_seconds=start_s)
        except _Unwanted:
            return None
        except NothingToMeasure as reason:
            return Measured(None, {}, where, str(reason))
        pictures = {path.name: path.read_bytes() for path in (Path(folder) / PICTURES).glob("*")}
        return Measured(store.scene(name), pictures, where)


class FarmBench:
    """Measures what `open_store(machine)` lacks."""

    def __init__(
        self,
        crew: DaskCrew,
        scenes: Mapping[str, Scene],
        settings: BenchSettings,
        open_store: Callable[[dict[str, str]], Store],
        start_s: float,
        note: Callable[[str], None],
    ) -> None:
        self._crew, self._scenes, self._settings, self._start_s = crew, scenes, settings, start_s
        self._open_store, self._note = open_store, note
        self.store: Store | None = None
        """Once it is known where things are measured."""

    def run(self, tell: Callable[[float, str], None], stop: Callable[[], bool]) -> bool:
        """False where `stop()` turned true before all was measured. Raises `UserError`; what is done is kept."""
        self._crew.share(self._settings)
        self._foreman = Foreman(self._crew, Weighing({_MACHINE: 0.01, "scene": 1.0}), stop)
        self._foreman.add([Job(_MACHINE, 1, (look,))])
        self._foreman.weighing.add("scene", len(self._scenes))
        return self._foreman.run(self._take, tell)

    def _take(self, job: Job, result: Any) -> None:
        if job.kind == _MACHINE:
            self.store = store = self._open_store(result)
            done = {scene.scene for scene in store.result.scenes if scene.complete}
            jobs = [
                Job("scene", number, (measure, name, scene, self._start_s))
                for number, (name, scene) in enumerate(self._scenes.items(), 1)
                if name not in done
            ]
            self._foreman.weighing.add("scene", len(jobs) - len(self._scenes))
            self._foreman.add(jobs, expected=True)
            return
        assert self.store is not None
        name, measured, store = job.call[1], result, self.store
        if measured.result is None:
            self._note(measured.skipped)
            return
        for key in _ONE_KIND:
            if measured.machine[key] != store.result.machine[key]:
                raise UserError(
                    f"scene '{name}' was measured on another {key} ('{measured.machine[key]}') than the others "
                    f"('{store.result.machine[key]}'), and times of two do not compare: give workers of one kind"
                )
        (store.directory / PICTURES).mkdir(exist_ok=True)
        for file, data in measured.pictures.items():
            with atomic_output(store.directory / PICTURES / file) as temporary:
                temporary.write_bytes(data)
        store.put_scene(measured.result)
        store.save()
