"""The farm commands: what render, animate and bench do, by many workers; Ctrl-C keeps what is done."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from ..base.errors import UserError, plain
from ..base.interrupts import interrupt_flag
from ..base.version import __version__
from . import options
from .animate import AnimateRequest, plan_of
from .bench import CAMERA_SCENES, BenchRequest, kept_text, load_scenes, met_by, repeat_command, write_and_show
from .bench import parse_settings as parse_bench_settings
from .render import RenderRequest, complete_settings, parse_settings, scene_as_asked

if TYPE_CHECKING:
    from ..bench.store import Store
    from ..farm.cluster import DaskCrew

MAX_WORKERS = 1024
FOLDER_SUFFIX = ".parts"


@dataclass(frozen=True)
class FarmRequest:
    """Options of every farm command as typed; None where the user said nothing."""

    workers: str | None = None
    scheduler: str | None = None
    parts: str | None = None
    keep_parts: bool = False


def note(sentence: str) -> None:
    """Tell what was assumed or met."""
    print(f"note: {plain(sentence)}", file=sys.stderr)


@contextmanager
def crew(farm: FarmRequest) -> Iterator[DaskCrew]:
    """Those who work. Raises `UserError`."""
    from ..farm.cluster import open_crew

    with open_crew(workers_of(farm), farm.scheduler) as found:
        yield found


def workers_of(farm: FarmRequest) -> int | None:
    """How many of this machine; None where a scheduler has its own. Raises `UserError`, also where Dask is missing."""
    from ..farm.cluster import check_installed
    from ..farm.gpus import count_gpus

    if farm.workers is not None and farm.scheduler is not None:
        raise UserError("--workers and --scheduler exclude each other: a running cluster has its own workers")
    workers = None
    if farm.scheduler is None:
        if farm.workers is not None:
            workers = options.parse_integer("--workers", farm.workers, 1, MAX_WORKERS)
        else:
            workers = count_gpus() or os.cpu_count() or 1
    check_installed()
    return workers


def farm_render_command(request: RenderRequest, farm: FarmRequest) -> int:
    """Render to a picture file; returns the exit code. Raises `UserError`."""
    from ..base.atomic import check_writable
    from ..base.image_io import check_suffix, write_image
    from ..base.progress import ProgressReporter

    asked = parse_settings(request)
    if request.seconds is not None:
        raise UserError("--seconds is for one process: parts share out a number of photons, given by --photons")
    check_suffix(request.output)
    parts = None if farm.parts is None else options.parse_integer("--parts", farm.parts, 1, options.MAX_PARTS)
    workers_of(farm)
    scene_file = options.find_scene(request.scene)
    if os.path.exists(request.output) and request.output.samefile(scene_file):
        raise UserError(f"cannot write {request.output}: it is the scene itself; choose another name")
    check_writable(request.output)
    scene = scene_as_asked(request)
    settings = complete_settings(asked, scene, request.stats)
    for told in scene.notes:
        note(told)

    from ..farm.part_folder import PREVIEW, held
    from ..farm.render import FarmRender

    started = time.perf_counter()
    folder = request.output.with_name(request.output.name + FOLDER_SUFFIX)
    with held(folder, request.output), interrupt_flag() as interrupted, crew(farm) as workers:
        note(f"{folder / PREVIEW} shows now and then what there is")
        work = FarmRender(workers, scene, settings, scene_file, folder, parts, note)
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
            request.output,
            result.picture.rgb,
            exposure_ev=settings.exposure_ev,
            glare=settings.glare,
            antialias=scene.render.antialias_highlights,
            spectral=result.picture.spectral,
            bin_edges_nm=result.picture.bin_edges_nm,
        )
        if not farm.keep_parts:
            work.kept.remove()
    stats, tally = result.picture.stats, result.tally
    again = f", {result.taken_up} of them from before" if result.taken_up else ""
    copied = f", {tally.copied} begun a second time" if tally.copied else ""
    print(
        f"{request.output.resolve()}: {settings.width}×{settings.height}, {result.parts} parts{again}{copied}, "
        f"{stats.photons:,} photons in {time.perf_counter() - started:.1f} s, of which merging "
        f"{result.part_bytes / 1e6:.1f} MB took {result.merge_seconds:.1f} s ({stats.renderer})"
    )
    if request.stats:
        print("\n".join(stats.lines()))
    return 0


def farm_animate_command(request: AnimateRequest, farm: FarmRequest) -> int:
    """Render an animation; returns the exit code. Raises `UserError`."""
    from ..base.movie import FILM_SUFFIXES, Frames, check_film, check_folder, open_sink
    from ..base.progress import ProgressReporter

    workers_of(farm)
    plan = plan_of(request)
    settings, count = plan.settings, len(plan.only)
    size = settings.width, settings.height

    from ..farm.animate import FarmFrames
    from ..farm.part_folder import held

    is_movie, started = request.output.suffix.lower() in FILM_SUFFIXES, time.perf_counter()
    folder = request.output.with_name(request.output.name + ".frames") if is_movie else request.output
    if is_movie:
        check_film(request.output, size)
    else:
        check_folder(folder)
    with held(folder, request.output), interrupt_flag() as interrupted, crew(farm) as workers:
        sink = Frames(folder, plan.manifest, request.overwrite)
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
        movie = open_sink(request.output, size, plan.fps, {})
        try:
            for index in plan.only:
                movie.write(index, sink.read(index))
        finally:
            movie.close()
        if not farm.keep_parts:
            shutil.rmtree(folder, ignore_errors=True)
    kept = f" ({there} were there)" if there else ""
    copied = f", {tally.copied} begun a second time" if tally.copied else ""
    print(
        f"{request.output.resolve()}: {made} of {count} frames{kept}{copied}, {size[0]}×{size[1]} at {plan.fps:g} a "
        f"second, in {time.perf_counter() - started:.1f} s"
    )
    return 0


def farm_bench_command(request: BenchRequest, farm: FarmRequest, show: Callable[[object], None]) -> int:
    """Measure scenes side by side; returns the exit code. Raises `UserError`."""
    if request.output is None:
        raise UserError("bench needs a folder for what it finds: give one with -o DIR")
    settings, count = parse_bench_settings(request), workers_of(farm)
    start_s, started = time.process_time(), time.perf_counter()
    scenes = load_scenes(request.scenes or (CAMERA_SCENES if request.camera_pass else ()))
    scenes = met_by(settings.reference, scenes)
    start_s += (time.perf_counter() - started) / len(scenes)
    if count is not None and count > 1:
        note("workers of one machine slow each other: times compare within this run only")
        if len(scenes) < count:
            note(f"a scene is measured by one worker, so {len(scenes)} of {count} have something to do")

    from ..base.progress import ProgressReporter
    from ..bench.results import BenchResult
    from ..farm.bench import FarmBench
    from ..farm.part_folder import held

    output = request.output

    def open_store(where: dict[str, str]) -> Store:
        from ..bench.store import Store

        now = datetime.now(UTC).isoformat(timespec="seconds")
        command = repeat_command([*scenes], request)
        return Store(output, BenchResult(__version__, now, command, where, [], settings), request.fresh)

    with held(output, output), interrupt_flag() as interrupted, crew(farm) as workers:
        work = FarmBench(workers, scenes, settings, open_store, start_s, note)
        with ProgressReporter("bench") as progress:
            is_done = work.run(progress, interrupted)
        if work.store is not None:
            if not is_done:
                print(f"spectrasplat: stopped; {kept_text(work.store.result)}", file=sys.stderr)
            write_and_show(work.store.result, output, show)
    return 0 if is_done else interrupted.exit_code
