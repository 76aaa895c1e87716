"""Finishes of receivers: the shaders' functions against float64, and a room of one brightness, in which nothing may be
lost or made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import finish
from spectrasplat.edit.parameters import Stage
from spectrasplat.model.environment import constant
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.rough_surfaces import coat_tables
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

from tests.gpu.camera_rig import at, horizontal

COUNT = 4000
COAT, ROUGH = ["lib/coat.glsl"], ["lib/rough_diffuse.glsl"]


def over_plane(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit vectors (count, 3) with z > 0.01."""
    v = finish.unit(rng.normal(size=(count, 3)))
    v[:, 2] = np.maximum(abs(v[:, 2]), 0.02)
    return as_f32(finish.unit(v))


def test_the_lobe_agrees_with_float64(gl) -> None:
    """Value, density of its directions and weight, alpha 1e-3 to 1: also where half vectors lie by the normal."""
    rng = np.random.default_rng(2)
    alpha, index = as_f32(10.0 ** rng.uniform(-3, 0, COUNT)), as_f32(rng.uniform(1.05, 3.0, COUNT))
    o = over_plane(rng, COUNT)
    tilt = rng.normal(size=(COUNT, 2)) * np.minimum(alpha, 0.3)[:, None]
    h = finish.unit(np.concatenate([tilt, np.ones((COUNT, 1))], axis=1))
    i = 2.0 * finish.dot(o, h)[:, None] * h - o
    keep = (i[:, 2] > 0.02) & (finish.dot(o, h) > 0.02)
    o, i, alpha, index = o[keep], as_f32(i[keep]), alpha[keep], index[keep]
    body = """
        r = coat_response(a, n, o, i);
        vec3 h = normalize(o + i);
        d = coat_direction_density(a, o, h);
        w = coat_weight(a, n, o, i, dot(o, h));
    """
    inputs = {"a": alpha, "n": index, "o": o, "i": i}
    got = evaluate(gl.ctx, COAT, body, inputs, {"r": "float", "d": "float", "w": "float"})
    half = finish.unit(o + i)
    want = finish.lobe(alpha, index, o, i)
    density = finish.density(alpha, half[:, 2]) * finish.smith_g1(alpha, o[:, 2]) / (4.0 * o[:, 2])
    weight = want / density
    # Where alpha is a thousandth, rounding of the half vector by 1e-7 is a part of it.
    slack = 2e-5 + 4e-7 / alpha
    assert (abs(got["r"] / want - 1.0) < 8 * slack).all()
    assert (abs(got["d"] / density - 1.0) < 8 * slack).all()
    assert (abs(got["w"] / weight - 1.0) < 1e-4).all()
    below = evaluate(gl.ctx, COAT, "r = coat_response(a, n, o, -i);", inputs, {"r": "float"})
    assert not below["r"].any()


def test_normals_are_drawn_as_they_are_seen(gl) -> None:
    """Shares of reflected directions in 6 × 8 cells of height and turn, by 64k points of a lattice, to 0.001; what
    draws by a roughness that is 15 % off is refused."""
    count = 1 << 16
    numbers = np.arange(count)
    points = np.stack([(numbers + 0.5) / count, (numbers * 0.6180339887498949) % 1.0], axis=1)
    directions, weights = finish.hemisphere(240, 480)
    for alpha, cosine in ((0.1, 0.9), (0.4, 0.3), (1.0, 0.6)):
        o = finish.toward(cosine)
        h = finish.unit(directions + o)
        density = finish.density(alpha, h[:, 2]) * finish.smith_g1(alpha, np.array(cosine)) / (4.0 * cosine)

        def cells(v: np.ndarray) -> np.ndarray:
            around = np.floor((np.arctan2(v[:, 1], v[:, 0]) / (2.0 * np.pi) + 0.5) * 8).astype(int) % 8
            return np.floor(np.clip(v[:, 2], 0.0, 0.999999) * 6).astype(int) * 8 + around

        expected = np.bincount(cells(directions), weights * density, 48)
        for drawn_with, passes in ((alpha, True), (1.15 * alpha, False)):
            inputs = {"u": points, "a": np.full(count, drawn_with), "o": np.broadcast_to(o, (count, 3))}
            body = "vec3 h = visible_microfacet(o, vec3(0.0, 0.0, 1.0), a, u); r = 2.0 * dot(o, h) * h - o;"
            r = evaluate(gl.ctx, COAT, body, inputs, {"r": "vec3"})["r"]
            above = r[r[:, 2] > 0.0]
            found = np.bincount(cells(above), minlength=48) / count
            off = abs(found - expected).max()
            assert (off < 1e-3) == passes, (alpha, cosine, drawn_with, off)


