"""A picture for every combination of values: what `spectrasplat sweep` draws, one after the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from queue import SimpleQueue
from typing import TYPE_CHECKING

from ..commands.table import MAX_WORKERS
from ..edit.parameters import Stage
from .arguments import Count, Size, settings_of, whole
from .device import Cancel, Device, Progress, Report
from .picture import Picture, Statistics
from .scene import Scene

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..render.sweep import SweepPlan
    from ..render.sweep_points import Drawn

DEFAULT_SAMPLES = 32


@dataclass(frozen=True)
class SweepPoint:
    """One picture of a sweep."""

    number: int
    """Its place among all combinations, the last parameter running fastest."""
    values: Mapping[str, float]
    """The parameters' values."""
    picture: Picture


def sweep(
    scene: Scene,
    parameters: Mapping[str, Sequence[float]],
    *,
    size: Size | None = None,
    photons: Count | None = None,
    spp: int = DEFAULT_SAMPLES,
    seed: int | None = None,
    method: str | None = None,
    bins: int | None = None,
    exact: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Generator[SweepPoint]:
    """Render `scene` with every combination of values; yields each picture as it is done, in any order.

    `parameters`: values by the paths of animations, such as {"objects.prism.dispersion_gain": [0, 1, 2]}. Points that
    kept photons serve (another dispersion, another power of a light) are rendered from one tracing, in this process;
    light follows a glass to first order in the change of its index, as in a `Session`. All others are traced, spread
    over `workers` processes of this machine or those of a Dask `scheduler` (which needs the extra `farm`). `exact`, and
    `bins`, trace every point. The rest as for `render`. Raises `UserError` before anything is rendered.
    """
    from ..render.sweep import SweepPlan, check_values, points_of

    settings = settings_of(scene, size=size, photons=photons, seed=seed, method=method, bins=bins, spp=spp)
    whole("workers", workers, 1, MAX_WORKERS)
    model = scene._model
    start = Stage(model, model.camera, settings.exposure_ev or 0.0)
    grid = {path: tuple(float(value) for value in values) for path, values in parameters.items()}
    for path, values in grid.items():
        check_values(path, values, start)
    plan = SweepPlan.of(points_of(start, grid), settings, exact)
    if plan.can_spread and (workers > 1 or scheduler is not None):
        from ..farm.cluster import check_installed

        check_installed()
        return _spread(plan, workers, scheduler, progress, cancel)
    return _here(plan, progress, cancel)


def _here(plan: SweepPlan, progress: Progress | None, cancel: Cancel | None) -> Generator[SweepPoint]:
    """One by one, in a thread of their own; those of a group together, for they share photons."""
    from ..gpu.shader import keep_programs
    from ..render.sweep_points import SweepPainter

    painters: list[SweepPainter] = []

    def draw(number: int) -> Callable[..., Drawn | None]:
        def work(context: Context, report: Report, stopped: Cancel) -> Drawn | None:
            if not painters:
                keep_programs(context.ctx)
                painters.append(SweepPainter(context, plan))
            return painters[0].draw(number, report, stopped)

        return work

    def release(context: Context, report: Report, stopped: Cancel) -> None:
        for painter in painters:
            painter.release()

    with Device() as device:
        try:
            for number in (point.number for group in plan.groups for point in group.points):
                started = time.perf_counter()
                drawn = device.run(draw(number), progress, cancel)
                if drawn is None:
                    return
                yield _point(plan, drawn, time.perf_counter() - started)
        finally:
            device.run(release)


def _spread(
    plan: SweepPlan,
    workers: int,
    scheduler: str | None,
    progress: Progress | None,
    cancel: Cancel | None,
) -> Generator[SweepPoint]:
    """By a crew, in a thread of its own; callbacks run in the caller's."""
    from ..farm.cluster import open_crew
    from ..farm.jobs import Foreman
    from ..farm.kinds import PointsJob

    news: SimpleQueue[Drawn | tuple[float, str] | BaseException | None] = SimpleQueue()
    stop = threading.Event()

    def work() -> None:
        try:
            with open_crew(None if scheduler else workers, scheduler) as crew:
                job = PointsJob(plan, news.put)
                Foreman(crew, job, stop.is_set).run(lambda share, text: news.put((share, text)))
            news.put(None)
        except BaseException as error:  # noqa: BLE001 - raised where the pictures are waited for
            news.put(error)

    thread = threading.Thread(target=work, name="spectrasplat-sweep", daemon=True)
    started = time.perf_counter()
    thread.start()
    try:
        while (event := news.get()) is not None:
            if isinstance(event, BaseException):
                raise event
            if isinstance(event, tuple):
                if progress is not None:
                    progress(*event)
                if cancel is not None and cancel():
                    stop.set()
            else:
                yield _point(plan, event, time.perf_counter() - started)
    finally:
        stop.set()
        thread.join()


def _point(plan: SweepPlan, drawn: Drawn, seconds: float) -> SweepPoint:
    stats = Statistics(
        drawn.photons,
        drawn.photons if drawn.traced else 0,
        drawn.samples,
        seconds,
        drawn.renderer,
        drawn.is_software,
        False,
        drawn.notices,
    )
    picture = Picture(
        drawn.rgb, drawn.spectral, drawn.bin_edges_nm, stats, {"beauty": drawn.rgb}, plan.settings.exposure_ev or 0.0
    )
    return SweepPoint(drawn.number, plan.points[drawn.number].values, picture)
