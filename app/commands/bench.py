"""The bench command: check everything first, measure with all kept, write the report, say what was found."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import UserError, suggestion
from ..base.interrupts import exit_code_of
from ..base.memory import check_picture_memory
from ..base.paths import shipped_scenes
from ..base.version import __version__
from ..bench.results import DEFAULT_METHODS, BenchResult, BenchSettings
from ..model.settings import CAMERA_METHODS, METHODS
from . import options

if TYPE_CHECKING:
    from ..model.scene import Scene

MAX_SEEDS = 1000
MAX_SECONDS = 3600.0
CAMERA_SECONDS = 20.0
"""Time of the largest rendering where the camera is measured and nothing else was asked for: the talk's stochastic
picture had as much."""
CAMERA_SCENES = ("prism_edge", "lens_text", "brilliant_studio", "ball_caustic")
"""Shipped scenes that are about what is seen through glass; `bench --camera` without names measures these."""


@dataclass(frozen=True)
class BenchRequest:
    """The bench command's options as typed; None where the user said nothing."""

    scenes: tuple[str, ...] = ()
    output: Path | None = None
    seconds: str | None = None
    horizon: str | None = None
    seeds: str | None = None
    methods: str | None = None
    size: str | None = None
    reference_seconds: str | None = None
    features: str | None = None
    fresh: bool = False
    camera_pass: bool = False
    reference: str | None = None


def bench_command(request: BenchRequest, show: Callable[[object], None]) -> int:
    """Run the bench; returns the exit code. Raises `UserError`."""
    if request.features is not None:
        if request.camera_pass:
            raise UserError("--features and --camera exclude each other: give one of them")
        return _features(request)
    if request.output is None:
        raise UserError("bench needs a folder for what it finds: give one with -o DIR")
    settings = parse_settings(request)
    # What any process of this program spends before it has its scene: interpreter and imports, as processor time, then
    # a scene's file and the OpenGL context.
    start_s, started = time.process_time(), time.perf_counter()
    scenes = load_scenes(request.scenes or (CAMERA_SCENES if request.camera_pass else ()))
    scenes = met_by(settings.reference, scenes)

    start_s += (time.perf_counter() - started) / len(scenes)

    from ..base.progress import ProgressReporter
    from ..bench.machine import machine
    from ..bench.runner import run_bench
    from ..bench.store import Store
    from ..gpu.context import create_context

    started = time.perf_counter()
    with create_context() as context:
        start_s += time.perf_counter() - started
        empty = BenchResult(
            __version__,
            datetime.now(UTC).isoformat(timespec="seconds"),
            repeat_command([*scenes], request),
            machine(context),
            [],
            settings,
        )
        store = Store(request.output, empty, request.fresh)
        stopped, left_out = 0, []

        def leave_out(reason: str) -> None:
            print(f"note: {reason}", file=sys.stderr)
            left_out.append(reason)

        try:
            with ProgressReporter("bench") as progress:
                # What others took hours for is not lost to one scene that cannot be measured.
                skipped = None if len(scenes) == 1 else leave_out
                run_bench(context, scenes, store, progress, skipped, start_seconds=start_s)
        except KeyboardInterrupt as interrupt:
            stopped = exit_code_of(interrupt)
            print(f"spectrasplat: stopped; {kept_text(store.result)}", file=sys.stderr)
    write_and_show(store.result, request.output, show)
    # Who names scenes wants them measured.
    return stopped or int(bool(request.scenes and left_out))


def parse_settings(request: BenchRequest) -> BenchSettings:
    """The options checked, with defaults where nothing was said."""
    asked: dict[str, Any] = {}
    if request.camera_pass:
        asked |= {
            "measured_pass": "camera",
            "seconds": CAMERA_SECONDS,
            "methods": tuple(name for name in DEFAULT_METHODS if name in CAMERA_METHODS and name != "srd-photons"),
        }
    if request.seconds is not None:
        asked["seconds"] = _seconds("--seconds", request.seconds)
    if request.horizon is not None:
        if request.camera_pass:
            raise UserError("--horizon is for methods of the light pass: leave it out with --camera")
        asked["horizon"] = _seconds("--horizon", request.horizon)
        if asked["horizon"] < asked.get("seconds", BenchSettings().seconds):
            raise UserError(
                f"--horizon {request.horizon} is less than the photon time that every method is given: give at least "
                f"{asked.get('seconds', BenchSettings().seconds):g}"
            )
    if request.reference_seconds is not None:
        asked["reference_seconds"] = _seconds("--reference-seconds", request.reference_seconds)
    if request.reference is not None:
        asked["reference"] = options.parse_reference(request.reference)
    if request.seeds is not None:
        asked["seeds"] = options.parse_integer("--seeds", request.seeds, 1, MAX_SEEDS)
    if request.methods is not None:
        asked["methods"] = parse_methods(request.methods, CAMERA_METHODS if request.camera_pass else METHODS)
    if request.size is not None:
        width, height = options.parse_size(request.size)
        check_picture_memory(width, height, None)
        asked["size"] = (width, height)
    return BenchSettings(**asked)


