"""How renderings are divided into passes: `progressive-stochastic` by Knaus and Zwicker's recursion, `progressive` by
passes that grow and count the more."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from spectrasplat.render.pass_sizes import (
    FIRST_PHOTONS,
    GROWTH,
    LARGEST_PHOTONS,
    WEIGHT_POWER,
    emphasis,
    endless_passes,
    pass_sizes,
)
from spectrasplat.render.shrinking import ALPHA, PASS_PHOTONS, kernel_scale


def test_kernels_follow_the_recursion() -> None:
    """r²ᵢ₊₁ / r²ᵢ = (i + α)/(i + 1), passes counted from 1."""
    scales = np.array([kernel_scale(number) for number in range(200)])
    assert scales[0] == pytest.approx(1.0)
    i = np.arange(1, 200)
    np.testing.assert_allclose((scales[1:] / scales[:-1]) ** 2, (i + ALPHA) / (i + 1), rtol=1e-12)
    # In the end as i^((α − 1)/2): with N photons, N passes, variance and bias² of a density both fall as N^(−2/3).
    late = np.log(kernel_scale(1_000_000) / kernel_scale(10_000)) / np.log(100.0)
    assert late == pytest.approx(0.5 * (ALPHA - 1.0), abs=1e-4)


def test_passes_of_equal_size_add_up() -> None:
    for photons in (1, 500, PASS_PHOTONS, 3 * PASS_PHOTONS // 2 + 1, 1_000_000):
        sizes = pass_sizes("progressive-stochastic", photons)
        assert abs(sum(sizes) - photons) <= len(sizes) and len(set(sizes)) == 1 and sizes[0] < 2 * PASS_PHOTONS
    assert len(pass_sizes("progressive-stochastic", 1_000_000)) == 61
    assert pass_sizes("stochastic", 1_000_000) == pass_sizes("srd", 1_000_000) == [1_000_000]


def test_passes_that_grow_end_with_a_whole_one() -> None:
    for photons in (1, 500, FIRST_PHOTONS, 5 * FIRST_PHOTONS - 1, 5 * FIRST_PHOTONS, 123_457, 10_000_000):
        sizes = pass_sizes("progressive", photons)
        assert sum(sizes) == photons and all(n > 0 for n in sizes)
        growths = np.array(sizes[1:]) / sizes[:-1]
        np.testing.assert_allclose(growths, GROWTH, rtol=1e-3)
        assert sizes[0] == photons or FIRST_PHOTONS <= sizes[0] < (GROWTH + 1.0) * FIRST_PHOTONS + 1
    # A rendering without an end goes through the same sizes, and no further than lattices can be counted.
    endless = list(islice(endless_passes("progressive"), 40))
    assert endless[:4] == pass_sizes("progressive", sum(endless[:4]))
    assert max(endless) == LARGEST_PHOTONS and endless == sorted(endless)


def test_coarse_passes_fade() -> None:
    """Whatever a pass errs by, its share of the sum falls as photons grow: what first passes blur goes with N^-3."""
    shares = []
    for count in (2, 4, 6):
        sizes = list(islice(endless_passes("progressive"), count))
        weights = np.array([n * emphasis(n, sizes[0]) for n in sizes])
        shares.append(weights[0] / weights.sum())
        assert weights[-1] / weights.sum() > 0.9
    slope = np.diff(np.log(shares)) / np.diff(np.log([GROWTH**2, GROWTH**4, GROWTH**6]))
    np.testing.assert_allclose(slope, -WEIGHT_POWER, atol=0.05)
    assert emphasis(5000, 5000) == 1.0
