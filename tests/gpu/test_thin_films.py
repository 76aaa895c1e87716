"""Thin films and metals against exact integrals over the spectrum, through photons, camera and references."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.film_stacks import film_stacks
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.materials.coating import Coating, preset
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.metals import metals
from spectrasplat.model.optics.thin_films import AIR, Film, Layer, Stack, power
from spectrasplat.model.scene import Camera, Dielectric, Material, Mirror, Scene, SceneObject
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.stress.rigs.camera_probe import PROBE, daylight_mean, render_probe, resized, slope_sky, with_sky
from spectrasplat.stress.rigs.probe import blocks

from tests.gpu.camera_rig import at, shares_of_the_sun, sheets_in_a_furnace, tilted
from tests.gpu.test_thin_sheets import PATCHES

GLASS = constant(1.5)
_SILVER = Layer(metals()["silver"], 25.0)
ETALON = Coating(Film((_SILVER, Layer(constant(1.5), 20_000.0), _SILVER)))
WINDOW = Coating(Film((Layer(metals()["silver"], 15.0), Layer(constant(2.0), 60.0))))


def soap(nm: float) -> Dielectric:
    return Dielectric(constant(1.33), thin=True, film_nm=nm)


COATED = Dielectric(GLASS, coating=preset("ar"))
SHEETS = {
    "soap of 1 nm": soap(1.0),
    "soap of 400 nm": soap(400.0),
    "soap of 3000 nm": soap(3000.0),
    "soap of 0.1 mm": soap(1e5),
    "dichroic": Dielectric(GLASS, thin=True, coating=preset("dichroic-blue")),
    "silvered": Dielectric(GLASS, thin=True, coating=WINDOW),
    "etalon": Dielectric(GLASS, thin=True, coating=ETALON),
    "half": Dielectric(GLASS, thin=True, coating=preset("beam-splitter")),
}


def shares(material: Material, cosine: float) -> tuple[np.ndarray, np.ndarray]:
    """(401,) each: means over every nanometre of what it reflects and lets through."""
    scene = Scene("one", Camera((0, 0, 1), (0, 0, 0)), (), (SceneObject("one", plane(1.0, 1.0), material),))
    nm = VISIBLE_NM[:, None] + (np.arange(64) + 0.5) / 64.0 - 0.5
    reflected, passed = power(film_stacks(scene)[0][0], cosine, nm.ravel())
    return reflected.reshape(nm.shape).mean(axis=1), passed.reshape(nm.shape).mean(axis=1)


@pytest.mark.parametrize(
    ("names", "tinted", "method"),
    [(SHEETS, (), "srd"), (["soap of 400 nm"], ["sheet"], "hero"), (["silvered"], ["solid"], "stochastic-even")],
)
def test_patches_of_sun_behind_films(gl: Context, names: Iterable[str], tinted: Iterable[str], method: str) -> None:
    """Beside tinted glass without a film."""
    stands = [[SceneObject("sheet", plane(1.0, 1.0), SHEETS[name], at(0.0, 0.0, 1.5))] for name in names]
    expected = [daylight_mean(shares(SHEETS[name], 1.0)[1]) for name in names]
    for name in tinted:
        stands.append(list(PATCHES[name][0]))
        expected.append(PATCHES[name][1])
    assert shares_of_the_sun(gl, stands, method) == pytest.approx(np.array(expected), rel=0.012, abs=2e-3)


def test_a_coated_block_lets_more_through(gl: Context) -> None:
    (found,) = shares_of_the_sun(gl, [[SceneObject("block", box((1.0, 1.0, 0.2)), COATED, at(0.0, 0.0, 1.5))]])
    reflected, passed = shares(COATED, 1.0)
    assert found == pytest.approx(daylight_mean(passed**2 / (1.0 - reflected**2)), rel=3e-3)


def _faces(*reflected: np.ndarray) -> np.ndarray:
    """What faces one behind the other let through together, with all that goes to and fro between them."""
    return np.asarray(1.0 / (1.0 + sum(r / (1.0 - r) for r in reflected)))


def test_a_coating_in_water_is_one_in_water(gl: Context) -> None:
    """A coated block within another of lower rank."""
    film, water = Film((Layer(constant(2.3), 60.0),)), constant(1.33)
    around = SceneObject("water", box((1.2, 1.2, 0.4)), Dielectric(water), at(0.0, 0.0, 1.5))
    coated = Dielectric(GLASS, priority=1, coating=Coating(film))
    block = SceneObject("block", box((1.0, 1.0, 0.2)), coated, at(0.0, 0.0, 1.5))
    (found,) = shares_of_the_sun(gl, [[around, block]])
    inner, _ = power(Stack(water, film, GLASS), 1.0, VISIBLE_NM)
    outer = np.full(401, (0.33 / 2.33) ** 2)
    expected, in_air = (
        daylight_mean(_faces(outer, r, r, outer)) for r in (inner, power(Stack(AIR, film, GLASS), 1.0, VISIBLE_NM)[0])
    )
    assert found == pytest.approx(expected, rel=5e-3)
    assert abs(in_air / expected - 1.0).min() > 0.03


@pytest.mark.parametrize("polarised", [False, True])
def test_gold_behind_glass_is_paler_than_in_air(gl: Context, polarised: bool) -> None:
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.05)
    block = SceneObject("block", box((1.0, 1.0, 0.2)), Dielectric(GLASS))
    gold = SceneObject("gold", plane(0.9, 0.9), Mirror(metal="gold"))
    scene = Scene("gilt", camera, (), (block, gold), background_rgb=(1.0, 1.0, 1.0))
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    metal, _ = power(Stack(GLASS, Film(()), metals()["gold"]), 1.0, VISIBLE_NM)
    expected = daylight_mean(0.04 + 0.96**2 * metal / (1.0 - 0.04 * metal))
    assert render_probe(gl, scene, PROBE).mean == pytest.approx(expected, rel=3e-3)


METALS = Mirror(metal="gold"), Mirror(metal="aluminium", film_nm=200.0, film_index=1.5)
FILMS = (*SHEETS.values(), *METALS)


@pytest.mark.parametrize(
    ("films", "polarised", "angles"),
    [(FILMS, False, (0.0, 80.0)), (FILMS[:5], True, (50.0, 80.0)), (FILMS[5:], True, (50.0, 80.0))],
)
def test_films_in_a_furnace(gl: Context, films: tuple[Material, ...], polarised: bool, angles: tuple) -> None:
    """All that comes back of white light: all of it, but for what metal absorbs."""
    sheets = [(film, degrees) for film in films for degrees in angles]
    for (film, degrees), seen in zip(sheets, sheets_in_a_furnace(gl, sheets, polarised), strict=True):
        reflected, passed = shares(film, float(np.cos(np.radians(degrees))))
        expected = daylight_mean(reflected + (0.0 if film.is_mirror else passed))
        assert seen == pytest.approx(expected, rel=5e-3), (film, degrees)


@pytest.mark.parametrize("polarised", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_films_as_the_reference_sees_them(gl: Context, polarised: bool) -> None:
    """A soap film, a coated prism and gold before a sky that changes in every direction."""
    camera = Camera((0.2, -0.3, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=22.0)
    film = SceneObject("film", plane(1.4, 1.4), soap(350.0), at(0.0, 0.0, 0.3) @ tilted(50.0))
    coated = Dielectric(GLASS, coating=Coating(Film((Layer(constant(2.3), 60.0), Layer(metals()["gold"], 8.0)))))
    solid = SceneObject("solid", box((0.5, 0.5, 0.5)), coated, at(-0.6, 0.2, 1.0) @ tilted(58.0))
    gold = SceneObject("gold", plane(0.8, 0.8), Mirror(metal="gold", film_nm=120.0, film_index=2.0), at(0.5, -0.4, 0.7))
    scene = with_sky(film, solid, gold, camera=camera, environment=slope_sky())
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    found = render_probe(gl, scene, resized(PROBE, 24, 18, 64)).picture
    reference = cached_camera_reference(scene, 24, 18, samples=1024).rgb
    assert found.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=5e-3)
    assert np.abs(blocks(found, 6) - blocks(reference, 6)).max() < 0.03
