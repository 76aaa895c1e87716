"""What pictures look like: tone mapping keeps hue and order, edges of what is overexposed, veiling glare, automatic
exposure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.glare import with_glare
from spectrasplat.base.image_io import read_image, write_image
from spectrasplat.base.tone_map import (
    NOT_FINITE_RGB,
    auto_exposure,
    luminance,
    srgb_eotf,
    srgb_oetf,
    to_display,
    tone_map_8bit,
)
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from spectrasplat.ui.auto_exposure import ARRIVED_EV, DEADBAND_EV, MEASURE_S, AutoExposure


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


FINE = 16
"""Points along a pixel's side."""


def drawn(colour_at: Callable[[np.ndarray, np.ndarray], np.ndarray], size=(64, 48)) -> tuple[np.ndarray, np.ndarray]:
    """A picture (H, W, 3) whose pixels are means of `colour_at(x, y)`, and linear display values of the same, tone
    mapped before the mean."""
    width, height = size
    y, x = (np.mgrid[0 : FINE * height, 0 : FINE * width] + 0.5) / FINE
    points = colour_at(x, y).astype(np.float32)

    def means(values: np.ndarray) -> np.ndarray:
        return values.reshape(height, FINE, width, FINE, 3).mean(axis=(1, 3)).astype(np.float32)

    return means(points), means(to_display(points, 0.0))


def beam(slope: float, colour: tuple[float, float, float]) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """A beam with sharp edges across grey paper."""

    def colour_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        inside = np.abs(y - 12.3 - slope * x) < 3.0
        return np.where(inside[..., None], np.array(colour), 0.15)

    return colour_at


