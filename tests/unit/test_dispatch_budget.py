"""How much a dispatch is given: converges on the time it should take, whatever a unit costs."""

from __future__ import annotations

import pytest
from spectrasplat.gpu.dispatch_budget import DispatchBudget


@pytest.mark.parametrize("unit_s", [1e-7, 3e-5, 2e-3])
def test_dispatches_come_to_take_what_they_should(unit_s: float) -> None:
    dispatch_budget = DispatchBudget(16, 8, 1 << 16)
    for _ in range(20):
        dispatch_budget.learn(dispatch_budget.units, 2e-4 + dispatch_budget.units * unit_s, 0.01)
    wanted = min(max(0.01 / unit_s, 8), 1 << 16)
    assert 0.8 * wanted - 8 <= dispatch_budget.units <= wanted + 8
    assert dispatch_budget.units % 8 == 0


def test_it_grows_carefully_and_shrinks_at_once() -> None:
    dispatch_budget = DispatchBudget(64, 64, 1 << 20)
    dispatch_budget.learn(64, 1e-6, 0.1)
    assert dispatch_budget.units == 256
    dispatch_budget.learn(256, 1.0, 0.1)
    assert dispatch_budget.units == 64


def test_a_small_rest_says_nothing_but_that_it_took_too_long() -> None:
    dispatch_budget = DispatchBudget(1024, 64, 1 << 20)
    dispatch_budget.learn(64, 0.009, 0.01)
    assert dispatch_budget.units == 1024
    dispatch_budget.learn(64, 0.02, 0.01)
    assert dispatch_budget.units == 64
