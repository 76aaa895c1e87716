"""Runs stress cases one after the other and keeps what each measured, also when it is stopped or a case fails.

A case that raises is a broken promise of its own: it is reported with its reason and the others go on. Ctrl-C
ends the run; what was measured by then is the result.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from ..base.errors import UserError, suggestion
from ..gpu import shader
from ..gpu.context import Context
from .case import Case, Measurement

Progress = Callable[[float, str], None]
Keep = Callable[["StressResult"], None]


@dataclass
class CaseResult:
    """What one case measured."""

    case: Case
    measurements: list[Measurement] = field(default_factory=list)
    seconds: float = 0.0
    failure: str = ""
    """Why the case could not go on, in a line; empty where it did."""
    trace: str = ""
    """The failure's traceback, for the JSON file only."""

    @property
    def complete(self) -> bool:
        """Whether every severity was measured."""
        return not self.failure and len(self.measurements) == self.case.steps

    def broken(self) -> list[str]:
        """The promises that do not hold, each with its severity."""
        found = [f"{m.label}: {sentence}" for m in self.measurements for sentence in m.broken()]
        return found + ([f"stopped by an error: {self.failure}"] if self.failure else [])


@dataclass
class StressResult:
    """One run of `spectrasplat stress`."""

    version: str
    date: str
    command: str
    machine: dict[str, str]
    asked: int
    """Cases that were to run."""
    cases: list[CaseResult] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def partial(self) -> bool:
        """Stopped before everything was measured (a failed case was measured as far as it went)."""
        return len(self.cases) < self.asked or any(not c.complete and not c.failure for c in self.cases)

    def broken(self) -> list[str]:
        """The promises that do not hold, each with its case and severity."""
        return [f"{c.case.name}, {sentence}" for c in self.cases for sentence in c.broken()]

    @property
    def measured(self) -> int:
        """Severities measured."""
        return sum(len(c.measurements) for c in self.cases)


def all_cases() -> tuple[Case, ...]:
    """The synthetic cases of the light, those of the camera, then those of whole scenes, then the sweep over shipped
    scenes."""
    from .cases import camera_cases, optics_cases, path_cases, scene_cases, splat_cases

    modules = (optics_cases, path_cases, splat_cases, camera_cases, scene_cases)
    return tuple(case for module in modules for case in module.CASES) + scene_cases.default_sweeps()


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


def _measured(case: Case, context: Context, found: CaseResult) -> Iterator[Measurement]:
    """The case's measurements; an error ends them and goes to `found`."""
    started = time.perf_counter()
    try:
        yield from case.measure(context)
        context.check(f"stress case {case.name}")
    except Exception as error:
        found.failure = " ".join(f"{type(error).__name__}: {error}".split())
        found.trace = traceback.format_exc()
        _forget_gl_errors(context)
    finally:
        found.seconds = time.perf_counter() - started
    if not found.failure and len(found.measurements) != case.steps:
        found.failure = f"measured {len(found.measurements)} of {case.steps} severities"


def _forget_gl_errors(context: Context) -> None:
    """What a failed case left unread must not be blamed on the next."""
    with suppress(RuntimeError):
        context.check("a failed stress case")


def _matches(name: str, case: str) -> bool:
    return case == name or (name.endswith("/") and case.startswith(name))
