"""The render command: check everything first, then render, then write, then say what was done."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UserError, plain
from ..base.interrupts import interrupt_flag
from ..base.memory import check_picture_memory
from ..base.process_age import process_age_s
from ..model.scene import Scene
from ..model.settings import RenderSettings
from . import options

if TYPE_CHECKING:
    from ..edit.opening import Opening
    from ..render.still import RenderStats


START_S, FRESH_S = 0.3, 20.0
"""What a process takes to start, where the system does not tell: --seconds holds that too …; an older one was not
started for this picture."""
ENDING_SHARE = 0.7
"""… and what it takes to end, over that: on a machine that others work on both take longer."""
WRITING_SHARE = 1.4
"""The same of writing a million pixels."""


@dataclass(frozen=True)
class RenderRequest:
    """The render command's options as typed; None where the user said nothing."""

    scene: str
    output: Path
    size: str | None = None
    photons: str | None = None
    seconds: str | None = None
    seed: str | None = None
    method: str | None = None
    camera_method: str | None = None
    layer: str | None = None
    bins: str | None = None
    exposure: str | None = None
    max_depth: str | None = None
    spp: str | None = None
    camera: str | None = None
    batch: str | None = None
    stats: bool = False
    opening: Opening | None = None
    passes: str | None = None
    glare: str | None = None
    lens_radius: str | None = None
    focus_distance: str | None = None
    polarisation: bool | None = None
    antialias_highlights: bool | None = None
    bounces: str | None = None
    haze: str | None = None
    haze_anisotropy: str | None = None


def render_command(request: RenderRequest) -> int:
    """Render to a file; returns the exit code. Raises `UserError`."""
    starting_s = process_age_s() or START_S
    starting_s = starting_s if starting_s < FRESH_S else START_S
    begun = time.perf_counter() - starting_s
    from ..base.atomic import check_writable
    from ..base.image_io import check_suffix, write_image
    from ..base.progress import ProgressReporter

    # What costs nothing to check comes before the scene is read, and that before the device.
    asked = parse_settings(request)
    share = _parse_passes(request)
    if share is None:
        check_suffix(request.output)
    scene_file = options.find_scene(request.scene)
    # os.path.exists, unlike Path.exists, is silent about a name that is too long.
    if os.path.exists(request.output) and request.output.samefile(scene_file):
        raise UserError(f"cannot write {request.output}: it is the scene itself; choose another name")
    check_writable(request.output)

    scene = scene_as_asked(request)
    settings = complete_settings(asked, scene, request.stats)
    begun -= starting_s * (ENDING_SHARE + WRITING_SHARE * 1e-6 * settings.width * settings.height)
    # Before the work: who waits for minutes should know what was assumed, and also if it fails.
    for note in (*scene.notes, *_unused_options(request)):
        print(f"note: {plain(note)}", file=sys.stderr)

    if share is not None:
        return _render_part(request, scene, settings, share, scene_file)

    from ..gpu.better_device import advice
    from ..render.still import render

    with interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        result = render(scene, settings, progress=progress, cancelled=interrupted, begun=begun)
        stopped = interrupted()
    if better := advice(result.stats.renderer, result.stats.is_software):
        print(f"note: {better}", file=sys.stderr)
    if request.camera == "beams" and (reason := _why_paths(scene, settings, result.stats)):
        print(f"note: --camera beams is not followed: {reason}; the picture is seen by paths", file=sys.stderr)
    for notice in result.stats.notices:
        print(f"note: {plain(notice)}", file=sys.stderr)
    write_image(
        request.output,
        result.rgb,
        exposure_ev=settings.exposure_ev,
        glare=settings.glare,
        antialias=scene.render.antialias_highlights,
        spectral=result.spectral,
        bin_edges_nm=result.bin_edges_nm,
    )
    print(_summary(request, settings, result.stats, stopped))
    if request.stats:
        print("\n".join(result.stats.lines()))
    return interrupted.exit_code if stopped else 0


def scene_as_asked(request: RenderRequest) -> Scene:
    """The scene with what options say of it. Raises `UserError`."""
    scene = options.open_scene(request.scene, request.opening)
    scene = options.with_lens(scene, request.lens_radius, request.focus_distance)
    bounces = None if request.bounces is None else options.parse_bounces(request.bounces)
    wishes: dict[str, Any] = {
        "polarisation": request.polarisation,
        "antialias_highlights": request.antialias_highlights,
        "bounces": bounces,
        "haze": None if request.haze is None else options.parse_haze(request.haze),
        "haze_anisotropy": None
        if request.haze_anisotropy is None
        else options.parse_haze_anisotropy(request.haze_anisotropy),
    }
    asked = {name: wish for name, wish in wishes.items() if wish is not None}
    return replace(scene, render=replace(scene.render, **asked)) if asked else scene


