"""The plots over all scenes of a run: error against time as small multiples, speed-up over target error.

Figures must be made and saved inside `style.plot_style()`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..curves import best_baseline, time_to_error
from ..results import CLOCKS, TARGETS, BenchResult, SceneResult
from . import style
from .curve_plots import (
    Series,
    axis_name,
    draw_series,
    draw_time_arrow,
    label_ends,
    points_of,
    scene_series,
    set_limits,
)
from .text import clock_name, percent, ratio_text, times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RIVALS = ("stochastic-even", "srd-lambda")
"""Shown next to `stochastic` and `srd` in the small panels: the first that the run has."""
_SCENE_COLOURS = (
    *("srd", "srd-lambda", "regular-7", "progressive", "other-1", "other-2", "other-3", "stochastic"),
    *("hero", "progressive-stochastic", "regular-16", "stochastic-point"),
)


def small_multiples(result: BenchResult) -> Figure:
    """Panels that share both axes, one for each scene that has points, in the order that the scenes were named in;
    each says how much sooner `srd` has the error that the best of all baselines ends with."""
    measured = {curve.method for scene in result.scenes for curve in scene.curves if curve.points}
    shown = {"stochastic", "srd", *[name for name in _RIVALS if name in measured][:1]}
    found = [(s, [one for one in scene_series(s, "seconds") if one.method in shown]) for s in result.scenes]
    found = [(scene, drawn) for scene, drawn in found if drawn]
    columns = 2 if len(found) == 4 else min(3, max(len(found), 1))
    figure, grid = style.panels(len(found), columns, (2.75, 2.3), (0.68, 1.32, 0.5, 0.35))
    for index, (axes, (scene, drawn)) in enumerate(zip(grid, found, strict=True)):
        set_limits(axes, [one for _, series in found for one in series])
        _draw_panel(axes, scene, drawn)
        if index % columns == columns - 1 or index == len(found) - 1:
            label_ends(axes, drawn)
    style.label_panels(grid, columns, axis_name(result.settings.measured_pass), "relMSE")
    return figure


def _draw_panel(axes: Axes, scene: SceneResult, drawn: Sequence[Series]) -> None:
    for one in drawn:
        draw_series(axes, one, markers=False)
    axes.set_title(scene.scene, loc="left", fontsize=10, fontweight="bold", pad=5)
    best, points = best_baseline(scene.curves), points_of(scene, "srd")
    if best is None or not points:
        return
    end = best.points[-1].relmse
    theirs, reached = time_to_error(best.points, end), time_to_error(points, end)
    assert theirs is not None, "a curve reaches its own end"
    ratio = 0.0 if reached is None else theirs.seconds / reached.seconds
    words = "never as good" if reached is None else f"{ratio_text(ratio, reached.at_once)} less time"
    colour = style.method_style("srd").colour if ratio > 1.0 else style.MUTED
    axes.set_title(words, loc="right", fontsize=9, color=colour, pad=5)
    if reached is not None and end > 0.0:
        draw_time_arrow(axes, theirs.seconds, max(reached.seconds, axes.get_xlim()[0]), end)


def speed_up_over_error(result: BenchResult) -> Figure | None:
    """Speed-up against target error, a line a scene; by the pass's own time and by that of a whole process. None where
    nothing was compared."""
    scenes = [scene for scene in result.scenes if any(one.ratio for one in scene.speed_ups)]
    ratios = [one.ratio for scene in scenes for one in scene.speed_ups if one.ratio]
    if not scenes:
        return None
    figure, grid = style.panels(2, 2, (3.2, 2.9), (0.75, 1.45, 0.6, 0.7))
    for axes, clock in zip(grid, CLOCKS, strict=True):
        style.log_axis(axes, "x", (TARGETS[0] * 1.5, TARGETS[-1] / 1.5), percent, TARGETS)
        style.log_axis(axes, "y", (min([0.5, *ratios]) / 1.5, max([2.0, *ratios]) * 1.5), times)
        axes.axhline(1.0, color=style.MUTED, lw=0.8, ls=(0.0, (3.0, 2.0)))
        style.title(axes, f"Speed-up by {clock_name(clock, result.settings.measured_pass)}", "hollow: a bound")
        for index, scene in enumerate(scenes):
            _draw_speed_ups(axes, scene, clock, style.PALETTE[_SCENE_COLOURS[index % len(_SCENE_COLOURS)]][0])
    style.label_panels(grid, 2, "target relMSE", "time of the best baseline ÷ time of srd")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(0.835, 0.86))
    return figure


def _draw_speed_ups(axes: Axes, scene: SceneResult, clock: str, colour: str) -> None:
    found = [
        (one.target, one.ratio, one.bound)
        for one in scene.speed_ups
        if one.clock == clock and one.ratio is not None and one.bound != "~"
    ]
    line: style.Settings = {"color": colour, "lw": 1.5, "marker": "o", "ms": 4.5, "label": scene.scene}
    axes.plot([target for target, _, _ in found], [ratio for _, ratio, _ in found], **line)
    for target, ratio, bound in found:
        if bound:
            marker = "^" if bound == "≥" else "v"
            axes.plot(target, ratio, marker, ms=6.5, mfc=style.PAPER, mec=colour, mew=1.2, zorder=6)
