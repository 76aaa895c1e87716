"""Light handed over by beams: photons that meet a beam's object first end there, and pieces go on as photons would."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.beams.polygons import joined
from spectrasplat.features.features import Features
from spectrasplat.gpu.records import FLAG_INSIDE, NONE
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import constant, laser
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.beam_emission import BeamEmission
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.light_plan import Division
from spectrasplat.render.photon_records import RoundOf

from tests.reference.first_events import diverging_first_event, first_events

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
radius = {radius}
material = {{ glass = "N-BK7", priority = 2 }}
position = {position}
"""
BESIDE, WITHIN = BALL.format(radius=0.5, position=[1.6, 0.1, 0.6]), BALL.format(radius=0.2, position=[0.0, 0.0, 1.1])


def scene_of(tmp_path: Path, more: str = "", shape: str = "prism") -> Scene:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.format(shape=shape, more=more))
    return load_scene(file)


@contextmanager
def light_of(
    gl, scene: Scene, beams: bool, bands: int = 1, photons: int = PHOTONS, seed: int = 1
) -> Iterator[LightPass]:
    """A light pass that is begun, with at least `bands` bands; with `beams` it leaves the first object to them."""
    settings = RenderSettings(width=96, height=96, photons=photons, layer="map:table", seed=seed, batch=1 << 17)
    features = replace(Features.of(scene, settings), beams=beams)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    light = LightPass(gl, scene, settings, features, buffers, division=Division({0: (bands, 1)}))
    try:
        light.prepare()
        light.begin(photons, seed)
        if beams:
            light.plans = [replace(plan, beam_objects=(0,)) for plan in light.plans]
        yield light
    finally:
        light.release()
        buffers.release()


def run(light: LightPass, photons: int = PHOTONS) -> None:
    for _ in light.pass_steps(0, photons):
        pass


def map_of(light: LightPass) -> np.ndarray:
    light.finish()
    return light.resolved_map(0) * light.map_scale


def emission_of(light: LightPass, two_events: bool) -> BeamEmission:
    """First events of the prism, in the bands of the light's plan."""
    spans = [(band.x_lo, band.x_hi) for band in light.plans[0].bands]
    edges = np.array([spans[0][0], *(hi for _, hi in spans)])
    pieces = first_events(light.buffers, light.survey.domains[0], 0, edges, two_events)
    return BeamEmission(light.buffers, light.trace.ray, pieces, [spans])


def hand_over(light: LightPass, emission: BeamEmission, count: int, first: int = 0, stride: int = 1) -> None:
    arguments = (0, count, float(PHOTONS), (123456789, 987654321), 77, light.trace.batch, first, stride)
    for rays in emission.batches(*arguments):
        for _ in light.batches.handed(rays, 0, RoundOf(0, first, stride, True), light.deposit(0)):
            pass


