"""The sweep command: a picture for every combination of values, with as little traced as they allow."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from ..base.memory import check_picture_memory
from ..model.settings import RenderSettings
from . import options
from .farm import FarmRequest, crew, note, workers_of

if TYPE_CHECKING:
    from ..edit.opening import Opening
    from ..edit.parameters import Stage
    from ..farm.point_tasks import Drawn
    from ..farm.sweep import SweepPlan
    from ..farm.sweep_folder import SweepFolder
    from ..model.scene import Scene

DEFAULT_SAMPLES = 32
FORMATS = ("png", "jpg", "webp", "exr", "npy")


@dataclass(frozen=True)
class SweepRequest:
    """The sweep command's options as typed; None where the user said nothing."""

    scene: str
    output: Path
    ranges: tuple[str, ...] = ()
    format: str | None = None
    size: str | None = None
    photons: str | None = None
    spp: str | None = None
    bins: str | None = None
    exposure: str | None = None
    seed: str | None = None
    method: str | None = None
    exact: bool = False
    overwrite: bool = False
    farm: FarmRequest = field(default_factory=FarmRequest)
    opening: Opening | None = None


def sweep_command(request: SweepRequest) -> int:
    """Draw all points; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage

    if request.output.suffix and not request.output.is_dir():
        raise UserError(f"cannot write {request.output}: a sweep is a folder of pictures; --format says of which kind")
    suffix = _suffix(request.format)
    is_here = request.farm.scheduler is None and request.farm.workers in (None, "1")
    workers = 1 if is_here else workers_of(request.farm)
    scene = options.open_scene(request.scene, request.opening)
    settings = _settings(request, scene)
    exposure = scene.render.exposure_ev if request.exposure is None else options.parse_exposure(request.exposure)

    from ..farm.part_folder import held
    from ..farm.sweep import SweepPlan, parse_set, points_of
    from ..farm.sweep_folder import SweepFolder

    start = Stage(scene, scene.camera, exposure)
    grid: dict[str, tuple[float, ...]] = {}
    for text in request.ranges:
        path, values = parse_set(text, start)
        if path in grid:
            raise UserError(f"{path} is given twice: set each parameter once, all its values in one --set")
        grid[path] = values
    plan = SweepPlan.of(points_of(start, grid), settings, request.exact)
    for told in scene.notes:
        note(told)
    if request.bins is not None and not request.exact:
        note("--bins: photons that are kept have colours only, so every point is traced")
    note(plan.told(workers))
    started, drawn_by = (
        time.perf_counter(),
        _here if is_here or (len(plan.groups) == 1 and plan.keeps_photons) else _by_crew,
    )
    with held(request.output, request.output), interrupt_flag() as interrupted:
        folder = SweepFolder(
            request.output, plan.points, _description(start, settings, plan), suffix, request.overwrite
        )
        there = sum(folder.has(point.number) for point in plan.points)
        with ProgressReporter(scene.name) as progress:
            drawn_by(request.farm, plan, settings, folder, progress, interrupted)
        made = sum(folder.has(point.number) for point in plan.points)
    kept = f" ({there} were there)" if there else ""
    stopped = interrupted() and made < len(plan.points)
    print(
        f"{request.output.resolve()}: {made} of {len(plan.points)} pictures{kept}, {settings.width}×{settings.height}, "
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
    farm: FarmRequest,
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
    farm: FarmRequest,
    plan: SweepPlan,
    settings: RenderSettings,
    folder: SweepFolder,
    tell: Callable[[float, str], None],
    stop: Callable[[], bool],
) -> None:
    from ..farm.sweep_run import FarmSweep

    with crew(farm) as workers:
        FarmSweep(
            workers, plan, settings, _taker(folder), lambda number: not folder.has(number), first=folder.first
        ).run(tell, stop)


def _suffix(name: str | None) -> str:
    if name is None:
        return ".png"
    if name not in FORMATS:
        raise UserError(f"--format '{name}' is unknown, known are {', '.join(FORMATS)}")
    return f".{name}"


def _settings(request: SweepRequest, scene: Scene) -> RenderSettings:
    asked: dict[str, Any] = {"spp": DEFAULT_SAMPLES, "photons": scene.render.photons}
    wishes = scene.render
    settings = RenderSettings(wishes.width, wishes.height, max_depth=wishes.max_depth)
    if request.size is not None:
        asked["width"], asked["height"] = options.parse_size(request.size)
    if request.photons is not None:
        asked["photons"] = options.parse_photons(request.photons)
    for name, text, low, high in (
        ("spp", request.spp, 1, options.MAX_SPP),
        ("bins", request.bins, options.MIN_BINS, options.MAX_BINS),
        ("seed", request.seed, 0, options.MAX_SEED),
    ):
        if text is not None:
            asked[name] = options.parse_integer(f"--{name}", text, low, high)
    if request.method is not None:
        asked["method"] = options.parse_method(request.method)
    settings = replace(settings, **asked)
    check_picture_memory(settings.width, settings.height, settings.bins)
    return settings


def _description(start: Stage, settings: RenderSettings, plan: SweepPlan) -> Mapping[str, object]:
    """What decides the pictures besides their values."""
    from ..render.parts import rendering_key

    return {
        "scene": start.scene.name,
        "rendering": rendering_key(start.scene, settings),
        "exposure_ev": start.exposure_ev,
        "keeps_photons": plan.keeps_photons,
    }
