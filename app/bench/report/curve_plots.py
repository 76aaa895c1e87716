"""Error against time and against photons for one scene, and the pieces that the other plots share.

Figures are to be made and saved inside `report_style.plot_style()`. All error axes are logarithmic. A mean error
that is zero (the debiased estimate lies below the reference's own noise) is drawn as a hollow triangle on the floor
of the plot, never dropped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..curves import speed_up, time_to_error
from ..measured_passes import MEASURED_PASSES
from ..results import Curve, Point, SceneResult
from . import style as style
from .text import number, ratio_text, superscript

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BASELINE = "stochastic"


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


def series(curve: Curve, abscissa: str) -> Series:
    """The finite points of `curve` over `abscissa` ("seconds" or "photons")."""
    rows = [
        (float(getattr(p, abscissa)), p.relmse, p.relmse_low, p.relmse_high)
        for p in sorted(curve.points, key=lambda p: p.photons)
    ]
    rows = [row for row in rows if row[0] > 0 and all(math.isfinite(value) for value in row)]
    x, mean, low, high = np.array(rows, float).reshape(-1, 4).T
    return Series(curve.method, x, mean, low, high)


def scene_series(scene: SceneResult, abscissa: str) -> list[Series]:
    """All curves of a scene that have a point to draw, in drawing order (the last lies on top)."""
    drawn = [series(curve, abscissa) for curve in scene.curves]
    return sorted((s for s in drawn if s.x.size), key=lambda s: style.method_style(s.method).rank)


def error_against(scene: SceneResult, abscissa: str) -> Figure:
    """relMSE of all methods over "seconds" (photon or camera time) or "photons" (or samples); bands over seeds, dotted
    the reference's own error."""
    figure = style.new_figure(6.6, 4.5)
    axes = figure.add_axes((0.105, 0.125, 0.70, 0.735))
    drawn = scene_series(scene, abscissa)
    measured = MEASURED_PASSES[scene.measured_pass]
    what = measured.time if abscissa == "seconds" else measured.unit
    seeds = "one seed" if scene.seeds == 1 else f"{scene.seeds} seeds; band: least to largest"
    style.title(axes, f"{scene.scene}: error against {what}", f"{scene.size[0]}×{scene.size[1]}, {seeds}")
    axes.set_ylabel("relMSE (dimensionless)")
    if not drawn:
        axes.set_xlabel(axis_name(scene.measured_pass, abscissa))
        axes.text(0.5, 0.5, "no finished points yet", ha="center", color=style.MUTED, transform=axes.transAxes)
        axes.set(xticks=[], yticks=[])
        return figure
    own = scene.reference.relmse if scene.reference is not None else 0.0
    set_limits(axes, [drawn], [own], abscissa, scene.measured_pass)
    for one in drawn:
        draw_series(axes, one)
    _draw_reference_error(axes, own)
    if abscissa == "seconds":
        draw_ratio_arrow(axes, scene)
    label_ends(axes, drawn)
    return figure


def set_limits(
    axes: Axes, groups: Sequence[Sequence[Series]], own_errors: Sequence[float], abscissa: str, measured: str = "light"
) -> None:
    """Logarithmic axes around all that is positive, with ticks that read as plain numbers."""
    everything = [one for group in groups for one in group]
    x = np.concatenate([one.x for one in everything])
    means, spans = (
        np.concatenate([one.mean for one in everything]),
        np.concatenate([np.append(one.low, one.high) for one in everything]),
    )
    min_mean = float(np.min(means, where=means > 0, initial=np.inf))
    if math.isinf(min_mean):
        min_mean = 1e-3
    # Neither a single lucky seed nor a very good reference may stretch the axis over empty decades.
    kept = [*spans[spans > min_mean / 10], *(own for own in own_errors if min_mean / 300 < own < math.inf)]
    least, largest = min([min_mean, *kept]), max([min_mean * 3, *means, *kept])
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(float(x.min()) / 1.25, float(x.max()) * 1.12)
    axes.set_ylim(float(least) / 1.8, float(largest) * 1.6)
    axes.set_xlabel(axis_name(measured, abscissa))
    _ticks(axes, abscissa)
    axes.grid(True, which="major", color=style.GRID, lw=0.7)
    axes.set_axisbelow(True)


