"""Meshes: geometry, transforms, refusal of broken input; every fault is counted exactly, and repairs say what they
did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.geometry.mesh_health import examine, repair

TRIANGLE = np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0)])


def _random_affine(seed: int, mirrored: bool) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(seed).normal(size=(3, 4))
    if (np.linalg.det(matrix[:3, :3]) < 0.0) != mirrored:
        matrix[0] *= -1.0
    return matrix


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


BOX = primitives.box()


def _joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    triangles = np.concatenate([m.triangles + s for m, s in zip(meshes, starts, strict=False)])
    return make_mesh("joined", np.concatenate([m.vertices for m in meshes]), triangles)


def _scaled(mesh: Mesh, factor: float) -> Mesh:
    return mesh.transformed(np.diag([factor, factor, factor, 1.0]))


def test_good_solid_has_no_faults() -> None:
    health = examine(primitives.sphere(1.0, 500))
    assert health.summary() == "watertight"
    assert health.components == 1 and health.signed_volume > 4.0
    mesh, notes = repair(primitives.sphere(1.0, 500))
    assert notes == () and len(mesh.triangles) == 500


def test_open_mesh_is_counted_and_told() -> None:
    opened = replace(BOX, triangles=BOX.triangles[1:], uv=BOX.uv[1:])
    assert examine(opened).boundary_edges == 3
    mesh, notes = repair(opened)
    assert notes == ("open mesh 'box': 3 boundary edges; the side is decided by the face normals",)
    assert len(mesh.triangles) == 11


def test_non_manifold_edge() -> None:
    fin = make_mesh("fin", np.vstack([BOX.vertices, (0.0, 0.0, 2.0)]), np.vstack([BOX.triangles, (4, 5, 8)]))
    health = examine(fin)
    assert (health.non_manifold_edges, health.boundary_edges) == (1, 2)
    assert any("non-manifold mesh 'fin': 1 edge with more" in note for note in repair(fin)[1])


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
@pytest.mark.parametrize("normals", ["true", "of the winding", None])
def test_triangles_wound_by_chance_are_turned_with_their_normals(share: float, normals: str | None) -> None:
    ball = primitives.sphere(1.0, 320)
    # Two balls, one of which nobody turned: parts are judged each for itself.
    other = ball.transformed(np.array([[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    turned = np.append(np.random.default_rng(3).random(320) < share, np.zeros(320, bool))
    both = _joined(ball, other).triangles
    triangles = np.where(turned[:, None], both[:, ::-1], both)
    corners = np.concatenate([ball.corner_normals, other.corner_normals])
    corners = np.where(turned[:, None, None], corners[:, ::-1], corners)
    if normals == "of the winding":
        corners = np.where(turned[:, None, None], -corners, corners)
    spoilt = make_mesh("two", np.vstack([ball.vertices, other.vertices]), triangles, corners if normals else None)
    assert examine(spoilt).inconsistent_edges > 0
    mesh, notes = repair(spoilt)
    assert examine(mesh).watertight and "turned to face as all others do" in notes[0]
    one = 2.0 * (share < 0.7)  # where most were turned, the part faces inward and is said to
    assert mesh.volume() == pytest.approx(one * ball.volume(), abs=1e-9)
    if normals:
        assert np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals()).min() > 0.9 or one == 0.0


def test_a_surface_with_one_side_is_left_as_it_is() -> None:
    # A Möbius strip of five quadrilaterals, whose last is joined crosswise.
    turn = np.arange(5) * np.pi / 5
    ring = np.stack([np.cos(2 * turn), np.sin(2 * turn), 0 * turn], axis=1)
    out = 0.3 * np.stack([np.cos(turn) * np.cos(2 * turn), np.cos(turn) * np.sin(2 * turn), np.sin(turn)], axis=1)
    rows = [(a, a + 1, a + 5) for a in range(4)] + [(a + 1, a + 6, a + 5) for a in range(4)] + [(4, 5, 9), (5, 0, 9)]
    strip = make_mesh("strip", np.vstack([ring - out, ring + out]), rows)
    mesh, notes = repair(strip)
    assert any("inconsistently wound" in note for note in notes)
    np.testing.assert_array_equal(mesh.triangles, strip.triangles)


def test_doubled_triangles_are_dropped_where_that_leaves_a_solid() -> None:
    reversed_too = make_mesh("b", BOX.vertices, np.vstack([BOX.triangles, np.roll(BOX.triangles[:, ::-1], 1, axis=1)]))
    alike = make_mesh("b", BOX.vertices, np.vstack([BOX.triangles, BOX.triangles[:2]]))
    for spoilt, dropped in ((reversed_too, 12), (alike, 2)):
        mesh, notes = repair(spoilt)
        assert notes == (f"mesh 'b': {dropped} triangles on the same corners as others dropped",)
        assert mesh.is_closed and mesh.volume() == pytest.approx(1.0)
    # Of two tetrahedra that touch, the common wall goes; so does a fin with two sides.
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
    upper = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    lower = np.array([(0, 1, 2), (1, 0, 4), (2, 1, 4), (0, 2, 4)])
    mesh, notes = repair(make_mesh("t", corners, np.vstack([upper, lower])))
    assert len(mesh.triangles) == 6 and mesh.volume() == pytest.approx(1.0 / 3.0)
    fin = make_mesh("fin", np.vstack([BOX.vertices, (0.0, 0.0, 2.0)]), np.vstack([BOX.triangles, (4, 5, 8), (8, 5, 4)]))
    assert len(repair(fin)[0].triangles) == 12


def test_inside_out_solid_is_turned() -> None:
    ball = primitives.sphere(1.0, 320)
    health = examine(ball.flipped())
    assert health.inside_out and health.summary().startswith("inside out")
    mesh, notes = repair(ball.flipped())
    assert mesh.volume() == pytest.approx(ball.volume())
    assert np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals()).min() > 0.9
    assert len(notes) == 1 and "inside out" in notes[0]


def test_winding_and_normals_are_turned_each_for_itself() -> None:
    ball = primitives.sphere(1.0, 320)
    for triangles, normals, said in (
        (ball.triangles[:, ::-1], ball.corner_normals[:, ::-1], "inside out"),
        (ball.triangles, -ball.corner_normals, "its normals pointed away"),
    ):
        mesh, notes = repair(make_mesh("ball", ball.vertices, triangles, normals))
        assert len(notes) == 1 and said in notes[0]
        assert mesh.volume() > 4.0
        assert np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals()).min() > 0.9


def test_cavity_is_kept_and_told() -> None:
    hollow = _joined(BOX, _scaled(BOX, 0.5).flipped())
    health = examine(hollow)
    assert (health.components, health.inward_components) == (2, 1)
    assert health.signed_volume == pytest.approx(1.0 - 0.125)
    assert "1 of 2 parts face inward" in repair(hollow)[1][0]


def test_degenerate_triangles_are_dropped() -> None:
    extra = np.vstack([BOX.triangles, (0, 0, 1), (3, 4, 4)])
    health = examine(make_mesh("b", BOX.vertices, extra))
    assert health.degenerate_triangles == 2
    mesh, notes = repair(make_mesh("b", BOX.vertices, extra))
    assert mesh.is_closed and len(mesh.triangles) == 12
    assert notes == ("mesh 'b': 2 degenerate triangles dropped",)
    sliver = make_mesh("s", [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)])
    assert len(repair(sliver)[0].triangles) == 1
    with pytest.raises(UserError, match="every triangle is degenerate"):
        repair(make_mesh("s", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))


def test_seam_of_a_t_junction_stays_closed() -> None:
    # The middle of a box's edge belongs to one of its two faces only; a flat triangle stitches it.
    a, b = 0, 1
    middle = 0.5 * (BOX.vertices[a] + BOX.vertices[b])
    rows = []
    for t in BOX.triangles.tolist():
        if any((t[i], t[(i + 1) % 3]) == (a, b) for i in range(3)):
            c = next(v for v in t if v not in (a, b))
            rows += [(a, 8, c), (8, b, c)]
        else:
            rows.append(t)
    mesh = make_mesh("t", np.vstack([BOX.vertices, middle]), np.array([*rows, (a, b, 8)]))
    assert mesh.is_closed and examine(mesh).degenerate_triangles == 1
    mended, notes = repair(mesh)
    assert mended.is_closed and notes == ()


def test_zero_normals_take_the_face_normal() -> None:
    ball = primitives.sphere(1.0, 80)
    normals = ball.corner_normals.copy()
    normals[3, 1] = 0.0
    normals[5, 0] = np.nan
    mesh = make_mesh("ball", ball.vertices, ball.triangles, normals)
    assert examine(mesh).zero_normals == 2
    mended, notes = repair(mesh)
    np.testing.assert_allclose(mended.corner_normals[3, 1], ball.face_normals()[3])
    assert notes == ("mesh 'ball': 2 zero normals replaced by the face normal",)


def test_loose_triangles_are_welded_and_then_judged() -> None:
    loose = make_mesh("loose", BOX.corners().reshape(-1, 3), np.arange(36).reshape(-1, 3))
    health = examine(loose)
    assert health.duplicate_vertices == 28 and health.boundary_edges == 36 and health.components == 12
    mended, notes = repair(loose)
    assert mended.is_closed and len(mended.vertices) == 8 and notes == ()
    assert len(mended.convex_planes) == 6


def test_components_of_a_long_chain() -> None:
    strip = np.stack([np.arange(5000), np.arange(5000) + 1, np.arange(5000) + 2], axis=1)
    points = np.random.default_rng(0).normal(size=(5002, 3))
    order = np.random.default_rng(1).permutation(5002)
    assert examine(make_mesh("chain", points, order[strip])).components == 1
    assert examine(make_mesh("two", points, order[np.delete(strip, [2499, 2500], axis=0)])).components == 2


@pytest.mark.parametrize(("gap", "closes"), [(1e-6, True), (1e-3, False)])
def test_seam_that_gapes_by_rounding_is_closed(gap: float, closes: bool) -> None:
    """A sphere of longitudes whose last meets its first but for rounding, as exporters write it."""
    rings, sides = 8, 12
    polar, round_it = np.meshgrid(np.linspace(0.0, np.pi, rings), np.linspace(0.0, 2.0 * np.pi + gap, sides + 1))
    points = np.stack([np.sin(polar) * np.cos(round_it), np.sin(polar) * np.sin(round_it), np.cos(polar)], axis=2)
    a = np.add.outer(np.arange(sides) * rings, np.arange(rings - 1)).ravel()
    quads = np.stack([a, a + rings, a + rings + 1, a, a + rings + 1, a + 1], axis=1)
    mesh, notes = repair(make_mesh("ball", points.reshape(-1, 3), quads.reshape(-1, 3)))
    assert mesh.is_closed == closes and any("open" in note for note in notes) != closes
    if closes:
        assert abs(mesh.volume()) == pytest.approx(3.6, abs=0.3)
