"""The sweep command: a picture for every combination of values, with as little traced as they allow."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from ..model.settings import RenderSettings
from .farm import crew, workers_of
from .opened import note_assumptions, open_scene, settings_for
from .printing import note
from .table import Sweep

if TYPE_CHECKING:
    from ..edit.parameters import Stage
    from ..farm.point_tasks import Drawn
    from ..farm.sweep import SweepPlan
    from ..farm.sweep_folder import SweepFolder

DEFAULT_SAMPLES = 32


def sweep(asked: Sweep) -> int:
    """Draw all points; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage

    if asked.output.suffix and not asked.output.is_dir():
        raise UserError(f"cannot write {asked.output}: a sweep is a folder of pictures; --format says of which kind")
    is_here = asked.scheduler is None and asked.workers in (None, 1)
    workers = 1 if is_here else workers_of(asked)
    scene = open_scene(asked)
    settings = settings_for(asked, scene, spp=DEFAULT_SAMPLES, photons=scene.render.photons)
    exposure = scene.render.exposure_ev if asked.exposure is None else asked.exposure

    from ..farm.part_folder import held
    from ..farm.sweep import SweepPlan, parse_set, points_of
    from ..farm.sweep_folder import SweepFolder

    start = Stage(scene, scene.camera, exposure)
    grid: dict[str, tuple[float, ...]] = {}
    for text in asked.ranges:
        path, values = parse_set(text, start)
        if path in grid:
            raise UserError(f"{path} is given twice: set each parameter once, all its values in one --set")
        grid[path] = values
    plan = SweepPlan.of(points_of(start, grid), settings, asked.exact)
    note_assumptions(scene)
    if asked.bins is not None and not asked.exact:
        note("--bins: photons that are kept have colours only, so every point is traced")
    note(plan.told(workers))
    started, drawn_by = (
        time.perf_counter(),
        _here if is_here or (len(plan.groups) == 1 and plan.keeps_photons) else _by_crew,
    )
    with held(asked.output, asked.output), interrupt_flag() as interrupted:
        folder = SweepFolder(
            asked.output, plan.points, _description(start, settings, plan), f".{asked.format}", asked.overwrite
        )
        there = sum(folder.has(point.number) for point in plan.points)
        with ProgressReporter(scene.name) as progress:
            drawn_by(asked, plan, settings, folder, progress, interrupted)
        made = sum(folder.has(point.number) for point in plan.points)
    kept = f" ({there} were there)" if there else ""
    stopped = interrupted() and made < len(plan.points)
    print(
        f"{asked.output.resolve()}: {made} of {len(plan.points)} pictures{kept}, {settings.width}×{settings.height}, "
        f"in {time.perf_counter() - started:.1f} s"
        + ("; stopped early, and the same command goes on" if stopped else "")
    )
    return interrupted.exit_code if stopped else 0


class _Told:
    """A local point's progress."""

    def __init__(self, tell: Callable[[float, str], None], stop: Callable[[], bool]) -> None:
        self.unwanted = stop
        self._tell = tell
        self.begin, self.count = 0, 1

    def __call__(self, share: float, text: str = "") -> None:
        self._tell((self.begin + share) / self.count, f"picture {self.begin + 1} of {self.count}")


def _here(
    asked: Sweep,
    plan: SweepPlan,
    settings: RenderSettings,
    folder: SweepFolder,
    tell: Callable[[float, str], None],
    stop: Callable[[], bool],
) -> None:
    from ..farm.desk import Desk
    from ..farm.sweep_run import by_group, draw_point, shared_of

    due = list(by_group(plan.groups, lambda number: not folder.has(number)))
    desk, shared, told = Desk(), shared_of(plan, settings), _Told(tell, stop)
    told.count, take = len(due), _taker(folder)
    try:
        for place, (group, number) in enumerate(due):
            told.begin = place
            drawn = draw_point(desk, plan, shared, group, number, told)
            if drawn is None:
                return
            take(drawn)
    finally:
        desk.clear()


def _taker(folder: SweepFolder) -> Callable[[Drawn], None]:
    """Writes pictures, and tells what they say of themselves, each sentence once."""
    said: set[str] = set()

    def take(drawn: Drawn) -> None:
        folder.put(drawn)
        for sentence in drawn.notices:
            if sentence not in said:
                said.add(sentence)
                note(f"picture {drawn.number}: {sentence}")

    return take


def _by_crew(
    asked: Sweep,
    plan: SweepPlan,
    settings: RenderSettings,
    folder: SweepFolder,
    tell: Callable[[float, str], None],
    stop: Callable[[], bool],
) -> None:
    from ..farm.sweep_run import FarmSweep

    with crew(asked) as workers:
        FarmSweep(
            workers, plan, settings, _taker(folder), lambda number: not folder.has(number), first=folder.first
        ).run(tell, stop)


def _description(start: Stage, settings: RenderSettings, plan: SweepPlan) -> Mapping[str, object]:
    """What decides the pictures besides their values."""
    from ..render.parts import rendering_key

    return {
        "scene": start.scene.name,
        "rendering": rendering_key(start.scene, settings),
        "exposure_ev": start.exposure_ev,
        "keeps_photons": plan.keeps_photons,
    }
