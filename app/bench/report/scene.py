"""One scene in the bench report: curves, tables, pictures side by side, and where its time goes."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...reference.metrics import EPSILON_SHARE, lit_mean
from ..measured_passes import MEASURED_PASSES
from ..results import OTHER_MEASURES, Curve, Point, SceneResult
from . import pictures as pictures
from . import plots as report_plots
from . import style as report_style
from . import text as text
from .curve_plots import BASELINE, is_lower_bound
from .html import Html, element, figure, table


def section(scene: SceneResult, anchor: str, curve_svgs: Mapping[str, Html], directory: Path) -> Html:
    """The whole of one scene; `curve_svgs` holds the plots over "seconds" and "photons", already drawn."""
    warnings = text.warnings_of(scene)
    return element(
        "section",
        element("h2", scene.scene, id=anchor),
        element("p", scene.title) if scene.title and scene.title != scene.scene else None,
        element("p", _setting(scene), cls="muted"),
        element("div", [element("p", warning) for warning in warnings], cls="warning") if warnings else None,
        element("div", [figure(svg) for svg in curve_svgs.values()], cls="two"),
        _speed_table(scene),
        _other_measures_table(scene),
        _bias_figure(scene, anchor),
        _error_table(scene),
        _pictures(scene, directory),
        element("h3", "Cost"),
        _stage_figure(scene, anchor),
        _cost_table(scene),
    )


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
                f"its caustic: {text.count(own.caustic_photons)} photons, whose noise is about {text.number(own.caustic_relmse)} of its relMSE"
            )
        parts.append(f"its own relMSE {text.number(own.relmse)}, its key {own.key[:12]}")
    return "; ".join(parts) + "."


def _name(method: str) -> Html:
    return element("span", method, cls="srd" if method == "srd" else None)


def _curves(scene: SceneResult) -> list[Curve]:
    found = {curve.method: curve for curve in scene.curves}
    return [found[name] for name in report_style.by_rank(list(found))]


def _ends(curve: Curve) -> tuple[Point, Point] | None:
    """The points of the smallest and of the largest budget."""
    if not curve.points:
        return None
    order = sorted(curve.points, key=lambda point: point.photons)
    return order[0], order[-1]


def _speed_table(scene: SceneResult) -> Html:
    rows = []
    measured = MEASURED_PASSES[scene.measured_pass]
    compared = any(curve.method == BASELINE and curve.points for curve in scene.curves)
    for curve in _curves(scene):
        ends, ratio = _ends(curve), scene.time_to_equal_error.get(curve.method)
        reached = ratio is not None and math.isfinite(ratio) and ratio > 0
        unreached = "never" if compared and ends is not None else "–"
        ratio_cell = text.ratio_text(ratio, is_lower_bound(scene, curve.method)) if reached else unreached
        if ends is None:
            rows.append([_name(curve.method), *["–"] * 6])
            continue
        first, last = ends
        rows.append(
            [
                _name(curve.method),
                ratio_cell,
                f"{text.number(first.relmse)} at {first.seconds:.2g} s",
                text.number(last.relmse),
                f"{text.number(last.relmse_low)} to {text.number(last.relmse_high)}",
                f"{last.seconds:.3g}",
                text.count(last.photons),
            ]
        )
    return table(
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
        "Time ratio: time of stochastic over time of the method, to the error that stochastic ends with; above 1 the method is faster.",
    )


def _other_measures_table(scene: SceneResult) -> Html | None:
    """Time ratios by every measure, so that none is trusted alone."""
    measures = [name for name in OTHER_MEASURES if name in scene.time_to_equal_other]
    if not measures:
        return None
    columns = [scene.time_to_equal_error, *(scene.time_to_equal_other[name] for name in measures)]
    rows = [
        [_name(c.method), *(_ratio_or_never(column.get(c.method)) for column in columns)]
        for c in _curves(scene)
        if c.method != BASELINE
    ]
    headings = [text.MEASURES.get(name, name) for name in measures]
    return table(
        ("time ratio by", "relMSE", *headings),
        rows,
        "The same ratio by other measures: a finding that hangs on one measure is none.",
    )


def _ratio_or_never(ratio: float | None) -> str:
    return text.ratio_text(ratio) if ratio is not None and math.isfinite(ratio) and ratio > 0 else "never"


def _bias_figure(scene: SceneResult, anchor: str) -> Html | None:
    drawn = report_plots.bias_and_variance(scene)
    if drawn is None:
        return None
    svg = inlined(
        report_style.svg_text(drawn),
        f"{anchor}-bias",
        f"{scene.scene}: bias squared and variance of each method against {MEASURED_PASSES[scene.measured_pass].time}",
    )
    caption = (
        "relMSE told apart: variance is what differs between seeds, bias² what all seeds share, such as columns and bands that are too wide. "
        "A hollow triangle means that no bias could be detected there."
    )
    return figure(svg, caption)


def _error_table(scene: SceneResult) -> Html:
    rows = []
    for curve in _curves(scene):
        samples, ends, share = report_plots.largest_samples(curve), _ends(curve), text.bias_share(curve)
        metrics = {
            key: _mean([s.metrics[key] for s in samples if key in s.metrics])
            for key in ("relmse_trimmed", "smape", "chroma", "nrmse", "energy_ratio")
        }
        last = ends[1] if ends else None
        told_apart = last is not None and scene.seeds > 1
        slope = (
            f"{text.signed(curve.slope)} ± {curve.slope_half_width:.2f}"
            if curve.slope and math.isfinite(curve.slope)
            else "–"
        )
        rows.append(
            [
                _name(curve.method),
                text.number(last.bias2) if told_apart else "–",
                text.number(last.variance) if told_apart else "–",
                "–" if share is None or not told_apart else f"{100 * share:.0f} %",
                slope,
                text.number(metrics["relmse_trimmed"]),
                text.number(metrics["smape"]),
                text.number(metrics["chroma"]),
                text.number(metrics["nrmse"]),
                "–" if metrics["energy_ratio"] is None else f"{metrics['energy_ratio']:.4f}",
            ]
        )
    return table(
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


def _stage_figure(scene: SceneResult, anchor: str) -> Html | None:
    drawn = report_plots.time_by_stage(scene)
    if drawn is None:
        return None
    svg = inlined(
        report_style.svg_text(drawn),
        f"{anchor}-stages",
        f"{scene.scene}: {MEASURED_PASSES[scene.measured_pass].time} by stage for each method",
    )
    return figure(svg, "At the largest budget of each method, mean over seeds.", "half")


def _cost_table(scene: SceneResult) -> Html:
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
                _name(curve.method),
                *(text.number(value) for value in (*seconds, *(stages.get(stage) for stage in measured.stages))),
                f"{text.count(samples[0].photons / total)}/s" if total > 0 else "–",
                *splats,
                text.number(curve.buffers_mib or None, 3),
            ]
        )
    headings = [f"{name} s" for name in (*measured.setup, *measured.uncounted, *measured.stages)]
    uncounted = ", ".join((*measured.setup, *measured.uncounted))
    return table(
        ("method", *headings, measured.units, *(["splats a photon"] if is_light else []), "buffers MiB"),
        rows,
        f"Not in {measured.time}: {uncounted} (set-up once per scene; buffers are tree and uploads). Stages are those of the longest run.",
    )


def _mean(values: list[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


def inlined(document: str, prefix: str, label: str) -> Html:
    """An SVG document as an element of the page."""
    return Html(report_style.inline_svg(document, prefix, html.escape(label, quote=True)))


def _pictures(scene: SceneResult, directory: Path) -> Html:
    """The matrix of pictures: a column for the reference and each method, rows that can be compared across."""
    title = element("h3", "Pictures at equal time")
    found = pictures.load_pictures(scene.pictures, directory)
    if not found:
        return element("div", title, element("p", "There are no pictures of this scene yet.", cls="muted"))
    reference = found["reference"]
    window, exposure = pictures.choose_window(reference), pictures.exposure_of(reference)
    methods = report_style.by_rank([curve.method for curve in scene.curves])
    names = ["reference", *methods]
    errors = {name: pictures.signed_error(found[name], reference) for name in methods if name in found}
    limit = pictures.error_limit(list(errors.values()))

    def crop(name: str) -> Html:
        return _image(
            pictures.toned(window.of(found[name]), exposure), f"{scene.scene}, {name}: part of the picture", "crop"
        )

    rows = []
    for ending, share in reversed(MEASURED_PASSES[scene.measured_pass].pictures):
        shown = {n: (crop(n + ending), _numbers(scene, n + ending, found)) for n in methods if n + ending in found}
        if shown or not ending:
            rows.append(
                _picture_row(
                    f"{share * scene.equal_time:.2g} s, part", names, shown | {"reference": (crop("reference"), None)}
                )
            )
    whole = {name: (_whole(scene, name, found[name], window, exposure), None) for name in names if name in found}
    rows.append(_picture_row(f"{scene.equal_time:.2g} s, whole", names, whole))
    maps = {
        name: (_image(pictures.error_map(error, limit), f"{scene.scene}, {name}: signed error", None), None)
        for name, error in errors.items()
    }
    rows.append(_picture_row("signed error, whole", names, {"reference": (_scale(limit), None)} | maps))
    head = element(
        "tr",
        element("td", "", cls="row"),
        [element("th", name, scope="col", cls="srd" if name == "srd" else None) for name in names],
    )
    matrix = element("table", element("thead", head), element("tbody", rows), cls="pictures")
    return element("div", title, element("div", matrix, cls="wide"), element("p", _caption(exposure), cls="muted"))


def _picture_row(heading: str, names: list[str], cells: Mapping[str, tuple[Html, Html | None]]) -> Html:
    missing = element("span", "no picture", cls="missing")
    return element(
        "tr",
        element("th", heading, scope="row", cls="row"),
        [element("td", *cells.get(name, (missing, None))) for name in names],
    )


def _image(address: str, label: str, cls: str | None) -> Html:
    return element("img", src=address, alt=label, cls=cls)


def _whole(scene: SceneResult, name: str, picture: np.ndarray, window: pictures.Window, exposure: float) -> Html:
    """A thumbnail with the crop's outline."""
    height, width = picture.shape[:2]
    shares = {
        "left": window.column / width,
        "top": window.row / height,
        "width": window.width / width,
        "height": window.height / height,
    }
    outline = element("i", style=";".join(f"{side}:{100 * share:.2f}%" for side, share in shares.items()))
    return element(
        "span",
        _image(pictures.toned(pictures.halved(picture), exposure), f"{scene.scene}, {name}: whole picture", None),
        outline,
        cls="framed",
    )


