"""Spectra against CIE's numbers, and the spectral coordinate against its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.optics import catalogue, colorimetry, glass
from spectrasplat.model.optics import spectrum as sp
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM
from spectrasplat.model.optics.glass import Dispersion
from spectrasplat.model.optics.spectral_tables import SpectralAxis, cumulative
from spectrasplat.model.optics.spectrum import Spectrum


def _xy(spectrum: Spectrum) -> np.ndarray:
    xyz = spectrum.xyz()
    return xyz[:2] / xyz.sum()


def test_observer_is_cie_1931() -> None:
    cmf = sp.cmf_xyz()
    assert cmf.shape == (401, 3)
    assert cmf[555 - 380] == pytest.approx([0.512050100, 1.0, 0.005749999], abs=1e-9)
    assert cmf[600 - 380] == pytest.approx([1.0622, 0.631, 0.0008], abs=1e-9)
    # CIE 15: the sum of ȳ at 1 nm over 360-830 is 106.856895; 380-780 lacks 4e-4 of it
    assert cmf[:, 1].sum() == pytest.approx(106.8569, abs=1e-3)


def test_illuminant_names() -> None:
    assert sp.illuminant("cie d65") == sp.illuminant("D65") == sp.illuminant("d 65")
    assert sp.illuminant("F12") == sp.illuminant("fl12")
    assert {"D65", "A", "E", "FL1", "FL3.15", "LED-B1", "HP5"} <= set(sp.illuminant_names())
    with pytest.raises(UserError, match="unknown illuminant 'D66', did you mean .*'D65'"):
        sp.illuminant("D66")


def test_blackbody_is_planck() -> None:
    body = sp.blackbody(2848.0)
    relative = body.density / body.density[180]
    # Illuminant A is defined by this temperature with an older radiation constant (0.27 % off).
    assert relative == pytest.approx(sp.illuminant("A").density / 100.0, rel=0.025)
    assert _xy(sp.blackbody(6500.0)) == pytest.approx([0.31352, 0.32363], abs=1e-4)
    assert sp.blackbody(5778.0).density[120] == pytest.approx(2.637e4, rel=1e-3)  # W/(sr m² nm) at 500 nm
    for bad in (0.0, -5.0, math.nan, math.inf):
        with pytest.raises(UserError, match="black body"):
            sp.blackbody(bad)


def test_power_and_lumens_of_lines() -> None:
    assert sp.laser(555.0, 2.0).luminous() == pytest.approx(2.0 * K_M, rel=1e-12)
    between = sp.laser(555.5).xyz() / K_M
    assert between == pytest.approx(sp.cmf_xyz()[175:177].mean(axis=0), rel=1e-12)
    mixed = sp.constant(0.5) + sp.laser(632.8, 3.0)
    assert mixed.power_w() == pytest.approx(0.5 * 401 + 3.0, rel=1e-14)
    assert mixed.scaled_to_power(7.0).power_w() == pytest.approx(7.0, rel=1e-14)
    assert mixed.scaled_to_luminous(800.0).luminous() == pytest.approx(800.0, rel=1e-14)
    assert mixed.scaled(2.0).lines == ((632.8, 6.0),)


def test_support() -> None:
    assert sp.constant(1.0).support_nm() == (380.0, 780.0)
    assert sp.from_table([500.0, 510.0], [1.0, 1.0]).support_nm() == (499.5, 510.5)
    assert sp.laser(632.8).support_nm() == (632.8, 632.8)
    assert (sp.laser(632.8) + sp.from_table([500.0, 510.0], [1.0, 1.0])).support_nm() == (499.5, 632.8)
    assert Spectrum().support_nm() == (380.0, 780.0)


def test_a_spectrum_is_a_value() -> None:
    one, other = sp.illuminant("D65"), sp.illuminant("D65")
    assert one == other and hash(one) == hash(other) and one != sp.illuminant("A")
    with pytest.raises(ValueError, match="read-only"):
        one.density[0] = 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Spectrum(np.full(401, np.nan)), "must be a number of 0 or more"),
        (lambda: Spectrum(np.where(np.arange(401) == 20, -1.0, 0.0)), "-1 at 400 nm"),
        (lambda: Spectrum(np.zeros(81)), "401 values"),
        (lambda: sp.laser(1064.0), "1064 nm is not visible"),
        (lambda: sp.laser(math.nan), "wavelength is nan"),
        (lambda: sp.laser(500.0, -1.0), "has power -1"),
        (lambda: sp.constant(1.0).scaled_to_power(math.nan), "power is nan"),
        (lambda: Spectrum().scaled_to_power(1.0), "holds nothing between 380 and 780 nm"),
        (lambda: sp.from_table([500.0, 400.0], [1.0, 1.0]), "400 follows 500"),
        (lambda: sp.from_table([500.0], [1.0]), "two or more"),
        (lambda: sp.from_table([400.0, 500.0], [1.0, -2.0]), "negative \\(-2\\) at 500 nm"),
    ],
)
def test_bad_spectra(make, message: str) -> None:
    with pytest.raises(UserError, match=message):
        make()


def test_rgb_matrices() -> None:
    white = colorimetry.xyz_to_rgb709(sp.illuminant("D65").scaled_to_luminous(1.0).xyz())
    assert white == pytest.approx([1.0, 1.0, 1.0], abs=1e-14)
    # IEC 61966-2-1 prints this matrix to four digits, with its white rounded.
    published = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    assert colorimetry.rgb709_to_xyz_matrix() == pytest.approx(np.array(published), abs=5e-4)
    rgb = np.random.default_rng(1).uniform(-0.2, 1.0, (5, 4, 3))
    assert colorimetry.xyz_to_rgb709(colorimetry.rgb709_to_xyz(rgb)) == pytest.approx(rgb, abs=1e-13)


def _seen_through(rgb: np.ndarray, distance: float) -> np.ndarray:
    d65 = sp.illuminant("D65")
    alpha = colorimetry.attenuation_from_colour(tuple(rgb), distance)
    assert alpha.shape == (401,) and alpha.min() >= 0.0
    return colorimetry.xyz_to_rgb709(Spectrum(d65.density * np.exp(-alpha * distance)).xyz()) / d65.luminous()


def test_attenuation_gives_the_colour_back() -> None:
    """At the distance that is named, the purest colours too; black counts as 1e-4."""
    pure = [(0.9, 0.02, 0.02), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.02, 0.9, 0.02), (0.05, 0.9, 0.9), (0.9, 0.05, 0.9)]
    for colour in [*pure, *np.random.default_rng(7).uniform(0.0, 1.0, (100, 3))]:
        np.testing.assert_allclose(_seen_through(colour, 2.5), np.maximum(colour, 1e-4), rtol=0.0, atol=1e-9)


def test_attenuation_limits() -> None:
    assert np.ptp(colorimetry.attenuation_from_colour((0.3, 0.3, 0.3), 2.0)) == 0.0
    assert colorimetry.attenuation_from_colour((0.3, 0.3, 0.3), 2.0)[0] == pytest.approx(-math.log(0.3) / 2.0)
    assert np.all(colorimetry.attenuation_from_colour((1.0, 1.0, 1.0), 2.0) == 0.0)
    assert np.all(colorimetry.attenuation_from_colour((0.5, 0.2, 1.0), math.inf) == 0.0)
    assert colorimetry.attenuation_from_colour((0.0, 0.0, 0.0), 1.0).max() == pytest.approx(-math.log(1e-4))
    for bad in (0.0, -1.0, math.nan):
        with pytest.raises(UserError, match="m.glass: attenuation distance"):
            colorimetry.attenuation_from_colour((0.5, 0.5, 0.5), bad, "m.glass")
    with pytest.raises(UserError, match="attenuation colour"):
        colorimetry.attenuation_from_colour((0.5, -0.1, 0.5), 1.0)


# ---- the spectral coordinate --------------------------------------------------------------

WAVES = np.concatenate([[380.0], np.random.default_rng(3).uniform(380.0, 780.0, 500), [780.0]])


def _wobbly() -> Dispersion:
    return glass.table([380, 450, 520, 600, 700, 780], [1.5, 1.52, 1.49, 1.5, 1.48, 1.47])


@pytest.mark.parametrize("names", [["N-BK7"], ["N-SF11", "N-SF11"], ["water", "vacuum"]])
def test_one_glass_is_affine_in_n(names: list[str]) -> None:
    glasses = [catalogue.find(name) for name in names]
    axis = SpectralAxis.build(glasses)
    n = glasses[0].index
    expected = (n(380.0) - n(WAVES)) / (n(380.0) - n(780.0))
    assert axis.affine_in_n
    assert axis.x_of_nm(WAVES) == pytest.approx(expected, abs=1e-12)


def test_without_dispersion_x_is_linear() -> None:
    axis = SpectralAxis.build([glass.constant(1.5)])
    assert not axis.affine_in_n
    assert axis.x_of_nm(WAVES) == pytest.approx((WAVES - 380.0) / 400.0, abs=1e-15)
    assert axis.nm_of_x(0.25) == 480.0


@pytest.mark.parametrize(
    ("names", "tolerance"),
    [
        (["N-BK7"], 1e-9),
        (["N-BK7", "N-SF11"], 1e-9),
        (["N-SF11", "diamond", "water"], 1e-9),
        (["diamond"], 1e-6),
        (["wobbly"], 1e-6),
    ],
)
def test_axis_is_strictly_monotone_and_inverts(names: list[str], tolerance: float) -> None:
    axis = SpectralAxis.build([_wobbly() if name == "wobbly" else catalogue.find(name) for name in names])
    x = axis.x_of_nm(np.sort(WAVES))
    assert x[0] == 0.0 and x[-1] == 1.0 and np.all(np.diff(x) > 0.0)
    assert axis.nm_of_x(axis.x_of_nm(WAVES)) == pytest.approx(WAVES, abs=tolerance)
    inner = np.linspace(0.0, 1.0, 999)
    assert axis.x_of_nm(axis.nm_of_x(inner)) == pytest.approx(inner, abs=1e-12)
    assert axis.nm_of_x(0.5).shape == () and axis.x_of_nm(np.full((2, 2), 500.0)).shape == (2, 2)


def test_turning_index_is_not_called_affine() -> None:
    assert not SpectralAxis.build([_wobbly()]).affine_in_n
    assert not SpectralAxis.build([catalogue.find("diamond")]).affine_in_n  # clamped above 760 nm


def test_tables_know_the_power_of_light_where_no_index_changes() -> None:
    """Half of the light lies where n is held at 1: the shaders' samples over x must tell it from the rest."""
    axis = SpectralAxis.build([glass.from_abbe(1.5, 1e-3)])
    running = cumulative(axis, sp.constant(1.0))
    samples = np.linspace(0.0, 1.0, 1025)
    x = axis.x_of_nm(WAVES).astype(np.float32).astype(float)
    known = np.interp(x, samples, running.at(samples)[:, 3])
    assert known == pytest.approx(running.at(axis.x_of_nm(WAVES))[:, 3], abs=1e-3 * running.values[-1, 3])