def _seconds(option: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise UserError(f"{option} '{text}' is not a number, give one, for example 3") from None
    if not 0.0 < value <= MAX_SECONDS:
        raise UserError(f"{option} {text} is out of range: give more than 0 and at most {MAX_SECONDS:.0f}")
    return value


def parse_methods(text: str, known: Sequence[str] = METHODS) -> tuple[str, ...]:
    """Names among `known`, parted by commas; "regular" stands for both of its kinds."""
    names: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        for name in ("regular-7", "regular-16") if part == "regular" else (part,):
            if name not in known:
                hint = suggestion(name, known)
                what = "is a method of the light pass alone" if name in METHODS else "is unknown"
                raise UserError(f"--methods '{name}' {what}{hint or ','} known are {', '.join(known)}")
            if name not in names:
                names.append(name)
    return tuple(names)


def load_scenes(names: Sequence[str]) -> dict[str, Scene]:
    """The scenes asked for by their files' stems, or every shipped one that holds glass."""
    from ..model.io.scene_file import load_scene

    if not names:
        shipped = {name: load_scene(path) for name, path in shipped_scenes().items()}
        return {name: scene for name, scene in shipped.items() if any(o.material.transmits for o in scene.objects)}
    files = [options.find_scene(name) for name in names]
    scenes: dict[str, Scene] = {}
    for name, file in zip(names, files, strict=True):
        if file.stem in scenes:
            raise UserError(
                f"scene {name}: another scene of this run is called '{file.stem}' too; rename the file or run them "
                "apart"
            )
        scenes[file.stem] = load_scene(file)
    return scenes


def met_by(reference: str, scenes: dict[str, Scene]) -> dict[str, Scene]:
    """The scenes as a reference of this kind (`REFERENCES`) is to meet them; their pictures stay the same."""
    if reference == "exact":
        return scenes
    from ..reference.exact_shapes import as_triangles

    return {name: as_triangles(scene) for name, scene in scenes.items()}


def repeat_command(scenes: Sequence[str], request: BenchRequest) -> str:
    """The one command that repeats this run."""
    given = {
        "--seconds": request.seconds,
        "--horizon": request.horizon,
        "--seeds": request.seeds,
        "--methods": request.methods,
        "--size": request.size,
        "--reference-seconds": request.reference_seconds,
        "--reference": request.reference,
    }
    words = [
        "spectrasplat",
        "bench",
        *(["--camera"] if request.camera_pass else []),
        *(request.scenes or scenes),
        "-o",
        request.output.name if request.output else "",
    ]
    for option, value in given.items():
        words += [] if value is None else [option, value]
    return shlex.join(words)


def kept_text(result: BenchResult) -> str:
    """How much is done, and how to go on."""
    complete = [scene.scene for scene in result.scenes if scene.complete]
    text = f"{len(complete)} scene{'s' * (len(complete) != 1)} done"
    for scene in result.scenes:
        if not scene.complete:
            done = sum(len({sample.seed for sample in curve.samples}) for curve in scene.curves)
            text += f", {done} of {scene.seeds * len(result.settings.methods)} method seeds of '{scene.scene}' kept"
    return text + "; the same command goes on from there"


def _features(request: BenchRequest) -> int:
    """What each feature costs in one scene."""
    assert request.features is not None
    if request.scenes:
        raise UserError(
            f"--features measures one scene alone: give 'bench --features {request.features}' without further scenes"
        )
    scene = load_scenes([request.features])

    from ..bench.features import cost as features_cost

    return features_cost.command(next(iter(scene.values())), request.output)


def write_and_show(result: BenchResult, directory: Path, show: Callable[[object], None]) -> None:
    """Tables on the screen, then plots and pages in the folder."""
    from ..bench.report.report import write_report
    from ..bench.screen import scene_lines, scene_table

    measured = [scene for scene in result.scenes if any(curve.points for curve in scene.curves)]
    for scene in measured:
        show(scene_table(scene))
        for line in scene_lines(scene):
            show(line)
    if measured:
        write_report(result, directory)
        show(
            f"{(directory / 'report.html').resolve()}: the report; {(directory / 'results.json').resolve()}: every "
            "number"
        )
