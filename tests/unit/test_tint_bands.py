"""Bands cut where glass and mirrors change a spectrum: three weights a band then follow it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import box, slab
from spectrasplat.model.materials.absorption import Absorption
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz, mirror_reflectance
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import Spectrum, blackbody, illuminant
from spectrasplat.model.scene import Mirror, Scene, SceneObject
from spectrasplat.model.tint_bands import TOLERANCE, bin_of_nm, cut_by_tints, tint_curves
from spectrasplat.stress.cases.crowds import LINES_NM, behind_the_slab
from spectrasplat.stress.rigs.scene_parts import solid, stage

WHITE = illuminant("D65")
AXES = {"wavelength": SpectralAxis.build([]), "flint": SpectralAxis.build([from_abbe(1.7, 30.0)])}
WHOLE = (0.0, 1.0)


def lines(width_nm: float, depth: float = 3.0) -> np.ndarray:
    """Transmittance (1, 401) with the lines of the stress case."""
    sigma = width_nm / np.sqrt(8.0 * np.log(2.0))
    depths = np.exp(-0.5 * ((VISIBLE_NM[:, None] - np.array(LINES_NM)) / sigma) ** 2).sum(axis=1)
    return np.exp(-depth * depths)[None]


def added(edges: np.ndarray, curve: np.ndarray, axis: SpectralAxis) -> np.ndarray:
    """What straight weights, told one band after the other, add to a curve (401,)."""
    x, drawn = axis.x_of_nm(VISIBLE_NM), np.zeros(401)
    for lo, hi in pairwise(edges):
        inside = (x >= lo) & (x <= hi)
        places = np.array([lo, 0.5 * (lo + hi), hi])
        order = np.argsort(x)
        drawn[inside] = np.interp(x[inside], places, np.interp(places, x[order], curve[order]))
    return drawn - curve


def misplaced(edges: np.ndarray, curve: np.ndarray, axis: SpectralAxis, *, signed: bool = False) -> float:
    """Share of the light that straight weights misplace; `signed`: what they add."""
    more, power = added(edges, curve, axis), WHITE.density
    return float((power * (more if signed else np.abs(more))).sum() / (power * curve).sum())


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
@pytest.mark.parametrize("width_nm", [40.0, 10.0, 5.0])
def test_bands_follow_lines(axis: SpectralAxis, width_nm: float) -> None:
    curve = lines(width_nm)
    edges = cut_by_tints(WHOLE, 1, 32, curve, WHITE, axis)
    assert 2 < len(edges) <= 33 and (np.diff(edges) > 0.0).all() and (edges[0], edges[-1]) == WHOLE
    # Even bands are what there was before.
    assert misplaced(edges, curve[0], axis) < min(0.02, 0.4 * misplaced(np.linspace(0.0, 1.0, 17), curve[0], axis))


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
@pytest.mark.parametrize("width_nm", [80.0, 20.0, 5.0])
def test_few_photons_lose_no_light(axis: SpectralAxis, width_nm: float) -> None:
    """However coarsely a tint may be told, what all of it lets through is told well."""
    curve = lines(width_nm)
    edges = cut_by_tints(WHOLE, 1, 32, curve, WHITE, axis, 0.1)
    assert len(edges) < len(cut_by_tints(WHOLE, 1, 32, curve, WHITE, axis))
    assert abs(misplaced(edges, curve[0], axis, signed=True)) < 1.5 * TOLERANCE


def brightness_of_means(edges: np.ndarray, curve: np.ndarray, light: Spectrum, axis: SpectralAxis) -> float:
    """Of what footprints draw that are so broad that all wavelengths of a band have one weight, its mean by power, as
    a share of what there is."""
    nm = np.concatenate([VISIBLE_NM, [line for line, _ in light.lines]])
    power = np.concatenate([light.density, [watts for _, watts in light.lines]])
    kept, x = np.interp(nm, VISIBLE_NM, curve), axis.x_of_nm(nm)
    luminous = power * np.interp(nm, VISIBLE_NM, cmf_xyz()[:, 1])
    drawn = 0.0
    for lo, hi in pairwise(edges):
        inside = (x >= lo) & (x < hi)
        if power[inside].sum() > 0.0:
            drawn += luminous[inside].sum() * (power * kept)[inside].sum() / power[inside].sum()
    return drawn / (luminous * kept).sum()


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
@pytest.mark.parametrize("tolerance", [0.01, 0.1])
def test_wide_footprints_are_as_bright_as_narrow_ones(axis: SpectralAxis, tolerance: float) -> None:
    """Green and red line of a lamp behind glass that takes the one and leaves the other: both had the mean of both
    where the footprints of a diamond are broad, and a scene was 4 % too bright; and the same in white light."""
    lamp = Spectrum(np.zeros(401), ((450.0, 1.0), (546.1, 2.0), (611.0, 1.5)))
    takes_green = np.exp(-1.0 / (1.0 + np.exp((VISIBLE_NM - 590.0) / 5.0)))
    for light in (lamp, WHITE):
        edges = cut_by_tints(WHOLE, 1, 32, takes_green[None], light, axis, tolerance)
        assert brightness_of_means(edges, takes_green, light, axis) == pytest.approx(
            1.0, abs=max(0.022, 0.55 * tolerance)
        )
    assert abs(brightness_of_means(np.array(WHOLE), takes_green, lamp, axis) - 1.0) > 0.03, "one band would do"


def test_what_does_not_change_needs_no_band() -> None:
    axis = AXES["flint"]
    assert cut_by_tints(WHOLE, 1, 32, np.zeros((0, 401)), WHITE, axis).tolist() == [0.0, 1.0]
    # A steep one only for the brightness of wide footprints: straight weights follow it whole.
    steep = (0.3 + 0.5 * axis.x_of_nm(VISIBLE_NM))[None]
    assert len(cut_by_tints(WHOLE, 1, 32, steep, WHITE, axis)) <= 4
    straight = (0.3 + 0.05 * axis.x_of_nm(VISIBLE_NM))[None]
    assert cut_by_tints(WHOLE, 1, 32, straight, WHITE, axis).tolist() == [0.0, 1.0]
    # Dispersion asks for five; a curve that lets nothing through says nothing.
    for curve in (straight, np.full((1, 401), 1e-9)):
        edges = cut_by_tints((0.1, 0.9), 5, 32, curve, WHITE, axis)
        assert len(edges) == 6 and np.diff(edges).max() <= 0.8 / 5 * 1.001 and edges[-1] == 0.9


def test_no_band_is_wider_than_dispersion_allows() -> None:
    edges = cut_by_tints(WHOLE, 6, 32, lines(5.0), WHITE, AXES["flint"])
    assert np.diff(edges).max() <= 1.0 / 6.0 * (1.0 + 1e-6)


def test_bands_are_spent_where_the_light_is() -> None:
    """Of two equal steps the one that the light does not reach stays as it is."""
    axis, nm = AXES["wavelength"], VISIBLE_NM
    curve = (0.5 + 0.4 * np.tanh((nm - 450.0) / 4.0) * (nm < 500.0) + 0.4 * np.tanh((nm - 700.0) / 4.0) * (nm > 600.0))[
        None
    ]
    red = Spectrum(np.where(nm > 600.0, 1.0, 0.0))
    found = axis.nm_of_x(cut_by_tints(WHOLE, 1, 32, curve, red, axis))
    assert ((found > 680.0) & (found < 720.0)).sum() >= 2 and ((found > 430.0) & (found < 470.0)).sum() == 0
    # A line is light too.
    lamp = replace(Spectrum(), lines=((450.0, 1.0), (452.0, 1.0), (455.0, 1.0)))
    found = axis.nm_of_x(cut_by_tints(WHOLE, 1, 32, curve, lamp, axis))
    assert ((found > 440.0) & (found < 460.0)).sum() >= 1


def test_as_few_as_will_do() -> None:
    """A smooth tint takes fewer bands than the sixteen that every tint once had, and one less would not do."""
    curve, axis = np.exp(-np.linspace(0.1, 1.5, 401))[None], AXES["wavelength"]
    edges = cut_by_tints(WHOLE, 1, 32, curve, WHITE, axis)
    assert len(edges) - 1 <= 4
    fewer = cut_by_tints(WHOLE, 1, len(edges) - 2, curve, WHITE, axis)
    assert misplaced(fewer, curve[0], axis) > misplaced(edges, curve[0], axis)
    assert misplaced(edges, curve[0], axis) < TOLERANCE


def test_curves_of_a_scene() -> None:
    """Glass for the lengths that light is likely to go in it, mirrors for a few reflections; nothing for grey."""
    (first, *_) = tint_curves(behind_the_slab(10.0))
    pane = slab(3.0, 3.0, 0.5)
    alpha = Absorption(np.linspace(0.1, 1.0, 401))
    glass = solid("", pane, from_abbe(1.5, 60.0))
    tinted = replace(glass, material=glass.material.changed(absorption=alpha))
    half = tint_curves(stage(tinted))[0]
    chord = 4.0 * 4.5 / 24.0
    np.testing.assert_allclose(half, np.exp(-0.5 * chord * alpha.coefficient), rtol=1e-9)
    assert first.shape == (401,)
    grow = np.diag([2.0, 2.0, 2.0, 1.0])
    twice = tint_curves(stage(replace(tinted, object_to_world=grow)))[0]
    np.testing.assert_allclose(twice, half**2, rtol=1e-9)
    assert len(tint_curves(stage(glass))) == 0

    def mirror(*rgb: float) -> Scene:
        return stage(SceneObject("mirror", box(), Mirror(rgb)))

    assert len(tint_curves(mirror(0.9, 0.9, 0.9))) == 0
    once, four_times = tint_curves(mirror(0.9, 0.6, 0.2))
    np.testing.assert_allclose(four_times, once**4)


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
def test_each_bin_that_is_kept_holds_its_own_light(axis: SpectralAxis) -> None:
    """Copper under a warm lamp: what is missed where the light is dim is nothing to all of it."""
    curve, light = mirror_reflectance((0.95, 0.6, 0.3), VISIBLE_NM), blackbody(3200.0)
    off = {}
    for bins in (None, 8):
        edges = cut_by_tints(WHOLE, 1, 32, curve[None], light, axis, 0.03, bins=bins)
        more, held = (np.bincount(bin_of_nm(8), some * light.density) for some in (added(edges, curve, axis), curve))
        off[bins] = np.abs(more / held)[held > 2e-3 * held.sum()].max()
    assert off[8] < TOLERANCE < 2.0 * TOLERANCE < off[None], off


def test_bins_are_even_and_the_last_holds_both_its_ends() -> None:
    assert np.bincount(bin_of_nm(8)).tolist() == [50] * 7 + [51]
    assert np.bincount(bin_of_nm(1)).tolist() == [401]
