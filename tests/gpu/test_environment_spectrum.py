"""The environment's light with its spectrum through glass: a furnace, Snell's law at every wavelength, and float64
paths of single wavelengths (`reference.gathered`), by blocks of 8 × 8 texels."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from reference.gathered import irradiance
from spectrasplat.edit.parameters import Stage
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.model.environment import constant
from spectrasplat.model.environment_light import spectral_taps
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.materials import Absorption
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.panorama_lights import with_panorama_lights
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Black, Camera, Dielectric, Diffuse, Grating, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.passes.environment_light import EnvironmentLightPass
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.frames import FrameRenderer

FLINT = from_abbe(1.7847, 25.7)
APEX_DEG, ELEVATION_DEG, HEIGHT, BLOCK = 30.0, 15.0, 0.9, 8


def window(half_azimuth_deg: float, half_elevation_deg: float, radiance: float) -> Environment:
    """One bright rectangle towards +x in a dim room."""
    height = 256
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    rgb = np.full((height, 2 * height, 3), 0.1, np.float32)
    near = np.abs(90.0 - 180.0 * v - ELEVATION_DEG) < half_elevation_deg
    rgb[near & (np.abs(360.0 * (0.5 - u)) < half_azimuth_deg)] = radiance
    return Environment(rgb, lights=True)


def scene_of(mesh: Mesh, environment: Environment, at=(0.0, 0.0, HEIGHT), tint=None, floor=(5.0, 4.0, -1.8)) -> Scene:
    glass, table = np.eye(4), np.eye(4)
    glass[:3, 3], table[0, 3] = at, floor[2]
    if environment.kind == "constant":
        glass[:3, :3] = rotation_about((0.3, 1.0, 0.2), 0.4)
    things = (
        SceneObject("glass", mesh, Dielectric(FLINT, tint), glass),
        SceneObject("floor", primitives.plane(*floor[:2]), Diffuse((0.7, 0.7, 0.7)), table),
    )
    return Scene("spectrum", Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.0)), (), things, environment=environment)


class Found(NamedTuple):
    """Of the finest window, row by row: places in the world, what comes by glass, all irradiance."""

    position: np.ndarray
    by_glass: np.ndarray
    all: np.ndarray


def found(gl: Context, scene: Scene, directions: int, finer: float = 1.0, method: str = "srd") -> Found:
    buffers = scene_buffers(gl, scene, RenderSettings(48, 32, spp=4, photons=2000, method=method))
    light = EnvironmentLightPass(gl, buffers, directions=directions, finer=finer)
    try:
        for _ in light.steps():
            pass
        own = slice(*light.places.tiles[0])
        width = int(np.ptp(light.places.texel_xy[own, 0])) + 1
        specular = light._specular(light._found(), light.asked)
        position = buffers.space.to_world(light.places.places["position"])
        return Found(*(v[own].reshape(-1, width, 3) for v in (position, specular, light.irradiance())))
    finally:
        light.release()
        buffers.release()


def prism() -> Mesh:
    return primitives.prism(APEX_DEG, 0.3, 1.2)


@pytest.mark.parametrize("mesh", [prism(), primitives.prism(60.0, 1.0, 1.0)])
def test_dispersive_glass_takes_no_light_out_of_a_furnace(gl: Context, mesh: Mesh) -> None:
    """A ball: `test_environment_light`."""
    scene = scene_of(mesh, constant((1.0, 1.0, 1.0)), (0.0, 0.0, 0.7), None, (0.02, 0.02, 0.0))
    light = found(gl, scene, 16384, 0.02).all / math.pi
    np.testing.assert_allclose(light.mean(axis=(0, 1)), 1.0, atol=1e-3)


@pytest.mark.parametrize("reflects", [False, True])
def test_a_grating_sends_an_even_sky_on_by_its_orders(gl: Context, reflects: bool) -> None:
    """A place under a wide sheet receives an even sky through it, or over it: all of order 0, and of another one those
    directions whose parts in the sheet, a disc of radius 1, are still in that disc once they are shifted by m λ / Λ."""
    sheet = Grating(1200.0, (0, 1), (0.3, 0.6), reflects=reflects)
    scene = scene_of(primitives.plane(80.0, 80.0), constant((1.0, 1.0, 1.0)), (0.0, 0.0, 0.0), None, (0.02, 0.02, 0.0))
    higher = np.eye(4)
    higher[2, 3] = 0.2
    above = replace(scene.objects[0], material=sheet, object_to_world=higher)
    scene = replace(scene, objects=(above, scene.objects[1]))
    axis = SpectralAxis.build([FLINT])
    edges_x, shares = spectral_taps(axis, 400)
    shift = np.minimum(1.2e-3 * axis.nm_of_x(0.5 * (edges_x[1:] + edges_x[:-1])), 2.0)
    common = (2.0 * np.arccos(0.5 * shift) - 0.5 * shift * np.sqrt(4.0 - shift**2)) / math.pi
    expected = 0.3 + 0.6 * (shares.sum(axis=1) * common[:, None]).sum(axis=0)
    light = found(gl, scene, 16384, 0.02).all / math.pi
    np.testing.assert_allclose(light.mean(axis=(0, 1)), expected, atol=2e-3)


def test_a_window_lands_behind_a_prism_where_snells_law_has_it(gl: Context) -> None:
    """The middle of what arrives in red, green and blue, by what each wavelength's middle ray does."""
    light = found(gl, scene_of(prism(), window(20.0, 3.0, 100.0)), 1024)
    axis = SpectralAxis.build([FLINT])
    edges_x, shares = spectral_taps(axis, 400)
    index = FLINT.index(axis.nm_of_x(0.5 * (edges_x[1:] + edges_x[:-1])))
    # From +x, tilted downwards, to the face whose normal is half the apex above the horizon; in the plane of x and z.
    incidence = math.radians(ELEVATION_DEG - 0.5 * APEX_DEG)
    inside = math.radians(APEX_DEG) - np.arcsin(math.sin(incidence) / index)
    leaves = np.arcsin(index * np.sin(inside)) - math.radians(0.5 * APEX_DEG)  # below the horizon, to −x
    through = 1.0 - _reflectance(np.arcsin(index * np.sin(inside)), inside, index)
    lands = -(HEIGHT / np.tan(leaves))
    weight = shares.sum(axis=1) * through[:, None]
    expected = (weight * lands[:, None]).sum(axis=0) / weight.sum(axis=0)
    near = np.abs(light.position[..., 1]) < 0.3
    x, glow = light.position[..., 0][near], light.by_glass[near]
    chosen = (x > lands.min() - 0.4) & (x < lands.max() + 0.4)
    middle = (glow[chosen] * x[chosen, None]).sum(axis=0) / glow[chosen].sum(axis=0)
    print(middle, expected)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(middle - middle[1], expected - expected[1], atol=0.15 * np.ptp(expected))


