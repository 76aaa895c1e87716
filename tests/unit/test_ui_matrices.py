"""Placements taken apart and put together: right-handed, about fixed axes, like a scene file's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit.matrices import (
    compose,
    decompose,
    rotation_matrix,
    with_position,
    with_rotation,
    with_scale,
)
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.placement import read_placement

SHEARED = np.array([(1.0, 0.7, 0, 3), (0, 2.0, 0.2, 4), (0.1, 0, 1.5, 5), (0, 0, 0, 1)])


@pytest.mark.parametrize(
    ("angles", "start", "end"),
    [((90, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 90, 0), (0, 0, 1), (1, 0, 0)), ((0, 0, 90), (1, 0, 0), (0, 1, 0))],
)
def test_rotations_are_right_handed(angles: tuple, start: tuple, end: tuple) -> None:
    np.testing.assert_allclose(rotation_matrix(angles) @ start, end, atol=1e-15)


def test_compose_is_what_a_scene_file_means() -> None:
    values = {"position": [1.0, 2.0, 3.0], "rotation_deg": [20.0, -50.0, 130.0], "scale": [2.0, -0.5, 1.5]}
    from_file = read_placement(SceneTable(values, Path("scene.toml")))
    np.testing.assert_allclose(compose((1, 2, 3), (20, -50, 130), (2, -0.5, 1.5)), from_file, atol=1e-14)


def test_decompose_undoes_compose() -> None:
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
