"""Films whose thickness varies: Newton's rings by photons and through the camera, a draining film and a bubble against
the float64 reference.

Smallest errors these can detect: radii to 0.3 %, colours to 1 %.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.materials.coating import RADIUS
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import constant as even
from spectrasplat.model.optics.spectrum import laser
from spectrasplat.model.optics.thin_films import Film, Layer, Stack, power
from spectrasplat.model.scene import Black, Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.camera_probe import PROBE, daylight_mean, render_probe, resized, slope_sky, with_sky
from spectrasplat.stress.rigs.probe import blocks

from tests.gpu.camera_rig import at, tilted
from tests.statistical.test_rough_glass import error, shares_of

GLASS, AIR = constant(1.5), constant(1.0)
NM, RINGS, RIM = 550.0, 6, 0.9
LENS_RADIUS_UNITS = RIM**2 / (RINGS * NM)
"""R in units²/nm: rings lie at sqrt(m λ R)."""


def gap(**more) -> tuple[SceneObject, SceneObject]:
    """What is left between a lens and a plate, within a block of their glass."""
    air = Dielectric(AIR, thin=True, film_nm=0.5 * RINGS * NM, film_along=RADIUS, **more)
    block = SceneObject("block", primitives.box((2.0, 2.0, 0.4)), Dielectric(GLASS), at(0.0, 0.0, 1.0))
    return block, SceneObject("gap", primitives.disc(RIM), air, at(0.0, 0.0, 1.05))


def passed(radius: float, nm: np.ndarray) -> np.ndarray:
    """What the gap lets through at a distance from where both touch."""
    return power(Stack(GLASS, Film((Layer(AIR, radius**2 / (2.0 * LENS_RADIUS_UNITS)),)), GLASS), 1.0, nm)[1]


def stretch(picture: np.ndarray, extent: float, expected: np.ndarray, radii: np.ndarray) -> float:
    """By what factor the rings of a square picture are too wide: where they follow `expected` (N,) by `radii` best."""
    at_px = (np.arange(len(picture)) + 0.5) * extent / len(picture) - 0.5 * extent
    radius = np.hypot(*np.meshgrid(at_px, at_px))
    inside = (radius < 0.92 * RIM) & (radius > 0.15 * RIM)
    factors = np.linspace(0.96, 1.04, 161)
    found = [np.corrcoef(np.interp(radius[inside] / f, radii, expected), picture[inside])[0, 1] for f in factors]
    assert max(found) > 0.97
    return float(factors[np.argmax(found)])


def test_newtons_rings_by_photons(gl: Context) -> None:
    light = CollimatedLight("beam", laser(NM), (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), radius=0.95)
    floor = SceneObject("floor", primitives.plane(4.0, 4.0), Diffuse(), at(0.0, 0.0, -1.0))
    camera = Camera((0.0, 0.0, 0.5), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=2.0)
    scene = Scene("rings", camera, (light,), (*gap(), floor))
    settings = RenderSettings(96, 96, photons=60_000, spp=16, layer="caustic")
    radii = np.linspace(0.0, RIM, 301)
    expected = np.array([passed(r, np.array([NM]))[0] for r in radii])
    found = render(scene, settings, context=gl).rgb[..., 1]
    assert stretch(found, 2.0, expected, radii) == pytest.approx(1.0, abs=4e-3)


@pytest.mark.parametrize("polarised", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_newtons_rings_seen(gl: Context, polarised: bool) -> None:
    """Reflected white, with what both faces of the block reflect, before black."""
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=2.0)
    black = SceneObject("black", primitives.plane(4.0, 4.0), Black(), at(0.0, 0.0, -1.0))
    scene = Scene("rings", camera, (), (*gap(), black), background_rgb=(1.0, 1.0, 1.0))
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    radii = np.linspace(0.0, RIM, 301)
    between, faces = np.array([passed(r, VISIBLE_NM) for r in radii]), 2.0 * 0.04 / 0.96
    expected = daylight_mean(1.0 - 1.0 / (faces + 1.0 / between))
    picture = render_probe(gl, scene, resized(PROBE, 64, 64, 16)).picture
    assert stretch(picture[..., 1], 2.0, expected[:, 1], radii) == pytest.approx(1.0, abs=4e-3)
    middle = picture[30:34, 30:34].mean(axis=(0, 1))
    assert middle == pytest.approx(expected[radii < 0.05].mean(axis=0), abs=0.01)


def draining(**more) -> Dielectric:
    return Dielectric(constant(1.33), thin=True, film_nm=900.0, film_from_nm=30.0, film_along=(0.0, -1.0, 0.0), **more)


@pytest.mark.parametrize("polarised", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_draining_film_as_the_reference_sees_it(gl: Context, polarised: bool) -> None:
    """Tilted and stretched, with a bubble of water and a ball of glass under oil, before a sky."""
    camera = Camera((0.2, -0.3, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=22.0)
    place = at(-0.1, 0.3, 0.3) @ tilted(50.0) @ np.diag([1.0, 1.6, 1.0, 1.0])
    film = SceneObject("film", primitives.plane(1.2, 0.8), draining(), place)
    bubble = Dielectric(find("water"), thin=True, film_nm=700.0, film_from_nm=100.0, film_along=(0.6, 0.0, -0.8))
    ball = SceneObject("bubble", primitives.sphere(0.4, 5000), bubble, at(0.5, -0.4, 0.4))
    oiled = Dielectric(find("N-BK7"), film_nm=600.0, film_index=1.8, film_along=(1.0, 0.0, 0.0))
    solid = SceneObject("solid", primitives.box((0.5, 0.5, 0.5)), oiled, at(-0.6, -0.4, 0.3) @ tilted(58.0))
    scene = with_sky(film, ball, solid, camera=camera, environment=slope_sky())
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    found = render_probe(gl, scene, resized(PROBE, 24, 18, 64)).picture
    reference = cached_camera_reference(scene, 24, 18, samples=1024).rgb
    assert found.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=5e-3)
    assert np.abs(blocks(found, 6) - blocks(reference, 6)).max() < 0.03


@pytest.mark.parametrize("method", ["srd", "hero"])
def test_light_behind_a_draining_film(gl: Context, method: str) -> None:
    """White light at 50°, whose bands of colour lie on the wall that it is reflected to."""
    light = CollimatedLight("beam", even(1.0), (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), radius=0.35)
    film = SceneObject("film", primitives.plane(1.2, 1.2), draining(), tilted(50.0))
    wall = SceneObject("wall", primitives.plane(4.0, 4.0), Diffuse(), at(0.0, -2.0, 0.3) @ tilted(-90.0))
    camera = Camera((0.0, 0.0, 0.9), (0.0, -2.0, 0.3), (0.0, 0.0, 1.0), vertical_fov_deg=60.0)
    scene = Scene("drains", camera, (light,), (film, wall))
    reference = cached_reference(scene, 48, 48, photons=1_000_000).rgb
    settings = RenderSettings(48, 48, photons=40_000, spp=16, layer="caustic", tally=True, method=method)
    found = render(scene, settings, context=gl)
    assert found.rgb.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.01)
    assert error(found.rgb, reference) < 0.05 and abs(shares_of(found)["unaccounted"]) < 1e-5