def _reflectance(outside: np.ndarray | float, inside: np.ndarray, index: np.ndarray) -> np.ndarray:
    a, b = np.cos(outside), np.cos(inside)
    return 0.5 * (((a - index * b) / (a + index * b)) ** 2 + ((b - index * a) / (b + index * a)) ** 2)


RED = Absorption(np.interp(VISIBLE_NM, [380.0, 560.0, 640.0, 780.0], [12.0, 8.0, 1.0, 1.0]))
CASES = {
    "prism": (scene_of(prism(), window(30.0, 5.0, 30.0)), "srd", 0.05, 0.026),
    "tinted": (scene_of(prism(), window(30.0, 5.0, 30.0), tint=RED), "srd", 0.046, 0.022),
    "single wavelengths": (scene_of(prism(), window(30.0, 5.0, 30.0)), "stochastic", 0.11, 0.14),
    "ball": (scene_of(primitives.sphere(0.4, 8000), window(30.0, 12.0, 10.0), (0.0, 0.0, 0.9)), "srd", 0.036, 0.008),
}
"""Scene, method, normalised root mean square error of blocks, largest error of a bright one's colour.

Bounds are 1.35 times (ball: 1.7) the root of the sum of three squares: of the reference's chance, by 20,000
directions against 80,000 (0.017, tinted 0.014, ball 0.009); of that of 512 directions, against 2,048 (0.024, tinted
0.025, ball 0.016, single wavelengths 0.077); and of what is left at 2,048, of first derivatives and of edges as sharp
as texels (0.023, 0.019, 0.011, 0.025). Of the colour of 14 to 29 blocks' channels, four times the standard deviation of
both (0.0065, 0.0055, 0.002, 0.034)."""


