"""The stress command: measures cases, keeps what is done, shows the table; the exit code is the verdict."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.atomic import make_output_folder
from ..base.version import __version__
from .measuring_table import Stress
from .options import words
from .printing import show
from .scenes import load_scenes

if TYPE_CHECKING:
    from ..stress.case import Case
    from ..stress.results import StressResult

BROKEN = 1
"""Exit code where a promise is broken."""
INTERRUPTED = 130
JSON, HTML = "stress.json", "stress.html"


def stress(options: Stress) -> int:
    """Run the cases; returns 0 where every promise holds, 1 where one is broken, 130 after Ctrl-C. Raises
    `UserError`."""
    from ..stress.runner import choose

    cases = choose(_cases(options.scenes), options.cases)
    if options.list_cases:
        show("\n".join(f"{case.name:<24} {case.steps:>3}  {case.title}" for case in cases))
        return 0
    if options.output is not None:
        make_output_folder(options.output, JSON, HTML)
    return _measure(options, cases)


def _measure(options: Stress, cases: Sequence[Case]) -> int:
    from ..base.progress import ProgressReporter
    from ..bench.machine import machine
    from ..gpu.context import create_context
    from ..stress.report import case_table, write_html
    from ..stress.results import StressResult
    from ..stress.runner import run

    with create_context() as context:
        date = datetime.now(UTC).isoformat(timespec="seconds")
        result = StressResult(__version__, date, repeat_command(options), machine(context), asked=len(cases))
        with ProgressReporter("stress") as progress:
            finished = run(result, cases, context, progress, lambda so_far: _keep(so_far, options.output))
    if not finished:
        print("spectrasplat: stopped; what was measured is shown and kept", file=sys.stderr)
    _keep(result, options.output)
    for found in result.cases:
        show(case_table(found).on_screen(("note",)))
    if options.output is not None:
        write_html(result, options.output / HTML)
        show(f"{(options.output / HTML).resolve()}")
    show(result.summary())
    if result.broken():
        return BROKEN
    return 0 if finished else INTERRUPTED


def _cases(names: Sequence[str]) -> tuple[Case, ...]:
    """The sweep over the scenes that are named, or without any all cases."""
    if not names:
        from ..stress.runner import all_cases

        return all_cases()
    scenes = load_scenes(names)
    from ..stress.cases.scenes import sweeps

    return sweeps(list(scenes.items()))


def _keep(result: StressResult, folder: Path | None) -> None:
    if folder is not None:
        from ..stress.results import write_json

        write_json(result, folder / JSON)


def repeat_command(options: Stress) -> str:
    """The one command that repeats this run."""
    output = [] if options.output is None else ["-o", options.output.name or "."]
    words_typed = words(options, leave_out=("scenes", "output", "list_cases"))
    return shlex.join(["spectrasplat", "stress", *options.scenes, *output, *words_typed])
