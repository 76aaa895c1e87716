"""Colours: the RGB basis keeps its promises, chromaticity and dominant wavelength against known answers."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.edit import chromaticity
from spectrasplat.edit.chromaticity import colour_info
from spectrasplat.model.optics.colorimetry import (
    K_M,
    VISIBLE_NM,
    cmf_xyz,
    daylight_per_lumen,
    illuminant_table,
    rgb_basis,
    xyz_to_rgb709,
)
from spectrasplat.model.optics.spectrum import blackbody


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


def test_the_curves_are_smooth_and_in_order() -> None:
    """No step above 1/30 per nm, and each curve is the largest where its primary's hue lies."""
    basis = rgb_basis()
    assert np.abs(np.diff(basis, axis=0)).max() < 1.0 / 30.0
    largest = basis.argmax(axis=1)
    assert [largest[np.flatnonzero(VISIBLE_NM == nm)[0]] for nm in (440.0, 530.0, 640.0)] == [2, 1, 0]


@pytest.mark.parametrize("wavelength", [450.0, 486.0, 520.0, 589.0, 640.0])
def test_a_line_is_its_own_dominant_wavelength(wavelength: float) -> None:
    view_model = colour_info(VISIBLE_NM, np.where(VISIBLE_NM == wavelength, 1.0, 0.0))
    assert view_model is not None and view_model.dominant_nm == pytest.approx(wavelength, abs=0.6)
    assert view_model.purity == pytest.approx(1.0, abs=0.01)
    assert not view_model.is_complementary


def test_daylight_is_white() -> None:
    view_model = colour_info(VISIBLE_NM, illuminant_table()["D65"])
    assert view_model is not None and view_model.dominant_nm is None
    # CIE 15: chromaticity of D65 for the 2° observer.
    assert (view_model.x, view_model.y) == pytest.approx((0.3127, 0.3290), abs=2e-4)


def test_red_and_violet_together_are_purple() -> None:
    view_model = colour_info(VISIBLE_NM, np.where((VISIBLE_NM == 440.0) | (VISIBLE_NM == 640.0), 1.0, 0.0))
    assert view_model is not None and view_model.is_complementary and view_model.dominant_nm is not None
    assert 495 < view_model.dominant_nm < 575
    assert 0.5 < view_model.purity <= 1.0


def test_illuminance_of_green_laser_light() -> None:
    # 1 W at 555 nm is 683 lm (within the table's rounding).
    view_model = colour_info(VISIBLE_NM, np.where(VISIBLE_NM == 555.0, 1.0, 0.0))
    assert view_model is not None and view_model.illuminance == pytest.approx(683.0, abs=0.5)


def test_darkness_has_no_colour() -> None:
    assert colour_info(VISIBLE_NM, np.zeros(401)) is None


@pytest.mark.parametrize(("kelvin", "tolerance"), [(2000.0, 2.0), (2856.0, 2.0), (6500.0, 5.0), (20000.0, 100.0)])
def test_a_black_body_has_its_own_temperature(kelvin: float, tolerance: float) -> None:
    found = colour_info(VISIBLE_NM, blackbody(kelvin).density)
    assert found is not None and found.temperature_k == pytest.approx(kelvin, abs=tolerance)


def test_strong_colours_have_no_temperature() -> None:
    for wavelength in (450.0, 520.0, 650.0):
        found = colour_info(VISIBLE_NM, np.where(VISIBLE_NM == wavelength, 1.0, 0.0))
        assert found is not None and found.temperature_k is None


def test_preparing_ends() -> None:
    chromaticity.ready()
    chromaticity._loading().join(60.0)
    assert chromaticity.ready()


def test_the_baked_observer_and_illuminants_are_colour_sciences() -> None:
    """Light and camera use tables that are baked, so that starting need not import colour-science: they are its own."""
    import colour
    from spectrasplat.model.optics.colorimetry import cmf_xyz

    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    held = np.isin(observer.wavelengths, VISIBLE_NM)
    np.testing.assert_array_equal(observer.values[held], cmf_xyz())
    for name, values in illuminant_table().items():
        if name in ("A", "E"):
            continue
        table = colour.SDS_ILLUMINANTS[name]
        own = np.interp(table.wavelengths, VISIBLE_NM, values)
        inside = (table.wavelengths >= 380) & (table.wavelengths <= 780)
        np.testing.assert_allclose(own[inside], table.values[inside], rtol=1e-9, atol=1e-9)