def difference(picture: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """nRMSE of each channel."""
    return np.sqrt(np.sum((picture - reference) ** 2, axis=(0, 1)) / np.sum(reference**2, axis=(0, 1)))


def test_what_meets_a_beams_object_first_is_left_to_it(gl, tmp_path: Path) -> None:
    found: dict[bool, tuple] = {}
    for beams in (False, True):
        with light_of(gl, scene_of(tmp_path, BESIDE), beams) as light:
            light.survey.beam_light = None  # what beams throw themselves is not looked at here
            run(light)
            tally = light.stats.tally
            assert tally.imbalance < 1e-4
            photons = np.frombuffer(light.trace.photons.read(), light.trace.photon.dtype)[: light.stats.splats]
            sources = set(np.unique(photons["light_and_source"] >> 16).tolist())
            emitted = tally.emitted + tally.left_to_beams
            shares = {name: flux / emitted for name, flux in tally.ended.items()}
            shares["beams"] = tally.left_to_beams / emitted
            # Pilots say where light lands, whoever carries it.
            found[beams] = light.survey.pilots[0].whole, sources, shares
    assert np.array_equal(found[False][0], found[True][0]) and len(found[True][0])
    assert found[False][1] == {0, 2} and found[True][1] == {2}
    before, after = found[False][2], found[True][2]
    assert before["beams"] == 0.0 and after["direct"] == pytest.approx(before["direct"], rel=1e-6)
    # The lattice lies over prism and ball.
    assert 0.3 < after["beams"] < 0.9
    assert sum(after.values()) == pytest.approx(1.0, abs=0.02)
    assert after["deposited"] < 0.7 * before["deposited"]


def test_records_say_where_a_piece_is(gl, tmp_path: Path) -> None:
    """Facet, side and medium: what keeps a ray from meeting the surface it starts on, and what it goes through."""
    more = WITHIN + BALL.format(radius=0.3, position=[4.0, 0.0, 0.5]).replace('"ball"', '"apart"')
    with light_of(gl, scene_of(tmp_path, more), True) as light:
        buffers = light.buffers
        all_corners = [buffers.space.to_gpu(mesh.corners()) for mesh in buffers.world_meshes]
        for triangle, number in enumerate(buffers.primitives.tolist()):
            item = int(np.searchsorted(buffers.first_triangle, triangle, side="right")) - 1
            corners = all_corners[item][triangle - buffers.first_triangle[item]]
            if item == 0:
                normal, offset = np.split(buffers.geometry.solids.planes[number & 0x7FFFFFFF].astype(float), [3])
                assert number >> 31 and corners @ normal == pytest.approx(float(offset[0]), abs=1e-6)
            elif item in buffers.geometry.curved.own:
                face = buffers.geometry.curved.faces[number & 0x3FFFFFFF]
                assert number >> 30 == 1 and np.abs(face.distance(corners)).max() < 1e-6
            else:
                assert buffers.geometry.triangles.order[number] == triangle
        emission = emission_of(light, False)
        (rays,) = emission.batches(0, 500, 1.0, (0, 0), 5, 10_000)
        planes = buffers.geometry.solids.planes[rays["last_primitive"] & 0x7FFFFFFF]
        off = np.einsum("ij,ij->i", rays["position"], planes[:, :3]) - planes[:, 3]
        assert np.abs(off).max() < 1e-6 and np.all(rays["last_object"] == 0) and np.all(rays["depth"] == 1)
        inward = np.einsum("ij,ij->i", rays["direction"], planes[:, :3]) < 0.0
        assert np.all((rays["flags"] == FLAG_INSIDE) == inward) and set(rays["flags"].tolist()) == {0, FLAG_INSIDE}
        prism_bit = 1 << buffers.stack_objects.index(0)
        assert np.all(rays["inside_mask"] == np.where(inward, prism_bit, 0)) and np.all(rays["inside_object"] == NONE)
        # A solid that stands alone is no bit of the mask.
        alone = replace(emission.pieces, inside=np.full(len(emission.pieces), 1 << 3, np.uint64))
        spans = [(band.x_lo, band.x_hi) for band in light.plans[0].bands]
        (rays,) = BeamEmission(buffers, light.trace.ray, alone, [spans]).batches(0, 500, 1.0, (0, 0), 5, 10_000)
        assert np.all(rays["inside_object"] == 3) and not rays["inside_mask"].any()


def test_beams_need_their_programs(gl, tmp_path: Path) -> None:
    with light_of(gl, scene_of(tmp_path), False) as light:
        light.plans = [replace(plan, beam_objects=(0,)) for plan in light.plans]
        with pytest.raises(ValueError, match="made without them"):
            run(light)


@pytest.mark.parametrize(
    ("two_events", "shape", "more"),
    [
        pytest.param(False, "prism", BESIDE, id="entered"),
        pytest.param(True, "prism", BESIDE, id="left", marks=pytest.mark.slow),
        pytest.param(True, "box", BESIDE, id="box"),
        pytest.param(False, "prism", WITHIN, id="ball within", marks=pytest.mark.slow),
    ],
)
def test_pieces_go_on_as_photons_would(gl, tmp_path: Path, two_events: bool, shape: str, more: str) -> None:
    """Against many more photons, pieces miss no more than as many photons of the emission lattice do."""
    scene, bands = scene_of(tmp_path, more, shape), 4
    with light_of(gl, scene, False, bands, 8 * PHOTONS, seed=3) as light:
        run(light, 8 * PHOTONS)
        reference = map_of(light)
    with light_of(gl, scene, False, bands) as light:
        run(light)
        alone = map_of(light)
    with light_of(gl, scene, True, bands) as light:
        run(light)
        left = light.stats.tally.left_to_beams
        emission = emission_of(light, two_events)
        assert emission.flux_w(0) * PHOTONS == pytest.approx(left, rel=5e-3)
        hand_over(light, emission, PHOTONS)
        tally = light.stats.tally
        assert tally.handed == pytest.approx(emission.flux_w(0) * PHOTONS, rel=1e-3)
        assert tally.imbalance < 1e-4 and tally.ended["lost_numeric"] < 1e-3 * left
        assert 0.7 * PHOTONS < light.trace.rays_traced < 12 * PHOTONS
        handed = map_of(light)
    # A ball within throws light far over the map's edge.
    assert handed.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.02 if more == WITHIN else 3e-3)
    print(difference(handed, reference), difference(alone, reference))
    assert np.all(difference(handed, reference) < 1.4 * difference(alone, reference))


