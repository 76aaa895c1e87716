"""The schedule of `progressive-stochastic`: Knaus and Zwicker's recursion, and passes that add up to what was asked."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.render.shrinking import ALPHA, PASS_PHOTONS, kernel_scale, passes


def test_kernels_follow_the_recursion() -> None:
    """r²ᵢ₊₁ / r²ᵢ = (i + α)/(i + 1), passes counted from 1."""
    scales = np.array([kernel_scale(number) for number in range(200)])
    assert scales[0] == pytest.approx(1.0)
    i = np.arange(1, 200)
    np.testing.assert_allclose((scales[1:] / scales[:-1]) ** 2, (i + ALPHA) / (i + 1), rtol=1e-12)
    # In the end as i^((α − 1)/2): with N photons, N passes, variance and bias² of a density both fall as N^(−2/3).
    late = np.log(kernel_scale(1_000_000) / kernel_scale(10_000)) / np.log(100.0)
    assert late == pytest.approx(0.5 * (ALPHA - 1.0), abs=1e-4)


def test_passes_add_up() -> None:
    for photons in (1, 500, PASS_PHOTONS, 3 * PASS_PHOTONS // 2 + 1, 1_000_000):
        count, each = passes("progressive-stochastic", photons)
        assert abs(count * each - photons) <= count and each < 2 * PASS_PHOTONS
    assert passes("progressive-stochastic", 1_000_000)[0] == 61
    assert passes("stochastic", 1_000_000) == (1, 1_000_000)
