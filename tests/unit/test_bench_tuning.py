"""The sweep of a baseline's kernel on made-up methods whose best kernels are known."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.bench.rendering import KERNELS, Rendering
from spectrasplat.bench.results import ERROR_SOUGHT, Curve
from spectrasplat.bench.tuning import kernel_at, tune

RATE = 1e5
"""Photons a second with the narrowest kernel."""


class Rig:
    """A density estimate in the plane: variance a / (N k²), bias² b (k / √N)⁴, so that the best k grows as N^(1/3)."""

    setup_seconds: dict[str, float] = {}
    buffers_mib = 0.0
    goes_on = True

    def __init__(self, kernels: tuple[float, ...] = KERNELS, variance: float = 3e3, bias: float = 1.0) -> None:
        self.kernels, self._variance, self._bias = kernels, variance, bias
        self.rendered: list[tuple[int, float]] = []

    def error(self, photons: int, kernel: float | None) -> float:
        if kernel is None:
            return self._variance / photons
        return self._variance / (photons * kernel**2) + self._bias * 1e4 * (kernel / photons**0.5) ** 4

    def best(self, photons: int) -> float:
        return float((self._variance * photons / (2e4 * self._bias)) ** (1 / 6))

    def budgets(self, seconds: float, count: int) -> list[int]:
        return [round(n) for n in np.geomspace(1000, seconds * RATE, count)]

    def render(self, photons: int, seed: int, kernel: float | None = None) -> Rendering:
        assert seed == 0
        self.rendered.append((photons, kernel or 0.0))
        seconds = photons / RATE * (1.0 + 0.02 * (kernel or 0.0))
        return Rendering(np.zeros((1, 1, 3)), {"trace": seconds}, photons, photons)

    def fitting(self, budget: int) -> int:
        return budget

    def release(self) -> None:
        """Owns nothing."""


def tuned(rig: Rig, seconds: float = 3.0, horizon: float = 30.0):
    def judge(rendering: Rendering) -> tuple[float, float]:
        photons, kernel = rig.rendered[-1]
        return rendering.seconds["trace"], rig.error(photons, kernel or None)

    return tune(rig, seconds, horizon, 10, judge, lambda _: None)


def test_every_budget_gets_its_best_kernel() -> None:
    rig = Rig()
    found = tuned(rig)
    assert len(found.budgets) == len(found.kernels) == 10 and found.budgets == sorted(found.budgets)
    for budget, kernel in zip(found.budgets, found.kernels, strict=True):
        # To a step of the sweep; errors are flat there.
        assert rig.error(budget, kernel) < 1.15 * rig.error(budget, rig.best(budget))
    assert found.kernels[-1] > 2.0 * found.kernels[0]
    # A mutant that keeps one kernel would not do.
    assert rig.error(found.budgets[-1], found.kernels[0]) > 2.0 * rig.error(found.budgets[-1], found.kernels[-1])


def test_the_smallest_budget_is_swept_whole_and_nothing_is_rendered_twice() -> None:
    rig = Rig()
    found = tuned(rig)
    smallest = min(t.photons for t in found.sweep)
    assert sorted(t.smoothing for t in found.sweep if t.photons == smallest) == pytest.approx(KERNELS)
    assert len(rig.rendered) == len(set(rig.rendered)) == len(found.sweep) < 2.8 * len(KERNELS)
    # Both neighbours of the best one are known at every budget.
    for budget in {t.photons for t in found.sweep}:
        known = {t.smoothing: t.relmse for t in found.sweep if t.photons == budget}
        at = KERNELS.index(min(known, key=lambda k: known[k]))
        assert all(KERNELS[i] in known for i in (at - 1, at + 1) if 0 <= i < len(KERNELS))


class TwoMinima(Rig):
    """Noise and blur: the widest kernel is best for few photons and the narrowest for many, anything between never."""

    def error(self, photons: int, kernel: float | None) -> float:
        assert kernel is not None
        blurred, noisy = 3.0 + 2.0 * abs(np.log(kernel / 32.0)), 3e5 / photons + 2.0 * abs(np.log(kernel / 0.45))
        return min(blurred, noisy)


def test_a_minimum_that_another_one_overtakes_is_found() -> None:
    found = tuned(TwoMinima())
    for budget, kernel in zip(found.budgets, found.kernels, strict=True):
        assert kernel == pytest.approx(32.0 if 3e5 / budget > 3.0 else 0.45), budget


def test_the_horizon_grows_until_the_error_sought_is_reached() -> None:
    """Without a kernel: 3e3 / N is 0.01 at 3 s; ten and a hundred times that variance needs 30 s and more."""
    near, far, beyond = (tuned(Rig((), variance=v)) for v in (2e3, 1.5e4, 1e6))
    assert near.kernels == [] and near.budgets[-1] == pytest.approx(3.0 * RATE, rel=0.01)
    assert 1.5e4 / far.budgets[-1] <= 1.01 * ERROR_SOUGHT and far.budgets[-1] < 30.0 * RATE
    assert beyond.budgets[-1] == pytest.approx(30.0 * RATE, rel=0.35) and beyond.budgets[-1] <= 30.1 * RATE
    assert tuned(Rig((), variance=1e6), horizon=3.0).budgets[-1] == pytest.approx(3.0 * RATE, rel=0.01)


def test_the_longest_run_takes_the_time_it_was_given() -> None:
    found = tuned(Rig(bias=1e-6))
    seconds = found.budgets[-1] / RATE * (1.0 + 0.02 * found.kernels[-1])
    assert found.kernels[-1] > 10.0 and seconds == pytest.approx(3.0, rel=0.1)


def test_kernels_between_budgets() -> None:
    curve = Curve("stochastic", {}, [], [100, 10_000], kernels=[1.0, 4.0])
    assert [kernel_at(curve, n) for n in (10, 100, 900, 1100, 10_000)] == [1.0, 1.0, 1.0, 4.0, 4.0]
    assert kernel_at(Curve("srd", {}, [], [100]), 100) is None
