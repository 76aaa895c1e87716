"""What a scene must show about `srd`, what it showed, and by how much and why it falls short."""

from __future__ import annotations

from collections.abc import Sequence

from .curves import best_baseline, error_at_time, points_by, speed_up
from .measured_passes import MEASURED_PASSES
from .results import Claim, Curve, Point, SceneResult

EARLY_SECONDS = 0.1
LATE_SECONDS = 3.0
STRONG_ABBE = 40.0
"""Flints and stronger: below this `srd` must beat `srd-lambda`."""


def claims_of(scene: SceneResult) -> list[Claim]:
    """The claims that the methods and the time of this scene allow to judge."""
    curves = {curve.method: curve for curve in scene.curves if curve.points}
    srd = curves.get("srd")
    if srd is None:
        return []
    claims = []
    best = best_baseline(scene.curves)
    if best is not None:
        claims.append(_speed_up_claim(scene, srd, best))
        if scene.measured_pass == "light" and scene.seconds >= LATE_SECONDS:
            claims.append(_first_picture_claim(scene, srd, best))
    linear = curves.get("srd-lambda")
    if linear is not None and 0.0 < scene.strongest_abbe < STRONG_ABBE:
        claims.append(_index_claim(scene, srd, linear))
    return claims


def ratios_of(curves: Sequence[Curve], measure: str = "relmse") -> dict[str, float]:
    """Method → how many times sooner it reaches the error that `stochastic` ends with, by any measure that sinks."""
    points = {curve.method: curve.points if measure == "relmse" else points_by(curve, measure) for curve in curves}
    if "stochastic" not in points:
        return {}
    found = {name: speed_up(own, points["stochastic"]) for name, own in points.items()}
    return {name: reached.seconds for name, reached in found.items() if reached is not None}


def _speed_up_claim(scene: SceneResult, srd: Curve, baseline: Curve) -> Claim:
    end, one_pass = baseline.points[-1], MEASURED_PASSES[scene.measured_pass]
    asked = (
        f"at most 1/{one_pass.asked_ratio:.0f} of the time of the best baseline, {baseline.method}, to its error at "
        f"the end ({end.relmse:.3g} after {end.seconds:.2f} s)"
    )
    reached = speed_up(srd.points, baseline.points)
    if reached is None:
        last = srd.points[-1]
        times = last.relmse / max(end.relmse, 1e-30)
        measured = f"not reached in {last.seconds:.2f} s: srd ends at {last.relmse:.3g}, {times:.2g} times that"
        return Claim("time to equal error", asked, measured, False, reason(scene, srd))
    measured = (
        f"{'at least ' if reached.at_once else ''}{reached.seconds:.3g} times sooner"
        if reached.seconds >= 1.0
        else f"{1.0 / reached.seconds:.3g} times later"
    )
    holds = reached.seconds >= one_pass.asked_ratio
    why = ""
    if not holds and reached.at_once:
        first = srd.points[0]
        why = (
            f"srd's smallest rendering ({one_pass.amount(first.photons)}, {first.seconds:.3f} s) is already as good: "
            f"{_stage_shares(scene, srd, first)}; longer runs would tell more"
        )
    elif not holds:
        why = f"short by a factor of {one_pass.asked_ratio / reached.seconds:.2g}; {reason(scene, srd)}"
    return Claim("time to equal error", asked, measured, holds, why)


def _first_picture_claim(scene: SceneResult, srd: Curve, baseline: Curve) -> Claim:
    late = error_at_time(baseline.points, LATE_SECONDS)
    end = baseline.points[-1]
    late = end.relmse if late is None else late
    asked = (
        f"the picture after {EARLY_SECONDS} s of photon time is better than that of the best baseline, "
        f"{baseline.method}, after {LATE_SECONDS:.0f} s (relMSE {late:.3g})"
    )
    early = error_at_time(srd.points, EARLY_SECONDS)
    if early is None:
        first = srd.points[0]
        why = (
            f"even {MEASURED_PASSES[scene.measured_pass].amount(first.photons)} take {first.seconds:.2f} s: "
            f"{_stage_shares(scene, srd, first)}"
        )
        return Claim(
            "first picture",
            asked,
            f"no picture before {first.seconds:.2f} s, then relMSE {first.relmse:.3g}",
            False,
            why,
        )
    holds = early < late
    why = (
        ""
        if holds
        else f"{early / max(late, 1e-30):.2g} times {baseline.method}'s; {reason(scene, srd, EARLY_SECONDS)}"
    )
    return Claim("first picture", asked, f"relMSE {early:.3g}", holds, why)


