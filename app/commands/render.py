"""The render command: check everything first, then render, then write, then say what was done."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UserError
from ..base.image_io import SHOWN_SUFFIXES, SPECTRAL_SUFFIXES, check_suffix, write_image
from ..base.interrupts import interrupt_flag
from ..base.process_age import process_age_s
from ..model.scene import Scene
from ..model.settings import RenderSettings
from .opened import note_assumptions, open_scene, settings_for
from .printing import note
from .scenes import find_scene
from .table import Render

if TYPE_CHECKING:
    from ..render.still import RenderResult

START_S, FRESH_S = 0.3, 20.0
"""What a process takes to start, where the system does not report it: --seconds includes that …; an older one
was not started for this picture."""
ENDING_SHARE = 0.7
"""… and what it takes to end, over that: on a machine that others work on both take longer."""
WRITING_SHARE = 1.4
"""The same of writing a million pixels."""
_USED_BY = (
    (
        "bins",
        (*SPECTRAL_SUFFIXES, ".ssp"),
        "--bins: a {} file holds no spectral channels; write an .exr to keep them",
    ),
    ("glare", SHOWN_SUFFIXES, "--glare does not change a {} file, which is linear; it is for pictures to look at"),
    ("antialias_highlights", SHOWN_SUFFIXES, "--antialias-highlights does not change a {} file, which is linear"),
)
"""Options with the suffixes of the formats that have a use for them, and what is noted otherwise."""


def render_picture(options: Render) -> int:
    """Render to a file; returns the exit code. Raises `UserError`."""
    starting_s = process_age_s() or START_S
    starting_s = starting_s if starting_s < FRESH_S else START_S
    begun = time.perf_counter() - starting_s
    from ..base.progress import ProgressReporter

    # What costs nothing to check comes before the scene is read, and that before the device.
    _check_passes(options)
    if options.passes is None:
        check_suffix(options.output)
    scene_file = check_output(options)
    scene = open_scene(options)
    settings = picture_settings(options, scene, options.stats)
    begun -= starting_s * (ENDING_SHARE + WRITING_SHARE * 1e-6 * settings.width * settings.height)
    # Before the work: who waits for minutes should know what was assumed, and also if it fails.
    note_assumptions(scene)
    for sentence in _unused_options(options):
        note(sentence)
    if options.passes is not None:
        return _render_part(options, scene, settings, options.passes, scene_file)

    from ..gpu.better_device import advice
    from ..render.still import render

    with interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        result = render(scene, settings, progress=progress, cancelled=interrupted, begun=begun)
        stopped = interrupted()
    if better := advice(result.stats.renderer, result.stats.is_software):
        note(better)
    write_result(options.output, scene, settings, result)
    print(_summary(options, settings, result.stats, stopped))
    if options.stats:
        print("\n".join(result.stats.lines()))
    return interrupted.exit_code if stopped else 0


def write_result(output: Path, scene: Scene, settings: RenderSettings, result: RenderResult) -> None:
    """Note what is to be said of a picture, and write it. Raises `UserError`."""
    for notice in result.stats.notices:
        note(notice)
    write_image(
        output,
        result.rgb,
        exposure_ev=settings.exposure_ev,
        glare=settings.glare,
        antialias=scene.render.antialias_highlights,
        spectral=result.spectral,
        bin_edges_nm=result.bin_edges_nm,
    )


def check_output(options: Render) -> Path:
    """The scene's file; raises `UserError` where that is not found, or the picture cannot be written."""
    from ..base.atomic import check_writable

    scene_file = find_scene(options.scene)
    check_writable(options.output)
    return scene_file


def picture_settings(options: Render, scene: Scene, tally: bool) -> RenderSettings:
    """Settings with the scene's own wishes where the user said nothing. Raises `UserError`."""
    wishes = scene.render
    return settings_for(
        options,
        scene,
        exposure_ev=wishes.exposure_ev,
        glare=wishes.glare,
        photons=None if options.seconds is not None else wishes.photons,
        tally=tally,
    )


def _check_passes(options: Render) -> None:
    """Raise `UserError` unless the output is a part where one is asked for, and a picture where none is."""
    is_part = options.output.suffix.lower() == ".ssp"
    if options.passes is None:
        if is_part:
            raise UserError(
                f"{options.output} is a part of a rendering: say which by --passes, for example --passes 1/8"
            )
    elif not is_part:
        raise UserError(f"--passes makes a part, not a picture: name the output .ssp, not '{options.output.name}'")
    elif options.seconds is not None:
        raise UserError("--passes and --seconds exclude each other: parts share out a number of photons")


def _render_part(
    options: Render, scene: Scene, settings: RenderSettings, share: tuple[int, int], scene_file: Path
) -> int:
    """Trace a part and write it; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..gpu.context import create_context
    from ..render.part_file import write_part
    from ..render.parts import Share, trace_part

    started = time.perf_counter()
    place = str(scene_file.resolve())
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        part = trace_part(
            context, scene, settings, Share(*share), place, lambda done: progress(done, "tracing photons"), interrupted
        )
    if part is None:
        print("spectrasplat: nothing was written: a part is whole or not at all", file=sys.stderr)
        return interrupted.exit_code
    write_part(options.output, part)
    print(
        f"{options.output.resolve()}: part {share[0]} of {share[1]}, {part.header.stats['photons']:,} photons in "
        f"{time.perf_counter() - started:.1f} s, {options.output.stat().st_size / 1e6:.1f} MB"
    )
    return 0


def _unused_options(options: Render) -> list[str]:
    """A sentence for each option that the output's format has no use for."""
    suffix = options.output.suffix.lower()
    notes = [
        sentence.format(suffix)
        for name, suffixes, sentence in _USED_BY
        if getattr(options, name) is not None and suffix not in suffixes
    ]
    if options.exposure is not None and suffix == ".ssp":
        notes.append("--exposure does not change a part; give it to 'merge'")
    elif options.exposure is not None and suffix not in SHOWN_SUFFIXES:
        notes.append(f"--exposure does not change a {suffix} picture, which is linear; it is for pictures to look at")
    return notes


def _summary(options: Render, settings: RenderSettings, stats: Any, stopped: bool) -> str:
    """Where the picture is and what was done in what time."""
    device = "software renderer" if stats.is_software else "GPU"
    early = ", stopped early" if stopped else ""
    return (
        f"{options.output.resolve()}: {settings.width}×{settings.height}, {stats.photons:,} photons, "
        f"{stats.splats:,} splats in {stats.seconds:.1f} s{early} ({device}: {stats.renderer})"
    )
