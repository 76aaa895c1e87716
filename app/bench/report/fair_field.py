"""Speed-up over target error against the best baseline, and the sweeps of their kernels: plots and tables.

Figures are to be made and saved inside `report_style.plot_style()`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..measured_passes import MEASURED_PASSES
from ..results import TARGETS, BenchResult, Curve, SceneResult, SpeedUp
from ..screen import speed_up_text
from . import style as style
from .page import Table
from .text import count, number, superscript

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SCENE_COLOURS = (
    *("srd", "srd-lambda", "regular-7", "progressive", "other-1", "other-2", "other-3", "stochastic"),
    *("hero", "progressive-stochastic", "regular-16", "stochastic-point"),
)
_CLOCKS = {"photon": "time of the measured pass", "whole": "whole process"}
_PANELS_A_ROW = 4


def clock_name(clock: str, measured_pass: str) -> str:
    """ "photon time", "whole process"."""
    return MEASURED_PASSES[measured_pass].time if clock == "photon" else _CLOCKS[clock]


def cell(one: SpeedUp | None) -> str:
    """The speed-up, or what stands in its place."""
    return "–" if one is None else speed_up_text(one)


def summary_table(result: BenchResult) -> Table | None:
    """All scenes and both clocks; None where nothing was compared."""
    rows = [
        [scene.scene, clock_name(clock, scene.measured_pass), *(_named(found.get(target)) for target in TARGETS)]
        for scene in result.scenes
        for clock in _CLOCKS
        if (found := {one.target: one for one in scene.speed_ups if one.clock == clock})
    ]
    if not rows:
        return None
    return Table(
        ("scene", "by", *(percent(target) for target in TARGETS)),
        rows,
        "Time of the best baseline over time of srd to each relMSE, and which baseline it is. ≥: srd's smallest "
        "rendering is already as good, or no baseline got there as long as all were followed; ≤: the baseline's "
        "smallest rendering is already as good; –: nobody got there.",
    )


def percent(target: float) -> str:
    """A target error as a heading."""
    return f"{100 * target:.3g} %"


def _named(one: SpeedUp | None) -> str:
    text = cell(one)
    return f"{text} {one.baseline}" if one is not None and one.baseline else text


def scene_table(scene: SceneResult) -> Table | None:
    """One scene's speed-ups with the times that they are made of."""
    if not scene.speed_ups:
        return None
    rows = [
        [
            percent(one.target),
            clock_name(one.clock, scene.measured_pass),
            cell(one),
            "–" if one.seconds is None else f"{'≤ ' if one.at_once else ''}{one.seconds:.3g}",
            one.baseline or "none of them",
            f"{'≤ ' if one.baseline_at_once else '' if one.baseline else '> '}{one.baseline_seconds:.3g}",
        ]
        for one in scene.speed_ups
    ]
    return Table(
        ("relMSE", "by", "speed-up", "srd s", "best baseline", "its s"),
        rows,
        "Each baseline has, at every budget, the kernel with the least actual error: more than any user could choose.",
        numbers=("speed-up", "srd s", "its s"),
    )


def speed_up_over_error(result: BenchResult) -> Figure | None:
    """Speed-up against target error, a line a scene; by the pass's own time and by that of a whole process. None where
    nothing was compared."""
    scenes = [scene for scene in result.scenes if any(one.ratio for one in scene.speed_ups)]
    if not scenes:
        return None
    figure = style.new_figure(8.6, 4.3)
    grid = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.085, right=0.83, bottom=0.14, top=0.84, wspace=0.06)
    ratios = [one.ratio for scene in scenes for one in scene.speed_ups if one.ratio]
    for axes, clock in zip(grid, _CLOCKS, strict=True):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(TARGETS[0] * 1.5, TARGETS[-1] / 1.5)
        axes.set_ylim(min([0.5, *ratios]) / 1.5, max([2.0, *ratios]) * 1.5)
        axes.axhline(1.0, color=style.MUTED, lw=0.8, ls=(0.0, (3.0, 2.0)))
        axes.grid(True, which="major", color=style.GRID, lw=0.7)
        axes.set_axisbelow(True)
        axes.set_xlabel("target relMSE")
        _axis_ticks(axes)
        style.title(axes, f"Speed-up by {clock_name(clock, result.settings.measured_pass)}", "hollow: a bound")
        for index, scene in enumerate(scenes):
            _draw_scene(axes, scene, clock, style.PALETTE[_SCENE_COLOURS[index % len(_SCENE_COLOURS)]][0])
    grid[0].set_ylabel("time of the best baseline ÷ time of srd")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.835, 0.86), frameon=False, fontsize=8)
    return figure


