"""Mesh values: geometry, transforms and refusal of broken input."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import make_mesh

TRIANGLE = np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0)])


def _random_affine(seed: int, mirrored: bool) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(seed).normal(size=(3, 4))
    if (np.linalg.det(matrix[:3, :3]) < 0.0) != mirrored:
        matrix[0] *= -1.0
    return matrix


def test_measures_of_one_triangle() -> None:
    mesh = make_mesh("t", TRIANGLE, [(0, 1, 2)])
    np.testing.assert_array_equal(mesh.face_normals(), [(0.0, 0.0, 1.0)])
    np.testing.assert_array_equal(mesh.areas(), [1.0])
    np.testing.assert_array_equal(mesh.bounds(), [(0.0, 0.0, 0.0), (2.0, 1.0, 0.0)])
    assert not mesh.is_closed
    assert mesh.vertices.dtype == np.float64 and mesh.triangles.dtype == np.int32


@pytest.mark.parametrize("mirrored", [False, True])
def test_transform_keeps_outside_outside(mirrored: bool) -> None:
    matrix = _random_affine(5, mirrored)
    ball = primitives.ellipsoid((1.0, 0.7, 0.4), 320)
    moved = ball.transformed(matrix)
    assert moved.is_closed
    assert moved.volume() == pytest.approx(abs(np.linalg.det(matrix[:3, :3])) * ball.volume(), rel=1e-12)
    # Normals of the image quadric |axes⁻¹ M⁻¹ (x - o)|² = 1, computed without any mesh code.
    root = np.diag(1.0 / np.array([1.0, 0.7, 0.4])) @ np.linalg.inv(matrix[:3, :3])
    gradient = (moved.corners() - matrix[:3, 3]) @ (root.T @ root)
    gradient /= np.linalg.norm(gradient, axis=2, keepdims=True)
    np.testing.assert_allclose(moved.corner_normals, gradient, atol=1e-12)


def test_transform_moves_half_spaces_and_uv() -> None:
    matrix = _random_affine(6, mirrored=True)
    moved = primitives.box().transformed(matrix)
    assert len(moved.convex_planes) == 6
    slack = moved.convex_planes[:, 3] - moved.vertices @ moved.convex_planes[:, :3].T
    assert slack.min() > -1e-12
    plane = primitives.plane()
    mirrored = plane.transformed(np.diag([-1.0, 1.0, 1.0, 1.0]))
    by_vertex = dict(zip(plane.triangles.ravel().tolist(), map(tuple, plane.uv.reshape(-1, 2)), strict=True))
    after = dict(zip(mirrored.triangles.ravel().tolist(), map(tuple, mirrored.uv.reshape(-1, 2)), strict=True))
    assert by_vertex == after


def test_volume_far_from_the_origin() -> None:
    shift = np.eye(4)
    shift[:3, 3] = 1e6
    assert primitives.box().transformed(shift).volume() == pytest.approx(1.0, rel=1e-9)


def test_flipped_twice_is_the_same_surface() -> None:
    ball = primitives.sphere(1.0, 80)
    assert ball.flipped().volume() == pytest.approx(-ball.volume())
    np.testing.assert_array_equal(ball.flipped().flipped().corner_normals, ball.corner_normals)


def test_singular_transform_is_refused() -> None:
    with pytest.raises(UserError, match="flattens"):
        primitives.box().transformed(np.diag([1.0, 0.0, 1.0, 1.0]))


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        (TRIANGLE, [(0, 1, 3)], "face 0 names vertex 3"),
        (TRIANGLE, [(0, 1, 2), (0, -1, 2)], "face 1 names vertex -1"),
        (TRIANGLE * np.nan, [(0, 1, 2)], "vertex 0 is not finite"),
        (np.zeros((0, 3)), np.zeros((0, 3), int), "empty"),
        (TRIANGLE, np.zeros((0, 3), int), "empty"),
        (TRIANGLE[:, :2], [(0, 1, 2)], "three numbers"),
    ],
)
def test_broken_arrays_are_refused(vertices, faces, says: str) -> None:
    with pytest.raises(UserError, match=f"thing.ply: .*{says}"):
        make_mesh("thing", vertices, faces, source="thing.ply")


def test_arrays_are_copied_and_read_only() -> None:
    vertices = TRIANGLE.copy()
    mesh = make_mesh("t", vertices, [(0, 1, 2)])
    vertices[0] = 9.0
    assert mesh.vertices[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1.0


def test_normals_that_are_no_directions_become_zero() -> None:
    normals = np.array([[(0.0, 0.0, 2.0), (0.0, 0.0, np.nan), (0.0, 0.0, 0.0)]])
    mesh = make_mesh("t", TRIANGLE, [(0, 1, 2)], corner_normals=normals)
    np.testing.assert_array_equal(mesh.corner_normals[0], [(0, 0, 1), (0, 0, 0), (0, 0, 0)])