# Slow as well for the paths that they are held against, which take half a minute to compile.
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_blocks_agree_with_paths_of_single_wavelengths(gl: Context, case: str) -> None:
    scene, method, most, most_colour = CASES[case]
    light = found(gl, scene, 512, 0.5, method)
    rows, columns = (n // BLOCK for n in light.position.shape[:2])
    shown = light.by_glass[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean((1, 3))
    step_u, step_v = light.position[0, 1] - light.position[0, 0], light.position[1, 0] - light.position[0, 0]
    corners = light.position[: rows * BLOCK : BLOCK, : columns * BLOCK : BLOCK] - 0.5 * (step_u + step_v)
    bright = shown.sum(axis=2) > 0.3 * shown.sum(axis=2).max()
    sides = np.broadcast_to(BLOCK * np.array([step_u, step_v]), (bright.sum(), 2, 3))
    expected, got = irradiance(scene, corners[bright], sides, 20000), shown[bright]
    error = np.sqrt(((got - expected) ** 2).sum() / (expected**2).sum())
    colour = got / got.sum(axis=1, keepdims=True) - expected / expected.sum(axis=1, keepdims=True)
    spread = np.ptp(expected / expected.sum(axis=1, keepdims=True), axis=0).max()
    print(case, "blocks", bright.sum(), "error", error, "colour", abs(colour).max(), "of", spread)
    assert error < most and abs(colour).max() < most_colour


def test_only_dispersive_glass_has_it() -> None:
    lit = scene_of(prism(), window(30.0, 5.0, 30.0))
    plain = scene_of(prism(), Environment(lit.environment.rgb, lights=False))
    settings = RenderSettings()
    assert Features.of(lit, settings).environment_spectrum
    assert not Features.of(plain, settings).environment_spectrum


@pytest.mark.slow
@pytest.mark.parametrize("method", ["srd", "srd-photons"])
def test_a_window_is_a_light_whose_caustic_is_that_of_single_wavelengths(gl: Context, method: str) -> None:
    """A narrow window's spectrum behind a prism, by beams and by photons, seen from straight above; what else arrives
    is that of a black prism."""
    lit, size, extent, block = scene_of(prism(), window(10.0, 1.5, 300.0)), (48, 32), 1.6, 4
    camera = Camera((-0.8, 0.0, 5.0), (-0.8, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=extent)
    assert [light.kind for light in with_panorama_lights(lit).lights] == ["area"]
    lit = replace(lit, camera=camera)
    dark = replace(lit, objects=(replace(lit.objects[0], material=Black()), lit.objects[1]))
    light = np.zeros((size[1], size[0], 3))
    for scene, sign in ((lit, 1.0), (dark, -1.0)):
        stage = Stage(scene, camera)
        renderer = FrameRenderer(gl, RenderSettings(*size, spp=4, photons=10000, method=method), [stage])
        try:
            light += sign * math.pi / 0.7 * renderer.run(stage).astype(float)
        finally:
            renderer.release()
    shown = light.reshape(size[1] // block, block, size[0] // block, block, 3).mean(axis=(1, 3))
    side = block * extent / size[1]
    x, y = np.meshgrid(
        -0.8 + side * (np.arange(size[0] // block) - 0.5 * size[0] // block), side * np.arange(4, -4, -1)
    )
    corners = np.stack([x, y - side, 0.0 * x], axis=-1)
    bright = (shown.sum(axis=2) > 0.1 * shown.sum(axis=2).max()) & (x < -0.4)
    sides = np.broadcast_to(side * np.eye(3)[:2], (bright.sum(), 2, 3))
    expected, got = irradiance(lit, corners[bright], sides, 20000), shown[bright]
    error = np.sqrt(((got - expected) ** 2).sum() / (expected**2).sum())
    print(method, bright.sum(), "error", error, got.mean(axis=0) / expected.mean(axis=0))
    np.testing.assert_allclose(got.mean(axis=0), expected.mean(axis=0), rtol=0.04)
    assert error < 0.1
