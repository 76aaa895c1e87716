"""What the gizmo's frame does to objects and lights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import placing
from spectrasplat.edit.state import Selection
from spectrasplat.model.contacts import world_bounds
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.ui import gizmo

SCENE = load_scene(assets_dir() / "scenes" / "prism.toml")
PRISM, SLIT, ROOM = Selection("object", 0), Selection("light", 0), Selection("light", 1)


def turned(frame: np.ndarray, angle: float, axis: int = 2) -> np.ndarray:
    """The frame turned about one of its own axes."""
    i, j = [k for k in range(3) if k != axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return frame @ matrix


def test_a_frame_is_right_handed_and_in_the_middle() -> None:
    for selection in (PRISM, SLIT, ROOM):
        for is_local in (True, False):
            frame = placing.frame_of(SCENE, selection, is_local)
            assert frame[:3, :3] @ frame[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
            assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    assert placing.frame_of(SCENE, PRISM, True)[:3, 3] == pytest.approx(world_bounds(SCENE.objects[0]).mean(axis=0))
    assert placing.frame_of(SCENE, SLIT, False)[:3, 3] == pytest.approx(SCENE.lights[0].position)


def test_an_object_turns_about_its_middle_and_keeps_its_shape() -> None:
    before = placing.frame_of(SCENE, PRISM, False)
    delta = placing.change(before, turned(before, 0.5), "rotate")
    scene = placing.changed(SCENE, PRISM, delta)
    linear = scene.objects[0].object_to_world[:3, :3] @ np.linalg.inv(SCENE.objects[0].object_to_world[:3, :3])
    assert linear == pytest.approx(turned(np.eye(4), 0.5)[:3, :3], abs=1e-12)
    centre = before[:3, 3]
    assert (delta @ np.append(centre, 1.0))[:3] == pytest.approx(centre)
    assert scene.objects[0].mesh is SCENE.objects[0].mesh


def test_noise_of_single_precision_neither_turns_nor_scales_what_is_moved() -> None:
    before = placing.frame_of(SCENE, PRISM, True)
    after = before.copy()
    after[:3, 3] += [1.0, 2.0, 3.0]
    after[:3, :3] *= 1.0 + 1e-6
    delta = placing.change(before, after, "move")
    assert delta[:3, :3].tolist() == np.eye(3).tolist()
    assert delta[:3, 3] == pytest.approx([1.0, 2.0, 3.0])


def test_scaling_follows_the_frame_axes() -> None:
    before = turned(placing.frame_of(SCENE, PRISM, False), 0.3)
    after = before.copy()
    after[:3, 0] *= 2.0
    delta = placing.change(before, after, "scale")
    assert delta[:3, :3] @ before[:3, 0] == pytest.approx(2.0 * before[:3, 0])
    assert delta[:3, :3] @ before[:3, 1] == pytest.approx(before[:3, 1])
    crushed = before.copy()
    crushed[:3, :3] = 0.0
    assert np.linalg.det(placing.change(before, crushed, "scale")[:3, :3]) > 0.0


def test_a_slit_turns_with_its_width() -> None:
    light = SCENE.lights[0]
    before = placing.frame_of(SCENE, SLIT, True)
    moved = placing.moved_light(light, placing.change(before, turned(before, np.pi / 2), "rotate"))
    assert moved.direction == pytest.approx(light.direction)
    assert np.abs(np.asarray(moved.tangent) @ before[:3, 1]) == pytest.approx(1.0)
    assert (moved.width, moved.height) == pytest.approx((light.width, light.height))
    assert moved.position == pytest.approx(light.position)
    wide = before.copy()
    wide[:3, 0] *= 3.0
    moved = placing.moved_light(light, placing.change(before, wide, "scale"))
    assert (moved.width, moved.height) == pytest.approx((3.0 * light.width, light.height))
    disc = replace(light, shape="disc", radius=0.5, tangent=None)
    moved = placing.moved_light(disc, placing.change(before, wide, "scale"))
    assert (moved.radius, moved.tangent) == (pytest.approx(1.5), None)


def test_a_directional_light_only_turns() -> None:
    before = placing.frame_of(SCENE, ROOM, True)
    moved = placing.moved_light(SCENE.lights[1], placing.change(before, turned(before, 0.2, 0), "rotate"))
    assert moved.position == SCENE.lights[1].position
    assert np.asarray(moved.direction) @ np.asarray(SCENE.lights[1].direction) == pytest.approx(np.cos(0.2))
    assert [placing.can_do(SCENE, ROOM, op) for op in ("move", "rotate", "scale")] == [False, True, False]
    assert [placing.can_do(SCENE, SLIT, op) for op in ("move", "rotate", "scale")] == [True, True, True]
    assert not placing.can_do(SCENE, Selection(), "move") and not placing.can_do(SCENE, Selection("object", 9), "move")


@pytest.mark.parametrize("height, step", [(4.0, 0.1), (1.0, 0.02), (40.0, 1.0), (0.003, 1e-4)])
def test_snapping_steps_are_round(height: float, step: float) -> None:
    assert gizmo.move_snap(height) == pytest.approx(step)


def test_matrices_survive_the_way_through_imguizmo() -> None:
    matrix = np.arange(16.0).reshape(4, 4)
    assert gizmo._from_guizmo(gizmo._to_guizmo(matrix)).tolist() == matrix.tolist()
    # Its translation lies in elements 12 to 14, as OpenGL has it.
    shift = np.eye(4)
    shift[:3, 3] = 7.0, 8.0, 9.0
    assert gizmo._to_guizmo(shift).values[12:15].tolist() == [7.0, 8.0, 9.0]