def _index_claim(scene: SceneResult, srd: Curve, linear: Curve) -> Claim:
    """Smaller error than the column by wavelength, at every time compared."""
    common = min(srd.points[-1].seconds, linear.points[-1].seconds)
    times = sorted({t for t in MEASURED_PASSES[scene.measured_pass].compared_seconds if t < common} | {common})
    pairs = [(t, error_at_time(srd.points, t), error_at_time(linear.points, t)) for t in times]
    compared = [(t, a, b) for t, a, b in pairs if a is not None and b is not None]
    asked = (
        f"smaller error than srd-lambda at equal time, the strongest glass being {scene.strongest_glass} (V_d "
        f"{scene.strongest_abbe:.1f})"
    )
    if not compared:
        return Claim(
            "index against wavelength",
            asked,
            "no time at which both have a picture",
            False,
            _stage_shares(scene, srd, srd.points[0]),
        )
    measured = ", ".join(f"at {t:.2g} s {a:.3g} against {b:.3g} ({b / max(a, 1e-30):.2g}×)" for t, a, b in compared)
    lost = [t for t, a, b in compared if not a < b]
    why = "" if not lost else f"not at {', '.join(f'{t:.2g} s' for t in lost)}; {reason(scene, srd)}"
    return Claim("index against wavelength", asked, measured, not lost, why)


def reason(scene: SceneResult, curve: Curve, seconds: float | None = None) -> str:
    """What the error of `curve` at its end (or at the point next to `seconds`) consists of."""
    point = curve.points[-1] if seconds is None else min(curve.points, key=lambda p: abs(p.seconds - seconds))
    parts = []
    if scene.reference is not None and scene.reference.relmse > 0.5 * point.relmse:
        parts.append(
            f"the reference's own relMSE of {scene.reference.relmse:.2g} leaves the true error of {point.relmse:.2g} "
            "uncertain"
        )
    total = point.bias2 + point.variance
    if total > 0.0 and len({s.seed for s in curve.samples}) > 1:
        share = point.bias2 / total
        one_pass = MEASURED_PASSES[scene.measured_pass]
        cause = one_pass.bias_cause if share > 0.5 else one_pass.noise_cause
        parts.append(
            f"{100 * share:.0f} % of {curve.method}'s error at {point.seconds:.2g} s is bias² and "
            f"{100 * (1 - share):.0f} % variance, so mostly {cause}"
        )
        parts += _common_share(scene, point) if share > 0.5 else []
    parts.append(_stage_shares(scene, curve, point))
    return "; ".join(parts)


def _common_share(scene: SceneResult, point: Point) -> list[str]:
    """How much of a bias² all methods have, as far as the pass's bare method tells."""
    one_pass = MEASURED_PASSES[scene.measured_pass]
    bare = next(
        (curve.points[-1] for curve in scene.curves if curve.method == one_pass.bare_method and curve.points), None
    )
    if bare is None or bare.bias2 < 0.1 * point.bias2:
        return []
    share = min(100.0 * bare.bias2 / point.bias2, 100.0)
    return [f"{share:.0f} % of that bias² is found in {one_pass.bare_method} too, {one_pass.bare_text}"]


def _stage_shares(scene: SceneResult, curve: Curve, point: Point) -> str:
    samples = [s for s in curve.samples if s.photons == point.photons]
    spent = {
        stage: sum(s.seconds.get(stage, 0.0) for s in samples) for stage in MEASURED_PASSES[scene.measured_pass].counted
    }
    total = sum(spent.values()) or 1.0
    return "its time is " + ", ".join(f"{100 * seconds / total:.0f} % {stage}" for stage, seconds in spent.items())
