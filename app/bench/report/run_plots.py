"""The plot over all scenes of a run: error against time as small multiples.

Figures must be made and saved inside `style.plot_style()`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..curves import best_baseline, time_to_error
from ..results import BenchResult, SceneResult
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
from .text import ratio_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RIVALS = ("stochastic-even", "srd-lambda")
"""Shown next to `stochastic` and `srd` in the small panels: the first that the run has."""


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
