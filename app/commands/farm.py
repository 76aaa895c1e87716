"""The farm commands: what render, animate and bench do, by many workers; Ctrl-C keeps what is done."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from .animate import plan_of
from .bench import empty_result, kept_text, scenes_of, settings_of, write_and_show
from .measuring_table import FarmBench
from .opened import note_assumptions, open_scene
from .printing import note, show
from .render import check_output, picture_settings
from .table import ByWorkers, FarmAnimate, FarmRender

if TYPE_CHECKING:
    from ..bench.store import Store
    from ..farm.cluster import DaskCrew

FOLDER_SUFFIX = ".parts"


@contextmanager
def crew(asked: ByWorkers) -> Iterator[DaskCrew]:
    """Those who work. Raises `UserError`."""
    from ..farm.cluster import open_crew

    with open_crew(workers_of(asked), asked.scheduler) as found:
        yield found


def workers_of(asked: ByWorkers) -> int | None:
    """How many of this machine; None where a scheduler has its own. Raises `UserError`, also where Dask is missing."""
    from ..farm.cluster import check_installed
    from ..farm.gpus import count_gpus

    if asked.workers is not None and asked.scheduler is not None:
        raise UserError("--workers and --scheduler exclude each other: a running cluster has its own workers")
    check_installed()
    if asked.scheduler is not None:
        return None
    return asked.workers or count_gpus() or os.cpu_count() or 1


def render(asked: FarmRender) -> int:
    """Render to a picture file; returns the exit code. Raises `UserError`."""
    from ..base.image_io import check_suffix, write_image
    from ..base.progress import ProgressReporter

    check_suffix(asked.output)
    workers_of(asked)
    scene_file = check_output(asked)
    scene = open_scene(asked)
    settings = picture_settings(asked, scene, asked.stats)
    note_assumptions(scene)

    from ..farm.part_folder import PREVIEW, held
    from ..farm.render import FarmRender

    started = time.perf_counter()
    folder = asked.output.with_name(asked.output.name + FOLDER_SUFFIX)
    with held(folder, asked.output), interrupt_flag() as interrupted, crew(asked) as workers:
        note(f"{folder / PREVIEW} shows now and then what there is")
        work = FarmRender(workers, scene, settings, scene_file, folder, asked.parts, note)
        try:
            with ProgressReporter(scene.name) as progress:
                result = work.run(progress, interrupted)
        except UserError as error:
            raise UserError(f"{error} ({work.kept.leave()})") from error
        except BaseException:
            work.kept.leave()
            raise
        if result is None:
            print(f"spectrasplat: stopped; {work.kept.leave()}: the same command goes on", file=sys.stderr)
            return interrupted.exit_code
        for told in result.picture.stats.notices:
            note(told)
        write_image(
            asked.output,
            result.picture.rgb,
            exposure_ev=settings.exposure_ev,
            glare=settings.glare,
            antialias=scene.render.antialias_highlights,
            spectral=result.picture.spectral,
            bin_edges_nm=result.picture.bin_edges_nm,
        )
        if not asked.keep_parts:
            work.kept.remove()
    stats, tally = result.picture.stats, result.tally
    again = f", {result.taken_up} of them from before" if result.taken_up else ""
    copied = f", {tally.copied} begun a second time" if tally.copied else ""
    print(
        f"{asked.output.resolve()}: {settings.width}×{settings.height}, {result.parts} parts{again}{copied}, "
        f"{stats.photons:,} photons in {time.perf_counter() - started:.1f} s, of which merging "
        f"{result.part_bytes / 1e6:.1f} MB took {result.merge_seconds:.1f} s ({stats.renderer})"
    )
    if asked.stats:
        print("\n".join(stats.lines()))
    return 0


def animate(asked: FarmAnimate) -> int:
    """Render an animation; returns the exit code. Raises `UserError`."""
    from ..base.movie import FILM_SUFFIXES, Frames, check_film, check_folder, open_sink
    from ..base.progress import ProgressReporter

    workers_of(asked)
    plan = plan_of(asked)
    settings, count = plan.settings, len(plan.only)
    size = settings.width, settings.height

    from ..farm.animate import FarmFrames
    from ..farm.part_folder import held

    is_movie, started = asked.output.suffix.lower() in FILM_SUFFIXES, time.perf_counter()
    folder = asked.output.with_name(asked.output.name + ".frames") if is_movie else asked.output
    if is_movie:
        check_film(asked.output, size)
    else:
        check_folder(folder)
    with held(folder, asked.output), interrupt_flag() as interrupted, crew(asked) as workers:
        sink = Frames(folder, plan.manifest, asked.overwrite)
        there = sum(sink.has(index) for index in plan.only)
        work = FarmFrames(workers, plan.animation, settings, sink, plan.only)
        try:
            with ProgressReporter(plan.animation.start.scene.name) as progress:
                tally = work.run(progress, interrupted)
        except UserError as error:
            made = sum(sink.has(index) for index in plan.only)
            raise UserError(f"{error} ({made} of {count} frames are in {folder})") from error
        finally:
            for told in work.notices.lines(of_frames=count > 1):
                note(told)
    made = sum(sink.has(index) for index in plan.only)
    if tally is None:
        print(
            f"spectrasplat: stopped; {made} of {count} frames are in {folder}: the same command goes on",
            file=sys.stderr,
        )
        return interrupted.exit_code
    if is_movie:
        movie = open_sink(asked.output, size, plan.fps, {})
        try:
            for index in plan.only:
                movie.write(index, sink.read(index))
        finally:
            movie.close()
        shutil.rmtree(folder, ignore_errors=True)
    kept = f" ({there} were there)" if there else ""
    copied = f", {tally.copied} begun a second time" if tally.copied else ""
    print(
        f"{asked.output.resolve()}: {made} of {count} frames{kept}{copied}, {size[0]}×{size[1]} at {plan.fps:g} a "
        f"second, in {time.perf_counter() - started:.1f} s"
    )
    return 0


def bench(asked: FarmBench) -> int:
    """Measure scenes side by side; returns the exit code. Raises `UserError`."""
    if asked.output is None:
        raise UserError("bench needs a folder for what it finds: give one with -o DIR")
    settings, count = settings_of(asked), workers_of(asked)
    start_s, started = time.process_time(), time.perf_counter()
    scenes = scenes_of(asked, settings)
    start_s += (time.perf_counter() - started) / len(scenes)
    if count is not None and count > 1:
        note("workers of one machine slow each other: times compare within this run only")
        if len(scenes) < count:
            note(f"a scene is measured by one worker, so {len(scenes)} of {count} have something to do")

    from ..base.progress import ProgressReporter
    from ..farm.bench import FarmBench
    from ..farm.part_folder import held

    output = asked.output

    def open_store(where: dict[str, str]) -> Store:
        from ..bench.store import Store

        return Store(output, empty_result([*scenes], asked, settings, where), asked.fresh)

    with held(output, output), interrupt_flag() as interrupted, crew(asked) as workers:
        work = FarmBench(workers, scenes, settings, open_store, start_s, note)
        with ProgressReporter("bench") as progress:
            is_done = work.run(progress, interrupted)
        if work.store is not None:
            if not is_done:
                print(f"spectrasplat: stopped; {kept_text(work.store.result)}", file=sys.stderr)
            write_and_show(work.store.result, output, show)
    return 0 if is_done else interrupted.exit_code