def error(display: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Per pixel, codes."""
    return 255 * np.abs(srgb_oetf(np.clip(display, 0, 1)) - srgb_oetf(truth)).max(axis=-1)


@pytest.mark.parametrize("slope", [0.0, 0.07, 0.31, 0.6, 1.0])
@pytest.mark.parametrize("colour", [(16.0, 16.0, 16.0), (200.0, 200.0, 200.0), (4.0, 12.0, 30.0)])
def test_edges_of_beams_have_no_steps(slope: float, colour: tuple[float, float, float]) -> None:
    """Of all pixels at the edges the error's root mean square falls to two fifths at the most; mostly to a tenth."""
    picture, truth = drawn(beam(slope, colour))
    before, after = error(to_display(picture, 0.0), truth), error(to_display(picture, 0.0, antialias=True), truth)
    edge = before > 3.0
    assert edge.mean() > 0.02
    assert np.sqrt(np.mean(after[edge] ** 2)) < 0.4 * np.sqrt(np.mean(before[edge] ** 2))
    assert (after[~edge] <= before[~edge] + 3.0).all()


def test_nothing_changes_where_nothing_is_overexposed() -> None:
    rng = np.random.default_rng(1)
    picture = rng.uniform(-0.3, 1.0, (40, 60, 3)).astype(np.float32)
    assert (to_display(picture, 0.0, antialias=True) == to_display(picture, 0.0)).all()


def test_only_pixels_beside_overexposed_ones_change() -> None:
    rng = np.random.default_rng(2)
    picture = rng.uniform(0.0, 0.9, (40, 60, 3)).astype(np.float32)
    picture[20, 30] = 40.0
    changed = (to_display(picture, 0.0, antialias=True) != to_display(picture, 0.0)).any(axis=-1)
    rows, columns = np.nonzero(changed)
    assert changed.sum() <= 4 and (np.abs(rows - 20) + np.abs(columns - 30) == 1).all()


@pytest.mark.parametrize("width", [2.0, 4.0, 8.0])
def test_slopes_stay_slopes(width: float) -> None:
    """A glow eight times white, and a spectrum beside black: three codes at most, one on average."""

    def glow(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r2 = (x - 32.2) ** 2 + (y - 23.7) ** 2
        return 0.15 + 8.0 * np.exp(-r2 / (2 * width**2))[..., None] * np.array([1.0, 0.7, 0.3])

    picture, truth = drawn(glow)
    plain, antialiased = (error(to_display(picture, 0.0, antialias), truth) for antialias in (False, True))
    lit = picture[..., 0] > 0.3
    assert antialiased[lit].mean() < plain[lit].mean() + 1.0
    assert (antialiased - plain).max() < 20.0 / width


def test_broken_pixels_are_seen_and_spoil_no_others() -> None:
    picture = np.full((9, 9, 3), 0.2, np.float32)
    picture[4, 5:] = 1e30
    picture[4, 4] = np.nan
    shown = tone_map_8bit(picture, 0.0, antialias=True)
    assert (shown[4, 4] == (255, 0, 255)).all()
    assert (shown[3, :4] == shown[0, 0]).all()


def spot(height: int) -> np.ndarray:
    """One unit of light in the middle of a black picture, whatever its size."""
    rgb = np.zeros((height, height, 3), np.float32)
    rgb[height // 2, height // 2] = height**2
    return rgb


def test_nothing_scattered_is_the_picture_itself() -> None:
    rgb = spot(64)
    assert with_glare(rgb, 0.0) is rgb


def test_energy_is_kept_and_falls_off_as_the_square() -> None:
    rgb = spot(512)
    shown = with_glare(rgb, 0.1)
    assert shown.sum() == pytest.approx(rgb.sum(), rel=0.01)
    assert shown.min() > -1e-6 * shown.max()
    near, far = shown[256, 256 + 16, 0], shown[256, 256 + 32, 0]
    assert 3.0 < near / far < 5.0  # 1/θ²: 4


def test_a_halo_is_as_wide_at_every_size() -> None:
    small, large = with_glare(spot(128), 0.1), with_glare(spot(512), 0.1)
    for share in (0.0625, 0.125, 0.25):
        of_small = small[64, 64 + int(share * 128), 1]
        assert of_small == pytest.approx(large[256, 256 + int(share * 512), 1], rel=0.05)


def test_light_beyond_the_border_does_not_come_back() -> None:
    rgb = np.zeros((64, 96, 3), np.float32)
    rgb[0, 0] = 1.0
    shown = with_glare(rgb, 0.5)
    assert shown[-1, -1].max() < 1e-2 * shown[8, 8].max()


@pytest.mark.parametrize(("before", "after"), [({}, {"glare": 0.2}), ({"antialias": False}, {"antialias": True})])
def test_only_pictures_to_look_at_have_either(tmp_path: Path, before: dict[str, Any], after: dict[str, Any]) -> None:
    rgb = drawn(beam(0.31, (16.0, 16.0, 16.0)))[0]
    for suffix in (".png", ".npy", ".exr"):
        write_image(tmp_path / f"a{suffix}", rgb, **before)
        write_image(tmp_path / f"b{suffix}", rgb, **after)
        a, b = (read_image(tmp_path / f"{name}{suffix}").rgb for name in "ab")
        assert np.array_equal(a, b) == (suffix != ".png")
        assert suffix == ".png" or np.array_equal(a, rgb)


GREY = np.full((9, 16, 3), 0.5, np.float32)


def run(exposure: AutoExposure, picture: np.ndarray, start_s: float, seconds: float) -> list[float]:
    """Exposures of every frame at 60 Hz."""
    return [exposure.follow(lambda: picture, start_s + i / 60, 1 / 60) for i in range(int(60 * seconds))]


def test_first_picture_is_exposed_at_once() -> None:
    assert AutoExposure().follow(lambda: GREY, 0.0, 1 / 60) == pytest.approx(auto_exposure(GREY))


def test_a_brighter_picture_is_followed_smoothly_and_then_stands_still() -> None:
    exposure = AutoExposure()
    before = run(exposure, GREY, 0.0, 1.0)[-1]
    values = np.array(run(exposure, 8 * GREY, 1.0, 4.0))
    assert np.abs(np.diff(values, prepend=before)).max() < 0.25  # stops a frame: no jump
    assert values[-1] == pytest.approx(before - 3.0, abs=ARRIVED_EV)
    assert not exposure.is_moving
    assert len(set(values[-30:])) == 1


def test_noise_is_not_followed() -> None:
    exposure = AutoExposure()
    before = run(exposure, GREY, 0.0, 0.5)[-1]
    assert set(run(exposure, GREY * 2 ** (0.5 * DEADBAND_EV), 1.0, 2.0)) == {before}


def test_black_is_waited_for_and_another_scene_taken_at_once() -> None:
    exposure = AutoExposure()
    assert exposure.follow(lambda: 0 * GREY, 0.0, 1 / 60) == 0.0
    assert exposure.follow(lambda: GREY, 2 * MEASURE_S, 1 / 60) == pytest.approx(auto_exposure(GREY))
    exposure.restart()
    assert exposure.follow(lambda: 4 * GREY, 2.1 * MEASURE_S, 1 / 60) == pytest.approx(auto_exposure(4 * GREY))
