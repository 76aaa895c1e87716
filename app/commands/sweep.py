"""The sweep command: a picture for every combination of values, with as little traced as they allow."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..base.image_io import SPECTRAL_SUFFIXES, write_image
from ..base.interrupts import interrupt_flag
from ..base.movie import Frames, frame_name
from ..model.settings import RenderSettings
from .farm import run, workers_of
from .opened import note_assumptions, open_scene, settings_for
from .printing import note
from .table import Sweep

if TYPE_CHECKING:
    from ..edit.parameters import Stage
    from ..render.sweep import SweepPlan
    from ..render.sweep_points import Drawn

DEFAULT_SAMPLES = 32
INDEX = "sweep.json"


def sweep(options: Sweep) -> int:
    """Draw all points; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage

    if options.output.suffix and not options.output.is_dir():
        raise UserError(f"cannot write {options.output}: a sweep is a folder of pictures; --format says of which kind")
    is_here = options.scheduler is None and options.workers in (None, 1)
    workers = 1 if is_here else workers_of(options)
    scene = open_scene(options)
    settings = settings_for(options, scene, spp=DEFAULT_SAMPLES, photons=scene.render.photons)
    exposure = scene.render.exposure_ev if options.exposure is None else options.exposure

    from ..farm.jobs import held
    from ..render.sweep import SweepPlan, points_of

    start = Stage(scene, scene.camera, exposure)
    grid: dict[str, tuple[float, ...]] = {}
    for text in options.ranges:
        path, values = parse_set(text, start)
        if path in grid:
            raise UserError(f"{path} is given twice: set each parameter once, all its values in one --set")
        grid[path] = values
    plan = SweepPlan.of(points_of(start, grid), settings, options.exact)
    note_assumptions(scene)
    if options.bins is not None and not options.exact:
        note("--bins: photons that are kept have colours only, so every point is traced")
    note(plan_words(plan, workers))
    started = time.perf_counter()
    with held(options.output, options.output), interrupt_flag() as interrupted:
        suffix = f".{options.format}"
        frames = Frames(options.output, _description(start, settings, plan, suffix), options.overwrite, INDEX, suffix)
        pictures = _Pictures(frames, plan)
        there = sum(frames.has(point.number) for point in plan.points)
        if is_here or not plan.can_spread:
            with ProgressReporter(scene.name) as progress:
                _draw_here(plan, frames, pictures, progress, interrupted)
        else:
            from ..farm.kinds import PointsJob

            job = PointsJob(plan, pictures.put, lambda number: not frames.has(number), pictures.first)
            run(options, job, scene.name, interrupted)
        made = sum(frames.has(point.number) for point in plan.points)
    kept = f" ({there} were there)" if there else ""
    stopped = interrupted() and made < len(plan.points)
    print(
        f"{options.output.resolve()}: {made} of {len(plan.points)} pictures{kept}, {settings.width}×{settings.height}, "
        f"in {time.perf_counter() - started:.1f} s"
        + ("; stopped early, and the same command goes on" if stopped else "")
    )
    return interrupted.exit_code if stopped else 0


def parse_set(text: str, stage: Stage) -> tuple[str, tuple[float, ...]]:
    """ "objects.prism.dispersion_gain=0:3:31" (31 values from 0 to 3) or "…=0,0.5,2" as a path with its values. Raises
    `UserError`."""
    from ..render.sweep import MAX_POINTS, check_values

    path, equals, numbers = text.partition("=")
    path = path.strip()
    refusal = UserError(
        f"--set '{text}' is no sweep: give PARAMETER=FROM:TO:COUNT, for example objects.prism.dispersion_gain=0:3:31, "
        "or PARAMETER=A,B,C"
    )
    try:
        if ":" in numbers:
            first, last, count = numbers.split(":")
            if not 2 <= int(count) <= MAX_POINTS:
                raise UserError(f"--set '{text}' asks for {count} values: give 2 to {MAX_POINTS}")
            values = tuple(np.linspace(float(first), float(last), int(count)).tolist())
        else:
            values = tuple(float(number) for number in numbers.split(","))
    except ValueError:
        raise refusal from None
    if not equals or not path:
        raise refusal
    check_values(path, values, stage, "--set ")
    return path, values


