"""The stress result as one HTML page without other files: verdict, machine, and for each case a plot and a table."""

from __future__ import annotations

import math
from pathlib import Path

from ..base.atomic import atomic_output
from ..bench.report.page import inlined, render
from ..bench.report.style import plot_style, svg_text
from .case import FLUX_CLOSURE, Measurement
from .plots import case_plot
from .results import CaseResult, StressResult


def write_html(result: StressResult, path: Path) -> None:
    """The page, in one piece or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        temporary.write_text(html_text(result), encoding="utf-8")


def html_text(result: StressResult) -> str:
    """The page. It holds no script and fetches nothing."""
    with plot_style():
        cases = [_shown(number, case) for number, case in enumerate(result.cases)]
    return render(
        "stress.html",
        result=result,
        broken=result.broken(),
        summary=result.summary(),
        closure=f"{FLUX_CLOSURE:.0e}",
        run={"version": result.version, "date": result.date, **result.machine},
        cases=cases,
    )


def _shown(number: int, result: CaseResult) -> dict[str, object]:
    """What the page says of a case."""
    case, measured = result.case, result.measurements
    drawn, stops = case_plot(result), []
    if result.failure:
        stops = [f"Stopped by an error: {result.failure}"]
    elif not result.complete:
        stops = [f"Stopped after {len(measured)} of {case.steps} severities."]
    label = f"{case.name}: errors and bounds against {case.severity_name}"
    imbalances = [m.flux_imbalance for m in measured if m.flux_imbalance is not None]
    return {
        "name": case.name,
        "title": case.title,
        "why": case.why,
        "severity_name": case.severity_name,
        "broken": result.broken(),
        "stops": stops,
        "plot": None if drawn is None else inlined(svg_text(drawn), f"case-{number}", label),
        "numbers": (
            len(measured),
            sum(m.nonfinite for m in measured),
            _power(max(imbalances, default=None)),
            sum(sum(m.fallbacks.values()) for m in measured),
            _tightest(result),
            f"{result.seconds:.1f}",
        ),
        "rows": [
            {
                "label": m.label,
                "cells": (m.nonfinite, _power(m.flux_imbalance), _fallbacks(m)),
                "errors": _errors(m),
                "note": m.note,
                "broken": m.broken(),
            }
            for m in measured
        ],
    }


def _errors(m: Measurement) -> list[tuple[str, bool]]:
    """(error and bound, whether it is kept) of each that is worth the room."""
    return [
        (
            f"{name} {_power(error)}" + (f" / {_power(m.bounds[name])}" if name in m.bounds else ""),
            name not in m.bounds or error <= m.bounds[name],
        )
        for name, error in m.errors.items()
        if error or name not in m.bounds
    ]


def _fallbacks(m: Measurement) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {count:,}" for name, count in m.fallbacks.items() if count) or "none"


def _tightest(case: CaseResult) -> str:
    """The error that comes nearest to its bound (or exceeds it most), as a share of it."""
    shares = [
        (m.errors[name] / bound if math.isfinite(m.errors[name]) else math.inf, name)
        for m in case.measurements
        for name, bound in m.bounds.items()
        if bound > 0.0
    ]
    if not shares:
        return "–"
    share, name = max(shares)
    return f"{name}, {share:.0%}" if share < 100.0 else f"{name}, {share:.3g} times"


def _power(value: float | None) -> str:
    """Two digits, with a true minus sign in the exponent; a dash for none."""
    if value is None:
        return "–"
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else "∞"
    text = f"{value:.1e}" if value and not 0.01 <= abs(value) < 1000.0 else f"{value:.2g}"
    return text.replace("e-0", "e−").replace("e-", "e−").replace("e+0", "e").replace("e+", "e")
