"""Standard scores of pictures against a reference: chance stays chance, and what deviates is found with its size."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.bench.agreement import BLOCK, EXTREME, SHOWN, agreement
from spectrasplat.reference.metrics import ReferencePicture

SHAPE = (64, 96)
SEEDS = 6
WEIGHT = 1e-3
"""Luminance of one photon of the reference."""


def truth() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, SHAPE[1]), np.linspace(-1.0, 1.0, SHAPE[0]))
    return 2.0 * np.exp(-3.0 * (x**2 + y**2)) + 0.2


def reference(rng: np.random.Generator) -> ReferencePicture:
    hits = rng.poisson(truth() / WEIGHT)
    xyz, variance = hits * WEIGHT, hits * WEIGHT**2
    return ReferencePicture(np.repeat(xyz[..., None], 3, axis=2), np.repeat(variance[..., None], 3, axis=2))


def pictures(rng: np.random.Generator, deviation: np.ndarray | float = 0.0) -> np.ndarray:
    """A method's, with noise of 1 % and a relative deviation that no seed cures."""
    noise = rng.normal(0.0, 0.01, (SEEDS, *SHAPE))
    return truth() * (1.0 + noise + deviation)


@pytest.mark.parametrize("side", [1, BLOCK])
def test_chance_scores_as_chance(side: int) -> None:
    rng = np.random.default_rng(4)
    found = agreement(pictures(rng), reference(rng), side)
    assert found.places == truth().size // side**2
    assert 0.75 < found.chi2 < 1.15 and found.extreme == 0 and found.deviation < 0.004
    assert found.seldom < 0.01 * found.places


def test_a_deviation_is_found_with_its_size_and_place() -> None:
    rng = np.random.default_rng(5)
    wrong = np.zeros(SHAPE)
    wrong[16:24, 40:48] = 0.1
    found = agreement(pictures(rng, wrong), reference(rng), BLOCK)
    assert found.extreme == 1 and found.seldom <= 3
    worst, *others = found.worst
    assert worst.score > EXTREME and (worst.column, worst.row) == (40, 16)
    assert worst.share == pytest.approx(0.1, abs=0.01)
    assert len(others) == SHOWN - 1 and all(abs(other.score) < EXTREME for other in others)
    everywhere = agreement(pictures(rng, 0.05), reference(rng), 1)
    assert everywhere.deviation == pytest.approx(0.05, rel=0.1) and everywhere.chi2 > 2.0


def test_places_with_few_photons_are_left_out() -> None:
    rng = np.random.default_rng(6)
    dark = reference(rng)
    thin = ReferencePicture(dark.xyz, dark.xyz**2)  # a photon a pixel
    found = agreement(pictures(rng), thin, 1)
    assert (found.places, found.chi2, found.deviation) == (0, 1.0, 0.0)
