"""Picking: the surface under the cursor, and the receiver that is seen through glass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.camera_rays import camera_frame
from spectrasplat.model.features import Features
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Mirror,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.pick import Picker
from spectrasplat.render.device_scene import spectral_axis

SIZE = (160, 90)
PINHOLE = Camera(position=(1.0, -6.0, 3.5), target=(0.3, 0.2, 0.0), vertical_fov_deg=28.0)
ORTHOGRAPHIC = replace(PINHOLE, kind="orthographic", vertical_extent=4.0)
SCENES = Path(__file__).parents[2] / "assets" / "scenes"


@contextmanager
def picking(gl, scene: Scene) -> Iterator[Picker]:
    features = Features.of(scene, RenderSettings())
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    picker = Picker(gl, buffers)
    try:
        yield picker
    finally:
        picker.release()
        buffers.release()


def quad(half: float, z: float, material, name: str) -> SceneObject:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return SceneObject(name, make_mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]])), material)


def place_of(camera: Camera, point) -> tuple[float, float]:
    """Where a world point is in the picture, by the textbook."""
    right, up, forward = camera_frame(camera)
    way = np.asarray(point, float) - camera.position
    half = (
        0.5 * camera.vertical_extent
        if camera.kind == "orthographic"
        else np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * (way @ forward)
    )
    return 0.5 + 0.5 * (way @ right) / half * SIZE[1] / SIZE[0], 0.5 - 0.5 * (way @ up) / half


FLOOR = quad(12.0, 0.0, Diffuse(), "floor")
SLAB = SceneObject("slab", primitives.box((1.0, 1.0, 0.4)), Dielectric(glass.constant(1.5)))


def lifted(item: SceneObject, z: float) -> SceneObject:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return replace(item, object_to_world=matrix)


@pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=["pinhole", "orthographic"])
@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_a_point_of_the_floor_is_found_again(gl, camera: Camera, shift: float) -> None:
    move = np.array([shift, -shift, shift])
    floor = replace(FLOOR, mesh=make_mesh("floor", FLOOR.mesh.vertices + move, FLOOR.mesh.triangles))
    camera = replace(camera, position=tuple(np.add(camera.position, move)), target=tuple(np.add(camera.target, move)))
    point = np.array([0.5, 0.9, 0.0]) + move
    with picking(gl, Scene("test", camera, (), (floor,))) as picker:
        hit = picker.pick(camera, *SIZE, *place_of(camera, point))
        assert hit is not None
        assert hit.position == pytest.approx(point, abs=1e-4 + 1e-6 * shift)
        assert hit.normal == pytest.approx([0, 0, 1])
        assert hit.is_receiver and hit.object_index == 0
        assert picker.pick_receiver(camera, *SIZE, *place_of(camera, point)) == hit
        if camera.kind == "pinhole":
            assert hit.distance == pytest.approx(np.linalg.norm(point - camera.position), rel=1e-5)
        sky = replace(camera, target=tuple(np.add(camera.position, (0.0, 1.0, 1.0))))
        assert picker.pick(sky, *SIZE, 0.5, 0.5) is None
        assert picker.pick_receiver(sky, *SIZE, 0.5, 0.5) is None


def test_glass_comes_first_and_what_is_seen_through_it_second(gl) -> None:
    scene = Scene("test", PINHOLE, (), (lifted(SLAB, 0.7), FLOOR))
    x, y = place_of(PINHOLE, (0.0, 0.0, 0.9))  # the slab's upper face
    with picking(gl, scene) as picker:
        first = picker.pick(PINHOLE, *SIZE, x, y)
        seen = picker.pick_receiver(PINHOLE, *SIZE, x, y)
    assert (first.object_index, first.is_receiver) == (0, False)
    assert first.position == pytest.approx([0, 0, 0.9], abs=1e-4)
    assert (seen.object_index, seen.is_receiver) == (1, True)
    # Through a plane-parallel slab the ray goes on, moved sideways as Snell's law has it.
    direction = np.subtract(first.position, PINHOLE.position) / first.distance
    sine_i = np.linalg.norm(direction[:2])
    level = direction[:2] / sine_i
    inside = 0.4 * np.tan(np.arcsin(sine_i / 1.5))
    outside = 0.5 * sine_i / abs(direction[2])
    assert seen.position[:2] == pytest.approx((inside + outside) * level, abs=1e-4)
    assert seen.position[2] == pytest.approx(0.0, abs=1e-6)
    assert seen.distance > first.distance


def test_a_receiver_is_seen_in_a_mirror(gl) -> None:
    ceiling = quad(12.0, 4.0, Diffuse(), "ceiling")
    scene = Scene("test", PINHOLE, (), (quad(2.0, 0.0, Mirror(), "mirror"), ceiling))
    with picking(gl, scene) as picker:
        x, y = place_of(PINHOLE, (0.0, 0.0, 0.0))
        assert picker.pick(PINHOLE, *SIZE, x, y).object_index == 0
        seen = picker.pick_receiver(PINHOLE, *SIZE, x, y)
    assert seen.object_index == 1
    assert seen.position == pytest.approx([-4.0 / 3.5, 4.0 * 6.0 / 3.5, 4.0], abs=1e-3)
    assert seen.normal == pytest.approx([0, 0, -1])


def test_a_camera_inside_glass_still_picks(gl) -> None:
    inside = Camera(position=(0.0, 0.0, 0.7), target=(0.2, 0.1, 0.0))
    scene = Scene("test", inside, (), (lifted(SLAB, 0.7), FLOOR))
    with picking(gl, scene) as picker:
        assert picker.pick(inside, *SIZE, 0.5, 0.5).object_index == 0
        assert picker.pick_receiver(inside, *SIZE, 0.5, 0.5).object_index == 1


def test_objects_of_a_real_scene_are_picked_where_they_are(gl) -> None:
    scene = load_scene(SCENES / "default.toml")
    with picking(gl, scene) as picker:
        for index, item in enumerate(scene.objects[:2]):
            middle = (item.mesh.vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]).mean(axis=0)
            assert picker.pick(scene.camera, *SIZE, *place_of(scene.camera, middle)).object_index == index
