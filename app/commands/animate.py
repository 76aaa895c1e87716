"""The animate command: check everything, then render frame after frame; Ctrl-C keeps what is done."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError, plain
from ..base.interrupts import interrupt_flag
from ..base.memory import check_picture_memory
from ..model.scene import Scene
from ..model.settings import RenderSettings
from . import options

if TYPE_CHECKING:
    from ..edit.animation import Animation
    from ..edit.opening import Opening

DEFAULT_FRAMES = 120
DEFAULT_FPS = 24.0
MAX_FPS = 240.0
MAX_FRAMES = 1_000_000


@dataclass(frozen=True)
class AnimateRequest:
    """The animate command's options as typed; None where the user said nothing."""

    scene: str
    output: Path
    turntable: bool = False
    keys: Path | None = None
    ranges: tuple[str, ...] = ()
    frames: str | None = None
    fps: str | None = None
    size: str | None = None
    photons: str | None = None
    spp: str | None = None
    exposure: str | None = None
    seed: str | None = None
    method: str | None = None
    camera_method: str | None = None
    overwrite: bool = False
    opening: Opening | None = None
    skip_existing: bool = False


@dataclass(frozen=True)
class Plan:
    """What a request amounts to."""

    animation: Animation
    settings: RenderSettings
    fps: float
    only: range
    """Numbers of the frames that are asked for."""
    manifest: Mapping[str, object]


def plan_of(request: AnimateRequest) -> Plan:
    """Everything checked; what was assumed is told. Raises `UserError`."""
    from ..base.movie import FILM_SUFFIXES
    from ..edit.parameters import Stage
    from ..render.animate import description

    frames, only = _parse_frames(request.frames)
    if request.skip_existing and request.overwrite:
        raise UserError(
            "--skip-existing and --overwrite exclude each other: keep the frames there are, or replace them"
        )
    if request.skip_existing and request.output.suffix.lower() in FILM_SUFFIXES:
        raise UserError(
            f"--skip-existing is for a folder of frames: a film ({request.output.suffix}) is written in one go"
        )
    fps = DEFAULT_FPS if request.fps is None else _parse_fps(request.fps)
    scene = options.open_scene(request.scene, request.opening)
    settings = _settings(request, scene)
    exposure = scene.render.exposure_ev if request.exposure is None else options.parse_exposure(request.exposure)
    animation = _animation(request, Stage(scene, scene.camera, exposure), frames, fps)
    photons = settings.photons or scene.render.photons
    only = _checked_range(only, len(animation.times_s))
    for note in scene.notes:
        print(f"note: {plain(note)}", file=sys.stderr)
    return Plan(animation, settings, fps, only, description(animation, settings, fps, photons))


def animate_command(request: AnimateRequest) -> int:
    """Render an animation; returns the exit code. Raises `UserError`."""
    from ..base.movie import MANIFEST, open_sink
    from ..base.progress import ProgressReporter
    from ..render.animate import render_animation
    from ..render.notices import FrameNotices

    plan = plan_of(request)
    animation, settings, fps, only = plan.animation, plan.settings, plan.fps, plan.only
    scene = animation.start.scene
    sink = open_sink(request.output, (settings.width, settings.height), fps, plan.manifest, request.overwrite)

    from ..gpu.context import create_context
    from ..gpu.shader import keep_programs

    count, started, notices = len(only), time.perf_counter(), FrameNotices()
    there = sum(sink.has(i) for i in only)
    try:
        context = create_context()
    except BaseException:
        sink.close()
        raise
    with context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        keep_programs(context.ctx)  # frames of an edited scene need the same ones
        work, done = render_animation(context, animation, settings, sink, notices=notices, only=only), 0.0
        try:
            for done in work:
                progress(done, f"frame {min(int(done * count) + 1, count)} of {count}")
                if interrupted():
                    break
        finally:
            work.close()
            progress.close()
            for notice in notices.lines(of_frames=count > 1):
                print(f"note: {plain(notice)}", file=sys.stderr)
        stopped = interrupted() and done < 1.0
    written = int(done * count + 1e-6)
    kept = f" ({there} were there)" if there else ""
    early = ", stopped early" if stopped else ""
    place = request.output.resolve()
    if not stopped and written < count:
        early = f"; {count - written} are in the hands of other processes (the same command again sees to them)"
    if stopped and written == 0:
        print(f"{place}: no frame was finished")
        return interrupted.exit_code
    again = f"; the same command goes on ({MANIFEST} knows it)" if stopped and place.is_dir() else ""
    print(
        f"{place}: {written} of {count} frames{kept}, {settings.width}×{settings.height} at {fps:g} a second, in "
        f"{time.perf_counter() - started:.1f} s{early}{again}"
    )
    return interrupted.exit_code if stopped else 0