def _draw_scene(axes: Axes, scene: SceneResult, clock: str, colour: str) -> None:
    found = [
        (one.target, one.ratio, one.bound)
        for one in scene.speed_ups
        if one.clock == clock and one.ratio is not None and one.bound != "~"
    ]
    axes.plot(
        [target for target, _, _ in found],
        [ratio for _, ratio, _ in found],
        color=colour,
        lw=1.5,
        marker="o",
        ms=4.5,
        label=scene.scene,
    )
    for target, ratio, bound in found:
        if bound:
            marker = "^" if bound == "≥" else "v"
            axes.plot(target, ratio, marker, ms=6.5, mfc=style.PAPER, mec=colour, mew=1.2, zorder=6)


def _axis_ticks(axes: Axes) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

    axes.xaxis.set_major_locator(FixedLocator(list(TARGETS)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: percent(value)))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=30))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}×"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())


def sweep_plot(scene: SceneResult) -> Figure | None:
    """relMSE against the kernel's width, a panel a baseline, a line a budget; None where no kernel was swept."""
    swept = {curve.method: curve for curve in scene.curves if curve.kernels}
    names = style.by_rank(list(swept))
    trials = [t for name in names for t in swept[name].sweep if t.relmse > 0]
    if not trials:
        return None
    columns = min(len(names), _PANELS_A_ROW)
    rows = math.ceil(len(names) / columns)
    width, height = max(2.1 * columns + 0.8, 4.2), 2.2 * rows + 0.9
    figure = style.new_figure(width, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(
        left=0.7 / width, right=1 - 0.1 / width, bottom=0.5 / height, top=1 - 0.6 / height, wspace=0.1, hspace=0.3
    )
    figure.text(
        0.7 / width, 1 - 0.1 / height, f"{scene.scene}: the kernels that were tried", fontweight="bold", va="top"
    )
    for axes in grid.flat[len(names) :]:
        axes.set_visible(False)
    for index, (axes, name) in enumerate(zip(grid.flat, names, strict=False)):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(min(t.relmse for t in trials) / 1.5, max(t.relmse for t in trials) * 1.5)
        axes.set_title(name, loc="left", fontsize=9.5, color=style.method_style(name).colour, pad=4)
        axes.set_xlabel("kernel (lattice spacings)" if index + columns >= len(names) else "")
        axes.set_ylabel("relMSE" if index % columns == 0 else "")
        axes.grid(True, which="major", color=style.GRID, lw=0.7)
        _draw_sweep(axes, swept[name])
    return figure


def _draw_sweep(axes: Axes, curve: Curve) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

    colour = style.method_style(curve.method).colour
    for photons in sorted({t.photons for t in curve.sweep}):
        line = sorted((t.smoothing, t.relmse) for t in curve.sweep if t.photons == photons and t.relmse > 0)
        if not line:
            continue
        x, y = np.array(line).T
        axes.plot(x, y, color=colour, lw=1.0, marker="o", ms=2.5)
        axes.annotate(
            count(photons), (x[-1], y[-1]), xytext=(3, 0), textcoords="offset points", fontsize=7, color=style.MUTED
        )
    axes.xaxis.set_major_locator(FixedLocator([0.5, 1, 2, 4, 8, 16, 32]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(numticks=30))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: superscript(value)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_xlim(0.4, 60.0)


def kernel_table(scene: SceneResult) -> Table | None:
    """What the sweep chose: the kernel and its error at the budgets that were tried."""
    rows = []
    for curve in scene.curves:
        if not curve.kernels:
            continue
        for photons in sorted({t.photons for t in curve.sweep}):
            tried = [t for t in curve.sweep if t.photons == photons]
            best = min(tried, key=lambda t: t.relmse)
            narrow = next((t for t in tried if t.smoothing == min(t.smoothing for t in curve.sweep)), None)
            rows.append(
                [
                    curve.method,
                    count(photons),
                    f"{best.seconds:.3g}",
                    f"{best.smoothing:.2g}",
                    number(best.relmse),
                    "–" if narrow is None else number(narrow.relmse),
                    str(len(tried)),
                ]
            )
    if not rows:
        return None
    measured = MEASURED_PASSES[scene.measured_pass]
    headings = (measured.units, f"{measured.time.split()[0]} s", "best kernel", "its relMSE", "relMSE at 0.45", "tried")
    return Table(
        ("method", *headings),
        rows,
        "Kernels in standard deviations by lattice spacings, one seed that is not among those measured. From the "
        "second budget on the sweep follows the best kernel downhill; –: not tried there.",
        numbers=headings,
    )
