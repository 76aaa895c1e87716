"""Picking: the first surface under the cursor, found on the processor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit.picking import PickHit, pick, pick_in
from spectrasplat.edit.projection import View
from spectrasplat.edit.state import State
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject

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
