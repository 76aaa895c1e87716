"""The farm commands: what render and animate do, by many workers; Ctrl-C keeps what is done."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.image_io import check_suffix
from ..base.interrupts import interrupt_flag
from .animate import plan_of
from .opened import note_assumptions, open_scene
from .printing import note
from .render import check_output, picture_settings, write_result
from .table import ByWorkers, FarmAnimate, FarmRender

if TYPE_CHECKING:
    from ..farm.jobs import Job, Tally

FOLDER_SUFFIX = ".parts"


def run(options: ByWorkers, job: Job, name: str, stop: Callable[[], bool]) -> Tally | None:
    """Have a job done by the workers that are wanted; None where `stop()` turned true before. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..farm.cluster import open_crew
    from ..farm.jobs import Foreman

    with open_crew(workers_of(options), options.scheduler) as crew, ProgressReporter(name) as progress:
        if crew.workers is None and not crew.size():
            note(f"the scheduler at {crew.address} has no workers yet: waiting for some")
        return Foreman(crew, job, stop).run(progress)


def workers_of(options: ByWorkers) -> int | None:
    """How many of this machine; None where a scheduler has its own. Raises `UserError`, also where Dask is missing."""
    from ..farm.cluster import check_installed, count_gpus

    if options.workers is not None and options.scheduler is not None:
        raise UserError("--workers and --scheduler exclude each other: a running cluster has its own workers")
    check_installed()
    if options.scheduler is not None:
        return None
    return options.workers or count_gpus() or os.cpu_count() or 1


def render(options: FarmRender) -> int:
    """Render to a picture file; returns the exit code. Raises `UserError`."""
    check_suffix(options.output)
    workers_of(options)
    scene_file = check_output(options)
    scene = open_scene(options)
    settings = picture_settings(options, scene, options.stats)
    note_assumptions(scene)

    from ..farm.jobs import held
    from ..farm.still import PREVIEW, StillJob

    started = time.perf_counter()
    folder = options.output.with_name(options.output.name + FOLDER_SUFFIX)
    with held(folder, options.output), interrupt_flag() as interrupted:
        note(f"{folder / PREVIEW} shows now and then what there is")
        job = StillJob(scene, settings, scene_file, folder, options.parts, note)
        kept = job.kept
        try:
            tally = run(options, job, scene.name, interrupted)
        except UserError as error:
            raise UserError(f"{error} ({kept.leave()})") from error
        except BaseException:
            kept.leave()
            raise
        picture = job.picture
        if tally is None or picture is None:
            print(f"spectrasplat: stopped; {kept.leave()}: the same command goes on", file=sys.stderr)
            return interrupted.exit_code
        write_result(options.output, scene, settings, picture)
        if not options.keep_parts:
            kept.remove()
    again = f", {job.taken_up} of them from before" if job.taken_up else ""
    print(
        f"{options.output.resolve()}: {settings.width}×{settings.height}, {kept.count} parts{again}{_copied(tally)}, "
        f"{picture.stats.photons:,} photons in {time.perf_counter() - started:.1f} s, of which merging "
        f"{kept.size_bytes / 1e6:.1f} MB took {kept.seconds:.1f} s ({picture.stats.renderer})"
    )
    if options.stats:
        print("\n".join(picture.stats.lines()))
    return 0


def _copied(tally: Tally) -> str:
    return f", {tally.copied} begun a second time" if tally.copied else ""


def animate(options: FarmAnimate) -> int:
    """Render an animation; returns the exit code. Raises `UserError`."""
    from ..base.movie import FILMS, Frames, check_film, check_folder, open_sink

    workers_of(options)
    plan = plan_of(options)
    settings, count = plan.settings, len(plan.only)
    size = settings.width, settings.height

    from ..farm.jobs import held
    from ..farm.kinds import FramesJob

    is_movie, started = options.output.suffix.lower() in FILMS, time.perf_counter()
    folder = options.output.with_name(options.output.name + ".frames") if is_movie else options.output
    if is_movie:
        check_film(options.output, size)
    else:
        check_folder(folder)
    with held(folder, options.output), interrupt_flag() as interrupted:
        sink = Frames(folder, plan.manifest, options.overwrite)
        there = sum(sink.has(index) for index in plan.only)
        job = FramesJob(plan.animation, settings, sink, plan.only)
        try:
            tally = run(options, job, plan.animation.start.scene.name, interrupted)
        except UserError as error:
            made = sum(sink.has(index) for index in plan.only)
            raise UserError(f"{error} ({made} of {count} frames are in {folder})") from error
        finally:
            for sentence in job.notices.lines(of_frames=count > 1):
                note(sentence)
    made = sum(sink.has(index) for index in plan.only)
    if tally is None:
        print(
            f"spectrasplat: stopped; {made} of {count} frames are in {folder}: the same command goes on",
            file=sys.stderr,
        )
        return interrupted.exit_code
    if is_movie:
        movie = open_sink(options.output, size, plan.fps, {})
        try:
            for index in plan.only:
                movie.write(index, sink.read(index))
        finally:
            movie.close()
        shutil.rmtree(folder, ignore_errors=True)
    kept = f" ({there} were there)" if there else ""
    print(
        f"{options.output.resolve()}: {made} of {count} frames{kept}{_copied(tally)}, {size[0]}×{size[1]} at "
        f"{plan.fps:g} a second, in {time.perf_counter() - started:.1f} s"
    )
    return 0
