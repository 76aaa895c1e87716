"""The plots of one scene: error against time and photons.

Figures must be made and saved inside `style.plot_style()`. All error axes are logarithmic. A mean error of zero (the
debiased estimate lies below the reference's own noise) is drawn as a hollow triangle on the floor of the plot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..measured_passes import MEASURED_PASSES
from ..results import Point, SceneResult
from . import style
from .text import count, number, seeds_text, superscript

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Series:
    """What can be drawn of one curve; float64 arrays of one length, by rising number of photons (the last is the
    longest rendering)."""

    method: str
    x: np.ndarray
    """Photon seconds or photons, > 0; on a busy machine seconds need not rise."""
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    """relMSE: mean, least and largest of the seeds; finite, may be ≤ 0."""


def scene_series(scene: SceneResult, abscissa: str) -> list[Series]:
    """The finite points of all curves of a scene that have any, over "seconds" or "photons", in drawing order (the last
    lies on top)."""
    drawn, names = [], (abscissa, "relmse", "relmse_low", "relmse_high")
    for curve in scene.curves:
        rows = [[float(getattr(p, name)) for name in names] for p in sorted(curve.points, key=lambda p: p.photons)]
        rows = [row for row in rows if row[0] > 0 and all(map(math.isfinite, row))]
        if rows:
            drawn.append(Series(curve.method, *np.array(rows).T))
    return sorted(drawn, key=lambda one: style.method_style(one.method).rank)


def error_against(scene: SceneResult, abscissa: str) -> Figure:
    """relMSE of all methods over "seconds" (photon or camera time) or "photons" (or samples); bands over seeds, dotted
    the reference's own error."""
    figure = style.new_figure(6.6, 4.5)
    axes = figure.add_axes((0.105, 0.125, 0.70, 0.735))
    drawn, measured = scene_series(scene, abscissa), MEASURED_PASSES[scene.measured_pass]
    against = measured.time if abscissa == "seconds" else measured.unit
    seeds = seeds_text(scene.seeds) + ("" if scene.seeds == 1 else "; band: least to largest")
    style.title(axes, f"{scene.scene}: error against {against}", f"{scene.size[0]}×{scene.size[1]}, {seeds}")
    axes.set(xlabel=axis_name(scene.measured_pass, abscissa), ylabel="relMSE (dimensionless)")
    if not drawn:
        axes.text(0.5, 0.5, "no finished points yet", ha="center", color=style.MUTED, transform=axes.transAxes)
        axes.set(xticks=[], yticks=[])
        return figure
    own = scene.reference.relmse if scene.reference is not None else 0.0
    set_limits(axes, drawn, abscissa, own)
    for one in drawn:
        draw_series(axes, one)
    _draw_reference_error(axes, own)
    label_ends(axes, drawn)
    return figure


def axis_name(measured: str, abscissa: str = "seconds") -> str:
    """ "photon time (s)", "camera samples a pixel" and so on."""
    named = MEASURED_PASSES[measured]
    return f"{named.time} (s)" if abscissa == "seconds" else named.unit


def set_limits(axes: Axes, drawn: Sequence[Series], abscissa: str = "seconds", own_error: float = 0.0) -> None:
    """Logarithmic axes around all that is positive."""
    x = np.concatenate([one.x for one in drawn])
    means = np.concatenate([one.mean for one in drawn])
    spans = np.concatenate([np.append(one.low, one.high) for one in drawn])
    least = float(np.min(means, where=means > 0, initial=np.inf))
    least = 1e-3 if math.isinf(least) else least
    # Neither a single lucky seed nor a very good reference may stretch the axis over empty decades.
    kept = [least, *spans[spans > least / 10], *([own_error] if least / 300 < own_error < math.inf else [])]
    style.log_axis(axes, "x", (x.min() / 1.25, x.max() * 1.12), style.plain if abscissa == "seconds" else count)
    style.log_axis(axes, "y", (min(kept) / 1.8, max(least * 3, *means, *kept) * 1.6), superscript)


