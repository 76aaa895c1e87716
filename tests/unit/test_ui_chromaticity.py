"""Chromaticity and dominant wavelength against known answers."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.edit import chromaticity
from spectrasplat.edit.chromaticity import colour_info
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, illuminant_table
from spectrasplat.model.optics.spectrum import blackbody


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