def _parse_passes(request: RenderRequest) -> tuple[int, int] | None:
    """(index, count) of the part that is asked for; None for a whole picture."""
    is_part = request.output.suffix.lower() == ".ssp"
    if request.passes is None:
        if is_part:
            raise UserError(
                f"{request.output} is a part of a rendering: say which by --passes, for example --passes 1/8"
            )
        return None
    words = request.passes.split("/")
    if len(words) != 2 or not all(word.isascii() and word.isdigit() and len(word) < 8 for word in words):
        raise UserError(f"--passes '{request.passes}' is no part: give which of how many, for example 1/8")
    index, count = map(int, words)
    if not 1 <= index <= count <= options.MAX_PARTS:
        raise UserError(f"--passes {request.passes} is out of range: give 1/N to N/N, N at most {options.MAX_PARTS}")
    if not is_part:
        raise UserError(f"--passes makes a part, not a picture: name the output .ssp, not '{request.output.name}'")
    if request.seconds is not None:
        raise UserError("--passes and --seconds exclude each other: parts share out a number of photons")
    return index, count


def _render_part(
    request: RenderRequest, scene: Scene, settings: RenderSettings, share: tuple[int, int], scene_file: Path
) -> int:
    """Trace a part and write it; returns the exit code. Raises `UserError`."""
    import time

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
    write_part(request.output, part)
    print(
        f"{request.output.resolve()}: part {share[0]} of {share[1]}, {part.header.stats['photons']:,} photons in "
        f"{time.perf_counter() - started:.1f} s, {request.output.stat().st_size / 1e6:.1f} MB"
    )
    return 0


def parse_settings(request: RenderRequest) -> dict[str, Any]:
    """The fields of `RenderSettings` that the user gave, checked as far as no scene is needed."""
    if request.photons is not None and request.seconds is not None:
        raise UserError("--photons and --seconds exclude each other: give a count or a time, not both")
    parsers: dict[str, tuple[str | None, Callable[[str], Any]]] = {
        "photons": (request.photons, options.parse_photons),
        "seconds": (request.seconds, options.parse_seconds),
        "seed": (request.seed, _integer("--seed", 0, options.MAX_SEED)),
        "method": (request.method, options.parse_method),
        "camera_method": (request.camera_method, options.parse_camera_method),
        "layer": (request.layer, str),
        "bins": (request.bins, _integer("--bins", options.MIN_BINS, options.MAX_BINS)),
        "exposure_ev": (request.exposure, options.parse_exposure),
        "glare": (request.glare, options.parse_glare),
        "max_depth": (request.max_depth, _integer("--max-depth", 1, options.MAX_DEPTH)),
        "spp": (request.spp, _integer("--spp", 1, options.MAX_SPP)),
        "camera_beams": (request.camera, options.parse_camera),
        "batch": (request.batch, options.parse_batch),
    }
    asked = {field: parse(text) for field, (text, parse) in parsers.items() if text is not None}
    if request.size is not None:
        asked["width"], asked["height"] = options.parse_size(request.size)
    return asked


def complete_settings(asked: dict[str, Any], scene: Scene, stats: bool) -> RenderSettings:
    """Settings with the scene's own wishes where the user said nothing."""
    wishes = scene.render
    settings = RenderSettings(
        **{
            "width": wishes.width,
            "height": wishes.height,
            "max_depth": wishes.max_depth,
            "exposure_ev": wishes.exposure_ev,
            "glare": wishes.glare,
            "photons": None if "seconds" in asked else wishes.photons,
            "tally": stats,
            # Who asks for photons alone compares them with what else there is.
            "camera_beams": asked.get("method", "srd") == "srd",
            **asked,
        }
    )
    options.check_layer(settings.layer, scene)
    check_picture_memory(settings.width, settings.height, settings.bins)
    return settings


def _why_paths(scene: Scene, settings: RenderSettings, stats: RenderStats) -> str:
    """Why the camera saw nothing by beams; "" where it did."""
    from ..model.features import why_no_camera_beams  # it need not be read before the checks

    beams = stats.camera_pass.beams
    return beams.reason if beams is not None else why_no_camera_beams(scene, settings) or ""


def _unused_options(request: RenderRequest) -> list[str]:
    """A sentence for each option that the output's format has no use for."""
    from ..base.image_io import SHOWN_SUFFIXES

    suffix = request.output.suffix.lower()
    notes = []
    if request.bins is not None and suffix not in (".exr", ".ssp"):
        notes.append(f"--bins: a {suffix} picture holds no spectral channels; write an .exr to keep them")
    if request.exposure is not None and suffix == ".ssp":
        notes.append("--exposure does not change a part; give it to 'merge'")
    elif request.exposure is not None and suffix not in SHOWN_SUFFIXES:
        notes.append(f"--exposure does not change a {suffix} picture, which is linear; it is for pictures to look at")
    if request.glare is not None and suffix not in SHOWN_SUFFIXES:
        notes.append(f"--glare does not change a {suffix} file, which is linear; it is for pictures to look at")
    if request.antialias_highlights is not None and suffix not in SHOWN_SUFFIXES:
        notes.append(f"--antialias-highlights does not change a {suffix} file, which is linear")
    return notes


def _integer(option: str, low: int, high: int) -> Callable[[str], int]:
    return lambda text: options.parse_integer(option, text, low, high)


def _summary(request: RenderRequest, settings: RenderSettings, stats: Any, stopped: bool) -> str:
    """Where the picture is and what was done in what time."""
    device = "software renderer" if stats.is_software else "GPU"
    early = ", stopped early" if stopped else ""
    return (
        f"{request.output.resolve()}: {settings.width}×{settings.height}, {stats.photons:,} photons, "
        f"{stats.splats:,} splats in {stats.seconds:.1f} s{early} ({device}: {stats.renderer})"
    )
