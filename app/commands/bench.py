"""The commands bench and bench-view: check everything first, measure with all kept, say what was found."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UserError, suggestion
from ..base.interrupts import exit_code_of
from ..base.memory import check_picture_memory
from ..base.version import __version__
from ..bench.results import DEFAULT_METHODS, BenchResult, BenchSettings
from ..model.settings import CAMERA_METHODS, METHODS
from .measuring_table import Bench, BenchView
from .options import given_for, words
from .printing import note, show
from .scenes import find_scene, load_scenes

if TYPE_CHECKING:
    from ..model.scene import Scene

CAMERA_SECONDS = 20.0
"""Time of the largest rendering where the camera is measured and nothing else was asked for: the talk's stochastic
picture had as much."""
CAMERA_SCENES = ("prism_edge", "lens_text", "brilliant_studio", "ball_caustic")
"""Shipped scenes that are about what is seen through glass; `bench --camera` without names measures these."""
VIEW_SIZE = {True: (960, 540), False: (1920, 1080)}
"""Pixels of the viewport, by whether the processor draws: the sizes that the viewer promises its frame times for."""


def bench(options: Bench, show: Callable[[object], None] = show) -> int:
    """Run the bench; returns the exit code. Raises `UserError`."""
    if options.output is None:
        raise UserError("bench needs a folder for what it finds: give one with -o DIR")
    settings = settings_of(options)
    # What any process of this program spends before it has its scene: interpreter and imports, as processor time, then
    # a scene's file and the OpenGL context.
    start_s, started = time.process_time(), time.perf_counter()
    named = load_scenes(options.scenes or (CAMERA_SCENES if options.camera_pass else ()))
    scenes = met_by(settings.reference, named)
    start_s += (time.perf_counter() - started) / len(scenes)

    from ..base.progress import ProgressReporter
    from ..bench.machine import machine
    from ..bench.runner import run_bench
    from ..bench.store import Store
    from ..gpu.context import create_context

    started = time.perf_counter()
    with create_context() as context:
        start_s += time.perf_counter() - started
        store = Store(options.output, empty_result([*scenes], options, settings, machine(context)), options.fresh)
        stopped, left_out = 0, []

        def leave_out(reason: str) -> None:
            note(reason)
            left_out.append(reason)

        try:
            with ProgressReporter("bench") as progress:
                # What others took hours for is not lost to one scene that cannot be measured.
                skipped = None if len(scenes) == 1 else leave_out
                run_bench(context, scenes, store, progress, skipped, start_seconds=start_s)
        except KeyboardInterrupt as interrupt:
            stopped = exit_code_of(interrupt)
            print(f"spectrasplat: stopped; {kept_text(store.result)}", file=sys.stderr)
    write_and_show(store.result, options.output, show)
    # Who names scenes wants them measured.
    return stopped or int(bool(options.scenes and left_out))


def settings_of(options: Bench) -> BenchSettings:
    """What is measured, with defaults where nothing was said. Raises `UserError`."""
    own: dict[str, Any] = {}
    if options.camera_pass:
        own = {
            "measured_pass": "camera",
            "seconds": CAMERA_SECONDS,
            "methods": tuple(name for name in DEFAULT_METHODS if name in CAMERA_METHODS and name != "srd-photons"),
        }
    own |= given_for("settings", options)
    if options.methods is not None:
        own["methods"] = _checked_methods(options.methods, CAMERA_METHODS if options.camera_pass else METHODS)
    settings = BenchSettings(**own)
    if settings.size is not None:
        check_picture_memory(*settings.size, None)
    if settings.horizon is not None and options.camera_pass:
        raise UserError("--horizon is for methods of the light pass: leave it out with --camera")
    if settings.horizon is not None and settings.horizon < settings.seconds:
        raise UserError(
            f"--horizon {settings.horizon:g} is less than the photon time that every method is given: give at least "
            f"{settings.seconds:g}"
        )
    return settings


def _checked_methods(given: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Names among `known`; "regular" stands for both of its kinds."""
    names = [name for part in given for name in (("regular-7", "regular-16") if part == "regular" else (part,))]
    for name in names:
        if name not in known:
            hint = suggestion(name, known)
            what = "is a method of the light pass alone" if name in METHODS else "is unknown"
            raise UserError(f"--methods '{name}' {what}{hint or ','} known are {', '.join(known)}")
    return tuple(dict.fromkeys(names))


def met_by(reference: str, scenes: dict[str, Scene]) -> dict[str, Scene]:
    """The scenes as a reference of this kind (`REFERENCES`) is to meet them; their pictures stay the same."""
    if reference == "exact":
        return scenes
    from ..reference.scene_surfaces import as_triangles

    return {name: as_triangles(scene) for name, scene in scenes.items()}


def empty_result(
    scenes: Sequence[str], options: Bench, settings: BenchSettings, machine: dict[str, str]
) -> BenchResult:
    """What a run begins with."""
    output = options.output.name if options.output else ""
    words_typed = words(options, leave_out=("scenes", "output", "fresh", "camera_pass"))
    command = ["spectrasplat", "bench", *["--camera"] * options.camera_pass, *scenes, "-o", output, *words_typed]
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return BenchResult(__version__, now, shlex.join(command), machine, [], settings)


def kept_text(result: BenchResult) -> str:
    """How much is done, and how to go on."""
    complete = [scene.scene for scene in result.scenes if scene.complete]
    text = f"{len(complete)} scene{'s' * (len(complete) != 1)} done"
    for scene in result.scenes:
        if not scene.complete:
            done = sum(len({sample.seed for sample in curve.samples}) for curve in scene.curves)
            text += f", {done} of {scene.seeds * len(result.settings.methods)} method seeds of '{scene.scene}' kept"
    return text + "; the same command goes on from there"


def write_and_show(result: BenchResult, directory: Path, show: Callable[[object], None]) -> None:
    """Tables on the screen, then plots and pages in the folder."""
    from ..bench.report.report import write_report
    from ..bench.report.tables import screen_parts

    measured = [scene for scene in result.scenes if any(curve.points for curve in scene.curves)]
    for scene in measured:
        for part in screen_parts(scene):
            show(part)
    if measured:
        write_report(result, directory)
        show(
            f"{(directory / 'report.html').resolve()}: the report; {(directory / 'results.json').resolve()}: every "
            "number"
        )


def bench_view(options: BenchView) -> int:
    """Measure the viewer and print; returns the exit code. Raises `UserError`."""
    from ..bench import viewer_speed
    from ..bench.machine import words as figure_words
    from ..gpu.context import create_context

    scene = find_scene(options.scene)
    with create_context() as context:
        size = options.size or VIEW_SIZE[context.is_software]
        print(f"{scene.stem}, viewport {size[0]}×{size[1]}, {context.renderer}, {context.version}")
        for name, figures in viewer_speed.run(context, scene, size, options.seconds):
            print(f"{name:<22}{figure_words(figures)}", flush=True)
    return 0
