"""A scene's bench on the screen: a table with one line a method, then claims and what limits the figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .curves import error_at_time
from .measured_passes import MEASURED_PASSES
from .results import Curve, SceneResult, SpeedUp

if TYPE_CHECKING:
    from rich.table import Table


def scene_table(scene: SceneResult) -> Table:
    """Errors at a few times and at the end, bias, slope and the time to equal error."""
    from rich.table import Table

    width, height = scene.size
    own = "" if scene.reference is None else f", reference's own relMSE {scene.reference.relmse:.2g}"
    table = Table(
        title=f"{scene.scene}, {width}×{height}, {scene.seeds} seed{'s' * (scene.seeds != 1)}{own}",
        title_justify="left",
    )
    table.add_column("method")
    measured = MEASURED_PASSES[scene.measured_pass]
    times = [t for t in measured.compared_seconds if t < scene.seconds]
    for t in times:
        table.add_column(f"relMSE at {t:g} s", justify="right")
    for name in ("at the end", "after", measured.units, "bias² share", "slope", "time to equal error"):
        table.add_column(name, justify="right")
    for curve in scene.curves:
        if curve.points:
            table.add_row(
                curve.method, *(_error(error_at_time(curve.points, t)) for t in times), *_ending(scene, curve)
            )
    return table


def scene_lines(scene: SceneResult) -> list[str]:
    """Times to equal error by the other measures, one line a claim, and notes."""
    lines = _speed_up_lines(scene)
    if scene.time_to_equal_other and any(curve.method == "srd" for curve in scene.curves):
        others = ", ".join(
            f"{measure} {ratio_text(ratios.get('srd'))}" for measure, ratios in scene.time_to_equal_other.items()
        )
        lines.append(f"  srd's time to the error that stochastic ends with, by other measures: {others}")
    lines += [
        f"  {'holds' if claim.holds else 'FALLS SHORT'}: {claim.name}: {claim.asked}: "
        f"{claim.measured}{f' ({claim.why})' if claim.why else ''}"
        for claim in scene.claims
    ]
    if scene.reference_too_coarse and scene.reference is not None:
        lines.append(
            f"  note: the reference's own relMSE, {scene.reference.relmse:.2g}, is above a tenth of the smallest "
            "error; --reference-seconds lowers it"
        )
    if scene.picture_samples and all("flip" not in sample.metrics for sample in scene.picture_samples.values()):
        lines.append(
            "  note: FLIP is not available; 'pip install flip-evaluator' brings it, on Pythons that it has wheels for"
        )
    return lines


def _speed_up_lines(scene: SceneResult) -> list[str]:
    """The headline: a line for each clock, and one for the kernels that baselines were given."""
    lines = []
    for clock in dict.fromkeys(one.clock for one in scene.speed_ups):
        found = ", ".join(
            f"{one.target:g} {speed_up_text(one)} ({one.baseline or 'none of them'})"
            for one in scene.speed_ups
            if one.clock == clock
        )
        time = MEASURED_PASSES[scene.measured_pass].time if clock == "photon" else "time of a whole process"
        lines.append(f"  srd's speed-up over the best baseline at relMSE, by {time}: {found}")
    kernels = [
        f"{curve.method} {curve.kernels[0]:.2g} to {curve.kernels[-1]:.2g}" for curve in scene.curves if curve.kernels
    ]
    if kernels:
        lines.append(f"  kernels at their best, lattice spacings, first budget to last: {', '.join(kernels)}")
    return lines


def speed_up_text(one: SpeedUp) -> str:
    """ "12×", "≥ 30×" where it is a bound, "not reached" where srd does not get there, "both at once" where it cannot
    be known."""
    if one.ratio is None:
        return "not reached"
    if one.bound == "~":
        return "both at once"
    digits = f"{one.ratio:.0f}" if one.ratio >= 10 else f"{one.ratio:.2g}"
    return f"{one.bound}{' ' * bool(one.bound)}{digits}×"


def _ending(scene: SceneResult, curve: Curve) -> list[str]:
    last = curve.points[-1]
    total = last.bias2 + last.variance
    ratio = scene.time_to_equal_error.get(curve.method)
    return [
        _error(last.relmse),
        f"{last.seconds:.2f} s",
        f"{last.photons:,}",
        f"{100.0 * last.bias2 / total:.0f} %" if total > 0.0 else "–",
        f"{curve.slope:+.2f} ± {curve.slope_half_width:.2f}" if curve.slope_half_width > 0.0 else "–",
        ratio_text(ratio),
    ]


def ratio_text(ratio: float | None) -> str:
    """A time as a share of stochastic's: "1/33", "2×" where it is longer."""
    if ratio is None:
        return "not reached"
    return f"1/{ratio:.3g}" if ratio >= 1.0 else f"{1.0 / ratio:.3g}×"


def _error(error: float | None) -> str:
    return "–" if error is None else f"{error:.3g}"
