"""The search for beams keeps its books, whatever threads and seed; polygons stand for round lamps and cones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.beam_scenes import PRISM, lamp
from reference.beam_worlds import Rig, scene_of
from spectrasplat.base.generators import finished
from spectrasplat.base.paths import assets_dir
from spectrasplat.beams.facets import BeamScene, beam_scene
from spectrasplat.beams.find import Emission, Search, search
from spectrasplat.beams.leaves import Leaves
from spectrasplat.beams.light_beams import LIGHT_PARTS, BeamFinder, parts_for
from spectrasplat.beams.search import LEAF_PIECE, LEAF_RECEIVER, NARROWEST, SUM_ENTERED, SUM_NUMERIC, SUM_ROULETTE
from spectrasplat.beams.sources import RIM, _places, emissions
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.stress.cases.chains import kept as books_of
from spectrasplat.stress.rigs.gpu_paths import beam_light, extruded, glass, placed

from tests.unit.scene_texts import load

BK7 = glass("N-BK7")


@pytest.fixture(scope="module")
def stone() -> tuple[BeamScene, Emission]:
    """The brilliant and its narrow beam."""
    scene = load_scene(assets_dir() / "scenes" / "brilliant.toml")
    meshes = [o.mesh.transformed(o.object_to_world) for o in scene.objects]
    axis = SpectralAxis.build([o.material.dispersion for o in scene.objects if o.material.dispersion])
    frames = {0: (meshes[1].vertices.mean(axis=0), np.eye(3)[:2])}
    beams = beam_scene(scene, meshes, frames, axis, 1.0)
    beams.facets["texel"] = 1e-3
    return beams, emissions(scene.lights[0], beams, lambda p: np.asarray(p, float), 1.0, axis, 1)[0]


def fluxes(stone: tuple[BeamScene, Emission], seed: int, threads: int) -> tuple[np.ndarray, np.ndarray]:
    beams, emission = stone
    [(leaves, sums)] = search(beams, [(emission, Search(1e-3, seed, 96, 1e-3))], threads)
    return np.concatenate([part.leaf["flux"] for part in leaves]), sums


def test_what_enters_ends_somewhere(stone: tuple[BeamScene, Emission]) -> None:
    # At one index: bands are counted by their middles.
    scene, emission = stone
    single = replace(emission, lines=(0.4,), line_shares=(1.0,), is_continuous=False)
    _, sums = fluxes((scene, single), 1, 1)
    assert sums[SUM_ENTERED] > 0.0
    assert sums[: SUM_ROULETTE + 1].sum() == pytest.approx(sums[SUM_ENTERED], rel=1e-6)


@pytest.mark.parametrize("path", ["assets/scenes/brilliant.toml", "integrations/peers/scenes/brilliant.toml"])
def test_faint_light_moves_with_its_wavelength(path: str) -> None:
    """What is too faint to be halved stood still with the light of all its band: bright patches where nothing is, 3 %
    of what a tilted stone under a near spotlight casts."""
    rig = Rig(load_scene(assets_dir().parent / path))
    found = Leaves.joined(rig.find(rig.emissions()[0], 1e-3)[0])
    leaf, line = found.leaf, found.edge["line"]
    moves = np.zeros(len(leaf), bool)
    np.logical_or.at(moves, np.repeat(np.arange(len(leaf)), leaf["edges"]), (line[:, 0] != line[:, 2]).any(axis=1))
    stands = (leaf["kind"] == LEAF_RECEIVER) & ~moves & (leaf["depth"] > 1)
    assert (leaf["x"][stands, 2] - leaf["x"][stands, 0] <= NARROWEST).all()
    assert leaf["flux"][stands].sum() < 1e-3 * leaf["flux"][leaf["kind"] == LEAF_RECEIVER].sum()


@pytest.mark.parametrize("angle_rad", [1e-5, 1e-8])
def test_what_lies_ahead_of_a_grazed_facet_is_no_coat_on_it(angle_rad: float) -> None:
    """The floor was taken for one: a sliver of the light left the glass through no facet."""
    block = placed("block", extruded("block", np.array([(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)])), BK7)
    assert books_of([block], beam_light((0.1, 0.0, 2.0), (angle_rad, 0.0, -1.0), 0.4), angle_rad, "").broken() == []


PANE = """
[camera]
position = [3.5, -4.5, 1.7]
target = [1.2, 0.0, 0.5]
[[lights]]
kind = "{kind}"
position = [-3.0, 0.0, 4.0]
intensity_cd = 80000
[[objects]]
name = "pane"
shape = "box"
size = [0.004, 0.4, 0.6]
position = [0.0, 0.0, 1.5]
material = {{ glass = "N-BK7", absorption = {{ colour = [0.2, 0.3, 0.9], distance = 0.004 }} }}
[[objects]]
name = "floor"
shape = "plane"
width = 12.0
height = 12.0
material = "diffuse"
"""


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_light_that_is_caught_in_a_tinted_pane_ends_finite(tmp_path: Path, kind: str) -> None:
    """What is absorbed to 1e-320 in the middle of its band had an infinite slope: NaN round a blue window pane."""
    scene = load(tmp_path, PANE.format(kind=kind))
    meshes = [o.mesh.transformed(o.object_to_world) for o in scene.objects]
    axis = SpectralAxis.build([scene.objects[0].material.dispersion])
    beams = beam_scene(scene, meshes, {0: (np.zeros(3), np.eye(3)[:2])}, axis, 1.0)
    beams.facets["texel"] = 1e-3
    for emission in emissions(scene.lights[0], beams, lambda p: np.asarray(p, float), 1.0, axis, 1):
        found = Leaves.joined(search(beams, [(emission, Search(3e-7, 1, 96, 1e-3))])[0][0]).leaf
        assert len(found) and (found["density"][:, 1] < 1e-300).any()
        assert np.isfinite(found["slope"]).all() and np.isfinite(found["density"]).all()


def test_all_light_in_a_pane_meets_one_of_its_sides() -> None:
    """Half-planes of edges that light meets inside glass are straight to second order only for directions of the right
    lengths: with those of the light outside, 0.2 % met no side, and floors had lines 1.7 times too bright."""
    text = """