def test_index_table_interpolates_well() -> None:
    glasses = [catalogue.find("N-BK7"), catalogue.find("N-SF11"), catalogue.find("water"), glass.constant(1.3)]
    axis = SpectralAxis.build(glasses)
    table = np.array([dispersion.index(axis.nm_of_samples(1025)) for dispersion in glasses], np.float32)
    x = np.linspace(0.0, 1.0, 20011)
    for row, dispersion in zip(table, glasses, strict=True):
        interpolated = np.interp(x, np.linspace(0.0, 1.0, 1025), row.astype(np.float64))
        assert interpolated == pytest.approx(dispersion.index(axis.nm_of_x(x)), abs=2e-7)


@pytest.mark.parametrize("names", [[], ["N-BK7"], ["N-BK7", "diamond"], ["diamond"]])
def test_cumulative_keeps_all_energy(names: list[str]) -> None:
    axis = SpectralAxis.build([catalogue.find(name) for name in names])
    light = (
        sp.illuminant("D65")
        + sp.laser(380.0, 5e3)
        + sp.laser(780.0, 7e3)
        + sp.laser(550.5, 2e3)
        + sp.laser(601.23, 1e3)
    )
    running = cumulative(axis, light)
    expected = np.array([*light.xyz(), light.power_w()])
    assert np.all(np.diff(running.x) >= 0.0) and np.all(np.diff(running.values, axis=0) >= 0.0)
    assert running.at(0.0) == pytest.approx(np.zeros(4), abs=0.0)
    assert running.at(1.0) == pytest.approx(expected, rel=1e-13)
    edges = np.concatenate([[0.0], np.sort(np.random.default_rng(5).random(40)), [1.0]])
    bands = running.band(edges[:-1], edges[1:])
    assert bands.min() >= 0.0
    assert bands.sum(axis=0) == pytest.approx(expected, rel=1e-12)


