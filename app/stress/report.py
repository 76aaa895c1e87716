"""The stress result as one HTML page that stands alone: verdict, machine, and for each case a plot and a table."""

from __future__ import annotations

import html
import math
from pathlib import Path

from ..base.atomic import atomic_output
from ..bench.report.html import Html, element, figure, page, table
from ..bench.report.style import inline_svg, plot_style, svg_text
from .case import FLUX_CLOSURE, Measurement
from .plots import case_plot
from .runner import CaseResult, StressResult
from .table import summary


def write_html(result: StressResult, path: Path) -> None:
    """The page, in one piece or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        temporary.write_text(html_text(result), encoding="utf-8")


def html_text(result: StressResult) -> str:
    """The page. It holds no script and fetches nothing."""
    with plot_style():
        sections = [_section(number, case) for number, case in enumerate(result.cases)]
    return page(f"Stress report, SpectraSplat {result.version}", [_head(result), _overview(result), sections])


def _head(result: StressResult) -> list[Html]:
    broken = result.broken()
    view_model = {"version": result.version, "date": result.date, **result.machine}
    parts = [
        element("p", "SpectraSplat stress report", cls="muted"),
        element(
            "h1",
            "Every promise holds" if not broken else f"{len(broken)} broken promise{'s' if len(broken) > 1 else ''}",
        ),
        element("p", summary(result) + ".", cls="lead"),
    ]
    if result.partial:
        parts.append(
            element(
                "div",
                element("p", "This report is partial: the run was stopped before everything was measured."),
                cls="warning",
            )
        )
    if broken:
        parts.append(element("div", [element("p", sentence) for sentence in broken], cls="warning"))
    parts += [
        element(
            "p",
            "Each case sweeps one difficulty. Promised at every severity: no value of a photon, a map or a picture is NaN or infinite; "
            f"light emitted = light deposited + absorbed + escaped + lost, to {FLUX_CLOSURE:.0e}; every fall-back is counted; and each error keeps within the bound "
            "stated beside it. Errors are relative unless their name says a unit.",
        ),
        element("pre", result.command),
        element(
            "dl",
            [element("div", element("dt", name), element("dd", value)) for name, value in view_model.items()],
            cls="facts",
        ),
    ]
    return parts


def _overview(result: StressResult) -> list[Html]:
    rows = []
    for number, case in enumerate(result.cases):
        link = element("a", case.case.name, href=f"#case-{number}")
        imbalances = [m.flux_imbalance for m in case.measurements if m.flux_imbalance is not None]
        rows.append(
            (
                link,
                len(case.measurements),
                sum(m.nonfinite for m in case.measurements),
                _power(max(imbalances)) if imbalances else "–",
                sum(sum(m.fallbacks.values()) for m in case.measurements),
                _tightest(case),
                f"{case.seconds:.1f}",
                _verdict(case.broken()),
            )
        )
    headings = (
        "case",
        "severities",
        "not finite",
        "flux off, at most",
        "fall-backs",
        "nearest to its bound",
        "seconds",
        "verdict",
    )
    return [element("h2", "All cases"), table(headings, rows)]


def _section(number: int, result: CaseResult) -> Html:
    case = result.case
    parts: list[Html] = [
        element("h2", case.name, id=f"case-{number}", cls="flow"),
        element("p", case.title + "."),
        element("p", case.why, cls="muted"),
    ]
    drawn = case_plot(result)
    if drawn is not None:
        label = html.escape(f"{case.name}: errors and bounds against {case.severity_name}", quote=True)
        parts.append(
            figure(
                Html(inline_svg(svg_text(drawn), f"case-{number}", label)),
                "Errors as markers, bounds dashed or as bars. Zero lies on the plot's floor.",
                "half",
            )
        )
    if result.failure:
        parts.append(element("div", element("p", f"Stopped by an error: {result.failure}"), cls="warning"))
    elif not result.complete:
        parts.append(
            element(
                "div",
                element("p", f"Stopped after {len(result.measurements)} of {case.steps} severities."),
                cls="warning",
            )
        )
    if result.measurements:
        rows = [
            (
                m.label,
                m.nonfinite,
                "–" if m.flux_imbalance is None else _power(m.flux_imbalance),
                _fallbacks(m),
                _errors(m),
                m.note,
                _verdict(m.broken()),
            )
            for m in result.measurements
        ]
        parts.append(
            table(
                (case.severity_name, "not finite", "flux off", "fall-backs", "errors / bounds", "note", "verdict"),
                rows,
                left=8,
            )
        )
    return element("section", parts)


def _errors(m: Measurement) -> list[Html]:
    return [
        element(
            "div",
            f"{name} {_power(error)}" + (f" / {_power(m.bounds[name])}" if name in m.bounds else ""),
            cls="no" if name in m.bounds and not error <= m.bounds[name] else None,
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


def _verdict(broken: list[str]) -> Html:
    return (
        element("span", "holds", cls="yes") if not broken else element("span", "broken: " + "; ".join(broken), cls="no")
    )


def _power(value: float) -> str:
    """Two digits, with a true minus sign in the exponent."""
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else "∞"
    text = f"{value:.1e}" if value and not 0.01 <= abs(value) < 1000.0 else f"{value:.2g}"
    return text.replace("e-0", "e−").replace("e-", "e−").replace("e+0", "e").replace("e+", "e")
