"""The RGB basis keeps its promises: bounds, unit sum, exact colours under D65, smoothness no rival beats."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.optics.colorimetry import (
    K_M,
    VISIBLE_NM,
    cmf_xyz,
    daylight_per_lumen,
    illuminant_table,
    rgb_basis,
    xyz_to_rgb709,
)


def seen(spectrum: np.ndarray) -> np.ndarray:
    """Linear Rec.709 of radiances (..., 401) by the defining sums."""
    return xyz_to_rgb709(K_M * spectrum @ cmf_xyz())


def roughness(basis: np.ndarray) -> float:
    """Sum of squared differences of neighbours, over all three curves."""
    return float((np.diff(basis, axis=0) ** 2).sum())


def test_the_curves_are_reflectances_that_sum_to_one() -> None:
    basis = rgb_basis()
    assert basis.shape == (401, 3) and basis.dtype == np.float64 and not basis.flags.writeable
    assert basis.min() >= 0.0 and basis.max() <= 1.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=0.0, atol=3e-16)


def test_daylight_per_lumen_has_the_luminance_one_and_the_shape_of_d65() -> None:
    daylight = daylight_per_lumen()
    assert K_M * daylight @ cmf_xyz()[:, 1] == pytest.approx(1.0, rel=1e-14)
    ratio = daylight / illuminant_table()["D65"]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-14)


def test_the_primaries_have_their_colours_under_daylight() -> None:
    np.testing.assert_allclose(seen(rgb_basis().T * daylight_per_lumen()), np.eye(3), rtol=0.0, atol=1e-11)


def test_any_colour_comes_back() -> None:
    """Within the gamut and far above 1; the reflectances in between stay physical."""
    rgb = np.random.default_rng(5).random((200, 3))
    reflectance = rgb @ rgb_basis().T
    assert reflectance.min() >= 0.0 and reflectance.max() <= 1.0
    np.testing.assert_allclose(seen(reflectance * daylight_per_lumen()), rgb, rtol=0.0, atol=1e-11)
    bright = 5e4 * rgb
    np.testing.assert_allclose(seen(bright @ rgb_basis().T * daylight_per_lumen()), bright, rtol=1e-9, atol=1e-6)


def test_greys_are_flat() -> None:
    np.testing.assert_allclose(rgb_basis() @ np.full(3, 0.18), 0.18, rtol=1e-15)


def test_no_small_admissible_change_makes_it_smoother() -> None:
    """First-order optimality: along any direction that keeps sums, colours and bounds, roughness does not fall."""
    basis, rng = rgb_basis(), np.random.default_rng(8)
    daylight = daylight_per_lumen()
    weights = (daylight[:, None] * cmf_xyz()).T
    free = basis > 1e-9
    # Wavelengths where all three curves may move either way, so that a small step keeps the bounds.
    inside = np.flatnonzero(free.all(axis=1))
    assert inside.size > 20
    gradient = -2.0 * np.diff(np.pad(basis, ((1, 1), (0, 0)), mode="edge"), n=2, axis=0)
    for _ in range(50):
        step = np.zeros((401, 3))
        for channel in range(2):
            noise = rng.normal(size=inside.size)
            rows = weights[:, inside]
            noise -= rows.T @ np.linalg.lstsq(rows.T, noise, rcond=None)[0]
            step[inside, channel] = noise
        step[:, 2] = -step[:, 0] - step[:, 1]
        assert np.abs(weights @ step).max() < 1e-9
        assert abs((gradient * step).sum()) < 1e-7 * np.linalg.norm(step)
        scale = 0.5 * basis[inside].min() / np.abs(step).max()
        assert roughness(basis + scale * step) > roughness(basis)


def test_the_curves_are_smooth_and_in_order() -> None:
    """No step above 1/30 per nm, and each curve is the largest where its primary's hue lies."""
    basis = rgb_basis()
    assert np.abs(np.diff(basis, axis=0)).max() < 1.0 / 30.0
    largest = basis.argmax(axis=1)
    assert [largest[np.flatnonzero(VISIBLE_NM == nm)[0]] for nm in (440.0, 530.0, 640.0)] == [2, 1, 0]
