"""One plot a case: every error against severity, its bound dashed in the same colour, breaches as filled red crosses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from app.bench.report_style import PALETTE, new_figure
from app.stress.runner import CaseResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = [PALETTE[name][0] for name in ("srd", "srd-lambda", "progressive", "regular-16", "other-1", "other-2", "stochastic")]
BAD = PALETTE["bad"][0]
MUTED = PALETTE["muted"][0]
GRID = PALETTE["grid"][0]
FLOOR = 1e-9
"""Errors below this, and those of exactly zero, are drawn here."""
CEILING = 1e3
MARKERS = "osD^vP*"


def case_plot(result: CaseResult) -> Figure | None:
    """The case's errors; None where it measured none that can be drawn."""
    names = drawn_names(result)
    if not names:
        return None
    places = len(result.measurements)
    labelled = not result.case.logarithmic and any(m.label != f"{m.severity:g}" for m in result.measurements)
    figure = new_figure(7.0, 3.3) if not labelled else new_figure(7.0, 1.3 + 0.24 * max(places, 5))
    axes = figure.add_axes((0.1, 0.17, 0.6, 0.76)) if not labelled else figure.add_axes((0.42, 0.55 / (1.3 + 0.24 * max(places, 5)), 0.38, 0.86 - 0.4 / (1.3 + 0.24 * max(places, 5))))
    for number, name in enumerate(names):
        _draw(axes, result, name, COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], labelled)
    _frame(axes, result, labelled)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False, fontsize=8.0, handlelength=2.2, borderaxespad=0.0)
    return figure


def drawn_names(result: CaseResult) -> list[str]:
    """Errors worth a curve: those that were ever other than zero with a bound other than zero."""
    names = dict.fromkeys(name for m in result.measurements for name in m.errors)
    return [name for name in names if any(m.errors.get(name, 0.0) != 0.0 or m.bounds.get(name, 0.0) != 0.0 for m in result.measurements)]


def _draw(axes: Axes, result: CaseResult, name: str, colour: str, marker: str, labelled: bool) -> None:
    shown = [(i, m) for i, m in enumerate(result.measurements) if name in m.errors]
    places = [_place(result, i, m.severity, labelled) for i, m in shown]
    errors = [_visible(m.errors[name]) for _, m in shown]
    _curve(axes, places, errors, labelled, color=colour, marker=marker, ms=4.0, mec="none", lw=0.0 if labelled else 1.5, label=name, zorder=3)
    bounded = [(p, _visible(m.bounds[name])) for p, (_, m) in zip(places, shown, strict=True) if name in m.bounds]
    if bounded:
        style = {"ls": "none", "marker": "|" if labelled else "_", "ms": 9.0} if labelled or len(bounded) == 1 else {"ls": (0, (4, 2)), "lw": 1.1}
        _curve(axes, *zip(*bounded, strict=True), labelled, color=colour, alpha=0.75, zorder=2, label=f"{name}: bound", **style)
    broken = [(p, e) for p, e, (_, m) in zip(places, errors, shown, strict=True) if name in m.bounds and not m.errors[name] <= m.bounds[name]]
    if broken:
        _curve(axes, *zip(*broken, strict=True), labelled, color=BAD, ls="none", marker="X", ms=9.0, mec="none", zorder=4, label=f"{name}: broken")


def _curve(axes: Axes, places, values, labelled: bool, **style) -> None:
    """Severity along x, or down the y axis where severities are named."""
    axes.plot(*((values, places) if labelled else (places, values)), **style)


def _place(result: CaseResult, index: int, severity: float, labelled: bool) -> float:
    if labelled:
        return float(index)
    if result.case.logarithmic and not severity > 0.0:
        # A severity of zero stands a decade below the least that a logarithm can show.
        least = min((m.severity for m in result.measurements if m.severity > 0.0), default=1.0)
        return 0.1 * least
    return severity


def _visible(value: float) -> float:
    """Within the plot: zero on its floor; what is not finite on its ceiling."""
    return min(max(value, FLOOR), CEILING) if math.isfinite(value) else CEILING


def _frame(axes: Axes, result: CaseResult, labelled: bool) -> None:
    value_axis = axes.xaxis if labelled else axes.yaxis
    (axes.set_xscale if labelled else axes.set_yscale)("log")
    values = [_visible(v) for m in result.measurements for v in (*m.errors.values(), *m.bounds.values()) if v]
    low, high = min(values, default=1e-6), max(values, default=1.0)
    (axes.set_xlim if labelled else axes.set_ylim)(max(low / 3.0, 0.5 * FLOOR), high * 4.0)
    value_axis.set_label_text("error")
    if labelled:
        axes.set_yticks(range(len(result.measurements)), [_short(m.label) for m in result.measurements])
        axes.set_ylim(len(result.measurements) - 0.4, -0.6)
        axes.tick_params(axis="y", length=0)
    else:
        if result.case.logarithmic:
            axes.set_xscale("log")
        axes.set_xlabel(result.case.severity_name)
    axes.grid(color=GRID, lw=0.7)
    axes.set_axisbelow(True)


def _short(label: str, most: int = 46) -> str:
    return label if len(label) <= most else label[: most - 1] + "…"