def axis_name(measured: str, abscissa: str) -> str:
    """ "photon time (s)", "camera samples a pixel" and so on."""
    named = MEASURED_PASSES[measured]
    return f"{named.time} (s)" if abscissa == "seconds" else named.unit


def _ticks(axes: Axes, abscissa: str) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    def of_axis(limits: tuple[float, float]) -> LogLocator:
        return LogLocator(subs=(1.0, 3.0) if math.log10(limits[1] / limits[0]) < 3.2 else (1.0,), numticks=30)

    def time(value: float, _position: int) -> str:
        return f"{value:.3g}"

    def photons(value: float, _position: int) -> str:
        for unit, suffix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
            if value >= unit * 0.999:
                return f"{value / unit:.3g}{suffix}"
        return f"{value:.3g}"

    def error(value: float, _position: int) -> str:
        return superscript(value)

    axes.xaxis.set_major_locator(of_axis(axes.get_xlim()))
    axes.xaxis.set_major_formatter(FuncFormatter(time if abscissa == "seconds" else photons))
    axes.yaxis.set_major_locator(of_axis(axes.get_ylim()))
    axes.yaxis.set_major_formatter(FuncFormatter(error))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())


def draw_series(axes: Axes, one: Series, markers: bool = True) -> None:
    """A curve with its band over seeds; what is not positive goes to the floor of the axes."""
    appearance = style.method_style(one.method)
    floor = axes.get_ylim()[0]
    shown = one.mean > 0
    mean = np.where(shown, one.mean, np.nan)
    order = 3 + appearance.rank
    # A seed's error of zero or less reaches the floor; one point alone has a bar instead of a band.
    low, high = np.maximum(one.low, floor), np.maximum(one.high, floor)
    if one.x.size > 1:
        axes.fill_between(
            one.x, low, high, color=appearance.colour, alpha=0.16 if one.method == "srd" else 0.10, lw=0, zorder=order
        )
    else:
        axes.vlines(one.x, low, high, color=appearance.colour, lw=4, alpha=0.2, zorder=order)
    size = (4.6 if one.method == "srd" else 3.4) if markers else 0.0
    axes.plot(
        one.x,
        mean,
        color=appearance.colour,
        lw=appearance.width_pt,
        ls=appearance.dash,
        marker=appearance.marker,
        ms=size,
        mec=style.PAPER if appearance.marker not in "x+" else appearance.colour,
        mew=0.6 if appearance.marker not in "x+" else 1.1,
        zorder=order + 0.5,
    )
    if not shown.all():
        x = one.x[~shown]
        axes.plot(
            x,
            np.full(x.size, floor),
            "v",
            ms=6,
            mfc=style.PAPER,
            mec=appearance.colour,
            mew=1.2,
            clip_on=False,
            zorder=12,
        )


def _draw_reference_error(axes: Axes, own: float) -> None:
    if not 0 < own < math.inf:
        return
    low, high = axes.get_ylim()
    if own < low:
        axes.text(
            0.012,
            0.012,
            f"reference's own error {number(own)}, below",
            transform=axes.transAxes,
            fontsize=8,
            color=style.INK,
            zorder=13,
        )
        return
    axes.axhline(own, color=style.INK, lw=1.1, ls=(0.0, (1.0, 1.8)), zorder=2.5)
    under = own > math.sqrt(low * high)
    axes.annotate(
        "reference's own error",
        (0.012, own),
        xycoords=("axes fraction", "data"),
        xytext=(0, -3 if under else 3),
        textcoords="offset points",
        va="top" if under else "bottom",
        fontsize=8,
        color=style.INK,
        zorder=13,
    )


