"""Two plots of one scene that explain a curve: its bias and variance, and where its time goes.

Figures are to be made and saved inside `report_style.plot_style()`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..measured_passes import MEASURED_PASSES, MeasuredPass
from ..results import Curve, Sample, SceneResult
from . import style as style
from .curve_plots import Series, axis_name, scene_series, set_limits
from .text import count

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS_A_ROW = 6


def bias_and_variance(scene: SceneResult) -> Figure | None:
    """A panel for each method: variance (solid) and bias² (ink, dots) against time; None where one seed cannot tell
    them apart."""
    drawn = {one.method: one for one in scene_series(scene, "seconds")}
    parts = {curve.method: _parts(curve) for curve in scene.curves if curve.method in drawn}
    if not any(np.any(bias2 > 0) or np.any(variance > 0) for _, bias2, variance in parts.values()):
        return None
    names = style.by_rank(list(parts))
    columns = min(len(names), _PANELS_A_ROW)
    rows = math.ceil(len(names) / columns)
    width, height = max(1.85 * columns + 0.75, 4.2), 2.15 * rows + 1.12
    figure = style.new_figure(width, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(
        left=0.68 / width, right=1 - 0.1 / width, bottom=0.5 / height, top=1 - 0.85 / height, wspace=0.1, hspace=0.3
    )
    everything = [
        Series(name, seconds, values, values, values) for name, (seconds, *both) in parts.items() for values in both
    ]
    for axes in grid.flat[len(names) :]:
        axes.set_visible(False)
    for index, (axes, name) in enumerate(zip(grid.flat, names, strict=False)):
        set_limits(axes, [everything], [], "seconds", scene.measured_pass)
        share = "share of relMSE" if index % columns == 0 else ""
        axes.set(xlabel=axis_name(scene.measured_pass, "seconds"), ylabel=share)
        axes.set_title(
            name,
            loc="left",
            fontsize=9.5,
            color=style.method_style(name).colour,
            pad=4,
            fontweight="bold" if name == "srd" else "normal",
        )
        _draw_parts(axes, name, *parts[name])
    _key(figure, width, height, f"{scene.scene}: bias and variance")
    return figure


def _parts(curve: Curve) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Seconds, bias² and variance of the points that are finite, by rising number of photons."""
    order = sorted(curve.points, key=lambda p: p.photons)
    rows = [(p.seconds, p.bias2, p.variance) for p in order if p.seconds > 0 and math.isfinite(p.bias2 + p.variance)]
    seconds, bias2, variance = np.array(rows, float).reshape(-1, 3).T
    return seconds, bias2, variance


def _draw_parts(axes: Axes, name: str, seconds: np.ndarray, bias2: np.ndarray, variance: np.ndarray) -> None:
    appearance = style.method_style(name)
    axes.plot(seconds, np.where(variance > 0, variance, np.nan), color=appearance.colour, lw=2.0)
    axes.plot(seconds, np.where(bias2 > 0, bias2, np.nan), color=style.INK, lw=1.0, marker="o", ms=3.2)
    hidden = seconds[bias2 <= 0]
    axes.plot(
        hidden,
        np.full(hidden.size, axes.get_ylim()[0]),
        "v",
        ms=5,
        mfc=style.PAPER,
        mec=style.INK,
        mew=0.9,
        clip_on=False,
        zorder=6,
    )


def _key(figure: Figure, width_in: float, height_in: float, text: str) -> None:
    from matplotlib.lines import Line2D

    figure.text(0.68 / width_in, 1 - 0.12 / height_in, text, fontsize=10.5, fontweight="bold", va="top")
    handles = [
        Line2D([], [], color=style.MUTED, lw=2.0, label="variance"),
        Line2D([], [], color=style.INK, lw=1.0, marker="o", ms=3.2, label="bias²"),
        Line2D([], [], ls="", marker="v", ms=5, mfc=style.PAPER, mec=style.INK, label="no bias detected"),
    ]
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.58 / width_in, 1 - 0.26 / height_in),
        ncols=3,
        frameon=False,
        fontsize=8,
        handlelength=1.8,
        columnspacing=1.3,
    )


