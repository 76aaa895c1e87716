"""One plot a case: every error against severity, its bound dashed in the same colour, breaches marked by red crosses.

Severities on a scale go along x; severities that are names (a scene, a fault) go down the y axis. Axes of errors are
logarithmic. An error of exactly zero is a hollow marker on the plot's floor; one that is not finite lies on its
ceiling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..bench.report.style import PALETTE, error_axis, log_axis, new_figure
from ..bench.report.text import superscript
from .results import CaseResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KEYS = ("srd", "srd-lambda", "progressive", "regular-16", "other-1", "other-2", "stochastic")
COLOURS = [PALETTE[name][0] for name in KEYS]
BAD, MUTED, PAPER = (PALETTE[name][0] for name in ("bad", "muted", "paper"))
MARKERS = "osD^vPp"
SMALLEST, LARGEST = 1e-12, 1e6
"""Range within which errors and bounds set the axis."""
WIDTH_IN, HEIGHT_IN, ROW_IN = 7.2, 3.4, 0.23
LONGEST = 52
"""Characters of a label on the axis."""


def case_plot(result: CaseResult) -> Figure | None:
    """The case's errors; None where every error is zero or there is none."""
    names, measured = drawn_names(result), result.measurements
    if not names:
        return None
    named = not result.case.logarithmic and any(not m.label[:1].isdigit() for m in measured)
    figure = new_figure(WIDTH_IN, 1.0 + ROW_IN * max(len(measured), 6) if named else HEIGHT_IN)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    limits = _limits([values[n] for m in measured for values in (m.errors, m.bounds) for n in names if n in values])
    for number, name in enumerate(names):
        _draw(axes, result, name, COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], named, limits)
    _frame(axes, result, named, limits)
    _legend(figure, axes)
    return figure


def drawn_names(result: CaseResult) -> list[str]:
    """Errors worth drawing: those that were ever other than zero."""
    names = dict.fromkeys(name for m in result.measurements for name in m.errors)
    return [name for name in names if any(m.errors.get(name, 0.0) != 0.0 for m in result.measurements)]


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Floor and ceiling of the error axis."""
    shown = [v for v in values if math.isfinite(v) and SMALLEST <= v <= LARGEST] or [1e-6, 1.0]
    return min(shown) / 4.0, max(shown) * 4.0


def _draw(
    axes: Axes, result: CaseResult, name: str, colour: str, marker: str, named: bool, limits: tuple[float, float]
) -> None:
    floor, ceiling = limits
    shown = [
        (float(i) if named else _place(result, m.severity), m.errors[name], m.bounds.get(name))
        for i, m in enumerate(result.measurements)
        if name in m.errors
    ]

    def curve(points: Sequence[tuple[float, float]], **style) -> None:
        places = [p for p, _ in points]
        values = [min(max(v, floor), ceiling) if math.isfinite(v) else ceiling for _, v in points]
        axes.plot(*((values, places) if named else (places, values)), **style)

    bounded = [(p, bound) for p, _, bound in shown if bound is not None and bound > 0.0]
    if named or len(bounded) == 1:
        curve(bounded, color=colour, ls="none", marker="|" if named else "_", ms=9.0, mew=1.2, zorder=2)
    else:
        curve(bounded, color=colour, ls=(0, (4, 2)), lw=1.0, alpha=0.8, zorder=2)
    points, dots = [(p, e) for p, e, _ in shown], {"color": colour, "ls": "none", "marker": marker, "ms": 4.5}
    curve(points, color=colour, lw=0.0 if named else 1.5, zorder=3)
    curve([(p, e) for p, e in points if e != 0.0], mec="none", zorder=4, label=name, **dots)
    curve([(p, e) for p, e in points if e == 0.0], mfc=PAPER, zorder=4, **dots)
    beyond = [(p, e) for p, e, bound in shown if bound is not None and not e <= bound]
    curve(beyond, color=BAD, ls="none", marker="x", ms=11.0, mew=2.4, zorder=5)


def _place(result: CaseResult, severity: float) -> float:
    if result.case.logarithmic and not severity > 0.0:
        # A severity of zero is drawn a decade before the least that a logarithm can show.
        return 0.1 * min((m.severity for m in result.measurements if m.severity > 0.0), default=1.0)
    return severity


def _frame(axes: Axes, result: CaseResult, named: bool, limits: tuple[float, float]) -> None:
    errors, count = (0.8 * limits[0], 1.25 * limits[1]), len(result.measurements)
    if named:
        labels = [m.label if len(m.label) <= LONGEST else m.label[: LONGEST - 1] + "…" for m in result.measurements]
        axes.set(xlabel="error", ylim=(count - 0.4, -0.6))
        axes.set_yticks(range(count), labels)
        axes.tick_params(axis="y", length=0)
        log_axis(axes, "x", errors, superscript)
        return
    axes.set(ylabel="error", xlabel=result.case.severity_name)
    error_axis(axes, errors)
    if result.case.logarithmic:
        axes.set_xscale("log")
        log_axis(axes, "x", axes.get_xlim(), superscript)


def _legend(figure: Figure, axes: Axes) -> None:
    """The errors' names next to the plot, and what dashes and crosses mean."""
    from matplotlib.lines import Line2D

    handles, labels = axes.get_legend_handles_labels()
    handles.append(Line2D([], [], color=MUTED, ls=(0, (4, 2)), lw=1.0))
    handles.append(Line2D([], [], color=BAD, ls="none", marker="x", ms=8.0, mew=2.0))
    labels += ["bound, same colour", "beyond its bound"]
    figure.legend(handles, labels, loc="outside right upper")
