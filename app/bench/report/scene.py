"""One scene in the bench report: curves, tables, pictures side by side, and where its time goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from ...reference.metrics import EPSILON_SHARE, lit_mean
from ..measured_passes import MEASURED_PASSES
from ..results import OTHER_MEASURES, Curve, Point, SceneResult
from . import fair_field, pictures, text
from . import plots as report_plots
from . import style as report_style
from .curve_plots import BASELINE, is_lower_bound
from .page import Table, inlined

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Image:
    """A cell of the matrix of pictures."""

    source: str
    label: str
    is_part: bool = False
    numbers: Sequence[str] = ()
    outline: str = ""
    """CSS of the frame round what the parts show."""
    marks: Sequence[str] = ()
    """Of a colour scale."""


@dataclass(frozen=True)
class Matrix:
    """Pictures side by side: a column for the reference and each method, rows that can be compared across."""

    names: Sequence[str]
    rows: Sequence[tuple[str, Mapping[str, Image]]]
    exposure_ev: float


@dataclass(frozen=True)
class SceneView:
    """What the page shows of one scene."""

    name: str
    title: str
    anchor: str
    setting: str
    warnings: Sequence[str]
    curves: Sequence[Markup]
    speed_ups: Table | None
    speed: Table
    sweep: Markup | None
    kernels: Table | None
    other_measures: Table | None
    bias: Markup | None
    errors: Table
    pictures: Matrix | None
    stages: Markup | None
    cost: Table


def view(scene: SceneResult, anchor: str, curves: Sequence[Markup], directory: Path) -> SceneView:
    """The whole of one scene; `curves` holds the plots over seconds and photons, already drawn."""
    time = MEASURED_PASSES[scene.measured_pass].time
    bias = f"bias squared and variance of each method against {time}"
    return SceneView(
        scene.scene,
        scene.title,
        anchor,
        _setting(scene),
        text.warnings_of(scene),
        curves,
        fair_field.scene_table(scene),
        _speed_table(scene),
        _drawn(
            fair_field.sweep_plot(scene), f"{anchor}-sweep", f"{scene.scene}: error of each baseline against its kernel"
        ),
        fair_field.kernel_table(scene),
        _other_measures_table(scene),
        _drawn(report_plots.bias_and_variance(scene), f"{anchor}-bias", f"{scene.scene}: {bias}"),
        _error_table(scene),
        _pictures(scene, directory),
        _drawn(
            report_plots.time_by_stage(scene), f"{anchor}-stages", f"{scene.scene}: {time} by stage for each method"
        ),
        _cost_table(scene),
    )


def _drawn(figure: Figure | None, prefix: str, label: str) -> Markup | None:
    return None if figure is None else inlined(report_style.svg_text(figure), prefix, label)


def _setting(scene: SceneResult) -> str:
    glass = (
        f"strongest glass {scene.strongest_glass} (Abbe number {scene.strongest_abbe:.1f})"
        if scene.strongest_abbe > 0
        else "no dispersion"
    )
    measured = MEASURED_PASSES[scene.measured_pass]
    parts = [
        f"{scene.size[0]}×{scene.size[1]} pixels",
        text.seeds_text(scene.seeds),
        f"{scene.seconds:g} s of {measured.time}",
        glass,
    ]
    if scene.reference is not None:
        own = scene.reference
        parts.append(f"reference: {own.method}, {text.count(own.photons)} {measured.unit} in {own.seconds:.0f} s")
        if own.caustic_photons:
            parts.append(
                f"its caustic: {text.count(own.caustic_photons)} photons, whose noise is about "
                f"{text.number(own.caustic_relmse)} of its relMSE"
            )
        parts.append(f"its own relMSE {text.number(own.relmse)}, its key {own.key[:12]}")
    return "; ".join(parts) + "."


def _curves(scene: SceneResult) -> list[Curve]:
    found = {curve.method: curve for curve in scene.curves}
    return [found[name] for name in report_style.by_rank(list(found))]


def _ends(curve: Curve) -> tuple[Point, Point] | None:
    """The points of the smallest and of the largest budget."""
    if not curve.points:
        return None
    order = sorted(curve.points, key=lambda point: point.photons)
    return order[0], order[-1]


def _speed_table(scene: SceneResult) -> Table:
    rows = []
    measured = MEASURED_PASSES[scene.measured_pass]
    compared = any(curve.method == BASELINE and curve.points for curve in scene.curves)
    for curve in _curves(scene):
        ends, ratio = _ends(curve), scene.time_to_equal_error.get(curve.method)
        ratio_cell = "never" if compared and ends is not None else "–"
        if ratio is not None and math.isfinite(ratio) and ratio > 0:
            ratio_cell = text.ratio_text(ratio, is_lower_bound(scene, curve.method))
        if ends is None:
            rows.append([curve.method, *["–"] * 6])
            continue
        first, last = ends
        rows.append(
            [
                curve.method,
                ratio_cell,
                f"{text.number(first.relmse)} at {first.seconds:.2g} s",
                text.number(last.relmse),
                f"{text.number(last.relmse_low)} to {text.number(last.relmse_high)}",
                f"{last.seconds:.3g}",
                text.count(last.photons),
            ]
        )
    return Table(
        (
            "method",
            "time ratio",
            "relMSE, shortest run",
            "relMSE, longest run",
            "over seeds",
            f"{measured.time.split()[0]} s",
            measured.units,
        ),
        rows,
        "Time ratio: time of stochastic over time of the method, to the error that stochastic ends with; above 1 the "
        "method is faster.",
    )


def _other_measures_table(scene: SceneResult) -> Table | None:
    """Time ratios by every measure, so that none is trusted alone."""
    measures = [name for name in OTHER_MEASURES if name in scene.time_to_equal_other]
    if not measures:
        return None
    columns = [scene.time_to_equal_error, *(scene.time_to_equal_other[name] for name in measures)]
    rows = [
        [c.method, *(_ratio_or_never(column.get(c.method)) for column in columns)]
        for c in _curves(scene)
        if c.method != BASELINE
    ]
    headings = [text.MEASURES.get(name, name) for name in measures]
    return Table(
        ("time ratio by", "relMSE", *headings),
        rows,
        "The same ratio by other measures: a finding that hangs on one measure is none.",
    )


def _ratio_or_never(ratio: float | None) -> str:
    return text.ratio_text(ratio) if ratio is not None and math.isfinite(ratio) and ratio > 0 else "never"


def _error_table(scene: SceneResult) -> Table:
    rows = []
    for curve in _curves(scene):
        samples, ends, share = report_plots.largest_samples(curve), _ends(curve), text.bias_share(curve)
        metrics = {
            key: _mean([s.metrics[key] for s in samples if key in s.metrics])
            for key in ("relmse_trimmed", "smape", "chroma", "nrmse", "energy_ratio")
        }
        split = ends[1] if ends and scene.seeds > 1 else None
        slope = (
            f"{text.signed(curve.slope)} ± {curve.slope_half_width:.2f}"
            if curve.slope and math.isfinite(curve.slope)
            else "–"
        )
        rows.append(
            [
                curve.method,
                text.number(split.bias2) if split else "–",
                text.number(split.variance) if split else "–",
                "–" if share is None or split is None else f"{100 * share:.0f} %",
                slope,
                text.number(metrics["relmse_trimmed"]),
                text.number(metrics["smape"]),
                text.number(metrics["chroma"]),
                text.number(metrics["nrmse"]),
                "–" if metrics["energy_ratio"] is None else f"{metrics['energy_ratio']:.4f}",
            ]
        )
    return Table(
        (
            "method",
            "bias²",
            "variance",
            "bias's share",
            "tail slope (95 %)",
            "relMSE trimmed",
            "SMAPE",
            "Δu'v'",
            "nRMSE",
            "energy",
        ),
        rows,
        "What the error of the longest run consists of, and the other metrics there (means over seeds).",
    )


def _cost_table(scene: SceneResult) -> Table:
    measured, is_light = MEASURED_PASSES[scene.measured_pass], scene.measured_pass == "light"
    rows = []
    for curve in _curves(scene):
        samples = report_plots.largest_samples(curve)
        stages = report_plots.stage_seconds(samples, measured.key)
        total = sum(stages.values())
        seconds = [curve.setup_seconds.get(part) for part in measured.setup]
        seconds += [_mean([s.seconds[stage] for s in samples if stage in s.seconds]) for stage in measured.uncounted]
        splats = [text.number(_mean([s.splats / s.photons for s in samples if s.photons > 0]))] if is_light else []
        rows.append(
            [
                curve.method,
                *(text.number(value) for value in (*seconds, *(stages.get(stage) for stage in measured.stages))),
                f"{text.count(samples[0].photons / total)}/s" if total > 0 else "–",
                *splats,
                text.number(curve.buffers_mib or None, 3),
            ]
        )
    headings = [f"{name} s" for name in (*measured.setup, *measured.uncounted, *measured.stages)]
    uncounted = ", ".join((*measured.setup, *measured.uncounted))
    return Table(
        ("method", *headings, measured.units, *(["splats a photon"] if is_light else []), "buffers MiB"),
        rows,
        f"Not in {measured.time}: {uncounted} (set-up once per scene; buffers are tree and uploads). Stages are those "
        "of the longest run.",
    )


def _mean(values: list[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


def _pictures(scene: SceneResult, directory: Path) -> Matrix | None:
    """None where there is no picture yet."""
    found = pictures.load_pictures(scene.pictures, directory)
    if not found:
        return None
    reference = found["reference"]
    window, exposure = pictures.choose_window(reference), pictures.exposure_of(reference)
    methods = report_style.by_rank([curve.method for curve in scene.curves])
    names = ["reference", *methods]
    errors = {name: pictures.signed_error(found[name], reference) for name in methods if name in found}
    limit = pictures.error_limit(list(errors.values()))

    def part(name: str, numbers: Sequence[str] = ()) -> Image:
        shown = pictures.toned(window.of(found[name]), exposure)
        return Image(shown, f"{scene.scene}, {name}: part of the picture", True, numbers)

    rows: list[tuple[str, Mapping[str, Image]]] = []
    for ending, share in reversed(MEASURED_PASSES[scene.measured_pass].pictures):
        shown = {n: part(n + ending, _numbers(scene, n + ending, found)) for n in methods if n + ending in found}
        if shown or not ending:
            rows.append((f"{share * scene.equal_time:.2g} s, part", shown | {"reference": part("reference")}))
    whole = {name: _whole(scene, name, found[name], window, exposure) for name in names if name in found}
    rows.append((f"{scene.equal_time:.2g} s, whole", whole))
    scale = Image(pictures.error_scale(), "colour scale of the error maps", marks=(f"−{limit:g}", "0", f"+{limit:g}"))
    maps = {
        name: Image(pictures.error_map(error, limit), f"{scene.scene}, {name}: signed error")
        for name, error in errors.items()
    }
    rows.append(("signed error, whole", {"reference": scale} | maps))
    return Matrix(names, rows, exposure)


def _whole(scene: SceneResult, name: str, picture: np.ndarray, window: pictures.Window, exposure: float) -> Image:
    """A thumbnail with the part's outline."""
    height, width = picture.shape[:2]
    shares = {
        "left": window.column / width,
        "top": window.row / height,
        "width": window.width / width,
        "height": window.height / height,
    }
    return Image(
        pictures.toned(pictures.halved(picture), exposure),
        f"{scene.scene}, {name}: whole picture",
        outline=";".join(f"{side}:{100 * share:.2f}%" for side, share in shares.items()),
    )


def _numbers(scene: SceneResult, name: str, found: Mapping[str, np.ndarray]) -> list[str]:
    """relMSE and HDR-FLIP of a picture, as the run measured them; relMSE from the pictures where it did not."""
    sample = scene.picture_samples.get(name)
    metrics = sample.metrics if sample is not None else {}
    relmse = metrics.get("relmse", math.nan)
    note = ""
    if not math.isfinite(relmse):
        reference = found["reference"]
        epsilon = EPSILON_SHARE * max(lit_mean(reference), 1e-30) ** 2
        relmse, note = float(np.mean((found[name] - reference) ** 2 / (reference**2 + epsilon))), " (raw)"
    flip = metrics.get("flip", math.nan)
    lines = [
        f"relMSE {text.number(relmse)}{note}",
        f"HDR-FLIP {flip:.3f}" if math.isfinite(flip) else "HDR-FLIP not measured",
    ]
    if sample is not None:
        units = MEASURED_PASSES[scene.measured_pass].units
        lines.append(f"{sample.photon_seconds:.2g} s, {text.count(sample.photons)} {units}")
    return lines
