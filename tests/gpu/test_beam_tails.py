"""Beams too weak to be followed: photons carry them on, and nothing is lost or counted twice."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import plane
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.trace import Batch
from spectrasplat.render import pass_rounds
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.photon_records import NoRecords, RoundOf

from tests.unit.scene_texts import load

PHOTONS = 60_000
# Seven times as large as what GPU space holds as it is.
STONE = """
[camera]
position = [0.0, -30.0, 20.0]
[render]
max_depth = 24
[[lights]]
{light}
spectrum = {spectrum}
[[objects]]
name = "stone"
shape = "brilliant"
diameter = 7.0
glass = "diamond"
rotation_deg = [168.0, 8.0, 11.0]
position = [0.0, 0.0, 7.0]
[[objects]]
name = "table"
shape = "plane"
width = 80.0
height = 80.0
material = "diffuse"
{more}
"""
BEAM = 'kind = "collimated"\nposition = [-8.4, 5.6, 35.0]\ntarget = [0.0, 0.0, 7.0]\nradius = 3.2'
LAMP = 'kind = "spot"\nposition = [-4.2, 2.8, 21.0]\ntarget = [0.0, 0.0, 7.0]\nhalf_angle_deg = 10.0'
LINES = "{ lines = [[435.8, 1.0], [546.1, 2.0]] }"
BALL = '[[objects]]\nname = "ball"\nshape = "sphere"\nradius = 2.0\nglass = "N-BK7"\nposition = [25.0, 0.0, 2.0]'


def convex_stone(facets: int) -> Mesh:
    """The hull of points on a Fibonacci spiral: V points in general position give 2 V - 4 triangles."""
    k = np.arange(facets // 2 + 2)
    z, turn = 1.0 - (2.0 * k + 1.0) / len(k), k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    points = 0.5 * np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    triangles = ConvexHull(points).simplices
    a, b, c = (points[triangles[:, i]] for i in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) > 0.0
    return Mesh(f"{facets} facets", points, np.where(outward[:, None], triangles, triangles[:, ::-1]))


def scene_of(mesh: Mesh) -> Scene:
    """A stone of diamond, tilted, in a narrow beam above a table."""
    turned, raised = np.eye(4), np.eye(4)
    for axes, angle in (((1, 2), 0.21), ((0, 2), 0.13)):
        step = np.eye(4)
        step[np.ix_(axes, axes)] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        turned = step @ turned
    raised[2, 3] = 1.0
    lamp = CollimatedLight("lamp", illuminant("D65"), position=(0.0, 0.0, 4.0), direction=(0.0, 0.0, -1.0), radius=0.4)
    return Scene(
        name=mesh.name,
        camera=Camera((0.0, -6.0, 4.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        lights=(lamp,),
        objects=(
            SceneObject("stone", mesh, Dielectric(find("diamond")), raised @ turned),
            SceneObject("table", plane(30.0, 30.0), Diffuse((0.8, 0.8, 0.8)), np.eye(4)),
        ),
    )


def stone(folder: Path, light: str = BEAM, spectrum: str = '"D65"', more: str = "") -> Scene:
    return load(folder, STONE.format(light=light, spectrum=spectrum, more=more))


class _Counted(NoRecords):
    """Counts what it is asked to keep."""

    keeps, kept = True, 0

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        self.kept += batch.photons


@contextmanager
def passed(gl, scene: Scene, method: str = "srd", seed: int = 1, photons: int = PHOTONS) -> Iterator[LightPass]:
    """A light pass that has thrown about so many photons at the whole table."""
    settings = RenderSettings(width=96, height=96, method=method, photons=photons, layer="map:table", seed=seed)
    buffers = scene_buffers(gl, scene, settings)
    light = LightPass(gl, scene, settings, buffers.features, buffers, photon_records=_Counted())
    try:
        light.prepare()
        light.begin(photons, seed)
        for _ in light.pass_steps(0, photons):
            pass
        light.finish()
        yield light
    finally:
        light.release()
        buffers.release()


def landing(light: LightPass) -> float:
    """Share of the light that lands on the table, be it outside the map."""
    tally = light.stats.tally
    return tally.ended["deposited"] / tally.emitted


def held(light: LightPass) -> float:
    """Share of that in the map."""
    return light.maps.flux() / light.stats.tally.ended["deposited"]


def coarse(light: LightPass) -> np.ndarray:
    """The table's map in blocks of eight by eight texels."""
    texels = light.maps.receiver(0)[..., :3] * light.maps.scale
    height, width = (8 * (side // 8) for side in texels.shape[:2])
    return texels[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).sum(axis=(1, 3))


@pytest.mark.slow
@pytest.mark.parametrize("light", [BEAM, LAMP], ids=["parallel", "spot"])
def test_photons_carry_what_beams_leave_in_a_scene_of_any_size(gl, tmp_path: Path, light: str) -> None:
    scene = stone(tmp_path, light)
    with passed(gl, scene, "stochastic", photons=4 * PHOTONS) as alone:
        share, in_map = landing(alone), landing(alone) * held(alone)
    with passed(gl, scene) as by_beams:
        assert by_beams.survey.only_beams and by_beams.trace.rays_traced > PHOTONS / 4
        stats, tally = by_beams.survey.beams.stats, by_beams.stats.tally
        assert 0.01 < stats.left_w / stats.entered_w < 0.7
        # What beams say they left, and what photons took up.
        assert abs(tally.carried_on) < 0.01 * stats.left_w * PHOTONS
        assert tally.roulette == pytest.approx(0.0, abs=2e-3 * tally.emitted)
        assert landing(by_beams) == pytest.approx(share, rel=5e-3)
        # What grazes the table lands beyond the map of either.
        assert landing(by_beams) * held(by_beams) == pytest.approx(in_map, rel=6e-3)


def test_more_facets_ahead_than_a_flight_keeps(gl) -> None:
    """The light is halved until each part has few enough: else all but 192 of some 500 facets would stay dark."""
    scene = scene_of(convex_stone(1000))
    with passed(gl, scene, "stochastic", photons=4 * PHOTONS) as alone:
        share = landing(alone)
    with passed(gl, scene) as by_beams:
        assert by_beams.survey.only_beams and landing(by_beams) == pytest.approx(share, rel=5e-3)
        # The map of a layer leaves out a hundredth of the light at each side.
        assert held(by_beams) == pytest.approx(1.0, abs=0.04)


def test_lines_are_carried_on_one_by_one(gl, tmp_path: Path) -> None:
    """Two lines throw what each throws alone."""
    scene, each = stone(tmp_path, spectrum=LINES), []
    (lamp,) = scene.lights
    for line in lamp.spectral_power.lines:
        only = replace(lamp, spectral_power=replace(lamp.spectral_power, lines=(line,)))
        with passed(gl, replace(scene, lights=(only,))) as alone:
            each.append(coarse(alone).sum(axis=(0, 1)))
    with passed(gl, scene) as both:
        assert both.survey.only_beams and both.trace.rays_traced > PHOTONS / 4
        assert coarse(both).sum(axis=(0, 1)) == pytest.approx(sum(each), rel=0.01)


def test_lines_over_a_continuum_go_by_photons(gl, tmp_path: Path) -> None:
    """Pieces of the continuum would hold the lines too, which are followed apart."""
    scene = stone(tmp_path)
    (lamp,) = scene.lights
    mixed = replace(lamp.spectral_power, lines=((546.1, 2.0),))
    with passed(gl, replace(scene, lights=(replace(lamp, spectral_power=mixed),))) as light:
        assert light.survey.beams is None and "continuum" in light.survey.beam_light.why_not


TANK = """
[[lights]]
kind = "point"
position = [-0.5, 0.3, 6.0]
[[objects]]
name = "water"
shape = "box"
size = [10.0, 10.0, {height}]
position = [0.0, 0.0, {middle}]
material = {{ kind = "glass", glass = "water", absorption = {{ colour = [0.3, 0.6, 0.9], distance = 1.0 }} }}
[[objects]]
name = "prism"
shape = "prism"
side = 0.6
length = 0.7
glass = "N-SF11"
position = [0.2, 0.0, 1.5]
rotation_deg = [0, 15, 0]
[[objects]]
name = "table"
shape = "plane"
width = 5.0
height = 5.0
material = "diffuse"
"""


def test_beams_whose_light_is_lost_count_of_are_left_to_photons(gl, tmp_path: Path) -> None:
    """A lamp over a tank as wide as the scene: rays through its one facet are so far from parallel that beams know the
    end of 85 % of their light. A slab of water over the table's light keeps its beams."""
    for height, middle, by_beams in ((5.0, 1.0, False), (0.1, 3.0, True)):
        with passed(gl, load(tmp_path, TANK.format(height=height, middle=middle)), photons=2000) as light:
            assert (light.survey.beams is not None) == by_beams, light.survey.beam_light.why_not
            assert by_beams or "too far from parallel" in light.survey.beam_light.why_not


def test_what_is_kept_to_be_shown_again_holds_no_tail(gl, tmp_path: Path) -> None:
    """Weak beams play roulette when they are drawn again: kept tails, 8 % of the light, would count twice."""
    with passed(gl, stone(tmp_path)) as light:
        assert light.stats.splats > 1000 and light.batches.records.kept == 0
        whole = light.maps.flux() * light.maps.scale
        light.maps.clear()
        for _ in light.beam_steps_again(float(PHOTONS)):
            pass
        light.maps.photon_weight = float(PHOTONS)
        light.finish()
        assert light.maps.flux() * light.maps.scale == pytest.approx(whole, rel=0.06)


@pytest.mark.slow
def test_rounds_of_photons_have_their_beams_together(gl, tmp_path: Path, monkeypatch) -> None:
    """Beside photons, a few rounds share a search; a pass may only be left where photons have caught up with beams."""
    monkeypatch.setattr(gl, "traits", replace(gl.traits, photon_batch=4096))
    monkeypatch.setattr(pass_rounds, "MIN_BEAM_PHOTONS", PHOTONS // 3)
    scene = stone(tmp_path, more=BALL + '\n[[lights]]\nkind = "point"\nposition = [25.0, 0.0, 20.0]')
    with passed(gl, scene) as light:
        assert light.survey.has_beams and not light.survey.only_beams
        steps = [step for step in light.pass_steps(1, PHOTONS) if step.round_done]
        stats = light.survey.beams.stats
        assert stats is not None
        searches = stats.searches / 2
        assert searches == len(steps) and 2 <= searches <= 4 and steps[-1].fraction == 1.0
        assert light.maps.scale == pytest.approx(0.5 / PHOTONS, rel=1e-6)
