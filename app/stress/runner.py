"""Runs stress cases one after the other and keeps what each measured, also when it is stopped or a case fails.

A case that raises is a broken promise of its own: it is reported with its reason and the others go on. Ctrl-C
ends the run; what was measured by then is the result.
"""

from __future__ import annotations

import importlib
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from types import ModuleType

from ..base.errors import UserError, suggestion
from ..gpu import shader
from ..gpu.context import Context
from .case import Case, Measured
from .results import CaseResult, StressResult

Progress = Callable[[float, str], None]
Keep = Callable[[StressResult], None]


FILES = (
    *("optics", "materials", "crystals", "caustics", "chains", "meshes", "splats"),
    *("camera_surfaces", "camera_solids", "camera_lights"),
    *("films", "contacts", "lights", "losses", "crowds", "scenes"),
)
"""Files of `cases`, in the order of the report: light, then the camera, then whole scenes."""


def all_cases() -> tuple[Case, ...]:
    """Every case, in each file as they are written there, then the sweep over shipped scenes."""
    from .cases.scenes import default_sweeps

    files = [importlib.import_module(f".cases.{name}", __package__) for name in FILES]
    return tuple(case for file in files for case in cases_of(file)) + default_sweeps()


def cases_of(module: ModuleType) -> tuple[Case, ...]:
    """The cases of one file, single or in a tuple."""
    found: list[Case] = []
    for value in vars(module).values():
        found += [c for c in (value if isinstance(value, tuple) else (value,)) if isinstance(c, Case)]
    return tuple(found)


def choose(cases: Sequence[Case], names: str | None) -> tuple[Case, ...]:
    """The cases called so (separated by commas), in their own order; None: all. "prism/" is all that start so."""
    if names is None:
        return tuple(cases)
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    known = [case.name for case in cases]
    for name in wanted:
        if not any(_matches(name, case) for case in known):
            hint = suggestion(name, known)
            raise UserError(f"--cases '{name}' is no stress case{hint or ';'} 'spectrasplat stress --list' shows them")
    if not wanted:
        raise UserError("--cases names no case; 'spectrasplat stress --list' shows them")
    return tuple(case for case in cases if any(_matches(name, case.name) for name in wanted))


def _matches(name: str, case: str) -> bool:
    return case == name or (name.endswith("/") and case.startswith(name))


def run(result: StressResult, cases: Iterable[Case], context: Context, progress: Progress, keep: Keep) -> bool:
    """Measure `cases` into `result`; False when Ctrl-C stopped it.

    `keep(result)` is called after every case, so that what is done outlives whatever comes next. Cases share compiled
    programs: a sweep renders one scene many times, and a software renderer compiles longer than it renders.
    """
    shader.keep_programs(context.ctx)
    try:
        return _run(result, cases, context, progress, keep)
    finally:
        shader.forget_programs(context.ctx)


def _run(result: StressResult, cases: Iterable[Case], context: Context, progress: Progress, keep: Keep) -> bool:
    chosen = tuple(cases)
    steps, done = max(sum(case.steps for case in chosen), 1), 0
    started = time.perf_counter()
    for case in chosen:
        found = CaseResult(case)
        result.cases.append(found)
        try:
            for number, measurement in enumerate(_measured(case, context, found), 1):
                found.measurements.append(measurement)
                progress((done + min(number, case.steps)) / steps, f"{case.name}: {measurement.label}")
        except KeyboardInterrupt:
            if not found.measurements:
                result.cases.pop()
            return False
        finally:
            result.seconds = time.perf_counter() - started
        done += case.steps
        progress(done / steps, case.name)
        keep(result)
    return True


def _measured(case: Case, context: Context, found: CaseResult) -> Measured:
    """The case's measurements; an error ends them and goes to `found`."""
    started = time.perf_counter()
    try:
        yield from case.measure(context)
        context.check(f"stress case {case.name}")
    except Exception as error:  # noqa: BLE001 - whatever a case fails with is its result
        found.failure = " ".join(f"{type(error).__name__}: {error}".split())
        found.trace = traceback.format_exc()
        with suppress(RuntimeError):
            # What a failed case left unread must not be blamed on the next.
            context.check("a failed stress case")
    finally:
        found.seconds = time.perf_counter() - started
    if not found.failure and len(found.measurements) != case.steps:
        found.failure = f"measured {len(found.measurements)} of {case.steps} severities"
