"""How much a dispatch is given: converges on the time it should take, whatever a unit costs."""

from __future__ import annotations

import pytest
from spectrasplat.gpu.dispatch_budget import Portion


@pytest.mark.parametrize("unit_s", [1e-7, 3e-5, 2e-3])
def test_dispatches_come_to_take_what_they_should(unit_s: float) -> None:
    portion = Portion(16, 8, 1 << 16)
    for _ in range(20):
        portion.learn(portion.units, 2e-4 + portion.units * unit_s, 0.01)
    wanted = min(max(0.01 / unit_s, 8), 1 << 16)
    assert 0.8 * wanted - 8 <= portion.units <= wanted + 8
    assert portion.units % 8 == 0


def test_it_grows_carefully_and_shrinks_at_once() -> None:
    portion = Portion(64, 64, 1 << 20)
    portion.learn(64, 1e-6, 0.1)
    assert portion.units == 256
    portion.learn(256, 1.0, 0.1)
    assert portion.units == 64


def test_a_small_rest_says_nothing_but_that_it_took_too_long() -> None:
    portion = Portion(1024, 64, 1 << 20)
    portion.learn(64, 0.009, 0.01)
    assert portion.units == 1024
    portion.learn(64, 0.02, 0.01)
    assert portion.units == 64
