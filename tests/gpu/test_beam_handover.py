"""Light handed over by beams: photons that meet a beam's object first end there, and pieces go on as photons would."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.features import Features
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.beam_emission import BeamEmission
from spectrasplat.render.light_pass import LightPass, RoundOf, spectral_axis

from tests.reference.first_events import first_events

PHOTONS = 60_000
SCENE = """
[camera]
position = [0.5, -4.0, 3.0]
target = [0.8, 0.0, 0.0]
[[lights]]
kind = "directional"
direction = [0.75, 0.1, -0.6]
illuminance_lx = 100.0
[[objects]]
name = "glass"
shape = "{shape}"
material = {{ glass = "N-SF11" }}
position = [0.0, 0.0, 1.2]
[[objects]]
name = "table"
shape = "plane"
width = 12.0
height = 12.0
material = "diffuse"
{more}
"""
BALL = """
[[objects]]
name = "ball"
shape = "sphere"
radius = 0.5
material = { glass = "N-BK7" }
position = [1.6, 0.1, 0.6]
"""


def scene_of(tmp_path: Path, more: str = "", shape: str = "prism") -> Scene:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.format(shape=shape, more=more))
    return load_scene(file)


@contextmanager
def light_of(gl, scene: Scene, beams: bool, photons: int = PHOTONS, **settings) -> Iterator[LightPass]:
    chosen = RenderSettings(width=96, height=96, photons=photons, layer="map:table", **settings)
    features = replace(Features.of(scene, chosen), beams=beams)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    light = LightPass(gl, scene, chosen, features, buffers)
    try:
        light.prepare()
        light.begin(photons, chosen.seed)
        if beams:
            light.plans = [replace(plan, beam_objects=(0,)) for plan in light.plans]
        yield light
    finally:
        light.release()
        buffers.release()


def emission_of(light: LightPass, two_events: bool, bands: int = 4) -> BeamEmission:
    spans = [(band.x_lo, band.x_hi) for band in light.plans[0].bands]
    edges = np.linspace(spans[0][0], spans[-1][1], bands + 1)
    pieces = first_events(light.buffers, light.domains[0], 0, edges, two_events)
    return BeamEmission(light.buffers, light.trace.ray, pieces, [spans])


def hand_over(light: LightPass, emission: BeamEmission, count: int, first: int = 0, stride: int = 1) -> None:
    arguments = (0, count, float(PHOTONS), (123456789, 987654321), 77, light.trace.batch, first, stride)
    for rays in emission.batches(*arguments):
        for _ in light.batch_steps(light.trace.carry_on(rays, 0), RoundOf(0, 0, 1, True)):
            pass


def map_of(light: LightPass) -> np.ndarray:
    light.finish()
    return light.resolved_map(0) * light.map_scale


def test_what_meets_a_beams_object_first_is_left_to_it(gl, tmp_path: Path) -> None:
    ended = {}
    for beams in (False, True):
        with light_of(gl, scene_of(tmp_path, BALL), beams) as light:
            # Pilots say where light lands, whoever carries it.
            ended["pilot", beams] = light.pilots[0].whole
            for _ in light.pass_steps(0, PHOTONS):
                pass
            tally = light.stats.tally
            assert tally.imbalance < 1e-4
            ended[beams] = {name: flux / tally.emitted for name, flux in tally.ended.items()}
            sources = np.frombuffer(light.trace.photons.read(), light.trace.photon.dtype)["light_and_source"] >> 16
            ended["sources", beams] = set(np.unique(sources[: light.stats.splats]).tolist())
    assert np.array_equal(ended["pilot", False], ended["pilot", True])
    assert ended[False]["beams"] == 0.0 and ended["sources", False] >= {0, 2}
    # A sun's lattice over glass and ball: the prism's silhouette, 1 by 1 seen from there, is its share.
    assert 0.3 < ended[True]["beams"] < 0.9 and 0 not in ended["sources", True]
    assert ended[True]["direct"] == pytest.approx(ended[False]["direct"], rel=1e-6)
    assert 0.0 < ended[True]["deposited"] < ended[False]["deposited"]


@pytest.mark.parametrize("shape", ["prism", "box"])
@pytest.mark.parametrize("two_events", [False, True])
def test_pieces_go_on_as_photons_would(gl, tmp_path: Path, two_events: bool, shape: str) -> None:
    scene = scene_of(tmp_path, BALL, shape)
    pictures = []
    for seed in (1, 2):
        with light_of(gl, scene, False, seed=seed) as light:
            for _ in light.pass_steps(0, PHOTONS):
                pass
            pictures.append(map_of(light))
    with light_of(gl, scene, True) as light:
        for _ in light.pass_steps(0, PHOTONS):
            pass
        left = light.stats.tally.ended["beams"]
        emission = emission_of(light, two_events)
        assert emission.flux_w(0) * PHOTONS == pytest.approx(left, rel=5e-3)
        hand_over(light, emission, PHOTONS)
        tally = light.stats.tally
        assert tally.handed == pytest.approx(emission.flux_w(0) * PHOTONS, rel=1e-3)
        assert tally.imbalance < 1e-4 and tally.ended["lost_numeric"] < 1e-3 * left
        pictures.append(map_of(light))
    one, two, handed = pictures
    assert handed.sum(axis=(0, 1)) == pytest.approx(one.sum(axis=(0, 1)), rel=5e-3)
    noise = np.sqrt(np.sum((one - two) ** 2, axis=(0, 1)) / np.sum(one**2, axis=(0, 1)))
    error = np.sqrt(np.sum((handed - one) ** 2, axis=(0, 1)) / np.sum(one**2, axis=(0, 1)))
    print(noise, error)
    assert np.all(error < 1.3 * noise)