def test_the_rough_base_agrees_with_float64(gl) -> None:
    rng = np.random.default_rng(4)
    o, i = over_plane(rng, COUNT), over_plane(rng, COUNT)
    rgb, roughness = as_f32(rng.uniform(0.0, 1.0, (COUNT, 3))), as_f32(rng.uniform(0.02, 1.0, COUNT))
    body = "r = rough_response(c, s, o, i, o.z, i.z); a = rough_albedo(c, s, o.z);"
    inputs = {"c": rgb, "s": roughness, "o": o, "i": i}
    got = evaluate(gl.ctx, ROUGH, body, inputs, {"r": "vec3", "a": "vec3"})
    want = np.array([finish.eon(c, s, a, b) for c, s, a, b in zip(rgb, roughness, o, i, strict=True)])
    np.testing.assert_allclose(got["r"], want, atol=2e-5)
    directions, weights = finish.hemisphere(100, 120)
    for k in range(20):
        sent = finish.eon(rgb[k], roughness[k], np.broadcast_to(o[k], directions.shape), directions)
        mean = ((weights * directions[:, 2])[:, None] * sent).sum(axis=0) / np.pi
        np.testing.assert_allclose(got["a"][k], mean, atol=5e-4)


# ---- a room of one brightness ------------------------------------------------------------------

LOW, STEEP = Camera((0.0, -3.0, 0.35), (0.0, 0.0, 0.0)), Camera((0.0, -1.0, 3.0), (0.0, 0.0, 0.0))


def middle(gl, material: Diffuse, camera: Camera, spp: int = 64, lights=(), environment=None) -> np.ndarray:
    """Mean linear Rec.709 of a table's middle."""
    table = horizontal(-40, 40, -40, 40, 0.0, material, "table")
    scene = Scene("furnace", camera, lights, (table,), environment=environment)
    stage = Stage(scene, camera)
    renderer = FrameRenderer(gl, RenderSettings(16, 12, spp=spp, photons=1000), [stage])
    try:
        return renderer.run(stage)[4:8, 4:12].astype(float).mean(axis=(0, 1))
    finally:
        renderer.release()


@pytest.mark.parametrize("camera", [LOW, STEEP], ids=["low", "steep"])
@pytest.mark.parametrize(
    "finish_",
    [{"roughness": 0.0}, {"roughness": 0.25}, {"roughness": 1.0, "coat_index": 2.5}, {"diffuse_roughness": 1.0}],
    ids=["polished", "varnish", "dull", "rough"],
)
def test_a_white_finished_table_vanishes_in_a_white_room(gl, finish_: dict[str, float], camera: Camera) -> None:
    """What the coat leaves goes to the base, single scattering's loss too: nothing is lost, nothing made, to 0.3 %."""
    white = constant((1.0, 1.0, 1.0))
    found = middle(gl, Diffuse((1.0, 1.0, 1.0), **finish_), camera, environment=white)
    np.testing.assert_allclose(found, 1.0, atol=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["lens", "polarised", "stochastic", "hero", "regular-7"])
def test_a_white_coated_table_vanishes_in_every_way_of_sampling(gl, way: str) -> None:
    """With dispersive glass in view, which is seen in it: to 0.3 %, by single wavelengths to 0.8 %."""
    ball = SceneObject("ball", primitives.sphere(0.3, 2000), Dielectric(from_abbe(1.7, 20.0)), at(0.0, 1.5, 0.6))
    table = horizontal(-40, 40, -40, 40, 0.0, Diffuse((1.0, 1.0, 1.0), roughness=0.3), "table")
    camera = replace(LOW, lens_radius=0.05, focus_distance=3.0) if way == "lens" else LOW
    scene = Scene("furnace", camera, (), (ball, table), environment=constant((1.0, 1.0, 1.0)))
    scene = replace(scene, render=replace(scene.render, polarisation=way == "polarised"))
    method = way if way in ("stochastic", "hero", "regular-7") else "srd"
    stage = Stage(scene, camera)
    renderer = FrameRenderer(gl, RenderSettings(16, 12, spp=64, photons=1000, method=method), [stage])
    try:
        picture = renderer.run(stage).astype(float)
    finally:
        renderer.release()
    np.testing.assert_allclose(picture[9:].mean(axis=(0, 1)), 1.0, atol=8e-3 if method != "srd" else 3e-3)


def test_parallel_light_on_a_coat_is_the_lobe_over_the_base(gl) -> None:
    """The closed form: E (lobe + (1 − E(o)) (1 − E(i)) / (1 − mean) ρ cos / π), seen where the light is mirrored."""
    camera = Camera((0.0, -60.0, 60.0), (0.0, 0.0, 0.0), kind="orthographic", vertical_extent=0.1)
    lamp = DirectionalLight("sun", illuminant("D65").scaled_to_luminous(1.0), direction=(0.1, -0.6, -0.8))
    rho, roughness, index = 0.4, 0.4, 1.6
    found = middle(gl, Diffuse((rho,) * 3, roughness=roughness, coat_index=index), camera, 4, (lamp,))
    o = np.array([0.0, -1.0, 1.0]) / np.sqrt(2.0)
    i = finish.unit(-np.array(lamp.direction))
    alpha = roughness**2
    albedo, under = coat_tables(alpha, index, 1025)
    cosines = np.linspace(0.0, 1.0, 1025)
    base = (1.0 - np.interp(o[2], cosines, albedo)) * np.interp(i[2], cosines, under) * rho * i[2] / np.pi
    want = finish.lobe(np.array(alpha), np.array(index), o, i) + base
    np.testing.assert_allclose(found, want, rtol=2e-3)
    assert finish.lobe(np.array(alpha), np.array(index), o, i) > 0.2 * want
