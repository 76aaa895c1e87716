"""Plots over all scenes of a bench run: the time ratios beside what was asked, and error against time as small
multiples.

Figures are to be made and saved inside `report_style.plot_style()`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..curves import best_baseline, time_to_error
from ..measured_passes import MEASURED_PASSES
from ..results import BenchResult, SceneResult
from . import style as style
from .curve_plots import (
    BASELINE,
    Series,
    axis_name,
    draw_series,
    draw_time_arrow,
    is_lower_bound,
    label_ends,
    points_of,
    scene_series,
    set_limits,
)
from .text import ratio_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NEVER_PLACE = 1.18
"""Where a method that never gets there is drawn, as a factor on the axis's left end."""
_RIVALS = ("stochastic-even", "srd-lambda")
"""Who stands beside `stochastic` and `srd` in the small panels: the first that the run has."""


def overview(result: BenchResult) -> Figure:
    """Per scene the time to equal error as a ratio to `stochastic`, a dot for each method; the line is what is asked of
    `srd`."""
    scenes = sorted(result.scenes, key=lambda s: s.time_to_equal_error.get("srd", -1.0))
    height = 1.75 + 0.34 * max(len(scenes), 1)
    figure = style.new_figure(8.6, height)
    axes = figure.add_axes((0.27, 0.92 / height, 0.705, 1 - 1.6 / height))
    ratios = [r for s in scenes for r in s.time_to_equal_error.values() if r > 0 and math.isfinite(r)]
    asked = MEASURED_PASSES[result.settings.measured_pass].asked_ratio
    left, right = min([0.5, *ratios]) / 2.2, max([asked * 2, *ratios]) * 2.2
    axes.set_xscale("log")
    axes.set_xlim(left, right)
    axes.set_ylim(-0.6, max(len(scenes), 1) - 0.4)
    axes.axvspan(asked, right, color=style.WASH, lw=0, zorder=0)
    axes.axvline(asked, color=style.INK, lw=1.2, zorder=2)
    axes.axvline(1.0, color=style.MUTED, lw=0.8, ls=(0.0, (3.0, 2.0)), zorder=1)
    notes = [
        (right, f"asked of srd: at most 1/{asked:.0f} of the time", style.INK),
        (1.0, "as fast as stochastic", style.MUTED),
    ]
    if any(
        _ratio(scene, curve.method) is None for scene in scenes for curve in scene.curves if curve.method != BASELINE
    ):
        notes.append((left * _NEVER_PLACE, "never", style.MUTED))
    for x, text, colour in notes:
        axes.annotate(
            text,
            (x, 1),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right" if x == right else "center",
            va="bottom",
            fontsize=8,
            color=colour,
        )
    style.title(axes, "Time to equal error", " ")
    for row, scene in enumerate(scenes):
        _draw_ratios(axes, row, scene, left)
    _ratio_axes(axes, scenes)
    _method_key(axes, scenes, height)
    return figure


def _draw_ratios(axes: Axes, row: int, scene: SceneResult, left: float) -> None:
    for curve in scene.curves:
        if curve.method == BASELINE:
            continue
        appearance = style.method_style(curve.method)
        strong = curve.method == "srd"
        ratio = _ratio(scene, curve.method)
        reached = ratio is not None
        x = left * _NEVER_PLACE if ratio is None else ratio
        axes.plot(
            x,
            row,
            appearance.marker,
            ms=8.5 if strong else 5.0,
            zorder=5 + appearance.rank,
            clip_on=False,
            alpha=1.0 if reached else 0.75,
            mfc=appearance.colour if reached else style.PAPER,
            mec=appearance.colour if not strong or not reached else style.PAPER,
            mew=1.0,
        )
        if strong and ratio is not None:
            axes.annotate(
                ratio_text(ratio, is_lower_bound(scene, "srd")),
                (x, row),
                xytext=(0, 5),
                textcoords="offset points",
                ha="center",
                color=appearance.colour,
                fontweight="bold",
                fontsize=9,
                zorder=14,
            )


def _ratio(scene: SceneResult, method: str) -> float | None:
    """Time to equal error, None where the method never gets there."""
    ratio = scene.time_to_equal_error.get(method, 0.0)
    return ratio if ratio > 0 and math.isfinite(ratio) else None


