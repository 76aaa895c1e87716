"""The bench's measures: hand-made values; noise of the reference and few seeds do not tilt them; standard scores."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.bench.agreement import BLOCK, EXTREME, SHOWN, agreement
from spectrasplat.reference.metrics import (
    ReferencePicture,
    bias_variance,
    flip,
    measure,
    relmse_of_difference,
    relmse_raw,
)

SHAPE = (12, 20, 3)


def exact(xyz: np.ndarray) -> ReferencePicture:
    return ReferencePicture(xyz, np.zeros_like(xyz))


def test_values_by_hand() -> None:
    reference = np.zeros((1, 2, 3))
    reference[0, 0] = 6.0, 6.0, 12.0  # the mean over the lit pixel is 8, so ε = 0.64
    picture = reference.copy()
    picture[0, 0] = 7.0, 6.0, 9.0
    picture[0, 1] = 0.4, 0.4, 0.4
    found = measure(picture, exact(reference))
    relmse = (1.0 / 36.64 + 9.0 / 144.64 + 3 * 0.16 / 0.64) / 6.0
    assert found["relmse"] == pytest.approx(relmse, rel=1e-12) == found["relmse_raw"]
    assert found["relmse_trimmed"] == pytest.approx((relmse * 6.0 - 0.25) / 5.0, rel=1e-12)  # the largest of six goes
    assert found["relmse_whole"] == pytest.approx(
        (1.0 / 36.16 + 9.0 / 144.16 + 3 * 0.16 / 0.16) / 6.0, rel=1e-12
    )  # the mean over all is 4
    assert found["smape"] == pytest.approx((1.0 / 13.4 + 3.0 / 21.4 + 3 * 0.4 / 0.8) / 6.0, rel=1e-12)
    assert found["nrmse"] == pytest.approx(np.sqrt((1.0 + 9.0 + 3 * 0.16) / 216.0), rel=1e-12)
    assert found["energy_ratio"] == pytest.approx(23.2 / 24.0, rel=1e-12)
    uv, uv_reference = np.array([28.0, 54.0]) / (7.0 + 90.0 + 27.0), np.array([24.0, 54.0]) / (6.0 + 90.0 + 36.0)
    assert found["chroma"] == pytest.approx(np.linalg.norm(uv - uv_reference), rel=1e-12)


def test_a_perfect_picture_has_no_error() -> None:
    reference = np.random.default_rng(1).random(SHAPE)
    found = measure(reference, exact(reference))
    assert found.pop("energy_ratio") == 1.0
    assert set(found.values()) == {0.0}


def test_black_pictures_and_black_references_give_numbers() -> None:
    black, lit = np.zeros(SHAPE), np.ones(SHAPE)
    assert measure(black, exact(lit))["relmse"] == pytest.approx(1.0 / 1.01)
    assert measure(black, exact(lit))["chroma"] == pytest.approx(np.hypot(4 / 19 - 0.19783, 9 / 19 - 0.46832), rel=1e-9)
    assert all(np.isfinite(value) for picture in (black, lit) for value in measure(picture, exact(black)).values())
    assert flip(lit, exact(black)) is None


def noisy_reference(rng: np.random.Generator, xyz: np.ndarray, sigma: float) -> ReferencePicture:
    return ReferencePicture(xyz + rng.normal(0.0, sigma, xyz.shape), np.full(xyz.shape, sigma**2))


def test_the_references_variance_is_taken_out() -> None:
    """400 noisy references of 720 values: the mean of the freed error has a standard error of 0.3 %, so 1.5 % would
    show.

    Raw errors, the mutant, are 25 % too large here.
    """
    rng = np.random.default_rng(2)
    xyz = 10.0 + rng.random(SHAPE)
    # Errors of both signs: the weight's own noise is correlated with the error, a second-order effect that one sign
    # would show.
    picture = xyz * (1.0 + 0.02 * rng.choice((-1.0, 1.0), xyz.shape))
    true = measure(picture, exact(xyz))["relmse"]
    references = [noisy_reference(rng, xyz, 0.1) for _ in range(400)]
    raw = np.mean([relmse_raw(picture, reference_image) for reference_image in references])
    freed = np.mean([measure(picture, reference_image)["relmse"] for reference_image in references])
    assert freed == pytest.approx(true, rel=0.015)
    assert raw != pytest.approx(true, rel=0.2)


@pytest.mark.parametrize("bias", [0.0, 0.3])
def test_bias_and_variance_are_told_apart_without_bias(bias: float) -> None:
    """300 repeats of 4 seeds, noise 0.5, reference noise 0.1, all in units of a grey 10.

    Standard errors, in units of 1e-4 of relMSE: variance 0.07 of 25, bias² 0.06 of 9; 0.3 of each would show. The
    mutant without − V/n is 6.2 off, the one without the reference's variance 1.
    """
    rng = np.random.default_rng(3)
    xyz = np.full(SHAPE, 10.0)
    weight = 1.0 / (100.0 + 1.0)
    found, naive = [], []
    for _ in range(300):
        reference_image = noisy_reference(rng, xyz, 0.1)
        pictures = [xyz + bias + rng.normal(0.0, 0.5, SHAPE) for _ in range(4)]
        difference = np.mean(pictures, axis=0) - reference_image.xyz
        parts = bias_variance(difference, [relmse_raw(p, reference_image) for p in pictures], reference_image)
        found.append(
            (
                relmse_of_difference(difference, reference_image) - parts.variance / 4 - reference_image.own_relmse,
                parts.variance,
                parts.relmse,
            )
        )
        assert parts.bias2 == max(found[-1][0], 0.0)
        naive.append(relmse_of_difference(difference, reference_image) - reference_image.own_relmse)
    bias2, variance, relmse = np.mean(found, axis=0)
    assert bias2 == pytest.approx(bias**2 * weight, abs=3e-5)
    assert variance == pytest.approx(0.25 * weight, abs=3e-5)
    assert relmse == pytest.approx(bias2 + variance, rel=1e-9)
    assert np.mean(naive) - bias**2 * weight > 5e-4


def test_one_seed_cannot_be_told_apart() -> None:
    xyz = np.ones(SHAPE)
    parts = bias_variance(0.1 * xyz, [0.01 / 1.01], exact(xyz))
    assert (parts.bias2, parts.variance) == (0.0, 0.0) and parts.relmse == pytest.approx(0.01 / 1.01)


def test_flip_grows_with_noise_and_takes_mostly_black_pictures() -> None:
    pytest.importorskip("flip_evaluator")
    rng = np.random.default_rng(4)
    xyz = np.zeros((48, 64, 3))
    xyz[20:30, 10:50] = 50.0 * rng.random((10, 40, 1)) + 20.0
    values = [
        flip(xyz + amount * (xyz > 0.0) * rng.normal(0.0, 1.0, xyz.shape), exact(xyz)) for amount in (0.0, 3.0, 15.0)
    ]
    assert values[0] == 0.0 and 0.0 < values[1] < values[2] < 1.0


SCORED = (64, 96)
SCORED_SEEDS = 6
WEIGHT = 1e-3
"""Luminance of one photon of the reference."""


def truth() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, SCORED[1]), np.linspace(-1.0, 1.0, SCORED[0]))
    return 2.0 * np.exp(-3.0 * (x**2 + y**2)) + 0.2


def reference(rng: np.random.Generator) -> ReferencePicture:
    hits = rng.poisson(truth() / WEIGHT)
    xyz, variance = hits * WEIGHT, hits * WEIGHT**2
    return ReferencePicture(np.repeat(xyz[..., None], 3, axis=2), np.repeat(variance[..., None], 3, axis=2))


def pictures(rng: np.random.Generator, deviation: np.ndarray | float = 0.0) -> np.ndarray:
    """A method's, with noise of 1 % and a relative deviation that no seed cures."""
    noise = rng.normal(0.0, 0.01, (SCORED_SEEDS, *SCORED))
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
    wrong = np.zeros(SCORED)
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
