"""A light that lies on glass stands outside of it: what it sends into the glass is reflected and refracted there like
any other light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.beams import light_beams
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.lights import AreaLight, PointLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Diffuse, Light, Scene, SceneObject
from spectrasplat.model.scene_checks import contains
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render
from spectrasplat.stress.cases.contacts import plates
from spectrasplat.stress.rigs.probe import SMALL, probe
from spectrasplat.stress.rigs.scene_parts import BEAM, solid, stage, turn

TOP = 1.0
HEIGHTS = (0.0, 1e-7)
"""Above the glass; float32 knows its places to 1e-7."""
SETTINGS = RenderSettings(width=32, height=18, photons=4096, spp=1, layer="caustic")
WHITE = illuminant("D65").scaled_to_luminous(10.0)


def on_block(light: Light) -> Scene:
    return stage(solid("block", box((1.6, 1.6, 0.6)), constant(1.5, "n 1.5"), (0.0, 0.0, TOP - 0.3)), lights=[light])


def beam_at(height: float) -> Scene:
    return on_block(replace(BEAM, position=(0.0, 0.0, TOP + height), radius=0.3))


@pytest.mark.parametrize("method", ["srd", "srd-photons"])
@pytest.mark.parametrize("height", HEIGHTS)
def test_a_beam_from_the_face_of_a_plate_passes_both_faces(gl, method: str, height: float) -> None:
    tally = render(beam_at(height), replace(SETTINGS, method=method), context=gl).stats.light.tally
    assert tally.ended["deposited"] / tally.emitted == pytest.approx(plates(1.5), abs=2e-3)


@pytest.mark.parametrize("method", ["srd", "srd-photons"])
def test_a_point_on_a_face_lights_what_one_just_above_does(gl, method: str) -> None:
    landed = []
    for height in (1e-5, 0.0):
        scene = on_block(PointLight("lamp", WHITE, (0.1, 0.1, TOP + height)))
        ended = render(scene, replace(SETTINGS, method=method), context=gl).stats.light.tally.ended
        assert ended["lost_depth"] < 1e-3 * ended["deposited"]
        landed.append(ended["deposited"])
    # So few beams know it to some per cent; a lamp that shines within the glass as well lands a fifth more.
    assert landed[1] == pytest.approx(landed[0], rel=0.05)


@pytest.mark.parametrize("method", ["srd", "srd-photons"])
def test_a_beam_from_the_underside_of_a_plate_passes_both_faces(gl, method: str) -> None:
    """As from its top: which way a face looks makes a light on it neither inside nor outside."""
    block = solid("block", box((1.6, 1.6, 0.6)), constant(1.5, "n 1.5"), (0.0, 0.0, 1.5))
    up = replace(BEAM, position=(0.0, 0.0, 1.5 - 0.3), direction=(0.0, 0.0, 1.0), radius=0.3)
    place = np.eye(4)
    place[2, 3] = 3.0
    scene = stage(block, lights=[up], table=SceneObject("ceiling", plane(20.0, 20.0), Diffuse(), place))
    tally = render(scene, replace(SETTINGS, method=method), context=gl).stats.light.tally
    assert tally.ended["deposited"] / tally.emitted == pytest.approx(plates(1.5), abs=2e-3)


@pytest.mark.parametrize("turned", [0.0, 25.0])
def test_a_point_on_any_face_is_outside_and_one_below_it_inside(turned: float) -> None:
    item = solid("block", box((1.6, 1.2, 0.6)), constant(1.5, "n 1.5"))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn((1.0, 0.4, 0.2), turned), (0.1, -0.2, 1.7)
    item = replace(item, object_to_world=matrix)
    for axis, half in enumerate((0.8, 0.6, 0.3)):
        for side in (-1.0, 1.0):
            for depth, inside in ((0.0, False), (1e-6, True), (-1e-6, False)):
                local = np.array([0.11, 0.07, 0.05])
                local[axis] = side * (half - depth)
                assert contains(item, matrix[:3, :3] @ local + matrix[:3, 3]) == inside, (axis, side, depth)


@pytest.mark.parametrize(("height", "radius", "by_beams"), [(0.48, 0.3, False), (0.5, 0.3, True), (0.4, 0.1, True)])
def test_maps_hold_what_lands_of_a_lamp_near_a_face(gl, height: float, radius: float, by_beams: bool) -> None:
    """A panel half a unit above a block drew 11 % more by beams than landed: where the light was cut in halves, and
    along the sides of a cube, was taken for an edge with a penumbra. Penumbrae of nearer ones are wider still."""
    scene = on_block(AreaLight("panel", WHITE, (0.0, 0.0, TOP + height), (0.0, 0.0, -1.0), radius=radius))
    found, photons = (
        probe(gl, scene, replace(SMALL, method=method, layer="caustic", photons=20_000))
        for method in ("srd", "srd-photons")
    )
    assert (found.stats.polygons_w > 0.0) == by_beams
    # Penumbrae of edges that stand on the table, told from rays that leave other places of a face, made it 1.6e-3.
    assert found.map_error < 6e-4
    assert found.picture.sum() == pytest.approx(photons.picture.sum(), rel=0.01)


def test_the_tail_of_glass_without_dispersion_stays_in_the_bands_of_photons(gl, monkeypatch) -> None:
    """Beams from an area light close to a face end with corners that rounding decides; a band halved for that had no
    photons to carry it."""
    monkeypatch.setattr(light_beams, "is_near_facets", lambda *_: False)
    scene = on_block(AreaLight("panel", WHITE, (0.0, 0.0, TOP + 1e-3), (0.0, 0.0, -1.0), radius=0.3))
    result = render(scene, replace(SETTINGS, photons=1024), context=gl)
    tally = result.stats.light.tally
    # What photons carried less what beams left: chance decides its sign.
    assert np.isfinite(result.rgb).all() and 0.0 < abs(tally.carried_on) < 0.2 * tally.emitted


def test_halves_of_a_beam_hold_no_more_than_the_whole(gl) -> None:
    """With sweeps as fine as for 200,000 photons halves of one of a lamp's beams had lost edges that bounded them, and
    6 % more light ended than was emitted."""
    scene = on_block(AreaLight("panel", WHITE, (0.0, 0.0, TOP + 0.4), (0.0, 0.0, -1.0), radius=0.1))
    found = probe(gl, scene, replace(SMALL, layer="caustic", photons=200_000))
    assert sum(found.shares.values()) == pytest.approx(1.0, abs=3e-3)
    assert found.map_error < 1e-3