def test_cumulative_cells_and_steps_are_exact() -> None:
    axis = SpectralAxis.build([catalogue.find("N-SF11")])
    density = np.zeros(401)
    density[100:103] = [1.0, 2.0, 4.0]  # 480, 481, 482 nm
    running = cumulative(axis, Spectrum(density, ((550.0, 3.0), (550.0, 1.0))))
    power = running.at(axis.x_of_nm([479.5, 480.5, 481.5, 482.5, 549.9]))[:, 3]
    assert power == pytest.approx([0.0, 1.0, 3.0, 7.0, 7.0], abs=1e-12)
    at_line = float(axis.x_of_nm(550.0))
    assert running.band(at_line - 1e-9, at_line)[3] == pytest.approx(4.0, abs=1e-12)
    assert running.band(at_line, at_line + 1e-9)[3] == pytest.approx(0.0, abs=1e-12)
    middle = 0.5 * (axis.x_of_nm(480.5) + axis.x_of_nm(481.5))
    assert running.at(middle)[3] == pytest.approx(2.0, abs=1e-12)


def test_cumulative_with_own_weights() -> None:
    weights = np.column_stack([VISIBLE_NM, np.where(VISIBLE_NM < 500.0, -1.0, 1.0)])
    light = sp.constant(2.0) + sp.laser(450.0, 3.0)
    running = cumulative(SpectralAxis.build([]), light, weights)
    assert running.at(1.0) == pytest.approx(
        [2.0 * VISIBLE_NM.sum() + 1350.0, 2.0 * weights[:, 1].sum() - 3.0], rel=1e-13
    )