def draw_series(axes: Axes, one: Series, markers: bool = True) -> None:
    """A curve with its band over seeds; what is not positive goes to the floor of the axes."""
    looks, floor, strong = style.method_style(one.method), axes.get_ylim()[0], one.method == "srd"
    shown, order = one.mean > 0, 3 + looks.rank
    # A seed's error of zero or less reaches the floor; one point alone has a bar instead of a band.
    low, high = np.maximum(one.low, floor), np.maximum(one.high, floor)
    if one.x.size > 1:
        alpha = 0.16 if strong else 0.10
        axes.fill_between(one.x, low, high, color=looks.colour, alpha=alpha, lw=0, zorder=order)
    else:
        axes.vlines(one.x, low, high, color=looks.colour, lw=4, alpha=0.2, zorder=order)
    edge: style.Settings = (
        {"mec": looks.colour, "mew": 1.1} if looks.marker in "x+" else {"mec": style.PAPER, "mew": 0.6}
    )
    size = (4.6 if strong else 3.4) if markers else 0.0
    line: style.Settings = {
        "color": looks.colour,
        "lw": looks.width_pt,
        "ls": looks.dash,
        "marker": looks.marker,
        "ms": size,
    }
    axes.plot(one.x, np.where(shown, one.mean, np.nan), zorder=order + 0.5, **line, **edge)
    style.floor_marks(axes, one.x[~shown], looks.colour)


def _draw_reference_error(axes: Axes, own: float) -> None:
    if not 0 < own < math.inf:
        return
    low, high = axes.get_ylim()
    if own < low:
        axes.text(0.012, 0.012, f"reference's own error {number(own)}, below", transform=axes.transAxes, fontsize=8)
        return
    axes.axhline(own, color=style.INK, lw=1.1, ls=(0.0, (1.0, 1.8)), zorder=2.5)
    under = own > math.sqrt(low * high)
    place = {"xycoords": ("axes fraction", "data"), "va": "top" if under else "bottom"}
    style.note(axes, "reference's own error", (0.012, own), -3.0 if under else 3.0, **place)


def draw_time_arrow(axes: Axes, from_s: float, to_s: float, error: float) -> None:
    """From when another method has an error to when `srd` has it."""
    line = {"lw": 1.0, "ls": (0.0, (4.0, 2.0)), "color": style.method_style("srd").colour}
    arrow = {"arrowstyle": "-|>", "shrinkA": 3, "shrinkB": 0, **line}
    axes.annotate("", (to_s, error), (from_s, error), zorder=11, arrowprops=arrow)


def points_of(scene: SceneResult, method: str) -> list[Point]:
    """A method's points; none where it has none yet."""
    return next((curve.points for curve in scene.curves if curve.method == method), [])


def label_ends(axes: Axes, drawn: Sequence[Series], gap_pt: float = 11.5) -> None:
    """Name each curve at its right end; names are pushed apart and tied to their curves by a thin line."""
    low, high = axes.get_ylim()
    height_pt = axes.bbox.height / axes.figure.dpi * 72
    ends = sorted((max(float(one.mean[-1]), low), one.method, float(one.x[-1])) for one in drawn)
    wanted = [height_pt * math.log(error / low) / math.log(high / low) for error, _, _ in ends]
    tie = {"arrowstyle": "-", "lw": 0.6, "shrinkA": 1, "shrinkB": 3, "alpha": 0.7, "relpos": (0.0, 0.5)}
    for place, (error, name, x) in zip(spread(wanted, gap_pt, height_pt), ends, strict=True):
        axes.annotate(
            name,
            (x, error),
            xytext=(1.035, place / height_pt),
            textcoords="axes fraction",
            va="center",
            color=style.method_style(name).colour,
            fontweight="bold" if name == "srd" else "normal",
            annotation_clip=False,
            arrowprops=tie | {"color": style.method_style(name).colour},
        )


def spread(wanted: Sequence[float], gap: float, height: float) -> list[float]:
    """Rising places as near to `wanted` (rising) as can be, at least `gap` apart: isotonic regression of wanted −
    i·gap.

    They stay within 0…height as long as there is room.
    """
    from scipy.optimize import isotonic_regression

    steps = gap * np.arange(len(wanted))
    levels = isotonic_regression(np.asarray(wanted, float) - steps).x if len(wanted) else steps
    return (np.clip(levels, 0.0, max(height - gap * (len(wanted) - 1), 0.0)) + steps).tolist()