[camera]
position = [0, -6, 5]
target = [0, 0, 0]
[[lights]]
kind = "point"
position = [0.6, 0.3, 1.6]
intensity_cd = 1000
[[objects]]
name = "pane"
shape = "box"
size = [2.4, 2.4, 0.1]
position = [0, 0, 1]
material = { n_d = 1.5 }
"""
    rig = Rig(scene_of(text), texel=0.016)
    sums = sum(rig.find(emission, 1e-5)[1] for emission in rig.emissions())
    assert 0.0 <= sums[SUM_NUMERIC] < 3e-4 * sums[SUM_ENTERED]


def test_threads_do_not_matter(stone: tuple[BeamScene, Emission]) -> None:
    one, sums = fluxes(stone, 1, 1)
    two, sums_of_two = fluxes(stone, 1, 2)
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(sums, sums_of_two)


@pytest.mark.parametrize("other", [2, 3])
def test_seeds_next_to_each_other_play_other_roulettes(stone: tuple[BeamScene, Emission], other: int) -> None:
    first, _ = fluxes(stone, 1, 2)
    second, _ = fluxes(stone, other, 2)
    assert first.shape != second.shape or not np.allclose(first, second)


def test_leaves_keep_their_own_edges_and_corners(stone: tuple[BeamScene, Emission]) -> None:
    every = Leaves.joined(search(stone[0], [(stone[1], Search(1e-3, 1, 96, 1e-3))], 1)[0][0])
    keep = np.arange(len(every.leaf)) % 3 == 1
    some = every.where(keep)
    for name, rows, kept in (("edges", every.edge, some.edge), ("corners", every.corner, some.corner)):
        by_leaf = np.split(rows, np.cumsum(every.leaf[name])[:-1])
        np.testing.assert_array_equal(kept, np.concatenate([by_leaf[i] for i in np.flatnonzero(keep)]))
    assert len(every.leaf) > 3 and len(some.leaf) == keep.sum()
    parts = [every.where(keep), every.where(~keep)]
    assert Leaves.joined(parts).leaf["flux"].sum() == pytest.approx(every.leaf["flux"].sum())
    assert len(Leaves.joined([]).leaf) == len(Leaves.joined([]).corner) == 0


@pytest.mark.parametrize("count", [4, 16, 64])
def test_places_on_a_lamp_have_its_middle_and_its_variance(count: int) -> None:
    """With the variance of the disc that stands for each of them: a quarter of the radius squared along every axis."""
    places = _places(count)
    np.testing.assert_allclose(places.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(places.T @ places / count + np.eye(2) / (4.0 * count), np.eye(2) / 4.0, atol=1e-12)
    assert np.linalg.norm(places, axis=1).max() < 1.1
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + 9.0 * np.eye(count)
    assert apart.min() > 1.0 / np.sqrt(count)


RADIUS, HALF_ANGLE = 0.31, 14.0
AREA, OUTSIDE, INSIDE = 1e-9, 1e-3, 5e-4
"""Relative: of the area; of the radius, to either side of the circle."""
ROUND = {
    "aperture": (lamp((-1.2, 0.3, 2.5), (0.5, -0.1, -0.8), (RADIUS,)), RADIUS),
    "cone": (
        lamp((-1.2, 0.3, 2.5), (0.5, -0.1, -0.8), (), "spot", f"half_angle_deg = {HALF_ANGLE}\nsoftness = 0.0"),
        np.tan(np.radians(HALF_ANGLE)),
    ),
}


def corners_of(limits: np.ndarray) -> np.ndarray:
    """Where each half-plane's line l0 + l1 u + l2 v = 0 crosses the next one's, (n, 2)."""
    pairs = zip(limits, np.roll(limits, -1, axis=0), strict=True)
    return np.array([np.linalg.solve(np.stack([a[1:], b[1:]]), [-a[0], -b[0]]) for a, b in pairs])


def across(rig: Rig, emission, q: np.ndarray) -> np.ndarray:
    """Places q (n, 2) of a lamp's emission as places across it, about its axis: at its own plane, or one unit away."""
    source, light = emission.source[0], rig.scene.lights[0]
    right, up, forward = light.axes().T
    offset = q[:, :1] * source["right"] + q[:, 1:] * source["up"]
    if light.is_parallel:
        from_place = source["origin"] + offset - np.array(light.position)
    else:
        from_place = source["forward"] + offset
        from_place /= (from_place @ forward)[:, None]
    return np.column_stack([from_place @ right, from_place @ up])


