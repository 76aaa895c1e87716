"""The stress command: check what is asked, measure, keep what is done, show the table; the exit code is the verdict."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.atomic import make_output_folder
from ..base.errors import UserError
from ..base.version import __version__
from . import options

if TYPE_CHECKING:
    from ..stress.case import Case
    from ..stress.runner import StressResult

BROKEN = 1
"""Exit code where a promise is broken."""
INTERRUPTED = 130
JSON, HTML = "stress.json", "stress.html"


@dataclass(frozen=True)
class StressRequest:
    """The stress command's options as typed; None where the user said nothing."""

    scenes: tuple[str, ...] = ()
    output: Path | None = None
    cases: str | None = None
    list_cases: bool = False


def stress_command(request: StressRequest, show: Callable[[object], None]) -> int:
    """Run the cases; returns 0 where every promise holds, 1 where one is broken, 130 after Ctrl-C. Raises
    `UserError`."""
    from ..stress.runner import choose

    files = [options.find_scene(name) for name in request.scenes]
    if request.output is not None and not request.list_cases:
        make_output_folder(request.output, JSON, HTML)
    cases = choose(_cases(files), request.cases)
    if request.list_cases:
        show("\n".join(f"{case.name:<24} {case.steps:>3}  {case.title}" for case in cases))
        return 0
    return _measure(request, cases, show)


def _measure(request: StressRequest, cases: Sequence[Case], show: Callable[[object], None]) -> int:
    from ..base.progress import ProgressReporter
    from ..bench.machine import machine
    from ..gpu.context import create_context
    from ..stress.runner import StressResult, run
    from ..stress.table import summary, table

    with create_context() as context:
        date = datetime.now(UTC).isoformat(timespec="seconds")
        result = StressResult(__version__, date, repeat_command(request), machine(context), asked=len(cases))
        with ProgressReporter("stress") as progress:
            finished = run(result, cases, context, progress, lambda so_far: _keep(so_far, request.output))
    if not finished:
        print("spectrasplat: stopped; what was measured is shown and kept", file=sys.stderr)
    _keep(result, request.output)
    show(table(result))
    if request.output is not None:
        from ..stress.report import write_html

        write_html(result, request.output / HTML)
        show(f"{(request.output / HTML).resolve()}")
    show(summary(result))
    if result.broken():
        return BROKEN
    return 0 if finished else INTERRUPTED


def _cases(files: Sequence[Path]) -> tuple[Case, ...]:
    """The sweep over the scenes in `files`, or without any all cases."""
    if not files:
        from ..stress.runner import all_cases

        return all_cases()
    from ..model.io.scene_file import load_scene
    from ..stress.cases.scene_cases import sweeps

    scenes = {}
    for file in files:
        if file.stem in scenes:
            raise UserError(
                f"scene {file}: another scene of this run is called '{file.stem}' too; rename the file or run them "
                "apart"
            )
        scenes[file.stem] = load_scene(file)
    return sweeps(list(scenes.items()))


def _keep(result: StressResult, folder: Path | None) -> None:
    if folder is not None:
        from ..stress.record import write_json

        write_json(result, folder / JSON)


def repeat_command(request: StressRequest) -> str:
    """The one command that repeats this run."""
    words = ["spectrasplat", "stress", *request.scenes]
    words += [] if request.output is None else ["-o", request.output.name or "."]
    words += [] if request.cases is None else ["--cases", request.cases]
    return shlex.join(words)