def largest_samples(curve: Curve) -> list[Sample]:
    """All seeds of the largest budget that has a sample."""
    most = max((sample.photons for sample in curve.samples), default=0)
    return [sample for sample in curve.samples if sample.photons == most]


def stage_seconds(samples: list[Sample], measured: str) -> dict[str, float]:
    """Mean seconds of each stage of the pass over `samples`; empty when there are none."""
    if not samples:
        return {}
    return {
        stage: float(np.mean([max(sample.seconds.get(stage, 0.0), 0.0) for sample in samples]))
        for stage in MEASURED_PASSES[measured].stages
    }


def time_by_stage(scene: SceneResult) -> Figure | None:
    """Stacked bars: time by stage for each photon or sample at the largest budget; None without samples."""
    measured = MEASURED_PASSES[scene.measured_pass]
    rows = [
        (curve.method, samples, stage_seconds(samples, measured.key))
        for curve in scene.curves
        if (samples := largest_samples(curve))
    ]
    rows = [row for row in rows if sum(row[2].values()) > 0 and row[1][0].photons > 0]
    if not rows:
        return None
    order = style.by_rank([method for method, _, _ in rows])
    rows.sort(key=lambda row: order.index(row[0]), reverse=True)
    height = 1.2 + 0.36 * len(rows)
    figure = style.new_figure(6.6, height)
    axes = figure.add_axes((0.185, 0.5 / height, 0.55, 1 - 1.15 / height))
    longest = max(sum(stages.values()) / samples[0].photons for _, samples, stages in rows) * measured.tick[0]
    for place, (method, samples, stages) in enumerate(rows):
        _draw_bar(axes, place, samples, stages, longest, measured)
        axes.text(
            -0.02,
            place,
            method,
            transform=axes.get_yaxis_transform(),
            ha="right",
            va="center",
            color=style.method_style(method).colour,
            fontweight="bold" if method == "srd" else "normal",
        )
    axes.set(
        xlim=(0, longest * 1.02),
        ylim=(-0.6, len(rows) - 0.4),
        yticks=[],
        xlabel=f"{measured.time} for each {measured.each} ({measured.tick[1]})",
    )
    axes.spines["left"].set_visible(False)
    axes.grid(True, axis="x", color=style.GRID, lw=0.7)
    axes.set_axisbelow(True)
    _stage_key(axes, scene)
    return figure


def _draw_bar(
    axes: Axes, place: int, samples: list[Sample], stages: dict[str, float], longest: float, measured: MeasuredPass
) -> None:
    photons, total = samples[0].photons, sum(stages.values())
    start = 0.0
    for stage in measured.stages:
        length = stages[stage] / photons * measured.tick[0]
        axes.barh(place, length, left=start, height=0.62, color=style.STAGE_COLOURS[stage], lw=0)
        if length > 0.11 * longest:
            ink = style.PAPER if stage in ("trace", "looks") else style.ON_LIGHT_BAR
            axes.text(
                start + length / 2,
                place,
                f"{100 * stages[stage] / total:.0f} %",
                ha="center",
                va="center",
                fontsize=8,
                color=ink,
            )
        start += length
    axes.text(
        1.02,
        place,
        f"{total:.2g} s, {count(photons)} {measured.units}",
        transform=axes.get_yaxis_transform(),
        va="center",
        fontsize=8,
        color=style.MUTED,
    )


def _stage_key(axes: Axes, scene: SceneResult) -> None:
    from matplotlib.patches import Patch

    measured = MEASURED_PASSES[scene.measured_pass]
    style.title(axes, f"{scene.scene}: where the {measured.time} goes", " ")
    handles = [
        Patch(color=style.STAGE_COLOURS[stage], label=measured.stage_names.get(stage, stage))
        for stage in measured.stages
    ]
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(-0.02, 0.985),
        ncols=3,
        frameon=False,
        fontsize=8,
        handlelength=1.0,
        columnspacing=1.4,
        borderaxespad=0.0,
    )
