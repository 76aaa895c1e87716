"""Curves on power laws whose answers are known."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from spectrasplat.bench.curves import (
    best_baseline,
    budget_at_time,
    complete_curve,
    error_at_time,
    points_by,
    speed_ups,
    tail_slope,
    time_to_error,
)
from spectrasplat.bench.results import Curve, Point, Sample
from spectrasplat.reference.metrics import ReferencePicture

BUDGETS = [int(n) for n in np.geomspace(1000, 200_000, 10)]
RATE = 60_000.0
"""Photons a second."""


def law(scale: float, exponent: float = -1.0, floor: float = 0.0) -> list[Point]:
    """relMSE = scale · t^exponent + floor."""
    return [
        Point(n, n / RATE, e, e, e, floor, e - floor) for n in BUDGETS for e in [scale * (n / RATE) ** exponent + floor]
    ]


def curve(method: str, points: list[Point], seeds: int = 5) -> Curve:
    seconds = {"trace": 0.5, "splat": 0.4, "resolve": 0.1}
    samples = [
        Sample(
            p.photons,
            s + 1,
            p.photons,
            p.photons,
            {k: v * p.seconds for k, v in seconds.items()},
            {"relmse": p.relmse, "relmse_raw": p.relmse},
        )
        for p in points
        for s in range(seeds)
    ]
    return Curve(method, {}, samples, BUDGETS, points)


def test_points_by_another_measure() -> None:
    def measured(method: str, scale: float) -> Curve:
        plain = curve(method, law(1.0))
        plain.samples = [
            Sample(
                s.photons,
                s.seed,
                1,
                1,
                s.seconds,
                {"nrmse": scale * (1.5 if s.seed == 1 else 0.875) * RATE / s.photons},
            )
            for s in plain.samples
        ]
        return plain

    for scale in (1.0, 0.05):
        assert points_by(measured("srd", scale), "nrmse")[-1].relmse == pytest.approx(scale * RATE / BUDGETS[-1])


def test_a_curve_reaches_an_error_in_time_at_once_or_never() -> None:
    # Another exponent: 0.1 t^-2 = 1 / t_end at t = sqrt(0.1 t_end).
    end = law(1.0)[-1].seconds
    reached = time_to_error(law(0.1, -2.0), 1.0 / end)
    assert (
        reached is not None and not reached.at_once and reached.seconds == pytest.approx(np.sqrt(0.1 * end), rel=1e-9)
    )
    at_once = time_to_error(law(1e-6), 0.1)
    assert at_once is not None and at_once.at_once and at_once.seconds == law(1e-6)[0].seconds
    assert time_to_error(law(0.01, floor=1.0), 0.1) is None and time_to_error([], 1.0) is None


def test_a_lucky_point_gains_nothing() -> None:
    points = law(1.0)
    lucky = points.copy()
    lucky[2] = Point(points[2].photons, points[2].seconds, 1e-9, 1e-9, 1e-9, 0.0, 0.0)
    target = points[6].relmse
    plain, with_luck = time_to_error(points, target), time_to_error(lucky, target)
    assert plain is not None and with_luck is not None and with_luck.seconds == pytest.approx(plain.seconds)


def test_errors_and_photons_at_a_time() -> None:
    points = law(1.0)
    assert error_at_time(points, 0.1) == pytest.approx(10.0)
    assert error_at_time(points, 1e-3) is None
    assert error_at_time(points, 1e3) == pytest.approx(points[-1].relmse)
    assert budget_at_time(points, 0.1) == pytest.approx(0.1 * RATE, abs=1)
    assert budget_at_time(points, 10.0) == pytest.approx(10.0 * RATE, rel=1e-6)
    assert budget_at_time(points, 1e-4) == pytest.approx(points[0].photons, abs=1)
    zero = [Point(1, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0), *points]
    assert error_at_time(zero, 0.01) == pytest.approx(1e-12)


def noisy_samples(rng: np.random.Generator, exponent: float) -> list[Sample]:
    return [
        Sample(n, s, n, n, {}, {"relmse": float(1e3 * n**exponent * np.exp(rng.normal(0.0, 0.1)))})
        for n in BUDGETS
        for s in range(5)
    ]


def test_slope_and_its_interval() -> None:
    """Of 1000 intervals 95 % must hold the reference; fewer than 93 % or more than 97 % is 3 standard errors off. Half
    as wide ones, the mutant, hold it 68 times in 100."""
    rng = np.random.default_rng(5)
    slopes = np.array([tail_slope(noisy_samples(rng, -0.8), BUDGETS) for _ in range(1000)])
    off = np.abs(slopes[:, 0] + 0.8)
    assert 0.93 < np.mean(off < slopes[:, 1]) < 0.97
    assert np.mean(off < 0.5 * slopes[:, 1]) < 0.8
    assert np.isnan(tail_slope([], BUDGETS)[0]) and np.isnan(tail_slope(noisy_samples(rng, -1.0)[:3], BUDGETS)[0])


def test_points_hold_all_seeds() -> None:
    reference_image = ReferencePicture(np.ones((2, 2, 3)), np.full((2, 2, 3), 0.0101))
    errors = (0.04, 0.02, 0.03)
    samples = [
        Sample(100, s + 1, 100, 90, {"trace": t, "camera": 5.0}, {"relmse": e - 0.01, "relmse_raw": e})
        for s, (e, t) in enumerate(zip(errors, (1.0, 9.0, 2.0), strict=True))
    ]
    made = Curve("srd", {}, samples, [100, 200])
    complete_curve(made, {100: np.full((2, 2, 3), 0.15)}, reference_image)
    (point,) = made.points
    assert (point.photons, point.seconds, point.relmse_low, point.relmse_high) == (
        100,
        2.0,
        pytest.approx(0.01),
        pytest.approx(0.03),
    )
    of_mean = 0.15**2 / 1.01
    variance = 3 * (0.03 - of_mean) / 2
    assert point.variance == pytest.approx(variance) and point.bias2 == pytest.approx(of_mean - variance / 3 - 0.01)
    assert point.relmse == pytest.approx(0.02) and (made.slope, made.slope_half_width) == (0.0, 0.0)


def whole(points: list[Point], overhead: float) -> list[Point]:
    return [msgspec.structs.replace(p, whole_seconds=p.seconds + overhead) for p in points]


def test_speed_up_over_target_error_is_against_whoever_gets_there_first() -> None:
    """`noisy` is first at large errors, `biased` stops at 0.02, and nobody but srd reaches the smallest."""
    noisy = curve("stochastic", whole(law(0.1), 1.0))
    biased = curve("regular-7", whole(law(0.02, floor=0.02), 1.0))
    own = curve("srd", whole(law(0.002), 2.0))
    found = {(one.clock, one.target): one for one in speed_ups([noisy, biased, own])}
    # Both are there with their first pictures, of 1/60 s.
    first = found["photon", 0.3]
    assert first.baseline == "stochastic" or first.baseline == "regular-7"
    assert found["photon", 0.1].baseline == "regular-7"
    at_0_1 = found["photon", 0.1]
    assert at_0_1.baseline_seconds == pytest.approx(0.02 / 0.08, rel=0.05) and at_0_1.seconds == pytest.approx(0.02)
    assert at_0_1.ratio == pytest.approx(12.5, rel=0.05) and at_0_1.bound == ""
    assert found["photon", 0.1].ratio == at_0_1.baseline_seconds / at_0_1.seconds
    # regular-7 never comes to 0.01; stochastic's end is 0.03: the longest that both were followed is a bound.
    missed = found["photon", 0.01]
    end = law(1.0)[-1].seconds
    assert missed.baseline == "" and missed.baseline_seconds == pytest.approx(end) and missed.bound == "≥"
    assert missed.ratio == pytest.approx(end / 0.2)
    # A second and two of set-up swallow most of the gain.
    assert found["whole", 0.1].ratio == pytest.approx((0.25 + 1.0) / (0.02 + 2.0), rel=0.02)
    assert ("photon", 0.001) in found and found["photon", 0.001].seconds == pytest.approx(2.0)
    assert speed_ups([own]) == [] and speed_ups([noisy]) == []


def test_a_target_that_only_baselines_reach() -> None:
    found = speed_ups([curve("stochastic", whole(law(0.01), 1.0)), curve("srd", whole(law(1e-4, floor=0.05), 1.0))])
    missed = [one for one in found if one.target == 0.01 and one.clock == "photon"]
    assert [one.ratio for one in missed] == [None] and missed[0].baseline == "stochastic"


def test_the_best_baseline_is_the_best_where_all_are_followed() -> None:
    long_run = curve("stochastic", [Point(10, 30.0, 0.001, 0.001, 0.001, 0.0, 0.001), *law(1.0)][::-1])
    short = curve("stochastic-even", law(0.5))
    assert best_baseline([long_run, short, curve("srd", law(1e-6))]).method == "stochastic-even"  # type: ignore[union-attr]
    assert best_baseline([curve("srd", law(1.0)), curve("srd-photons", law(1.0))]) is None