@pytest.mark.parametrize("kind", ROUND)
def test_a_round_lamp_is_a_polygon_of_its_area_within_a_thousandth_of_its_radius(kind: str) -> None:
    text, radius = ROUND[kind]
    rig = Rig(scene_of(text + PRISM))
    (emission,) = rig.emissions()
    corners = across(rig, emission, corners_of(emission.limits))
    u, v = corners.T
    area = 0.5 * abs(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1)))
    assert len(corners) == RIM
    assert area == pytest.approx(np.pi * radius**2, rel=AREA)
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    farthest, nearest = np.linalg.norm(corners, axis=1).max(), np.linalg.norm(middles, axis=1).min()
    assert radius * (1.0 - INSIDE) < nearest < radius < farthest < radius * (1.0 + OUTSIDE)


WINDOW = lamp((-600.0, 0.0, 1800.0), (1.0, 0.0, -3.0), (40.0, 400.0), "area")
"""As a window of a panorama becomes: 1.2° by 12°, far away."""
STAND = """
[[objects]]
name = "stand"
shape = "box"
size = [{size}, {size}, 0.2]
position = [0.2, 0.0, 0.3]
material = "diffuse"
"""
PANE_ABOVE = """
[[objects]]
name = "pane"
shape = "box"
size = [0.5, 0.8, 0.02]
position = [0.0, 0.0, 1.0]
glass = "N-BK7"
"""


MIRROR_BEHIND_BAR = """
[[objects]]
name = "mirror"
shape = "box"
size = [0.02, 0.8, 0.5]
position = [0.01, 0.0, 1.0]
material = "mirror"
[[objects]]
name = "bar"
shape = "box"
size = [1.0, 3.0, 1e-3]
position = [-0.667, 0.0, 1.5]
material = "black"
"""