def _parse_frames(text: str | None) -> tuple[int | None, range | None]:
    """How many frames in all, and which of them: "240", "101-200" or "101-200/240"."""
    if text is None:
        return None, None
    which, slash, total = text.partition("/")
    first, dash, last = which.partition("-")
    if not dash and not slash:
        return options.parse_integer("--frames", text, 1, MAX_FRAMES), None
    if not (dash and first.strip() and last.strip()):
        raise UserError(f"--frames '{text}' is no range: give for example 0-119, or 101-200/240 of 240 in all")
    begin = options.parse_integer("--frames", first, 0, MAX_FRAMES - 1)
    end = options.parse_integer("--frames", last, 0, MAX_FRAMES - 1)
    if end < begin:
        raise UserError(f"--frames {text} runs backwards: give the lower number first")
    return options.parse_integer("--frames", total, 1, MAX_FRAMES) if slash else None, range(begin, end + 1)


def _checked_range(only: range | None, count: int) -> range:
    """`only`, where the animation has those frames; all without."""
    if only is not None and only.stop > count:
        raise UserError(
            f"--frames {only.start}-{only.stop - 1} goes beyond the animation, whose {count} frames are 0 to "
            f"{count - 1}: give fewer, or how many there are in all, as in {only.start}-{only.stop - 1}/{only.stop}"
        )
    return range(count) if only is None else only


def _parse_fps(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.1 <= value <= MAX_FPS:
        raise UserError(f"--fps '{text}' is out of range: give between 0.1 and {MAX_FPS:.0f} frames a second")
    return value


def _settings(request: AnimateRequest, scene: Scene) -> RenderSettings:
    settings = RenderSettings(width=scene.render.width, height=scene.render.height, max_depth=scene.render.max_depth)
    if request.size is not None:
        width, height = options.parse_size(request.size)
        settings = replace(settings, width=width, height=height)
    if request.photons is not None:
        settings = replace(settings, photons=options.parse_photons(request.photons))
    if request.spp is not None:
        settings = replace(settings, spp=options.parse_integer("--spp", request.spp, 1, options.MAX_SPP))
    if request.seed is not None:
        settings = replace(settings, seed=options.parse_integer("--seed", request.seed, 0, options.MAX_SEED))
    if request.method is not None:
        settings = replace(settings, method=options.parse_method(request.method))
    if request.camera_method is not None:
        settings = replace(settings, camera_method=options.parse_camera_method(request.camera_method))
    check_picture_memory(settings.width, settings.height, None)
    return settings


def _animation(request: AnimateRequest, stage, frames: int | None, fps: float):
    """What the options describe: keys and ranges together, and the turntable with them or alone."""
    from ..edit import animation

    tracks = () if request.keys is None else animation.read_keys(request.keys, stage)
    if request.ranges:
        last = max((track.times_s[-1] for track in tracks), default=0.0)
        duration = last or ((frames or DEFAULT_FRAMES) - 1) / fps
        ranges = tuple(animation.parse_range(text, stage, duration) for text in request.ranges)
        twice = {track.path for track in tracks} & {track.path for track in ranges}
        if twice or len({track.path for track in ranges}) < len(ranges):
            path = next(iter(twice), request.ranges[-1].partition("=")[0])
            raise UserError(f"{path} is given twice: set each parameter once, by --keys or by --set")
        tracks += ranges
    if not tracks:
        return animation.turntable(stage, frames or DEFAULT_FRAMES, fps)
    made = animation.keyed(stage, tracks, frames, fps)
    if not request.turntable:
        return made
    if animation.ORBIT in {track.path for track in tracks}:
        raise UserError(f"--turntable moves {animation.ORBIT}, which has keys of its own: leave one of them out")
    return animation.with_turntable(made)
