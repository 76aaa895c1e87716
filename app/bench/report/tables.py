"""The tables of a bench run, for the page, the screen and documents."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial

from ..curves import error_at_time, points_by
from ..measured_passes import MEASURED_PASSES
from ..results import CLOCKS, TARGETS, BenchResult, Curve, Point, SceneResult, SpeedUp
from .page import Table
from .style import by_rank
from .text import NONE, clock_name, count, number, percent, slope_text, speed_up_text, warnings_of

MEASURES = {
    "relmse_whole": "relMSE, ε of the whole picture",
    "relmse_trimmed": "relMSE trimmed",
    "nrmse": "nRMSE",
    "smape": "SMAPE",
    "chroma": "Δu'v'",
}
"""Further measures of `Sample.metrics` for the reader, so that no conclusion depends on relMSE alone."""


def ranked(scene: SceneResult) -> list[Curve]:
    """The curves, the most interesting method first."""
    found = {curve.method: curve for curve in scene.curves}
    return [found[name] for name in by_rank([*found])]


def ends(curve: Curve) -> list[Point]:
    """The points of the smallest and of the largest budget; none where there is no point."""
    order = sorted(curve.points, key=lambda point: point.photons)
    return [order[0], order[-1]] if order else []


def _mean(values: Iterable[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


# -- one scene ----------------------------------------------------------------------------


def speed_table(scene: SceneResult) -> Table:
    """Errors at a few times and at the ends, and their slope."""
    measured = MEASURED_PASSES[scene.measured_pass]
    seconds = [t for t in measured.compared_seconds if t < scene.seconds]
    headings = [
        *("method", *(f"relMSE at {t:g} s" for t in seconds)),
        *("relMSE, shortest run", "relMSE, longest run", "over seeds", "bias's share", "tail slope (95 %)"),
        *(f"{measured.time.split()[0]} s", measured.units),
    ]
    rows = []
    for curve in ranked(scene):
        if not curve.points:
            rows.append([curve.method, *[NONE] * (len(headings) - 1)])
            continue
        first, last = ends(curve)
        share = bias_share(last)
        rows.append(
            [
                curve.method,
                *(number(error_at_time(curve.points, t)) for t in seconds),
                f"{number(first.relmse)} at {first.seconds:.2g} s",
                number(last.relmse),
                f"{number(last.relmse_low)} to {number(last.relmse_high)}",
                NONE if share is None else f"{100 * share:.0f} %",
                slope_text(curve),
                f"{last.seconds:.3g}",
                count(last.photons),
            ]
        )
    own = "" if scene.reference is None else f", reference's own relMSE {number(scene.reference.relmse)}"
    size = f"{scene.size[0]}×{scene.size[1]}"
    return Table(
        headings,
        rows,
        title=f"{scene.scene}, {size}, {scene.seeds} seed{'s' * (scene.seeds != 1)}{own}",
    )


def bias_share(point: Point) -> float | None:
    """Share of bias² in bias² + variance, 0 to 1; None where it cannot be known."""
    bias2, variance = max(point.bias2, 0.0), max(point.variance, 0.0)
    return bias2 / (bias2 + variance) if bias2 + variance > 0 and math.isfinite(bias2 + variance) else None


def speed_up_table(scene: SceneResult) -> Table | None:
    """The speed-ups over the best baseline with the times that they are made of."""
    rows = [
        [
            percent(one.target),
            clock_name(one.clock, scene.measured_pass),
            speed_up_text(one),
            NONE if one.seconds is None else f"{'≤ ' if one.at_once else ''}{one.seconds:.3g}",
            one.baseline or "none of them",
            f"{'≤ ' if one.baseline_at_once else '' if one.baseline else '> '}{one.baseline_seconds:.3g}",
        ]
        for one in scene.speed_ups
    ]
    caption = (
        "Each baseline has, at every budget, the kernel with the least actual error: no user could choose so well."
    )
    headings = ("relMSE", "by", "speed-up", "srd s", "best baseline", "its s")
    return Table(headings, rows, caption, words=("by", "best baseline")) if rows else None


def kernel_table(scene: SceneResult) -> Table | None:
    """What the sweep chose: the kernel and its error at the budgets that were tried."""
    rows = []
    for curve in (curve for curve in scene.curves if curve.kernels):
        narrowest = min(t.smoothing for t in curve.sweep)
        for photons in sorted({t.photons for t in curve.sweep}):
            tried = [t for t in curve.sweep if t.photons == photons]
            best = min(tried, key=lambda t: t.relmse)
            at_least = next((t.relmse for t in tried if t.smoothing == narrowest), None)
            chosen = f"{best.seconds:.3g}", f"{best.smoothing:.2g}", number(best.relmse)
            rows.append([curve.method, count(photons), *chosen, number(at_least), str(len(tried))])
    measured = MEASURED_PASSES[scene.measured_pass]
    seconds = f"{measured.time.split()[0]} s"
    return (
        Table(
            ("method", measured.units, seconds, "best kernel", "its relMSE", "relMSE at 0.45", "tried"),
            rows,
            "Kernels in standard deviations by lattice spacings, one seed that is not among those measured. From the "
            "second budget on the sweep follows the best kernel downhill; –: not tried there.",
        )
        if rows
        else None
    )


def error_table(scene: SceneResult) -> Table:
    """What the error of the longest run consists of, and the other metrics there."""
    rows = []
    for curve in ranked(scene):
        samples = curve.largest_samples()
        means = {key: _mean(s.metrics[key] for s in samples if key in s.metrics) for key in (*MEASURES, "energy_ratio")}
        last = ends(curve)[1:] if scene.seeds > 1 else []
        split = [number(last[0].bias2), number(last[0].variance)] if last else [NONE, NONE]
        energy = means["energy_ratio"]
        others = (number(means[key]) for key in MEASURES)
        rows.append([curve.method, *split, *others, NONE if energy is None else f"{energy:.4f}"])
    return Table(
        ("method", "bias²", "variance", *MEASURES.values(), "energy"),
        rows,
        "What the error of the longest run consists of, and the other metrics there (means over seeds).",
    )


def cost_table(scene: SceneResult) -> Table:
    """Seconds by stage of the longest run, and what is not counted."""
    measured, is_light = MEASURED_PASSES[scene.measured_pass], scene.measured_pass == "light"
    rows = []
    for curve in ranked(scene):
        samples = curve.largest_samples()
        stages = [
            _mean(s.seconds[stage] for s in samples if stage in s.seconds)
            for stage in (*measured.uncounted, *measured.stages)
        ]
        total = sum(s.photon_seconds for s in samples)
        rate = f"{count(sum(s.photons for s in samples) / total)}/s" if total > 0 else NONE
        splats = [number(_mean(s.splats / s.photons for s in samples if s.photons > 0))] if is_light else []
        seconds = map(number, [*(curve.setup_seconds.get(part) for part in measured.setup), *stages])
        rows.append([curve.method, *seconds, rate, *splats, number(curve.buffers_mib or None, 3)])
    parts = [*measured.setup, *measured.uncounted]
    seconds_of = [f"{name} s" for name in (*parts, *measured.stages)]
    return Table(
        ("method", *seconds_of, measured.units, *(["splats a photon"] if is_light else []), "buffers MiB"),
        rows,
        f"Not in {measured.time}: {', '.join(parts)} (set-up once per scene; buffers are tree and uploads). Stages are "
        "those of the longest run, means over seeds.",
    )


def screen_parts(scene: SceneResult) -> list[object]:
    """What the terminal shows of a scene: its two main tables, and the warnings."""
    speed_ups = speed_up_table(scene)
    tables = [speed_table(scene).on_screen(("relMSE, shortest run", "over seeds"))]
    tables += [] if speed_ups is None else [speed_ups.on_screen()]
    return [*tables, *(f"  note: {warning}" for warning in warnings_of(scene))]


# -- the whole run ------------------------------------------------------------------------


def summary_table(result: BenchResult) -> Table | None:
    """Speed-ups of all scenes by both clocks; None where nothing was compared."""

    def cell(one: SpeedUp | None) -> str:
        return f"{speed_up_text(one)} {one.baseline if one is not None else ''}".strip()

    rows = []
    for scene in result.scenes:
        for clock in CLOCKS:
            found = {one.target: one for one in scene.speed_ups if one.clock == clock}
            name = clock_name(clock, scene.measured_pass)
            rows += [[scene.scene, name, *(cell(found.get(target)) for target in TARGETS)]] if found else []
    return (
        Table(
            ("scene", "by", *map(percent, TARGETS)),
            rows,
            "Time of the best baseline over time of srd to each relMSE, and which baseline it is. ≥: srd's smallest "
            "rendering is already as good, or no baseline got there as long as all were followed; ≤: the baseline's "
            "smallest rendering is already as good; –: no method got there.",
            words=("by",),
        )
        if rows
        else None
    )


def markdown(result: BenchResult) -> str:
    """The run's tables with their headings, to be pasted into a document; every table has its scenes in the order they
    were named, so that two runs can be compared."""
    measured = MEASURED_PASSES[result.settings.measured_pass]
    machine = ", ".join(value for key, value in result.machine.items() if key != "program")
    longest = max((scene.seconds for scene in result.scenes), default=0.0)
    by_method: dict[str, Callable[[Curve], str]] = {
        f"relMSE after {t:g} s of {measured.time}": partial(_after, t) for t in measured.compared_seconds if t < longest
    }
    by_method |= {
        f"relMSE at the end, after so many seconds of {measured.time}": _end,
        "nRMSE at the end": lambda curve: number(points_by(curve, "nrmse")[-1].relmse),
        "Exponent of relMSE over the second half of the curve": slope_text,
    }
    summary = summary_table(result)
    parts = [f"`{result.command}`, {result.date[:10]}; {machine}."]
    parts += [] if summary is None else ["## Speed-up of `srd` over the best baseline", summary.markdown()]
    for heading, value in by_method.items():
        parts += [f"## {heading}", _by_method(result, value).markdown()]
    return "\n\n".join(parts) + "\n"


def _by_method(result: BenchResult, value: Callable[[Curve], str]) -> Table:
    """A row a scene and a column a method, with `value` of its curve; last the reference's own relMSE."""
    methods = by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves if curve.points}))
    rows = []
    for scene in result.scenes:
        curves = {curve.method: curve for curve in scene.curves if curve.points}
        own = number(None if scene.reference is None else scene.reference.relmse)
        rows.append([f"`{scene.scene}`", *(value(curves[m]) if m in curves else NONE for m in methods), own])
    return Table(["scene", *(f"`{name}`" for name in methods), "reference's own relMSE"], rows)


def _after(seconds: float, curve: Curve) -> str:
    return number(error_at_time(curve.points, seconds))


def _end(curve: Curve) -> str:
    return f"{number(curve.points[-1].relmse)}, {curve.points[-1].seconds:.2g} s"
