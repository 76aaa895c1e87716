"""A stress result as JSON: plain numbers, with NaN and infinities as words, since JSON has none."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from ..base.atomic import atomic_output
from .case import FLUX_CLOSURE, Measurement
from .runner import CaseResult, StressResult


def write_json(result: StressResult, path: Path) -> None:
    """The whole result, in one piece or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        temporary.write_text(
            json.dumps(_result(result), indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
        )


def _result(result: StressResult) -> dict[str, Any]:
    return {
        "version": result.version,
        "date": result.date,
        "command": result.command,
        "machine": result.machine,
        "partial": result.partial,
        "seconds": result.seconds,
        "cases_asked": result.asked,
        "flux_closure": FLUX_CLOSURE,
        "broken": result.broken(),
        "cases": [_case(c) for c in result.cases],
    }


def _case(found: CaseResult) -> dict[str, Any]:
    case = found.case
    return {
        "name": case.name,
        "title": case.title,
        "why": case.why,
        "severity": case.severity_name,
        "logarithmic": case.logarithmic,
        "steps": case.steps,
        "seconds": found.seconds,
        "failure": found.failure,
        "traceback": found.trace,
        "measurements": [_measurement(m) for m in found.measurements],
    }


def _measurement(m: Measurement) -> dict[str, Any]:
    return {
        "severity": number(m.severity),
        "label": m.label,
        "nonfinite": m.nonfinite,
        "flux_imbalance": None if m.flux_imbalance is None else number(m.flux_imbalance),
        "fallbacks": {name: int(count) for name, count in m.fallbacks.items()},
        "dropped": int(m.dropped),
        "errors": {name: number(error) for name, error in m.errors.items()},
        "bounds": {name: number(bound) for name, bound in m.bounds.items()},
        "note": m.note,
        "broken": m.broken(),
    }


def number(value: float) -> float | str:
    """A JSON number, or "NaN", "Infinity", "-Infinity"."""
    value = float(value)
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else ("Infinity" if value > 0.0 else "-Infinity")