def test_pieces_of_light_that_diverges(gl, tmp_path: Path) -> None:
    """Eight hundred pieces of a point light."""
    scene = scene_of(tmp_path, BESIDE)
    lamp = PointLight("lamp", constant(1.0), position=(-2.4, -0.3, 3.0))
    scene = replace(scene, lights=(lamp,))
    maps = []
    for seed, photons in ((1, PHOTONS), (3, 8 * PHOTONS)):
        with light_of(gl, scene, False, 2, photons, seed) as light:
            run(light, photons)
            maps.append(map_of(light))
    with light_of(gl, scene, True, 2) as light:
        run(light)
        spans = [(band.x_lo, band.x_hi) for band in light.plans[0].bands]
        edges = np.array([spans[0][0], *(hi for _, hi in spans)])
        pieces = diverging_first_event(light.buffers, light.survey.domains[0], 0, edges, 10)
        emission = BeamEmission(light.buffers, light.trace.ray, pieces, [spans])
        assert emission.flux_w(0) * PHOTONS == pytest.approx(light.stats.tally.left_to_beams, rel=5e-3)
        hand_over(light, emission, PHOTONS)
        handed = map_of(light)
    alone, reference = maps
    print(len(pieces), difference(handed, reference), difference(alone, reference))
    assert handed.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=3e-3)
    assert np.all(difference(handed, reference) < 1.4 * difference(alone, reference))


def test_a_pass_may_come_in_sub_lattices(gl, tmp_path: Path) -> None:
    """Five rounds in small batches give the picture that one gives."""
    scene, maps = scene_of(tmp_path, BESIDE), []
    for rounds in (1, 5):
        with light_of(gl, scene, True, 2) as light:
            run(light)
            emission = emission_of(light, True)
            for first in range(rounds):
                hand_over(light, emission, PHOTONS, first, rounds)
            assert light.stats.tally.handed == pytest.approx(emission.flux_w(0) * PHOTONS, rel=2e-3)
            maps.append(map_of(light))
    assert np.all(difference(maps[1], maps[0]) < 0.01)


def test_a_laser_has_one_index(gl, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BESIDE)
    (sun,) = scene.lights
    scene = replace(scene, lights=(replace(sun, spectral_power=laser(532.0)),))
    with light_of(gl, scene, False) as light:
        run(light)
        alone = map_of(light)
    with light_of(gl, scene, True) as light:
        run(light)
        emission = emission_of(light, True)
        assert np.all(emission.pieces.x_lo == emission.pieces.x_hi)
        hand_over(light, emission, PHOTONS)
        handed = map_of(light)
    assert handed.sum(axis=(0, 1)) == pytest.approx(alone.sum(axis=(0, 1)), rel=3e-3)
    assert np.all(difference(handed, alone) < 0.03)


def test_what_no_table_has_is_refused(gl, tmp_path: Path) -> None:
    with light_of(gl, scene_of(tmp_path), True) as light:
        pieces = first_events(light.buffers, light.survey.domains[0], 0, np.array([0.25, 0.75]), False)
        line = replace(pieces, x_lo=pieces.x_hi)
        # A light's only line stands for all of its spectrum, where bands may be cut.
        alone = BeamEmission(light.buffers, light.trace.ray, line, [[(0.0, 1.0)]])
        (rays,) = alone.batches(0, 500, 1.0, (0, 0), 5, 10_000)
        assert not rays["x_lo"].any() and np.all(rays["x_hi"] == 1.0) and np.all(rays["x_anchor"] == 0.75)
        # A line in a band whose photons carry it has no photons of its own.
        both = BeamEmission(light.buffers, light.trace.ray, joined([pieces, line]), [[(0.0, 1.0)]])
        assert len(both.pieces) == len(pieces) and both.flux_w(0) > 0.0
        light.buffers.features = replace(light.features, spectral_groups=0, band_cuts=False)
        with pytest.raises(ValueError, match=r"no spectral table of light 0 has the band 0\.75"):
            BeamEmission(light.buffers, light.trace.ray, line, [[(0.0, 1.0)]])
