"""From samples to curves: points with bias and variance, the tail's slope, and who needs how much time for an error.

Everything between two points is interpolated in log-log. Where a curve is not monotone the later, worse crossing
counts, so that a lucky rendering gains nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from ..reference.metrics import ReferencePicture, bias_variance
from .results import CLOCKS, OWN_METHODS, TARGETS, Curve, Point, Sample, SpeedUp

SMALLEST_ERROR = 1e-12
"""Stands for 0 in logarithms."""
CONFIDENCE = 0.95


def make_point(
    samples: Sequence[Sample], mean_difference: np.ndarray, reference_image: ReferencePicture, setup: float = 0.0
) -> Point:
    """All seeds of one photon budget; `mean_difference`: mean over them of I − R̂, XYZ (H, W, 3); `setup`: seconds that
    come before any rendering."""
    split = bias_variance(mean_difference, [s.metrics["relmse_raw"] for s in samples], reference_image)
    single = [s.metrics["relmse"] for s in samples]
    return Point(
        samples[0].photons,
        float(np.median([s.photon_seconds for s in samples])),
        split.relmse,
        min(single),
        max(single),
        split.bias2,
        split.variance,
        setup + float(np.median([s.all_seconds for s in samples])),
    )


def tail_slope(samples: Sequence[Sample], budgets: Sequence[int]) -> tuple[float, float]:
    """Exponent of relMSE against photons over the larger half of `budgets`, and its 95 % half-width.

    Least squares over all single renderings, which are independent; (nan, nan) with fewer than three of them or of
    fewer than two budgets.
    """
    tail = set(sorted(budgets)[len(budgets) // 2 :])
    kept = [s for s in samples if s.photons in tail and s.metrics["relmse"] > SMALLEST_ERROR]
    if len(kept) < 3 or len({s.photons for s in kept}) < 2:
        return float("nan"), float("nan")
    from scipy.stats import t

    x = np.log([float(s.photons) for s in kept])
    y = np.log([s.metrics["relmse"] for s in kept])
    x -= x.mean()
    spread = float(np.sum(x**2))
    slope = float(np.sum(x * y) / spread)
    residual = y - y.mean() - slope * x
    freedom = len(kept) - 2
    error = np.sqrt(float(np.sum(residual**2)) / freedom / spread)
    return slope, float(t.ppf(0.5 + CONFIDENCE / 2, freedom) * error)


def complete_curve(curve: Curve, mean_differences: Mapping[int, np.ndarray], reference_image: ReferencePicture) -> None:
    """Fill `curve.points` and its slope from its samples; budgets without a mean picture are left out."""
    by_budget: dict[int, list[Sample]] = {}
    for sample in curve.samples:
        by_budget.setdefault(sample.photons, []).append(sample)
    setup = sum(curve.setup_seconds.values())
    curve.points = [
        make_point(by_budget[n], mean_differences[n], reference_image, setup)
        for n in sorted(by_budget)
        if n in mean_differences
    ]
    slope, half_width = tail_slope(curve.samples, curve.budgets)
    curve.slope, curve.slope_half_width = (slope, half_width) if np.isfinite(slope) else (0.0, 0.0)


def points_by(curve: Curve, measure: str) -> list[Point]:
    """The curve's points with another measure, its mean over seeds, in the place of relMSE."""
    of_budget = {p.photons: [s.metrics[measure] for s in curve.samples if s.photons == p.photons] for p in curve.points}
    return [msgspec.structs.replace(p, relmse=float(np.mean(of_budget[p.photons]))) for p in curve.points]


@dataclass(frozen=True)
class Reached:
    """When a curve reaches an error."""

    seconds: float
    at_once: bool
    """Its first point is already as good: the true time is at most `seconds`."""


def time_to_error(points: Sequence[Point], error: float) -> Reached | None:
    """Photon time from which on the curve stays at or below `error`; None when it ends above."""
    if not points or points[-1].relmse > error:
        return None
    last_above = max((i for i, p in enumerate(points) if p.relmse > error), default=-1)
    if last_above < 0:
        return Reached(points[0].seconds, True)
    above, below = points[last_above], points[last_above + 1]
    high, low = _log(above.relmse), _log(below.relmse)
    share = (high - _log(error)) / (high - low)
    return Reached(float(np.exp((1.0 - share) * np.log(above.seconds) + share * np.log(below.seconds))), False)


def error_at_time(points: Sequence[Point], seconds: float) -> float | None:
    """relMSE after `seconds` of photon time; None before the first picture. After the last point, that of the last."""
    if not points or seconds < points[0].seconds:
        return None
    order = sorted(points, key=lambda p: p.seconds)
    return float(
        np.exp(np.interp(np.log(seconds), [np.log(p.seconds) for p in order], [_log(p.relmse) for p in order]))
    )


def budget_at_time(points: Sequence[Point], seconds: float) -> int:
    """Photons or samples that take about `seconds`: in proportion beyond the last point, at least those of the
    first."""
    order = sorted(points, key=lambda p: p.seconds)
    if seconds > order[-1].seconds:
        return int(order[-1].photons * seconds / order[-1].seconds)
    return int(
        np.exp(np.interp(np.log(seconds), [np.log(p.seconds) for p in order], [np.log(p.photons) for p in order]))
    )


def whole_process(points: Sequence[Point]) -> list[Point]:
    """The points with the time of a whole process in the place of photon time."""
    return [msgspec.structs.replace(p, seconds=p.whole_seconds) for p in points]


def best_baseline(curves: Sequence[Curve]) -> Curve | None:
    """The one whose error is least where all that have points are still followed; None without one."""
    baselines = [c for c in curves if c.points and c.method not in OWN_METHODS]
    if not baselines:
        return None
    common = min(max(p.seconds for p in c.points) for c in baselines)
    return min(baselines, key=lambda c: error_at_time(c.points, common) or np.inf)


def speed_ups(curves: Sequence[Curve], own: str = "srd") -> list[SpeedUp]:
    """`own` against the best baseline at every target that either reaches, by photon time and by whole-process time."""
    found = []
    for clock in CLOCKS:
        points = {c.method: c.points if clock == "photon" else whole_process(c.points) for c in curves if c.points}
        baselines = {name: p for name, p in points.items() if name not in OWN_METHODS}
        if own not in points or not baselines:
            return []
        # A baseline that was followed for less time might have got there before the others' ends.
        end = min(max(point.seconds for point in p) for p in baselines.values())
        for target in TARGETS:
            mine = time_to_error(points[own], target)
            theirs = {name: reached for name, p in baselines.items() if (reached := time_to_error(p, target))}
            best = min(theirs, key=lambda name: theirs[name].seconds, default="")
            if mine is None and not best:
                continue
            found.append(
                SpeedUp(
                    target,
                    clock,
                    None if mine is None else mine.seconds,
                    mine is not None and mine.at_once,
                    best,
                    theirs[best].seconds if best else end,
                    bool(best) and theirs[best].at_once,
                )
            )
    return found


def _log(error: float) -> float:
    return float(np.log(max(error, SMALLEST_ERROR)))