def plan_words(plan: SweepPlan, workers: int | None) -> str:
    """Which points are spread, and why, in a sentence; `workers` None: those of a cluster."""
    points, groups = len(plan.points), len(plan.groups)
    who = "the cluster's workers" if workers is None else f"{workers} workers"
    spread = "" if workers == 1 else f", spread over {who}"
    if not plan.keeps_photons:
        if groups == points:
            return f"{points} points, each traced anew{spread}"
        which = "points that differ" if groups == 1 else f"points in {groups} groups, each of which differ"
        return f"{points} {which} by the camera alone, on which light does not depend{spread}"
    followed = ""
    if plan.first_order:
        followed = "; it follows the glass to first order in the change of its index (--exact traces every point)"
    if groups == 1:
        alone = "" if workers == 1 else ", so that there is nothing to spread over workers"
        return f"{points} points from one store of photons: light is traced once{alone}{followed}"
    return f"{points} points from {groups} stores of photons{spread}{followed}"


def _draw_here(
    plan: SweepPlan,
    frames: Frames,
    pictures: _Pictures,
    progress: Callable[[float, str], None],
    stop: Callable[[], bool],
) -> None:
    """One point after the other in this process."""
    from ..gpu.context import create_context
    from ..gpu.shader import keep_programs
    from ..render.sweep_points import SweepPainter

    due = [point.number for group in plan.groups for point in group.points if not frames.has(point.number)]
    with create_context() as context:
        keep_programs(context.ctx)
        painter = SweepPainter(context, plan)
        try:
            for drawn in painter.draw_all(due, progress, stop):
                pictures.put(drawn)
        finally:
            painter.release()


def _description(start: Stage, settings: RenderSettings, plan: SweepPlan, suffix: str) -> Mapping[str, object]:
    """What decides the pictures: their values, and all else."""
    from ..render.parts import rendering_key

    shared = {
        "scene": start.scene.name,
        "rendering": rendering_key(start.scene, settings),
        "exposure_ev": start.exposure_ev,
        "keeps_photons": plan.keeps_photons,
        "suffix": suffix,
    }
    return {
        "sweep": shared,
        "pictures": [{"file": frame_name(point.number, suffix), **point.values} for point in plan.points],
    }


class _Pictures:
    """Writes the points of a sweep into their folder, and notes what each says of itself, each sentence once."""

    def __init__(self, frames: Frames, plan: SweepPlan) -> None:
        self._frames, self._plan = frames, plan
        self._noted: set[str] = set()

    @property
    def first(self) -> int | None:
        """The point that must be drawn before the others can be written; None where that is settled."""
        return 0 if self._frames.shares_exposure and self._frames.exposure() is None else None

    def put(self, drawn: Drawn) -> None:
        """Write one. Raises `UserError`."""
        from ..base.tone_map import auto_exposure

        path, stage = self._frames.path(drawn.number), self._plan.points[drawn.number].stage
        exposure = None
        if self._frames.shares_exposure:
            own_ev = auto_exposure(drawn.rgb)
            exposure = self._frames.fix_exposure(own_ev) - own_ev + stage.exposure_ev
        for sentence in drawn.notices:
            if sentence not in self._noted:
                self._noted.add(sentence)
                note(f"picture {drawn.number}: {sentence}")
        keeps_bins = path.suffix in SPECTRAL_SUFFIXES
        write_image(
            path,
            drawn.rgb,
            exposure_ev=exposure,
            glare=stage.scene.render.glare,
            antialias=stage.scene.render.antialias_highlights,
            spectral=drawn.spectral if keeps_bins else None,
            bin_edges_nm=drawn.bin_edges_nm if keeps_bins else None,
        )