def draw_ratio_arrow(axes: Axes, scene: SceneResult) -> None:
    """From the end of `stochastic` to where `srd` reaches that error: the ratio that counts, to be seen as a length."""
    ratio = scene.time_to_equal_error.get("srd", 0.0)
    points = points_of(scene, BASELINE)
    own = time_to_error(points, points[-1].relmse) if points else None
    if own is None or not 1.2 < ratio < math.inf or not 0 < points[-1].relmse < math.inf:
        return
    end_s, error = own.seconds, points[-1].relmse
    reached_s = max(end_s / ratio, axes.get_xlim()[0])
    draw_time_arrow(axes, end_s, reached_s, error)
    axes.annotate(
        f"{ratio_text(ratio, is_lower_bound(scene, 'srd'))} less time",
        (math.sqrt(end_s * reached_s), error),
        xytext=(0, -3.5),
        textcoords="offset points",
        ha="center",
        va="top",
        color=style.method_style("srd").colour,
        fontweight="bold",
        fontsize=9,
        zorder=13,
    )


def draw_time_arrow(axes: Axes, from_s: float, to_s: float, error: float) -> None:
    """From when another method has an error to when `srd` has it: how much sooner, seen as a length."""
    axes.annotate(
        "",
        (to_s, error),
        (from_s, error),
        zorder=11,
        arrowprops={
            "arrowstyle": "-|>",
            "color": style.method_style("srd").colour,
            "lw": 1.0,
            "ls": (0.0, (4.0, 2.0)),
            "shrinkA": 3,
            "shrinkB": 0,
        },
    )


def points_of(scene: SceneResult, method: str) -> list[Point]:
    """A method's points; none where it has none yet."""
    return next((curve.points for curve in scene.curves if curve.method == method), [])


def is_lower_bound(scene: SceneResult, method: str) -> bool:
    """Whether the method's shortest rendering is already as good as the baseline's longest, so that the true ratio is
    larger still."""
    reached = speed_up(points_of(scene, method), points_of(scene, BASELINE))
    return reached is not None and reached.at_once and method != BASELINE


def label_ends(axes: Axes, drawn: Sequence[Series], gap_pt: float = 11.5) -> None:
    """Name each curve at its right end; names are pushed apart and tied to their curves by a thin line."""
    low, high = axes.get_ylim()
    height_pt = axes.bbox.height / axes.figure.dpi * 72
    ends = sorted((max(float(one.mean[-1]), low), one.method, float(one.x[-1])) for one in drawn)
    wanted = [height_pt * math.log(error / low) / math.log(high / low) for error, _, _ in ends]
    for place, (error, name, x) in zip(spread(wanted, gap_pt, height_pt), ends, strict=True):
        appearance = style.method_style(name)
        axes.annotate(
            name,
            (x, error),
            xytext=(1.035, place / height_pt),
            textcoords="axes fraction",
            va="center",
            ha="left",
            fontsize=9,
            color=appearance.colour,
            fontweight="bold" if name == "srd" else "normal",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": appearance.colour,
                "lw": 0.6,
                "shrinkA": 1,
                "shrinkB": 3,
                "alpha": 0.7,
                "relpos": (0.0, 0.5),
            },
        )


def spread(wanted: Sequence[float], gap: float, height: float) -> list[float]:
    """Rising places as near to `wanted` (rising) as can be, at least `gap` apart: isotonic regression of wanted −
    i·gap.

    They stay within 0…height as long as there is room.
    """
    blocks: list[list[float]] = []  # [sum, count] of pooled neighbours
    for index, place in enumerate(wanted):
        blocks.append([place - index * gap, 1])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            total, count = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += count
    levels = [total / count for total, count in blocks for _ in range(int(count))]
    ceiling = height - (len(levels) - 1) * gap
    return [min(max(level, 0.0), max(ceiling, 0.0)) + index * gap for index, level in enumerate(levels)]
