"""The parts of `prove-gpu`, each run in a process of its own: a driver that crashes ends one part, not the proof.

    python -m spectrasplat.commands.proof_steps PART SHORT FILE FOLDER

writes what it finds to FILE, a line of JSON each, as it finds it.
"""

from __future__ import annotations

import base64
import io
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from ..base.errors import UserError

if TYPE_CHECKING:
    import numpy as np

    from ..gpu.shader import Built
    from ..model.scene import Scene
    from ..stress.results import CaseResult

_MOST_COMPILERS = 8
"""Processes that compile at a time; each holds some 400 MiB."""
_SCREEN = (1920, 1080)
_CACHE_FOLDERS = ("XDG_CACHE_HOME", "MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH")
"""Where drivers and SpectraSplat keep programs."""
Figures = dict[str, int | float]


class Finding(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of a part."""

    name: str
    value: str
    broken: bool = False
    """It should be otherwise."""
    seconds: float | None = None
    picture: str = ""
    """A PNG in base64: what is drawn here next to what is stored."""
    rows: list[list[str]] = []
    """A table, its headings first."""
    figures: Figures = {}
    """What was measured, with units in the names."""
    done: float | None = None
    """No finding but the share done of the part."""


@dataclass(frozen=True)
class Part:
    """One part of the proof."""

    key: str
    title: str
    run: Callable[[bool, Path], Iterator[Finding]]
    """(short, folder for files) → what is found."""
    limit_s: tuple[float, float]
    """When it is ended; of the short form."""
    measures: bool = False
    """Nothing has to hold."""


# -- doctor -------------------------------------------------------------------------------


def _doctor(_short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench.machine import clocks, machine
    from ..gpu.context import create_context
    from ..gpu.device_traits import is_software_renderer
    from .doctor import examine

    checks = examine()
    yield from (Finding(check.name, check.found, not check.usable) for check in checks)
    with create_context() as context:
        yield from (Finding(f"machine {name}", value) for name, value in machine(context).items())
        yield Finding("is software", "yes" if is_software_renderer(context.renderer) else "no")
    if said := clocks():
        yield Finding("nvidia-smi", said)


# -- programs -----------------------------------------------------------------------------


def _programs(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..base.paths import shipped_scenes
    from ..gpu import shader, strict_compilers
    from .inspect_programs import HEADINGS, beyond_promises, program_rows

    absent = strict_compilers.missing()
    if absent:
        yield Finding("strict compilers", f"not asked: {absent}")
    scenes = {name: path for name, path in shipped_scenes().items() if not short or name in ("prism", "ball_plain")}
    seen: dict[tuple[str, ...], shader.Built] = {}
    for at, (name, compiled) in enumerate(_each_compiled(scenes)):
        new = [built for built in compiled.programs if built.texts not in seen]
        seen |= {built.texts: built for built in new}
        if compiled.problem:
            yield Finding(name, compiled.problem, True, compiled.seconds)
        else:
            said = beyond_promises(new)
            said += [] if absent else [words for built in new for words in strict_compilers.complaints(built)]
            driver_s = sum(built.seconds for built in compiled.programs)
            longest = max(compiled.programs, key=lambda built: built.seconds)
            words = f"{len(compiled.programs)} programs, {len(new)} of them new: {driver_s:.2f} s in the driver"
            words += f", the longest {longest.name} {longest.seconds:.2f} s; picture after {compiled.seconds:.1f} s"
            yield Finding(name, "; ".join([words, *said]), bool(said), compiled.seconds)
        yield Finding("", "", done=(at + 1) / len(scenes))
    rows = [[*row.cells()] for row in program_rows(list(seen.values()))]
    yield Finding("all programs", f"{len(seen)} different ones", rows=[list(HEADINGS), *rows])


@dataclass(frozen=True)
class _Compiled:
    """A scene's programs, as far as they compile."""

    programs: list[Built]
    problem: str
    seconds: float


def _compiled(path: Path) -> _Compiled:
    """In a process of its own."""
    from ..bench.programs import compiled_programs
    from ..gpu import shader
    from ..gpu.context import create_context
    from ..model.io.scene_file import load_scene
    from ..model.settings import RenderSettings

    scene = load_scene(path)
    with create_context() as context:
        started = time.perf_counter()
        programs, problem = [], ""
        try:
            programs = compiled_programs(context, scene, RenderSettings(max_depth=scene.render.max_depth))
        except (shader.ShaderError, UserError) as error:
            # The other scenes' programs may be wrong for reasons of their own: one run should report all.
            problem = " ".join(str(error).split())
        return _Compiled(programs, problem, time.perf_counter() - started)


def _each_compiled(scenes: dict[str, Path]) -> Iterator[tuple[str, _Compiled]]:
    """By scene, several at a time: a driver compiles a program on one core, for up to half a minute."""
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    workers = max(1, min(len(scenes), (os.cpu_count() or 1) // 2, _MOST_COMPILERS))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        started = {name: pool.submit(_compiled, path) for name, path in scenes.items()}
        for name, future in started.items():
            try:
                yield name, future.result()
            except BrokenProcessPool:
                yield name, _Compiled([], "the driver ended the process that compiled it, or one next to it", 0.0)


# -- known answers, stress ----------------------------------------------------------------

ANSWERS = ("tir-margin", "eye-mirrors", "eye-absorption", "gap", "stack", "perfect-focus", "eye-cut", "eye-grazing")
"""Stress cases against sums and forms in closed form."""
STRESS = ("overflow", "one-texel", "slivers", "eye-corner", "refusals", "prism/size")
"""What breaks elsewhere first. Every shipped scene is drawn with few photons by the part of the programs."""
_SHORT_CASES = 4


def _cases(names: tuple[str, ...], short: bool, folder: Path) -> Iterator[Finding]:
    from ..bench.machine import machine
    from ..gpu.context import create_context
    from ..stress.results import StressResult
    from ..stress.runner import all_cases, choose, run

    cases = choose(all_cases(), ",".join(names[:_SHORT_CASES] if short else names))
    with create_context() as context:
        for at, case in enumerate(cases):
            result = StressResult("", "", "", machine(context), asked=1)
            if not run(result, [case], context, lambda fraction, text: None, lambda so_far: None):
                raise KeyboardInterrupt
            found = result.cases[0]
            yield Finding(case.name, _verdict(found), bool(found.broken()), found.seconds)
            yield Finding("", "", done=(at + 1) / len(cases))


def _verdict(found: CaseResult) -> str:
    broken = found.broken()
    held = f"{len(found.measurements)} severities hold"
    return f"{found.case.title}: {'; '.join(broken) if broken else held}"


# -- pictures -----------------------------------------------------------------------------


def _pictures(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench.stored_pictures import LARGEST_ERROR, SCENES, compare
    from ..gpu import shader
    from ..gpu.context import create_context

    scenes = SCENES[:2] if short else SCENES
    with create_context() as context:
        shader.keep_programs(context.ctx)
        for at, made in enumerate(compare(context, scenes)):
            words = f"blocks differ by {made.error:.2%} (at most {LARGEST_ERROR:.0%})"
            yield Finding(made.scene, words, not made.agrees, made.seconds, _png(made.picture, made.reference))
            yield Finding("", "", done=(at + 1) / len(scenes))
        shader.forget_programs(context.ctx)


def _png(picture: np.ndarray, reference: np.ndarray) -> str:
    """Both side by side, alike exposed, as base64."""
    import numpy as np
    from PIL import Image

    white = float(np.percentile(reference.max(axis=-1), 98)) or 1.0
    both = np.clip(np.nan_to_num(np.concatenate([picture, reference], axis=1)) / white, 0.0, 1.0)
    made = io.BytesIO()
    Image.fromarray(np.round(255.0 * both ** (1 / 2.2)).astype(np.uint8)).save(made, "PNG")
    return base64.b64encode(made.getvalue()).decode()


# -- times --------------------------------------------------------------------------------


def _frames(short: bool, _folder: Path) -> Iterator[Finding]:
    """Photons traced anew every frame, at the size of a screen."""
    from ..bench import frame_speed
    from ..gpu.context import create_context

    size, photons = ((320, 180), (1 << 12, 1 << 14)) if short else (_SCREEN, (1 << 17, 1 << 20, 1 << 18))
    with create_context() as context:
        for name, scene in _scenes(short):
            costs, started = [], time.perf_counter()
            for cost in frame_speed.measure(context, scene, size, photons):
                costs.append(cost)
                yield _finding(name, cost.figures | {"since_opened_s": round(time.perf_counter() - started, 2)})
            within = {
                f"{what}_photons_in_{ms}_ms": frame_speed.photons_within(costs, 1e-3 * ms, what == "frame")
                for what in ("light", "frame")
                for ms in (4, 16)
            }
            yield _finding(f"{name}, {size[0]}×{size[1]}", within)


def _trace(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench.frame_speed import trace_rates
    from ..gpu.context import create_context

    photons, batches = (1 << 14, (1 << 13, 1 << 14)) if short else (1 << 20, (1 << 18, 1 << 20))
    with create_context() as context:
        for name, scene in _scenes(short):
            found = trace_rates(context, scene, photons, batches)
            yield from _measured((f"{name}, {what}", figures) for what, figures in found)


def _camera(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench.frame_speed import camera_costs
    from ..gpu.context import create_context

    with create_context() as context:
        for name, scene in _scenes(short, ("default", "brilliant")):
            size = (160, 90) if short else _SCREEN
            yield from (_finding(name, found) for found in camera_costs(context, scene, size, (0.02, 2.0)))


def _viewer(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..base.paths import shipped_scenes
    from ..bench import viewer_speed
    from ..gpu.context import create_context

    size, frames, seconds = ((320, 180), 8, 2.0) if short else (_SCREEN, 120, 8.0)
    for name in ("prism",) if short else ("prism", "default"):
        with create_context() as context:
            if short:
                few = replace(context.traits.viewer, first_photons=1 << 11, largest_photons=1 << 12)
                context.traits = replace(context.traits, viewer=few)
            found = viewer_speed.run(context, shipped_scenes()[name], size, seconds, frames)
            yield from _measured((f"{name}, {what}", figures) for what, figures in found)


def _start(short: bool, _folder: Path) -> Iterator[Finding]:
    """From a process's start to a small picture on the disk."""
    size, photons = ("160x90", "1k") if short else ("960x540", "32k")
    for name in ("prism",) if short else ("default", "prism"):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-P", "-m", "spectrasplat", "render", name, "-o", f"{folder}/first.png"]
            command += ["--size", size, "--photons", photons, "--spp", "1"]
            for state in ("cold", "warm"):
                started = time.perf_counter()
                subprocess.run(command, env=os.environ | dict.fromkeys(_CACHE_FOLDERS, folder), check=True)
                yield _finding(f"{name}, {state}", {"first_picture_s": round(time.perf_counter() - started, 3)})


def _scenes(
    short: bool, names: tuple[str, ...] = ("prism", "default", "brilliant", "ball")
) -> Iterator[tuple[str, Scene]]:
    """Those that frames are measured by; in the short form the first alone."""
    from ..base.paths import shipped_scenes
    from ..model.io.scene_file import load_scene

    yield from ((name, load_scene(shipped_scenes()[name])) for name in names[: 1 if short else None])


def _measured(found: Iterable[tuple[str, Mapping[str, float]]]) -> Iterator[Finding]:
    return (_finding(name, figures) for name, figures in found)


def _finding(name: str, figures: Mapping[str, float]) -> Finding:
    from ..bench.machine import words

    return Finding(name, words(figures), figures=dict(figures))


PARTS = (
    Part("doctor", "Machine, driver, limits", _doctor, (30, 60)),
    Part("programs", "Every program compiles, and is GLSL by the book", _programs, (240, 240)),
    Part("answers", "Known answers", partial(_cases, ANSWERS), (90, 120)),
    Part("pictures", "Pictures against stored ones", _pictures, (240, 240)),
    Part("stress", "Stress", partial(_cases, STRESS), (120, 240)),
    Part("frames", "Photons of a frame", _frames, (110, 200), True),
    Part("trace", "Tracing, by events a dispatch and rays in flight", _trace, (80, 90), True),
    Part("camera", "Camera samples, by the longest dispatch allowed", _camera, (50, 90), True),
    Part("viewer", "Viewer while something moves", _viewer, (70, 120), True),
    Part("start", "First picture, with an empty cache and with a full one", _start, (60, 90), True),
)
"""In this order: what must hold first, then what is only measured, the most important first."""


def main(arguments: list[str]) -> int:
    """Run one part; returns 0, or 2 where it could not go on for a reason that it printed."""
    key, short, file, folder = arguments
    part = next(part for part in PARTS if part.key == key)
    with Path(file).open("ab", buffering=0) as out:
        try:
            found = part.run(short == "short", Path(folder))
            out.writelines(msgspec.json.encode(finding) + b"\n" for finding in found)
        except UserError as error:
            print(f"{error}", file=sys.stderr)
            return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
