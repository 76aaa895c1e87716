"""Rough mirrors and metals: their energy by quadrature over microfacets, pictures and patterns against the float64
references, which draw microfacets in another way; a polished one as the limit.

Smallest errors these can detect: shares to 0.3 %, blocks of a picture to 3 % of its mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import microfacet
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.metals import metals
from spectrasplat.model.optics.spectrum import constant, laser
from spectrasplat.model.optics.thin_films import AIR, Film, Stack, power
from spectrasplat.model.scene import Camera, Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.camera_probe import PROBE, daylight_mean, render_probe, resized, slope_sky, with_sky
from spectrasplat.stress.rigs.probe import blocks

from tests.gpu.camera_rig import at, sheets_in_a_furnace, tilted
from tests.statistical.test_rough_glass import caustic, error, shares_of


def reflected_in_all(metal: str, degrees: float, width: float) -> np.ndarray:
    """(401,): what leaves the surface after one microfacet, and of the rest as much each time."""
    light, facets, hidden = microfacet.toward(np.radians(degrees)), microfacet.grid(width), microfacet.Unhidden(width)
    facing = facets.normal @ light
    seen = facing > 0.0
    facing, normal = facing[seen], facets.normal[seen]
    met = facing / normal[:, 2] * facets.area[seen] * microfacet.unhidden(np.radians(degrees), width) / light[2]
    out = hidden(2.0 * facing * normal[:, 2] - light[2])
    leaves = float((met * out).sum())
    cosines = np.linspace(0.0, 1.0, 129)
    rows = np.ones((129, 401))
    if metal:
        stack = Stack(AIR, Film(()), metals()[metal])
        rows = np.array([power(stack, cosine, VISIBLE_NM)[0] for cosine in cosines])
    found = np.zeros(401)
    for row, weight in zip(rows, np.bincount(np.rint(128 * facing).astype(int), met * out, 129), strict=True):
        found += weight * row / (1.0 - row * (1.0 - leaves))
    return found


ROUGH = [
    *[("", 0.4, 50.0), ("", 1.0, 50.0), ("gold", 0.3, 50.0), ("copper", 1.0, 50.0)],
    *[("gold", 0.001, 85.0), ("gold", 0.1, 85.0), ("gold", 1.0, 85.0), ("gold", 1.0, 5.0)],
]


@pytest.mark.parametrize("polarised", [False, True])
def test_rough_mirrors_in_a_furnace(gl: Context, polarised: bool) -> None:
    """All that comes back of white light: of an ideal one, all."""
    sheets = [(Mirror(metal=metal, roughness=roughness), degrees) for metal, roughness, degrees in ROUGH]
    found = sheets_in_a_furnace(gl, sheets, polarised, resized(PROBE, 24, 16, 128))
    for (metal, roughness, degrees), seen in zip(ROUGH, found, strict=True):
        expected = daylight_mean(reflected_in_all(metal, degrees, max(roughness**2, 1e-4)))
        assert seen == pytest.approx(expected, rel=4e-3), (metal, roughness, degrees)


def lit(roughness: float, metal: str = "gold", turn_deg: float = 35.0, lamp: object = None) -> Scene:
    """A white beam onto a plate, and a screen beside it."""
    light = CollimatedLight("beam", lamp or constant(1.0), (0.0, 0.0, 3.0), (0.0, 0.0, -1.0), radius=0.1)
    turn = np.eye(4)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    plate = SceneObject("plate", primitives.plane(2.0, 2.0), Mirror(metal=metal, roughness=roughness), turn)
    screen = SceneObject("screen", primitives.box((8.0, 8.0, 8.0)), Diffuse())
    camera = Camera((0.0, 0.0, 0.6), (4.0, 0.0, 0.8), (0.0, 0.0, 1.0), vertical_fov_deg=80.0)
    return Scene("lit", camera, (light,), (plate, screen))


@pytest.mark.parametrize(
    ("metal", "roughness", "method"),
    [("", 0.7, "srd"), ("copper", 0.5, "srd"), ("copper", 0.0, "srd"), ("copper", 0.5, "hero")],
)
def test_photons_leave_as_their_microfacets_do(gl: Context, metal: str, roughness: float, method: str) -> None:
    found = shares_of(caustic(gl, lit(roughness, metal, lamp=laser(550.0)), 20_000, (8, 8), method=method))
    assert found["deposited"] == pytest.approx(reflected_in_all(metal, 35.0, max(roughness**2, 1e-4))[170], rel=5e-3)
    assert abs(found["unaccounted"]) < 1e-5


def test_hardly_rough_metal_is_polished(gl: Context) -> None:
    rough, polished = (caustic(gl, lit(roughness), 20_000, method="srd-photons").rgb for roughness in (0.01, 0.0))
    assert error(rough, polished) < 0.01 and rough.sum() == pytest.approx(polished.sum(), rel=3e-3)


def test_a_rough_plate_of_gold_throws_what_the_reference_does(gl: Context) -> None:
    scene = lit(0.35)
    reference = cached_reference(scene, 64, 64, photons=400_000).rgb
    found = caustic(gl, scene, 40_000).rgb
    # Footprints are part of the lobe wide: the middle is a few per cent flatter.
    assert found.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.02)
    assert error(found, reference) < 0.05
    assert error(caustic(gl, lit(0.4), 40_000).rgb, reference) > 0.2


@pytest.mark.parametrize("polarised", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_brushed_metals_as_the_reference_sees_them(gl: Context, polarised: bool) -> None:
    """Gold, copper under a film and a white ball before a sky that changes in every direction."""
    camera = Camera((0.2, -0.3, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=22.0)
    gold = SceneObject("gold", primitives.plane(0.8, 0.8), Mirror(metal="gold", roughness=0.5), tilted(40.0))
    oiled = Mirror(metal="copper", film_nm=150.0, film_index=1.5, roughness=0.6)
    copper = SceneObject("copper", primitives.box((0.5, 0.5, 0.5)), oiled, at(-0.7, 0.2, 0.5) @ tilted(58.0))
    ball = SceneObject("ball", primitives.sphere(0.3, 5000), Mirror((0.9, 0.5, 0.3), roughness=0.4), at(0.6, 0.5, 0.0))
    scene = with_sky(gold, copper, ball, camera=camera, environment=slope_sky())
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    found = render_probe(gl, scene, resized(PROBE, 24, 18, 64)).picture
    reference = cached_camera_reference(scene, 24, 18, samples=512).rgb
    assert found.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=5e-3)
    assert np.abs(blocks(found, 6) - blocks(reference, 6)).max() < 0.03


def test_the_environment_lights_by_way_of_rough_copper(gl: Context) -> None:
    """A floor beside a wall of it, against paths."""
    wall = SceneObject(
        "wall", primitives.plane(3.0, 3.0), Mirror(metal="copper", roughness=0.5), at(-1.0, 0.0, 0.0) @ tilted(90.0)
    )
    floor = SceneObject("floor", primitives.plane(1.6, 1.6), Diffuse((0.7, 0.7, 0.7)))
    camera = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=1.2)
    scene = with_sky(wall, floor, camera=camera, environment=slope_sky())
    reference = cached_camera_reference(scene, 8, 8, samples=4096).rgb.mean(axis=(0, 1))
    found = render(scene, RenderSettings(8, 8, photons=1000, spp=4), context=gl).rgb.mean(axis=(0, 1))
    assert found == pytest.approx(reference, rel=0.01)
