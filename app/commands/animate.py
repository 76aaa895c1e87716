"""The animate command: check everything, then render frame after frame; Ctrl-C keeps what is done."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from ..model.settings import RenderSettings
from .opened import note_assumptions, open_scene, settings_for
from .printing import note
from .table import Animate

if TYPE_CHECKING:
    from ..edit.animation import Animation
    from ..edit.parameters import Stage

DEFAULT_FRAMES = 120


@dataclass(frozen=True)
class Plan:
    """What the options amount to."""

    animation: Animation
    settings: RenderSettings
    fps: float
    only: range
    """Numbers of the frames to render."""
    manifest: Mapping[str, object]


def plan_of(options: Animate) -> Plan:
    """Everything checked; what was assumed is noted. Raises `UserError`."""
    from ..edit.parameters import Stage
    from ..render.animate import description

    scene = open_scene(options)
    settings = settings_for(options, scene)
    exposure = scene.render.exposure_ev if options.exposure is None else options.exposure
    frames, only = options.frames
    animation = _animation(options, Stage(scene, scene.camera, exposure), frames)
    only = _checked_range(only, len(animation.times_s))
    note_assumptions(scene)
    photons = settings.photons or scene.render.photons
    return Plan(animation, settings, options.fps, only, description(animation, settings, options.fps, photons))


def animate(options: Animate) -> int:
    """Render an animation; returns the exit code. Raises `UserError`."""
    from ..base.movie import MANIFEST, open_sink
    from ..base.progress import ProgressReporter
    from ..render.animate import render_animation
    from ..render.notices import FrameNotices

    plan = plan_of(options)
    animation, settings, fps, only = plan.animation, plan.settings, plan.fps, plan.only
    scene = animation.start.scene
    sink = open_sink(options.output, (settings.width, settings.height), fps, plan.manifest, options.overwrite)

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
                note(notice)
        stopped = interrupted() and done < 1.0
    written = int(done * count + 1e-6)
    kept = f" ({there} were there)" if there else ""
    early = ", stopped early" if stopped else ""
    place = options.output.resolve()
    if not stopped and written < count:
        early = f"; {count - written} are being made by other processes (the same command again makes what they leave)"
    if stopped and written == 0:
        print(f"{place}: no frame was finished")
        return interrupted.exit_code
    again = f"; the same command goes on ({MANIFEST} knows it)" if stopped and place.is_dir() else ""
    print(
        f"{place}: {written} of {count} frames{kept}, {settings.width}×{settings.height} at {fps:g} a second, in "
        f"{time.perf_counter() - started:.1f} s{early}{again}"
    )
    return interrupted.exit_code if stopped else 0


def _checked_range(only: range | None, count: int) -> range:
    """`only`, where the animation has those frames; all without."""
    if only is not None and only.stop > count:
        raise UserError(
            f"--frames {only.start}-{only.stop - 1} goes beyond the animation, whose {count} frames are 0 to "
            f"{count - 1}: give fewer, or how many there are in all, as in {only.start}-{only.stop - 1}/{only.stop}"
        )
    return range(count) if only is None else only


def _animation(options: Animate, stage: Stage, frames: int | None) -> Animation:
    """What the options describe: keys and ranges together, and the turntable with them or alone."""
    from ..edit import animation

    tracks = () if options.keys is None else animation.read_keys(options.keys, stage)
    if options.ranges:
        last = max((track.times_s[-1] for track in tracks), default=0.0)
        duration = last or ((frames or DEFAULT_FRAMES) - 1) / options.fps
        ranges = tuple(animation.parse_range(text, stage, duration) for text in options.ranges)
        twice = {track.path for track in tracks} & {track.path for track in ranges}
        if twice or len({track.path for track in ranges}) < len(ranges):
            path = next(iter(twice), options.ranges[-1].partition("=")[0])
            raise UserError(f"{path} is given twice: set each parameter once, by --keys or by --set")
        tracks += ranges
    if not tracks:
        return animation.turntable(stage, frames or DEFAULT_FRAMES, options.fps)
    made = animation.keyed(stage, tracks, frames, options.fps)
    if not options.turntable:
        return made
    if animation.ORBIT in {track.path for track in tracks}:
        raise UserError(f"--turntable moves {animation.ORBIT}, which has keys of its own: leave one of them out")
    return animation.with_turntable(made)
