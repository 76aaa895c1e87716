"""The stress result for readers: a table for each case, on the screen and on one HTML page with verdict and
machine."""

from __future__ import annotations

import math
from pathlib import Path

from markupsafe import Markup

from ..base.atomic import atomic_output
from ..bench.report.page import Table, render
from .case import FLUX_CLOSURE, Measurement
from .results import CaseResult, StressResult


def write_html(result: StressResult, path: Path) -> None:
    """The page, in one piece or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        temporary.write_text(html_text(result), encoding="utf-8")


def html_text(result: StressResult) -> str:
    """The page. It holds no script and fetches nothing."""
    return render(
        "stress.html",
        result=result,
        broken=result.broken(),
        summary=result.summary(),
        closure=f"{FLUX_CLOSURE:.0e}",
        run={"version": result.version, "date": result.date, **result.machine},
        overview=_overview(result),
        cases=[{"case": found.case, "stops": _stops(found), "table": case_table(found)} for found in result.cases],
    )


def case_table(found: CaseResult) -> Table:
    """What a case measured, a row a severity."""
    rows = [
        [m.label, m.nonfinite, _power(m.flux_imbalance), _fallbacks(m), _errors(m), m.note, _verdict(m.broken())]
        for m in found.measurements
    ]
    if found.failure:
        rows.append(["", "", "", "", "", "", _verdict([found.failure])])
    headings = (found.case.severity_name, "not finite", "flux off", "fall-backs", "errors / bounds", "note", "verdict")
    return Table(headings, rows, title=found.case.name, words=headings[3:])


def _overview(result: StressResult) -> Table:
    """A row a case."""
    rows = []
    for number, found in enumerate(result.cases):
        measured, name = found.measurements, Markup('<a href="#case-{}">{}</a>').format(number, found.case.name)
        imbalances = [m.flux_imbalance for m in measured if m.flux_imbalance is not None]
        fallbacks = sum(sum(m.fallbacks.values()) for m in measured)
        worst = _power(max(imbalances, default=None)), fallbacks, _tightest(found), f"{found.seconds:.1f}"
        bad = sum(m.nonfinite for m in measured)
        rows.append([name, len(measured), bad, *worst, _verdict(found.broken())])
    headings = (
        "case",
        "severities",
        "not finite",
        "flux off, at most",
        "fall-backs",
        "nearest to its bound",
        "seconds",
    )
    return Table((*headings, "verdict"), rows, words=("verdict",))


def _stops(found: CaseResult) -> list[str]:
    """Why a case was not measured to its end."""
    if found.failure:
        return [f"Stopped by an error: {found.failure}"]
    steps = f"{len(found.measurements)} of {found.case.steps} severities"
    return [] if found.complete else [f"Stopped after {steps}."]


def _verdict(broken: list[str]) -> str:
    return f"BROKEN: {'; '.join(broken)}" if broken else "holds"


def _errors(m: Measurement) -> str:
    """Error and bound of each that is not zero, those beyond their bound marked."""
    parts = []
    for name, error in m.errors.items():
        bound = m.bounds.get(name)
        if error or bound is None:
            kept = bound is None or error <= bound
            of_bound = "" if bound is None else f" / {_power(bound)}"
            parts.append(f"{'' if kept else '! '}{name} {_power(error)}{of_bound}")
    return ", ".join(parts)


def _fallbacks(m: Measurement) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {count:,}" for name, count in m.fallbacks.items() if count) or "none"


def _tightest(found: CaseResult) -> str:
    """The error that comes nearest to its bound (or exceeds it most), as a share of it."""
    shares = [
        (m.errors[name] / bound if math.isfinite(m.errors[name]) else math.inf, name)
        for m in found.measurements
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
