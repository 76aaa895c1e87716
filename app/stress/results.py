"""What a stress run measured, and the same as JSON, in which numbers that are not finite are null."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from operator import methodcaller
from pathlib import Path

import msgspec

from ..base.atomic import atomic_output
from .case import FLUX_CLOSURE, Case, Measurement


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

    def summary(self) -> str:
        """One line: how many cases and severities, how many promises are broken."""
        broken, severities = self.broken(), sum(len(c.measurements) for c in self.cases)
        state = "stopped early; " if self.partial else ""
        verdict = f"{len(broken)} promise{'s' if len(broken) > 1 else ''} broken"
        if not broken:
            verdict = "every promise measured so far holds" if self.partial else "every promise holds"
        done = f"{len(self.cases)} of {self.asked} cases, {severities} severities in {self.seconds:.0f} s"
        return f"{state}{done}: {verdict}"


# ---- JSON ------------------------------------------------------------------------------------


def write_json(result: StressResult, path: Path) -> None:
    """The whole result, in one piece or not at all. Raises `UserError` where it cannot be written."""
    text = msgspec.json.encode(_record(result), enc_hook=methodcaller("item"))  # of numpy's numbers
    with atomic_output(path) as temporary:
        temporary.write_bytes(msgspec.json.format(text, indent=1) + b"\n")


def _record(result: StressResult) -> dict[str, object]:
    return {
        **{name: value for name, value in vars(result).items() if name not in ("cases", "asked")},
        "partial": result.partial,
        "cases_asked": result.asked,
        "flux_closure": FLUX_CLOSURE,
        "broken": result.broken(),
        "cases": [
            {
                "name": found.case.name,
                "title": found.case.title,
                "why": found.case.why,
                "severity": found.case.severity_name,
                "steps": found.case.steps,
                "seconds": found.seconds,
                "failure": found.failure,
                "traceback": found.trace,
                "measurements": [asdict(m) | {"broken": m.broken()} for m in found.measurements],
            }
            for found in result.cases
        ],
    }
