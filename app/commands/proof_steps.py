"""The parts of `prove-gpu`, each run in a process of its own: a driver that crashes ends one part, not the proof.

    python -m spectrasplat.commands.proof_steps PART SHORT FILE FOLDER

writes what it finds to FILE, a line of JSON each, as it finds it.
"""

from __future__ import annotations

import base64
import io
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from ..base.errors import UserError

if TYPE_CHECKING:
    import numpy as np

    from ..gpu.shader import Built
    from ..stress.results import CaseResult

_MOST_COMPILERS = 8
"""Processes that compile at a time; each holds some 400 MiB."""


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


# -- doctor -------------------------------------------------------------------------------


def _doctor(_short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench.machine import clocks, machine
    from ..gpu.context import create_context
    from .doctor import examine

    checks = examine()
    yield from (Finding(check.name, check.found, not check.usable) for check in checks)
    with create_context() as context:
        yield from (Finding(f"machine {name}", value) for name, value in machine(context).items())
        yield Finding("is software", "yes" if context.is_software else "no")
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
_SHORT_CASES = {"answers": 4, "stress": 4}


def _answers(short: bool, folder: Path) -> Iterator[Finding]:
    yield from _cases(ANSWERS[: _SHORT_CASES["answers"]] if short else ANSWERS)


def _stress(short: bool, folder: Path) -> Iterator[Finding]:
    yield from _cases(STRESS[: _SHORT_CASES["stress"]] if short else STRESS)


def _cases(names: tuple[str, ...]) -> Iterator[Finding]:
    from ..bench.machine import machine
    from ..gpu.context import create_context
    from ..stress.results import StressResult
    from ..stress.runner import all_cases, choose, run

    cases = choose(all_cases(), ",".join(names))
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
    """A million photons a frame, traced, splatted and seen."""
    from ..base.paths import shipped_scenes
    from ..bench.frame_speed import measure
    from ..gpu.context import create_context
    from ..model.io.scene_file import load_scene

    scene = load_scene(shipped_scenes()["prism"])
    photons, sizes = (1 << 15, ((160, 90), (320, 180))) if short else (1_000_000, ((960, 540), (1920, 1080)))
    with create_context() as context:
        for size in sizes:
            yield Finding(
                f"prism {size[0]}×{size[1]}, {photons:,} photons", measure(context, scene, size, photons).line
            )


def _speed(short: bool, _folder: Path) -> Iterator[Finding]:
    from ..bench import speed

    yield from map(_line, speed.run(short))


def _view(size: tuple[int, int], short_size: tuple[int, int]) -> Callable[[bool, Path], Iterator[Finding]]:
    def run(short: bool, _folder: Path) -> Iterator[Finding]:
        from ..base.paths import shipped_scenes
        from ..bench import viewer_speed
        from ..gpu.context import create_context

        with create_context() as context:
            lines = viewer_speed.run(
                context, shipped_scenes()["prism"], short_size if short else size, 0.5 if short else 4
            )
            yield from (Finding("", line) for line in lines)

    return run


def _line(line: str) -> Finding:
    """A line of a table: the text before the first gap is its name."""
    name, gap, value = line.partition("  ")
    return Finding(name, " ".join(value.split())) if gap else Finding("", line)


def _bench(short: bool, folder: Path) -> Iterator[Finding]:
    from .bench import bench
    from .measuring_table import Bench

    said: list[str] = []

    def show(content: object) -> None:
        from rich.console import Console

        text = io.StringIO()
        Console(file=text, width=200).print(content)
        said.append(text.getvalue())

    options = Bench(
        scenes=("prism",) if short else ("prism", "ball_plain"),
        output=folder / "bench",
        seconds=0.2 if short else 1.0,
        horizon=0.2 if short else 1.0,
        seeds=1 if short else 2,
        methods=("srd", "srd-photons", "hero"),
        size=(96, 54) if short else (480, 270),
        reference_seconds=2.0 if short else 15.0,
        fresh=True,
    )
    code = bench(options, show)
    yield from (Finding("", text.rstrip()) for text in said)
    if code:
        raise UserError(f"bench ended with {code}")


PARTS = (
    Part("doctor", "Machine, driver, limits", _doctor, (60, 60)),
    Part("programs", "Every program compiles, and is GLSL by the book", _programs, (240, 240)),
    Part("answers", "Known answers", _answers, (90, 120)),
    Part("pictures", "Pictures against stored ones", _pictures, (240, 240)),
    Part("stress", "Stress", _stress, (120, 240)),
    Part("frames", "Frames of a million photons", _frames, (60, 120)),
    Part("speed", "Stages", _speed, (90, 240)),
    Part("view-small", "Viewer, 960×540", _view((960, 540), (160, 90)), (90, 240)),
    Part("view-large", "Viewer, 1920×1080", _view((1920, 1080), (320, 180)), (90, 240)),
    Part("bench", "Error against run time", _bench, (180, 240)),
)
"""In this order: what must hold first, what is only measured last."""


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
