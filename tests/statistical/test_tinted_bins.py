"""Spectral bins of light whose colour mirrors and glass change: each holds its own light, however dim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.optics.spectrum import Spectrum
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render import light_plan
from spectrasplat.render.still import render

from tests.statistical.test_hero import tinted_without_dispersion
from tests.statistical.test_reference_against_gpu import HEIGHT, WIDTH, mirrored

BINS, TOLERANCE = 8, 0.02


def light_of(gl, scene: Scene, method: str, photons: int, bins: int | None = BINS) -> np.ndarray:
    """Sums over the picture, by bin or by colour."""
    asked = RenderSettings(
        width=WIDTH, height=HEIGHT, photons=photons, method=method, layer="caustic", spp=4, bins=bins
    )
    result = render(scene, asked, context=gl)
    return (result.rgb if bins is None else result.spectral).astype(float).sum(axis=(0, 1))


def test_a_dim_bin_holds_its_own_light(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    """A copper ball under a warm lamp: the second of eight bins, a hundredth of the light, had 9 % too much of it."""
    expected = light_of(gl, mirrored(), "stochastic-even", 200_000)
    assert light_of(gl, mirrored(), "srd", 50_000) == pytest.approx(expected, rel=TOLERANCE)
    cut = light_plan.cut_by_tints
    monkeypatch.setattr(light_plan, "cut_by_tints", lambda *args: cut(*args[:-1]))
    off = np.abs(light_of(gl, mirrored(), "srd", 50_000) / expected - 1.0)
    assert off.max() > 1.5 * TOLERANCE, "bands for the whole light would do"


@pytest.mark.parametrize("bins", [pytest.param(None, marks=pytest.mark.slow), BINS])
def test_what_beams_leave_has_the_photons_bands(gl, bins: int | None) -> None:
    """A tinted pane that disperses nothing under a lamp without violet and deep red: photons' bands began where the
    lamp does and beams' at the end of the axis, and what beams left had no table."""
    scene = tinted_without_dispersion()
    power = np.where((np.arange(401) >= 60) & (np.arange(401) < 300), 0.01, 0.0)
    scene = replace(scene, lights=(replace(scene.lights[0], spectral_power=Spectrum(power)),))
    beams, photons = (light_of(gl, scene, method, 20_000, bins) for method in ("srd", "srd-photons"))
    lit = photons > 0.01 * photons.max()
    assert lit.sum() >= 3 and beams[lit] == pytest.approx(photons[lit], rel=TOLERANCE)