@pytest.mark.parametrize(
    ("text", "middle", "ends"), [(PANE_ABOVE, 1.0, [1.0, 1.0]), (MIRROR_BEHIND_BAR, 1.125, [1.25, 1.5])]
)
def test_penumbrae_of_a_far_window_are_as_wide_as_it_is_seen(text: str, middle: float, ends: list[float]) -> None:
    """Rays of its other points were taken to be straight about a place as far from the glass as these points are from
    each other: penumbrae forty times too wide, which held back a tenth of the light. Edges of what stands before a
    mirror were taken for the mirror's own: up to a million times too wide."""
    rig = Rig(scene_of(WINDOW + text))
    parts = rig.emissions(parts=16)
    leaves, _ = rig.find(parts[len(parts) // 2], 1e-2)
    found = Leaves.joined(leaves)
    strongest = int(found.leaf["flux"].argmax())
    edges = found.edge[found.leaf["edges"][:strongest].sum() :][: found.leaf["edges"][strongest]]
    across = np.abs(edges["line"][:, 1, :2] @ rig.beams.facets["frame"][found.leaf["facet"][strongest], 1:])[:, 1] > 0.9
    # A part is half of the lamp's width and an eighth of its length; its light falls slantwise from such heights.
    slant = np.hypot(600.0, 1800.0) / 1800.0
    assert len(parts) == 16 and across.any() and not across.all()
    assert edges["soft"][across] == pytest.approx(middle * 10.0 / 1897.4 * slant, rel=0.05)
    assert edges["soft"][~across] == pytest.approx(np.array(ends) * 200.0 / 8.0 / 1897.4 * slant**2, rel=0.05)


BALL_BEFORE_PANE = """
[[objects]]
name = "ball"
shape = "sphere"
radius = 0.03
position = [0.7, 0.0, 2.5]
glass = "N-BK7"
"""


def test_what_a_ball_hides_from_some_points_of_a_lamp_is_left_to_photons_by_every_search() -> None:
    """Photons leave out what the survey's few points see past the ball; of more points some did not, and all that their
    search found was dropped: 13 % of the light of a lens and a step cut under a lamp."""
    rig = Rig(scene_of(lamp((0.0, 0.0, 4.0), (0.0, 0.0, -1.0), (2.0, 2.0), "area") + PANE_ABOVE + BALL_BEFORE_PANE))
    finder = BeamFinder(rig.scene, rig.meshes, {}, {}, rig.axis, lambda p: np.asarray(p, float), 1.0)
    found = {count: finished(finder.find(1e-2, 16, 1, count)) for count in (4, 16)}
    assert found[4].carried == found[16].carried == {0: ()}


def test_a_lamp_broader_than_the_glass_is_as_many_points_as_can_be() -> None:
    """Each point's light is a narrow picture of the glass, then, and the whole is one of the lamp: with the fewest,
    where a survey had found no polygon as wide as its penumbra, parts of it were 86 % too dark."""
    counts = []
    for size in ((1.0, 1.0), (4.0, 0.1)):
        rig = Rig(scene_of(lamp((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), size, "area") + PANE_ABOVE))
        finder = BeamFinder(rig.scene, rig.meshes, {}, {}, rig.axis, lambda p: np.asarray(p, float), 1.0)
        polygons = finished(finder.find(1e-2, 16, 1, 4)).polygons
        counts.append(parts_for(polygons.take(np.zeros(0, int)), np.zeros(0), 4, finder.broadest))
    assert counts == [LIGHT_PARTS[0], LIGHT_PARTS[-1]]


def test_a_box_ends_beams_and_its_light_is_left_to_photons() -> None:
    """Light past a box lies on the floor as it does without one, less the box's shadow; none of it goes by photons."""
    sun = 'kind = "directional"\ndirection = [0.3, 0.0, -1.0]\nilluminance_lx = 1000.0\n'
    text = "[[lights]]\n" + sun + PANE_ABOVE
    flux = []
    for more in ("", STAND.format(size=0.2), STAND.format(size=3.0)):
        rig = Rig(scene_of(text + more))
        leaf = Leaves.joined(rig.find(rig.emissions()[0], 1e-3)[0]).leaf
        flux.append([leaf["flux"][leaf["kind"] == kind].sum() for kind in (LEAF_RECEIVER, LEAF_PIECE)])
    bare, small, whole = np.array(flux)
    assert bare[1] == whole[0] == 0.0
    assert (small.sum(), whole[1]) == pytest.approx((bare[0], bare[0]), rel=1e-6)
    # Seen along the sun: the top of the small box and one of its sides.
    assert small[1] == pytest.approx(bare[0] * 0.2 * (0.2 + 0.2 * 0.3) / (0.5 * 0.8), rel=0.02)


TANK = """
[[objects]]
name = "tank"
shape = "box"
size = [2.0, 2.0, 2.0]
material = {{ glass = "water", absorption = {{ colour = [{grey}, {grey}, {grey}], distance = 1.0 }} }}
[[objects]]
name = "shade"
shape = "box"
size = [3.0, 3.0, 0.1]
position = [-1.5, 0.0, 1.5]
material = "black"
[[objects]]
name = "bed"
shape = "plane"
width = 1.8
height = 1.8
material = "diffuse"
"""


def test_water_over_a_receiver_absorbs_the_light_of_a_lamp_with_extent() -> None:
    """Beams get the edges of the facet that they left last besides their own, for penumbrae, and forgot what their last
    flight had lost: a prism in blue water under a lamp threw four times its light. 0.5 % would be noticed."""
    flux = []
    for grey in (1.0, 0.5):
        text = lamp((0.0, 0.0, 60.0), (0.0, 0.0, -1.0), (0.5, 0.5), "area") + TANK.format(grey=grey)
        rig = Rig(scene_of(text, None))
        leaf = Leaves.joined(rig.find(rig.emissions(parts=4)[0], 1e-3)[0]).leaf
        flux.append(leaf["flux"][(leaf["kind"] == LEAF_RECEIVER) & (leaf["depth"] == 1)].sum())
    assert flux[1] == pytest.approx(0.5 * flux[0], rel=5e-3) and flux[0] > 0.0
