"""Outlines in a plane and the borders near which light lands."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.features.facts import has_borders
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.outline import convex_outline
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.scene import Black, Diffuse, SceneObject
from spectrasplat.passes.borders import borders_near
from spectrasplat.passes.plane_frame import plane_frame

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
HALVES = np.array([[0, 1, 2], [0, 3, 2]])
"""One of them the other way round."""


def test_an_outline_has_the_corners_alone() -> None:
    points = np.concatenate([SQUARE, [[1.0, 0.0], [1.0, 0.5]]])
    fan = np.array([[0, 4, 5], [4, 1, 5], [1, 2, 5], [2, 3, 5], [3, 0, 5]])
    outline = convex_outline(points, fan)
    assert outline is not None
    np.testing.assert_allclose(outline, SQUARE)
    outline = convex_outline(SQUARE, HALVES)
    assert outline is not None and len(outline) == 4


def test_what_is_not_convex_has_none() -> None:
    notched = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
    assert convex_outline(notched, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])) is None
    assert convex_outline(SQUARE, np.array([[0, 1, 2]])) is not None, "a triangle; its fourth corner is none of it"
    assert convex_outline(SQUARE, np.concatenate([HALVES, HALVES[:1]])) is None, "covered twice"
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    assert convex_outline(line, np.array([[0, 1, 2]])) is None


@pytest.mark.parametrize("corners", [3, 5, 64])
def test_a_polygon_for_a_disc(corners: int) -> None:
    angle = 2.0 * np.pi * np.arange(corners) / corners
    ring = 1e-3 * np.stack([np.cos(angle), np.sin(angle)], axis=1) + [5.0, -3.0]
    fan = np.array([[0, i, i + 1] for i in range(1, corners - 1)])
    outline = convex_outline(ring, fan)
    assert outline is not None and len(outline) == corners


def test_only_borders_near_light_count() -> None:
    turned = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    frame = plane_frame(np.array([3.0, 1.0, 2.0]) + SQUARE @ turned)
    outline = frame.project(np.array([3.0, 1.0, 2.0]) + SQUARE @ turned)
    outline = convex_outline(outline, HALVES)
    assert outline is not None
    at = frame.project(np.array([3.0, 1.0, 2.0]) + np.array([[1.0, 0.05]]) @ turned)
    (near,) = borders_near(frame, outline, at)
    # Half way along the lower side, 0.05 inside.
    assert near[:3] @ (np.array([3.0, 1.0, 2.0]) + np.array([1.0, 0.05]) @ turned) + near[3] == pytest.approx(0.05)
    np.testing.assert_allclose(near[:3], turned[1], atol=1e-12)
    corner = frame.project(np.array([[3.0, 1.0, 2.0]]))
    assert len(borders_near(frame, outline, corner)) == 2
    middle = frame.project(np.array([3.0, 1.0, 2.0]) + np.array([[1.0, 0.5]]) @ turned)
    assert len(borders_near(frame, outline, middle)) == 0


def test_which_objects_have_borders() -> None:
    assert has_borders(SceneObject("table", plane(2.0, 1.0), Diffuse()))
    assert not has_borders(SceneObject("shade", plane(2.0, 1.0), Black()))
    assert not has_borders(SceneObject("box", box((1.0, 1.0, 1.0)), Diffuse()))
    corner = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], float)
    notched = Mesh("corner", corner, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]))
    assert not has_borders(SceneObject("corner", notched, Diffuse()))


def test_a_plane_keeps_its_frame() -> None:
    """Whatever rounding its points have: maps of neighbouring frames would lie upside down to each other."""
    rng = np.random.default_rng(1)
    for normal in ((-0.907, 0.0, 0.421), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        across = np.cross(normal, (0.3, 0.8, 0.5))
        square = (SQUARE - 0.5) @ np.stack([across, np.cross(normal, across)])
        moved = [(square + rng.normal(size=3)) * rng.uniform(0.1, 3.0) for _ in range(100)]
        axes = np.stack([plane_frame(points.astype(np.float32).astype(float)).axes for points in moved])
        np.testing.assert_allclose(axes, np.broadcast_to(axes[0], axes.shape), atol=1e-4)
