"""Tone mapping keeps hue and order, never clips, and leaves ordinary colours alone."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.tone_map import (
    NOT_FINITE_RGB,
    auto_exposure,
    luminance,
    srgb_eotf,
    srgb_oetf,
    to_display,
    tone_map_8bit,
)
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz, rgb709_to_xyz, xyz_to_rgb709


def spectral_locus(low_nm: float = 410.0, high_nm: float = 690.0) -> np.ndarray:
    """Linear Rec.709 of equal-energy monochromatic light, float32 (N, 3), strongly negative."""
    inside = (VISIBLE_NM >= low_nm) & (VISIBLE_NM <= high_nm)
    return xyz_to_rgb709(cmf_xyz()[inside]).astype(np.float32)


def hue_angle(rgb: np.ndarray) -> np.ndarray:
    """Angle round the grey axis in a plane of linear RGB: equal angles are equal dominant wavelengths."""
    r, g, b = np.moveaxis(np.asarray(rgb, float), -1, 0)
    return np.arctan2(np.sqrt(3) * (g - b), 2 * r - g - b)


def angle_difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.parametrize("exposure_ev", [-4.0, 0.0, 3.0, 6.0])
def test_spectral_colours_keep_their_dominant_wavelength(exposure_ev):
    rgb = spectral_locus()
    assert rgb.min() < -0.5
    shown = to_display(rgb, exposure_ev)
    assert shown.min() >= 0 and shown.max() <= 1
    assert angle_difference(hue_angle(shown), hue_angle(rgb)).max() < 2e-3
    # A channel-by-channel clip, the mistake this replaces, is far off.
    clipped = np.clip(rgb * 2.0**exposure_ev, 0, 1)
    coloured = np.ptp(clipped, axis=-1) > 1e-6
    assert angle_difference(hue_angle(clipped), hue_angle(rgb))[coloured].max() > 0.2


def test_a_sweep_through_the_spectrum_has_no_plateaus_and_no_jumps():
    inside = np.linspace(430.0, 640.0, 2000)
    cmf = np.stack([np.interp(inside, VISIBLE_NM, column) for column in cmf_xyz().T], axis=-1)
    codes = srgb_oetf(to_display(xyz_to_rgb709(cmf).astype(np.float32), 0.0)).astype(float)
    step = np.abs(np.diff(codes, axis=0)).max(axis=-1)
    assert step.max() < 2.0 / 255  # 0.1 nm a step
    # Over any 2 nm something is seen to change (half a code at least).
    change = np.abs(codes[20:] - codes[:-20]).max(axis=-1)
    assert change.min() > 0.5 / 255


def test_brighter_stays_brighter_for_every_hue():
    rgb = spectral_locus()[::5]
    steps = np.stack([luminance(to_display(rgb, ev)) for ev in np.arange(-6.0, 10.0, 0.25)])
    assert np.diff(steps, axis=0).min() > 0
    grey = np.array([luminance(to_display(np.ones((1, 3)), ev)) for ev in np.arange(-6.0, 10.0, 0.25)])
    assert np.diff(grey[:, 0]).min() > 0


def test_ordinary_colours_come_out_exactly():
    rng = np.random.default_rng(3)
    rgb = (0.3 + 0.15 * rng.uniform(-1, 1, (500, 3))).astype(np.float32)
    assert np.abs(to_display(rgb, 0.0) - rgb).max() < 1e-6
    assert np.abs(to_display(rgb, -2.0) - rgb / 4).max() < 1e-6
    codes = tone_map_8bit(rgb, 0.0)
    assert np.abs(codes - 255 * srgb_oetf(rgb)).max() < 0.52


def test_luminance_is_kept_on_the_way_into_the_gamut():
    rgb = spectral_locus() * 0.05  # below the shoulder
    assert luminance(to_display(rgb, 0.0)) == pytest.approx(luminance(rgb), rel=2e-3)


def test_overexposed_colours_bleach():
    green = np.array([[0.0, 1.0, 0.0]], np.float32)
    mild, hot = to_display(green, 1.0)[0], to_display(green, 12.0)[0]
    assert mild[0] / mild[1] < 0.35
    assert hot.min() > 0.9


def test_black_negative_and_broken_pixels():
    rgb = np.array([[0, 0, 0], [-1, -1, -1], [np.nan, 0, 0], [0, np.inf, 0], [1e38, 0, 0]], np.float32)
    shown = to_display(rgb, 8.0)
    assert np.all(shown[:2] < 1e-6)
    assert np.all(shown[2:4] == NOT_FINITE_RGB)
    assert np.isfinite(shown[4]).all() and shown[4].max() <= 1


def test_srgb_curve_known_values_and_inverse():
    assert srgb_oetf(np.array([0.0, 0.0031308, 0.18, 1.0])) == pytest.approx([0, 0.04045, 0.461356, 1], abs=2e-6)
    values = np.linspace(0, 1, 1001)
    assert np.abs(srgb_eotf(srgb_oetf(values)) - values).max() < 3e-7


def test_luminance_weights_belong_to_our_matrices():
    assert luminance(np.eye(3)) == pytest.approx(rgb709_to_xyz(np.eye(3))[:, 1], abs=2e-4)


class TestAutoExposure:
    def test_scales_with_the_picture(self):
        rgb = np.random.default_rng(1).gamma(1.0, 1.0, (64, 64, 3))
        assert auto_exposure(rgb * 1024) == pytest.approx(auto_exposure(rgb) - 10, abs=1e-3)

    def test_plain_paper_becomes_middle_grey(self):
        assert 0.5 * 2 ** auto_exposure(np.full((8, 8, 3), 0.5)) == pytest.approx(0.18, rel=1e-4)

    def test_black_environment_and_fireflies_change_nothing(self):
        rgb = np.zeros((100, 100, 3))
        rgb[40:60, 40:60] = np.random.default_rng(2).uniform(0.5, 1.5, (20, 20, 1))
        alone = auto_exposure(rgb[40:60, 40:60])
        assert auto_exposure(rgb) == pytest.approx(alone, abs=1e-6)
        rgb[50, 50] = 1e6
        assert auto_exposure(rgb) == pytest.approx(alone, abs=0.1)

    def test_deep_shadows_do_not_open_the_aperture(self):
        rgb = np.ones((100, 100, 3))
        rgb[:30] = 1e-3
        assert auto_exposure(rgb) == pytest.approx(np.log2(0.18), abs=1e-3)

    def test_bright_caustics_are_held_within_three_stops(self):
        rgb = np.ones((100, 100, 3))
        rgb[:10] = 1000.0
        assert 1000.0 * 2 ** auto_exposure(rgb) == pytest.approx(8.0, rel=1e-3)

    def test_black_and_broken_pictures(self):
        assert auto_exposure(np.zeros((4, 4, 3))) == 0
        assert auto_exposure(np.full((4, 4, 3), np.nan)) == 0
