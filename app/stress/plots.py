"""One plot a case: every error against severity, its bound dashed in the same colour, breaches marked by red crosses.

Severities on a scale go along x; severities that are names (a scene, a fault) go down the y axis. Axes of errors are
logarithmic. An error of exactly zero is a hollow marker on the plot's floor; one that is not finite lies on its
ceiling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..bench.report.style import PALETTE, new_figure
from ..bench.report.text import superscript
from .results import CaseResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

COLOURS = [
    PALETTE[name][0] for name in ("srd", "srd-lambda", "progressive", "regular-16", "other-1", "other-2", "stochastic")
]
BAD, MUTED, GRID, PAPER = (PALETTE[name][0] for name in ("bad", "muted", "grid", "paper"))
MARKERS = "osD^vPp"
SMALLEST, LARGEST = 1e-12, 1e6
"""Range within which errors and bounds set the axis."""
WIDTH_IN, HEIGHT_IN, ROW_IN = 7.2, 3.4, 0.23


@dataclass(frozen=True)
class _Scale:
    """The error axis."""

    floor: float
    ceiling: float

    def place(self, value: float) -> float:
        """Where `value` is drawn."""
        if not math.isfinite(value):
            return self.ceiling
        return min(max(value, self.floor), self.ceiling)


def case_plot(result: CaseResult) -> Figure | None:
    """The case's errors; None where every error is zero or there is none."""
    names = drawn_names(result)
    if not names:
        return None
    named = not result.case.logarithmic and any(not _is_number(m.label) for m in result.measurements)
    figure = new_figure(WIDTH_IN, 1.0 + ROW_IN * max(len(result.measurements), 6) if named else HEIGHT_IN)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    scale = _scale(result, names)
    for number, name in enumerate(names):
        _draw(axes, result, name, COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], named, scale)
    _frame(axes, result, named, scale)
    _legend(figure, axes)
    return figure


def drawn_names(result: CaseResult) -> list[str]:
    """Errors worth drawing: those that were ever other than zero."""
    names = dict.fromkeys(name for m in result.measurements for name in m.errors)
    return [name for name in names if any(m.errors.get(name, 0.0) != 0.0 for m in result.measurements)]


def _scale(result: CaseResult, names: Sequence[str]) -> _Scale:
    values = [
        values[name] for m in result.measurements for values in (m.errors, m.bounds) for name in names if name in values
    ]
    shown = [v for v in values if math.isfinite(v) and SMALLEST <= v <= LARGEST] or [1e-6, 1.0]
    return _Scale(min(shown) / 4.0, max(shown) * 4.0)


def _draw(axes: Axes, result: CaseResult, name: str, colour: str, marker: str, named: bool, scale: _Scale) -> None:
    shown = [
        (_place(result, i, named), m.errors[name], m.bounds.get(name))
        for i, m in enumerate(result.measurements)
        if name in m.errors
    ]

    def curve(points: Sequence[tuple[float, float]], **style) -> None:
        places, values = [p for p, _ in points], [scale.place(v) for _, v in points]
        axes.plot(*((values, places) if named else (places, values)), **style)

    bounded = [(p, bound) for p, _, bound in shown if bound is not None and bound > 0.0]
    if named or len(bounded) == 1:
        curve(bounded, color=colour, ls="none", marker="|" if named else "_", ms=9.0, mew=1.2, zorder=2)
    else:
        curve(bounded, color=colour, ls=(0, (4, 2)), lw=1.0, alpha=0.8, zorder=2)
    curve([(p, e) for p, e, _ in shown], color=colour, lw=0.0 if named else 1.5, zorder=3)
    curve(
        [(p, e) for p, e, _ in shown if e != 0.0],
        color=colour,
        ls="none",
        marker=marker,
        ms=4.5,
        mec="none",
        zorder=4,
        label=name,
    )
    curve(
        [(p, e) for p, e, _ in shown if e == 0.0], color=colour, ls="none", marker=marker, ms=4.5, mfc=PAPER, zorder=4
    )
    curve(
        [(p, e) for p, e, bound in shown if bound is not None and not e <= bound],
        color=BAD,
        ls="none",
        marker="x",
        ms=11.0,
        mew=2.4,
        zorder=5,
    )


def _place(result: CaseResult, index: int, named: bool) -> float:
    severity = result.measurements[index].severity
    if named:
        return float(index)
    if result.case.logarithmic and not severity > 0.0:
        # A severity of zero stands a decade before the least that a logarithm can show.
        return 0.1 * min((m.severity for m in result.measurements if m.severity > 0.0), default=1.0)
    return severity


def _frame(axes: Axes, result: CaseResult, named: bool, scale: _Scale) -> None:
    if named:
        axes.set_xscale("log")
        axes.set_xlim(0.8 * scale.floor, 1.25 * scale.ceiling)
        axes.set_xlabel("error")
        axes.set_yticks(range(len(result.measurements)), [_short(m.label) for m in result.measurements])
        axes.set_ylim(len(result.measurements) - 0.4, -0.6)
        axes.tick_params(axis="y", length=0)
        _powers(axes.xaxis)
    else:
        axes.set_yscale("log")
        axes.set_ylim(0.8 * scale.floor, 1.25 * scale.ceiling)
        axes.set_ylabel("error")
        axes.set_xlabel(result.case.severity_name)
        _powers(axes.yaxis)
        if result.case.logarithmic:
            axes.set_xscale("log")
            _powers(axes.xaxis)
    axes.grid(color=GRID, lw=0.7)
    axes.set_axisbelow(True)


def _powers(axis: Axis) -> None:
    """Powers of ten as ticks, at most eight, without matplotlib's mathematics."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: superscript(value) if value > 0.0 else ""))
    axis.set_minor_formatter(NullFormatter())


def _legend(figure: Figure, axes: Axes) -> None:
    """The errors' names beside the plot, and what dashes and crosses mean."""
    from matplotlib.lines import Line2D

    handles, labels = axes.get_legend_handles_labels()
    handles += [
        Line2D([], [], color=MUTED, ls=(0, (4, 2)), lw=1.0),
        Line2D([], [], color=BAD, ls="none", marker="x", ms=8.0, mew=2.0),
    ]
    figure.legend(
        handles,
        [*labels, "bound, same colour", "beyond its bound"],
        loc="outside right upper",
        frameon=False,
        fontsize=8.0,
        handlelength=1.8,
    )


def _is_number(label: str) -> bool:
    return label[:1].isdigit()


def _short(label: str, most: int = 52) -> str:
    return label if len(label) <= most else label[: most - 1] + "…"