def _numbers(scene: SceneResult, name: str, found: Mapping[str, np.ndarray]) -> Html | None:
    """relMSE and HDR-FLIP of a picture, as the run measured them; relMSE from the pictures where it did not."""
    if name == "reference":
        return None
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
        lines.append(f"{sample.photon_seconds:.2g} s, {text.count(sample.photons)} {MEASURED_PASSES[scene.measured_pass].units}")
    return element("div", [(line, element("br")) for line in lines], cls="numbers")


def _scale(limit: float) -> Html:
    marks = (f"−{limit:g}", "0", f"+{limit:g}")
    return element(
        "div",
        _image(pictures.error_scale(), "colour scale of the error maps", None),
        element("div", [element("span", mark) for mark in marks]),
        element("p", "blue: too dark, red: too bright"),
        cls="scale",
    )


def _caption(exposure: float) -> str:
    return (
        f"All pictures at one exposure ({exposure:+.1f} EV) chosen for the reference, and the part chosen on the reference alone, where light and "
        "structure are richest. Whole pictures are means of 2×2 pixels. Signed error is (Y − R) / √(R² + ε), luminance, the same scale for all, full "
        "resolution; colours follow the root of its size, and the mean of its square is the luminance's part of relMSE. Measures are of the one picture shown."
    )
