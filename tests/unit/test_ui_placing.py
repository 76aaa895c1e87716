"""Placements taken apart and put together, what the gizmo does to objects and lights, ruler and protractor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import measuring, placing
from spectrasplat.edit.lessons import lesson, lessons
from spectrasplat.edit.matrices import decompose, rotation_matrix, with_position, with_rotation, with_scale
from spectrasplat.edit.state import Selection, State
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.placement import read_placement
from spectrasplat.model.scene import Camera, Scene
from spectrasplat.ui import gizmo

SHEARED = np.array([(1.0, 0.7, 0, 3), (0, 2.0, 0.2, 4), (0.1, 0, 1.5, 5), (0, 0, 0, 1)])


@pytest.mark.parametrize(
    ("angles", "start", "end"),
    [((90, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 90, 0), (0, 0, 1), (1, 0, 0)), ((0, 0, 90), (1, 0, 0), (0, 1, 0))],
)
def test_rotations_are_right_handed(angles: tuple, start: tuple, end: tuple) -> None:
    np.testing.assert_allclose(rotation_matrix(angles) @ start, end, atol=1e-15)


def compose(position: Sequence[float], rotation_deg: Sequence[float], scale: Sequence[float]) -> np.ndarray:
    """As a scene file means them."""
    values = {"position": [*position], "rotation_deg": [*rotation_deg], "scale": [*scale]}
    return read_placement(SceneTable(values, Path("scene.toml")))


def test_decompose_undoes_what_a_scene_file_means() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        position, scale = tuple(rng.uniform(-9, 9, 3)), tuple(rng.uniform(0.01, 9, 3))
        rotation = tuple(rng.uniform((-179, -89, -179), (179, 89, 179)))
        found = decompose(compose(position, rotation, scale))
        np.testing.assert_allclose(found, [position, rotation, scale], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("y", [90.0, -90.0])
def test_looking_straight_up_loses_no_rotation(y: float) -> None:
    matrix = compose((0, 0, 0), (30.0, y, 50.0), (1, 2, 3))
    position, rotation, scale = decompose(matrix)
    assert rotation[0] == 0.0
    np.testing.assert_allclose(compose(position, rotation, scale), matrix, atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirror_shows_where_it_was_typed(axis: int) -> None:
    scale = [1.0, 2.0, 3.0]
    scale[axis] *= -1.0
    _, rotation, found = decompose(compose((0, 0, 0), (10.0, 5.0, -8.0), tuple(scale)))
    np.testing.assert_allclose(found, scale)
    np.testing.assert_allclose(rotation, (10.0, 5.0, -8.0), atol=1e-9)


def test_editing_one_part_leaves_the_others_and_the_shear() -> None:
    position, rotation, scale = decompose(SHEARED)
    moved = with_position(SHEARED, (9.0, 8.0, 7.0))
    np.testing.assert_array_equal(moved[:3, :3], SHEARED[:3, :3])
    assert decompose(moved)[0] == (9.0, 8.0, 7.0)
    turned = with_rotation(SHEARED, (10.0, 20.0, 30.0))
    np.testing.assert_allclose(decompose(turned)[1], (10, 20, 30), atol=1e-9)
    np.testing.assert_allclose(turned[:3, :3].T @ turned[:3, :3], SHEARED[:3, :3].T @ SHEARED[:3, :3], atol=1e-12)
    scaled = with_scale(SHEARED, (2.0, 2.0, 2.0))
    np.testing.assert_allclose(decompose(scaled)[2], (2, 2, 2))
    np.testing.assert_allclose(scaled[:3, :3] / np.linalg.norm(scaled[:3, :3], axis=0), SHEARED[:3, :3] / scale)
    for same in (with_position(SHEARED, position), with_rotation(SHEARED, rotation), with_scale(SHEARED, scale)):
        np.testing.assert_allclose(same, SHEARED, atol=1e-12)


def test_what_rounding_leaves_of_an_angle_is_nothing() -> None:
    """It would be shown as "-0.00°"."""
    for degrees in range(-170, 180, 7):
        found = decompose(compose((0, 0, 0), (-90.0, 0.0, float(degrees)), (1, 1, 1)))[1]
        assert f"{found[1]:.2f}" == "0.00"


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
    assert placing.frame_of(SCENE, PRISM, True)[:3, 3] == pytest.approx(SCENE.objects[0].world_bounds.mean(axis=0))
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


EMPTY = Scene("none", Camera((0, -1, 0), (0, 0, 0)), (), ())


def test_three_points_give_two_lengths_and_the_angle_between() -> None:
    state = State(EMPTY, EMPTY.camera)
    for point in ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 2.0)):
        state = measuring.with_point(state, point)
    assert measuring.lengths(state.measured) == pytest.approx([3.0, 8.0**0.5])
    assert measuring.angle_deg(state.measured) == pytest.approx(90.0)
    assert "90.00°" in measuring.words(state.measured)
    assert measuring.with_point(state, (1.0, 0.0, 0.0)).measured == ((1.0, 0.0, 0.0),)


def test_small_angles_are_exact() -> None:
    assert measuring.angle_deg(((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1e-7, 0.0))) == pytest.approx(
        5.7296e-6, rel=1e-4
    )
    assert measuring.angle_deg(((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))) is None


def test_each_lesson_has_a_scene_that_holds_what_it_is_about(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert len(lessons()) == 9 and main(["lesson"]) == 0
    listed = capsys.readouterr().out
    for each in lessons():
        scene = load_scene(each.path)
        assert each.select in [item.name for item in scene.objects]
        assert not each.target or (each.path.parent / each.target).is_file()
        assert 3 <= len(each.steps) <= 5 and 100 < len(each.words) < 400
        assert each.name in listed and each.title in listed


def test_an_unknown_lesson_is_refused_with_a_way_out() -> None:
    with pytest.raises(UserError, match="did you mean 'newton'"):
        lesson("newtn")