def _ratio_axes(axes: Axes, scenes: Sequence[SceneResult]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=30))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}×"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("time of stochastic ÷ time of the method, to the error stochastic has at its end; larger is faster")
    axes.set_yticks(range(len(scenes)), [_scene_label(scene) for scene in scenes])
    axes.tick_params(axis="y", length=0)
    axes.grid(True, axis="both", color=style.GRID, lw=0.7)
    axes.set_axisbelow(True)
    axes.spines["left"].set_visible(False)


def _scene_label(scene: SceneResult) -> str:
    name = scene.scene if len(scene.scene) <= 20 else f"{scene.scene[:19]}…"
    if scene.strongest_abbe <= 0:
        return f"{name}  (no dispersion)"
    return f"{name}  ({scene.strongest_glass[:14]}, Abbe {scene.strongest_abbe:.0f})"


def _method_key(axes: Axes, scenes: Sequence[SceneResult], height_in: float) -> None:
    """A line of markers at the foot: dots cannot be named directly where eight rows share them."""
    from matplotlib.lines import Line2D

    names = style.by_rank(sorted({c.method for s in scenes for c in s.curves} - {BASELINE}))
    if not names:
        return
    handles = [
        Line2D(
            [],
            [],
            ls="",
            marker=(appearance := style.method_style(name)).marker,
            ms=8 if name == "srd" else 5.5,
            mfc=appearance.colour,
            mec=appearance.colour,
            label=name,
        )
        for name in names
    ]
    axes.figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.26, 0.06 / height_in),
        ncols=len(handles),
        frameon=False,
        fontsize=8,
        handletextpad=0.2,
        columnspacing=1.3,
    )


def small_multiples(result: BenchResult) -> Figure:
    """Panels that share both axes, one for each scene that has points, in the order that the scenes were named in;
    each tells how much sooner `srd` has the error that the best of all baselines ends with."""
    measured = {curve.method for scene in result.scenes for curve in scene.curves if curve.points}
    shown = {BASELINE, "srd", *[name for name in _RIVALS if name in measured][:1]}
    panels = [(s, [one for one in scene_series(s, "seconds") if one.method in shown]) for s in result.scenes]
    panels = [(scene, drawn) for scene, drawn in panels if drawn]
    columns = 2 if len(panels) == 4 else min(3, max(len(panels), 1))
    rows = max(math.ceil(len(panels) / columns), 1)
    width, height = 2.75 * columns + 2.05, 2.3 * rows + 0.75
    figure = style.new_figure(width, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(
        left=0.68 / width, right=1 - 1.32 / width, bottom=0.5 / height, top=1 - 0.35 / height, wspace=0.08, hspace=0.28
    )
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for index, (axes, (scene, drawn)) in enumerate(zip(grid.flat, panels, strict=False)):
        set_limits(axes, [group for _, group in panels], [], "seconds", scene.measured_pass)
        lowest, leftmost = index + columns >= len(panels), index % columns == 0
        last = index % columns == columns - 1 or index == len(panels) - 1
        name = axis_name(scene.measured_pass, "seconds")
        axes.set(xlabel=name if lowest else "", ylabel="relMSE" if leftmost else "")
        axes.tick_params(labelbottom=lowest)
        _draw_panel(axes, scene, drawn, named=last)
    return figure


def _draw_panel(axes: Axes, scene: SceneResult, drawn: Sequence[Series], named: bool) -> None:
    for one in drawn:
        draw_series(axes, one, markers=False)
    if named:
        label_ends(axes, drawn)
    axes.set_title(scene.scene, loc="left", fontsize=10, fontweight="bold", pad=5)
    best, points = best_baseline(scene.curves), points_of(scene, "srd")
    if best is None or not points:
        return
    end = best.points[-1].relmse
    theirs, reached = time_to_error(best.points, end), time_to_error(points, end)
    assert theirs is not None, "a curve reaches its own end"
    ratio = None if reached is None else theirs.seconds / reached.seconds
    text = "never as good" if ratio is None or reached is None else f"{ratio_text(ratio, reached.at_once)} less time"
    colour = style.method_style("srd").colour if ratio is not None and ratio > 1.0 else style.MUTED
    axes.set_title(text, loc="right", fontsize=9, color=colour, pad=5)
    if reached is not None and end > 0.0:
        draw_time_arrow(axes, theirs.seconds, max(reached.seconds, axes.get_xlim()[0]), end)
