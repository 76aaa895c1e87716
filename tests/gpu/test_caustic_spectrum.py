"""The spectrum under the cursor in true units: the sun through a thick pane, by its closed form in lx and W/(m² nm)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit.chromaticity import colour_info
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.live_light import LiveLight
from spectrasplat.render.viewer.photon_queries import caustic_spectrum, world_photons

PANE = """
lights = [{ kind = "directional", direction = [0, 0, -1], illuminance_lx = 2700, spectrum = "A" }]
[camera]
position = [0, -6, 4]
[[objects]]
shape = "plane"
width = 6
height = 6
material = "diffuse"
[[objects]]
shape = "slab"
width = 2
height = 2
thickness = 0.4
position = [0, 0, 1]
material = { n_d = 1.6 }
"""
PHOTONS = 100_000


@pytest.fixture(scope="module", params=["srd-photons", "srd"])
def traced(gl: Context, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest):
    """By photons, and by photons that stand for beams."""
    path: Path = tmp_path_factory.mktemp("pane") / "pane.toml"
    path.write_text(PANE)
    scene = load_scene(path)
    inputs = LiveInputs(scene, scene.camera, 160, 90)
    settings = RenderSettings(width=160, height=90, batch=8192, method=request.param, editable=True)
    light = LiveLight(gl, scene, settings, 64 << 20)
    light.light_pass.prepare()
    light.light_pass.begin(PHOTONS, 1)
    assert light.light_pass.survey.has_beams == (request.param == "srd")
    for _ in light.sample(PHOTONS) if light.light_pass.survey.has_beams else light.light_pass.pass_steps(0, PHOTONS):
        pass
    yield light, inputs
    light.release()


def told(traced, place, limit: int = 10_000_000, power: float = 1.0):
    light, inputs = traced
    spectra = [each.spectral_power for each in inputs.scene.lights]
    shown = [each.scaled(power) for each in spectra]
    photons = world_photons(light, inputs, limit)
    return caustic_spectrum(photons, light.stored_weight(limit), 0, np.array(place), 0.15, spectra, shown)


def transmittance(n: float = 1.6) -> float:
    """Of a pane of two surfaces with all reflections between them: (1 − R) / (1 + R)."""
    reflectance = ((n - 1.0) / (n + 1.0)) ** 2
    return (1.0 - reflectance) / (1.0 + reflectance)


def test_lux_and_watts_of_the_sun_through_a_pane(traced) -> None:
    found = told(traced, (0.1, 0.2, 0.0))
    assert found.irradiance is not None and found.resolution_nm == pytest.approx(10.0)
    edges = np.linspace(380.0, 780.0, 41)
    expected = transmittance() * traced[1].scene.lights[0].spectral_power.binned(edges)
    np.testing.assert_allclose(found.irradiance, expected, rtol=0.08)
    assert found.irradiance.sum() == pytest.approx(expected.sum(), rel=0.03)
    told_colour = colour_info(found.wavelength_nm, found.irradiance)
    assert told_colour is not None
    assert told_colour.illuminance == pytest.approx(2700.0 * transmittance(), rel=0.03)


def test_half_the_photons_say_the_same_and_an_edited_lamp_counts(traced) -> None:
    whole, part = told(traced, (0.1, 0.2, 0.0)), told(traced, (0.1, 0.2, 0.0), limit=PHOTONS // 2)
    assert part.irradiance.sum() * part.resolution_nm == pytest.approx(
        whole.irradiance.sum() * whole.resolution_nm, rel=0.1
    )
    bright = told(traced, (0.1, 0.2, 0.0), power=3.0)
    np.testing.assert_allclose(bright.irradiance, 3.0 * whole.irradiance, rtol=1e-9)


def test_where_nothing_lands_it_is_dark(traced) -> None:
    found = told(traced, (2.5, 2.5, 0.0))
    assert found.irradiance is not None and not found.irradiance.any()


def test_few_photons_are_said_to_be_too_few(traced) -> None:
    light, inputs = traced
    photons = world_photons(light, inputs, 10_000_000)
    some = photons.chosen(np.flatnonzero(photons.receiver == 0)[::2000])
    spectra = [each.spectral_power for each in inputs.scene.lights]
    place = some.position[0]
    found = caustic_spectrum(some, 1.0, 0, place, 0.05, spectra, spectra)
    assert found.irradiance is None and found.error > 0.2
