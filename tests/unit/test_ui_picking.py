"""What a click meets, and lines and outlines over the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.picking import PickHit, pick, pick_in
from spectrasplat.edit.projection import View
from spectrasplat.edit.state import State
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.ui.overlay import Canvas, box_corners, mixed_srgb
from spectrasplat.ui.panels.spectrum_strip import spectral_srgb
from spectrasplat.ui.session_requests import source_at
from spectrasplat.ui.viewport_marks import not_shown, outline_of

PINHOLE = Camera(position=(1.0, -6.0, 3.5), target=(0.3, 0.2, 0.0), vertical_fov_deg=28.0)
ORTHOGRAPHIC = replace(PINHOLE, kind="orthographic", vertical_extent=4.0)


def quad(half: float, z: float, material, name: str) -> SceneObject:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return SceneObject(name, make_mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]])), material)


def placed(item: SceneObject, z: float, scale: float = 1.0) -> SceneObject:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[2, 3] = z
    return replace(item, object_to_world=matrix)


def at(scene: Scene, camera: Camera, point) -> PickHit | None:
    """What is met on the way to a world point."""
    view = View.of(camera, 16 / 9)
    return pick(scene, view, *view.project(np.asarray(point, float))[0])


FLOOR = quad(12.0, 0.0, Diffuse(), "floor")
SLAB = SceneObject("slab", primitives.box((1.0, 1.0, 0.4)), Dielectric(glass.constant(1.5)))


@pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=["pinhole", "orthographic"])
@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_a_point_of_the_floor_is_found_again(camera: Camera, shift: float) -> None:
    move = np.array([shift, -shift, shift])
    floor = replace(FLOOR, mesh=make_mesh("floor", FLOOR.mesh.vertices + move, FLOOR.mesh.triangles))
    camera = replace(camera, position=tuple(np.add(camera.position, move)), target=tuple(np.add(camera.target, move)))
    point = np.array([0.5, 0.9, 0.0]) + move
    scene = Scene("test", camera, (), (floor,))
    hit = at(scene, camera, point)
    assert hit is not None and hit.position == pytest.approx(point, abs=1e-9 + 1e-12 * shift)
    assert hit.normal == pytest.approx([0, 0, 1]) and hit.is_receiver and hit.object_index == 0
    if camera.kind == "pinhole":
        assert hit.distance == pytest.approx(np.linalg.norm(point - camera.position))
    sky = View.of(replace(camera, target=tuple(np.add(camera.position, (0.0, 1.0, 1.0)))), 16 / 9)
    assert pick(scene, sky, 0.5, 0.5) is None


def test_glass_comes_first_and_paint_on_it_before_it() -> None:
    scene = Scene("test", PINHOLE, (), (placed(SLAB, 0.7), FLOOR))
    first = at(scene, PINHOLE, (0.0, 0.0, 0.9))
    assert first is not None and (first.object_index, first.is_receiver) == (0, False)
    assert first.position == pytest.approx([0, 0, 0.9])
    painted = replace(scene, objects=(*scene.objects, quad(0.2, 0.9, Diffuse(), "paint")))
    assert at(painted, PINHOLE, (0.0, 0.0, 0.9)).object_index == 2  # type: ignore[union-attr]
    inside = replace(PINHOLE, position=(0.0, 0.0, 0.7), target=(0.2, 0.1, 0.0))
    assert pick(scene, View.of(inside, 1.0), 0.5, 0.5).object_index == 0  # type: ignore[union-attr]


def test_what_is_hidden_is_looked_past() -> None:
    scene = Scene("test", PINHOLE, (), (placed(SLAB, 0.7), FLOOR))
    state = State(scene, PINHOLE, hidden=frozenset({("object", "slab")}))
    place = View.of(PINHOLE, 16 / 9).project(np.array([0.0, 0.0, 0.9]))[0]
    assert pick_in(state, *place).object_index == 1  # type: ignore[union-attr]
    everything = frozenset(("object", item.name) for item in scene.objects)
    assert pick_in(replace(state, hidden=everything), *place).object_index == 0  # type: ignore[union-attr]


def test_blocks_of_triangles_find_what_all_triangles_do() -> None:
    """A closed ball of shuffled facets: every ray inside its outline meets it, where the sphere is."""
    ball = primitives.sphere(1.0, triangles=20_480)
    shuffled = np.random.default_rng(1).permutation(ball.triangles)
    item = placed(SceneObject("ball", make_mesh("ball", ball.vertices, shuffled), Diffuse()), 0.5, 2.0)
    scene, view = Scene("test", PINHOLE, (), (item,)), View.of(PINHOLE, 16 / 9)
    for x, y in np.random.default_rng(2).random((200, 2)):
        origin, direction = view.ray(x, y)
        closest = np.linalg.norm(np.cross(np.array([0, 0, 0.5]) - origin, direction))
        hit = pick(scene, view, x, y)
        assert (hit is not None) == (closest < 2.0) or abs(closest - 2.0) < 0.01
        if hit is not None:
            assert np.linalg.norm(np.subtract(hit.position, (0, 0, 0.5))) == pytest.approx(2.0, abs=0.01)
            assert np.dot(hit.normal, direction) < 0.0


TABLE, LEFT_GLASS, RIGHT_GLASS, WALL = 0, 1, 2, 3


@pytest.fixture
def photons() -> dict[str, np.ndarray]:
    """Two spots on a table and one on a wall, each of its own glass; a little light of the left glass everywhere."""
    rng = np.random.default_rng(3)
    spots = [(-1.0, TABLE, LEFT_GLASS), (1.0, TABLE, RIGHT_GLASS), (0.0, WALL, RIGHT_GLASS)]
    places = [rng.normal(0, 0.05, (500, 3)) * [1, 1, 0] + [x, 0, -receiver] for x, receiver, _ in spots]
    stray = np.column_stack([rng.uniform(-2, 2, (300, 2)), np.zeros(300)])
    return {
        "position": np.concatenate([*places, stray]),
        "flux_w": np.concatenate([np.full(1500, 1.0), np.full(300, 0.05)]),
        "source": np.repeat([*(glass for *_, glass in spots), LEFT_GLASS], [500, 500, 500, 300]),
        "photon_receiver": np.repeat([*(receiver for _, receiver, _ in spots), TABLE], [500, 500, 500, 300]),
    }


@pytest.mark.parametrize(("x", "glass"), [(-1.0, LEFT_GLASS), (1.0, RIGHT_GLASS)])
def test_each_spot_belongs_to_its_glass(photons: dict[str, np.ndarray], x: float, glass: int) -> None:
    assert source_at(np.array([x, 0.02, 0.0]), TABLE, **photons) == glass


def test_photons_of_another_receiver_do_not_count(photons: dict[str, np.ndarray]) -> None:
    assert source_at(np.array([0.0, 0.0, -WALL]), WALL, **photons) == RIGHT_GLASS
    assert source_at(np.array([0.0, 5.0, -WALL]), WALL, **photons) is None


def test_light_straight_from_a_light_is_nobodys_caustic(photons: dict[str, np.ndarray]) -> None:
    photons["source"] = np.full_like(photons["source"], -1)
    assert source_at(np.array([1.0, 0.0, 0.0]), TABLE, **photons) is None


def test_stray_light_beside_a_caustic_is_none(photons: dict[str, np.ndarray]) -> None:
    assert source_at(np.array([0.0, -1.5, 0.0]), TABLE, **photons) is None


def test_no_photons() -> None:
    empty = np.zeros(0, int)
    assert source_at(np.zeros(3), TABLE, np.zeros((0, 3)), np.zeros(0), empty, empty) is None


def test_what_was_added_or_stands_elsewhere_is_not_shown_yet() -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    assert not_shown(scene, scene) == []
    matrix = scene.objects[0].object_to_world.copy()
    matrix[0, 3] += 1.0
    added = replace(scene.objects[0], name="another", object_to_world=matrix)
    assert not_shown(replace(scene, objects=(*scene.objects, added)), scene) == [added]
    assert not_shown(scene, replace(scene, objects=(added, *scene.objects[1:]))) == [scene.objects[0]]
    renamed = replace(scene.objects[0], name="renamed")
    assert not_shown(replace(scene, objects=(renamed, *scene.objects[1:])), scene) == []


def test_an_outline_goes_once_round_all_places() -> None:
    square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0), (2.0, 1.0), (1.0, 2.0)])
    outline = outline_of(square)
    assert {tuple(p) for p in outline} == {(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)}
    x, y = np.roll(outline, -1, axis=0).T, outline.T
    assert abs(float((y[0] * x[1] - x[0] * y[1]).sum())) == 24.0  # twice the area: in order
    assert len(outline_of(np.zeros((0, 2)))) == 0
    assert len(outline_of(np.ones((7, 2)))) < 3


CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=90.0)


def canvas(camera: Camera = CAMERA) -> Canvas:
    return Canvas(None, View.of(camera, 2.0), 10.0, 20.0, 400.0, 200.0)  # type: ignore[arg-type]


def test_a_visible_segment_goes_to_its_pixels() -> None:
    segments = canvas().segments(np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.5]]))
    assert segments.reshape(4) == pytest.approx([210, 120, 310, 70])


def test_what_lies_behind_is_cut_away() -> None:
    assert len(canvas().segments(np.array([[0.0, -1.0, 0.0], [1.0, -2.0, 0.5]]))) == 0
    segments, index = canvas().cut(np.array([[[0, -1.0, 0], [0, -2, 0]], [[0.1, 1.0, 0.1], [0.1, -1.0, 0.1]]]))
    assert index.tolist() == [1]
    assert np.isfinite(segments).all() and np.abs(segments).max() < 1000.0  # not the far side of the pole
    assert (segments[0, 1] - segments[0, 0]) @ [1.0, -1.0] > 0.0  # on towards where it came from: up and to the right


def test_an_orthographic_camera_sees_what_lies_behind_it() -> None:
    flat = canvas(replace(CAMERA, kind="orthographic", vertical_extent=2.0))
    assert flat.segments(np.array([[0.0, -1.0, 0.0], [1.0, -2.0, 0.5]])).reshape(4) == pytest.approx(
        [210, 120, 310, 70]
    )


def test_lines_that_leave_the_picture_keep_their_slope() -> None:
    ((start, end),) = canvas().segments(np.array([[0.0, 1.0, 0.0], [1e6, 1.0, 5e5]]))
    assert np.abs(end).max() < 1000.0
    assert (end - start)[1] / (end - start)[0] == pytest.approx(-0.5)


def test_all_wavelengths_together_are_white_and_one_is_its_own_colour() -> None:
    all_nm = tuple(np.linspace(400.0, 700.0, 9).tolist())
    assert mixed_srgb(all_nm, all_nm) == pytest.approx((1.0, 1.0, 1.0))
    assert mixed_srgb((all_nm[2],), all_nm) == pytest.approx(spectral_srgb()[round(all_nm[2]) - 380])
    red, _, blue = mixed_srgb(all_nm[6:], all_nm)
    assert red > 3.0 * blue
    assert mixed_srgb((550.0,), (550.0,)) == pytest.approx(spectral_srgb()[170])


def test_a_box_stands_as_its_object_does() -> None:
    matrix = np.diag([2.0, 1.0, 1.0, 1.0])
    matrix[:3, 3] = 5.0, 0.0, 0.0
    corners = box_corners(np.array([[0.0, 0, 0], [1, 2, 3]]), matrix)
    assert corners.min(axis=0) == pytest.approx([5, 0, 0]) and corners.max(axis=0) == pytest.approx([7, 2, 3])
