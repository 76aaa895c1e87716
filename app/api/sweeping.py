"""A picture for every combination of values: what `spectrasplat sweep` draws, one after the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from queue import SimpleQueue
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..edit.parameters import Stage
from ..model.settings import RenderSettings
from .asking import Count, Size, settings_of
from .device import Cancel, Device, Progress
from .picture import Picture, Statistics
from .scene import Scene

if TYPE_CHECKING:
    from ..farm.point_tasks import Drawn
    from ..farm.sweep import SweepPlan
    from ..gpu.context import Context

DEFAULT_SAMPLES = 32


@dataclass(frozen=True)
class SweepPoint:
    """One picture of a sweep."""

    number: int
    """Its place among all combinations, the last parameter running fastest."""
    values: Mapping[str, float]
    """Of the parameters."""
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
    from ..farm.sweep import SweepPlan, check_values, points_of

    settings = settings_of(scene, size=size, photons=photons, seed=seed, method=method, bins=bins, spp=spp)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise UserError(f"workers {workers!r} is no number of processes: give 1 or more")
    model = scene._model
    start = Stage(model, model.camera, settings.exposure_ev or 0.0)
    grid = {path: tuple(float(value) for value in values) for path, values in parameters.items()}
    for path, values in grid.items():
        check_values(path, values, start)
    plan = SweepPlan.of(points_of(start, grid), settings, exact)
    spreads = (workers > 1 or scheduler is not None) and not (len(plan.groups) == 1 and plan.keeps_photons)
    if spreads:
        from ..farm.cluster import check_installed

        check_installed()
        return _spread(plan, settings, workers, scheduler, progress, cancel)
    return _here(plan, settings, progress, cancel)


def _here(
    plan: SweepPlan, settings: RenderSettings, progress: Progress | None, cancel: Cancel | None
) -> Generator[SweepPoint]:
    """One by one, in a thread of their own."""
    from ..farm.desk import Desk
    from ..farm.sweep_run import by_group, draw_point, shared_of
    from ..gpu import shader

    shared, desks = shared_of(plan, settings), list[Desk]()

    def draw(group: int, number: int) -> Callable[..., Drawn | None]:
        def work(context: Context, report: Callable[[float, str], None], stopped: Callable[[], bool]) -> Drawn | None:
            if not desks:
                shader.keep_programs(context.ctx)
                desks.append(Desk(context))
            return draw_point(desks[0], plan, shared, group, number, _Told(report, stopped))

        return work

    def clear(context: Context, report: Callable[[float, str], None], stopped: Callable[[], bool]) -> None:
        for desk in desks:
            desk.clear()

    with Device() as device:
        try:
            for group, number in by_group(plan.groups, lambda number: True):
                started = time.perf_counter()
                drawn = device.run(draw(group, number), progress, cancel)
                if drawn is None:
                    return
                yield _point(plan, settings, drawn, time.perf_counter() - started)
        finally:
            device.run(clear)


class _Told:
    """Progress of one point."""

    def __init__(self, report: Callable[[float, str], None], stopped: Callable[[], bool]) -> None:
        self._report, self.unwanted = report, stopped

    def __call__(self, share: float, text: str = "") -> None:
        self._report(share, text)


def _spread(
    plan: SweepPlan,
    settings: RenderSettings,
    workers: int,
    scheduler: str | None,
    progress: Progress | None,
    cancel: Cancel | None,
) -> Generator[SweepPoint]:
    """By a crew, which a thread looks after; callbacks run in the caller's."""
    from ..farm.cluster import open_crew
    from ..farm.sweep_run import FarmSweep

    news: SimpleQueue[Drawn | tuple[float, str] | BaseException | None] = SimpleQueue()
    stop = threading.Event()

    def work() -> None:
        try:
            with open_crew(None if scheduler else workers, scheduler) as crew:
                FarmSweep(crew, plan, settings, news.put).run(lambda share, text: news.put((share, text)), stop.is_set)
            news.put(None)
        except BaseException as error:  # noqa: BLE001 - raised where the pictures are waited for
            news.put(error)

    thread = threading.Thread(target=work, name="spectrasplat-sweep", daemon=True)
    started = time.perf_counter()
    thread.start()
    try:
        while (told := news.get()) is not None:
            if isinstance(told, BaseException):
                raise told
            if isinstance(told, tuple):
                if progress is not None:
                    progress(*told)
                if cancel is not None and cancel():
                    stop.set()
            else:
                yield _point(plan, settings, told, time.perf_counter() - started)
    finally:
        stop.set()
        thread.join()


def _point(plan: SweepPlan, settings: RenderSettings, drawn: Drawn, seconds: float) -> SweepPoint:
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
        drawn.rgb, drawn.spectral, drawn.bin_edges_nm, stats, {"beauty": drawn.rgb}, settings.exposure_ev or 0.0
    )
    return SweepPoint(drawn.number, plan.points[drawn.number].values, picture)
