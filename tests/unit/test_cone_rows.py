"""Cones of solids of revolution are cut into rows, so that interpolated normals turn evenly over their facets."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.geometry import cone_rows
from spectrasplat.model.geometry.primitives import solid_of_revolution

TAPERED = [(0.0, 0.0), (0.62, 0.0), (0.8, 1.56), (0.0, 1.56)]


def uneven_share(segments: int) -> float:
    """How far the interpolated normal of a tapered tumbler's wall is ahead of or behind its place, in segments."""
    mesh = solid_of_revolution(TAPERED, segments=segments)
    assert mesh.corner_normals is not None
    wall = np.abs(mesh.face_normals()[:, 2]) < 0.5
    weights = np.random.default_rng(3).dirichlet(np.ones(3), (64, np.count_nonzero(wall)))
    place = np.einsum("rtc,tcj->rtj", weights, mesh.corners()[wall])
    normal = np.einsum("rtc,tcj->rtj", weights, mesh.corner_normals[wall])
    ahead = np.arctan2(normal[..., 1], normal[..., 0]) - np.arctan2(place[..., 1], place[..., 0])
    ahead = (ahead + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.abs(ahead).max()) * segments / (2.0 * np.pi)


def test_normals_turn_as_their_places_do() -> None:
    """To half of a row's taper at most over a segment, however narrow segments are (a quarter of it, at the worst
    place, is what a triangle's edge between two rings leaves)."""
    for segments in (64, 512):
        assert uneven_share(segments) < 0.3 * cone_rows.TAPER


def test_without_rows_more_segments_do_not_help(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the rows are there for: in one row it is as uneven with 512 segments as with 64."""
    monkeypatch.setattr(cone_rows, "TAPER", 1.0)
    few, many = uneven_share(64), uneven_share(512)
    assert min(few, many) > 0.05
    assert many == pytest.approx(few, rel=0.1)


def test_rows_keep_the_profile() -> None:
    """Its points stay, rows lie on its segments, and none tapers by more than is said but towards a tip."""
    points = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.8, 2.2), (0.0, 3.0)])
    normals = np.array([(0.0, -1.0), (1.0, 0.0), (0.97, -0.24), (0.71, 0.71)])
    found, start, end = cone_rows.in_rows(points, normals, normals, loop=False)
    assert all((found == point).all(axis=1).any() for point in points)
    # Discs and cylinders stay one row.
    assert (found[:3] == points[:3]).all()
    assert (found[-1] == points[-1]).all()
    assert len(start) == len(end) == len(found) - 1
    assert start == pytest.approx(end)
    radii = found[:, 0]
    upper, lower = np.maximum(radii[1:], radii[:-1]), np.minimum(radii[1:], radii[:-1])
    cones = np.flatnonzero((upper != lower) & (found[1:, 1] != found[:-1, 1]))
    shoulder = [row for row in cones if found[row, 1] < 2.2]
    assert len(shoulder) > 5
    assert (upper[shoulder] / lower[shoulder] <= 1.0 + cone_rows.TAPER + 1e-9).all()
    assert len(cones) - len(shoulder) == cone_rows.MOST_ROWS


def test_rows_of_a_smooth_loop_turn_from_end_to_end() -> None:
    """A ring whose profile is smooth: every row begins with the normal that the one before it ends with."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    circle = np.stack([1.0 + 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found, start, end = cone_rows.in_rows(circle, normals, np.roll(normals, -1, axis=0), loop=True)
    assert len(found) == len(start) == len(end) > 12
    assert np.roll(start, -1, axis=0) == pytest.approx(end)
    assert np.linalg.norm(start, axis=1) == pytest.approx(1.0)
