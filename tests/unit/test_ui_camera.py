"""Moves of the camera: what the cursor holds stays under it, and the horizon stays level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit import camera_controls as controls
from spectrasplat.edit.brush import followed
from spectrasplat.edit.projection import View, fitted
from spectrasplat.edit.state import Brush
from spectrasplat.model.scene import Camera

PINHOLE = Camera(position=(1.5, -6.6, 5.4), target=(1.35, 0.3, 0.05), vertical_fov_deg=30.0)
ORTHOGRAPHIC = replace(PINHOLE, kind="orthographic", vertical_extent=3.0)
BOTH = pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC])
ASPECT = 16 / 9


def picture(camera: Camera, point) -> np.ndarray:
    return View.of(camera, ASPECT).project(np.asarray(point, float))[0]


def distance(camera: Camera, point) -> float:
    return float(np.linalg.norm(np.subtract(camera.position, point)))


@BOTH
def test_projection_and_rays_are_each_others_inverse(camera):
    view = View.of(camera, ASPECT)
    origin, direction = view.ray(0.2, 0.7)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    assert view.project(origin + 3.7 * direction)[0] == pytest.approx([0.2, 0.7])


@BOTH
def test_the_matrices_agree_with_the_projection(camera):
    view = View.of(camera, ASPECT)
    origin = np.array([100.0, 7.0, -3.0])
    point = np.array([0.7, 0.2, 1.1])
    clip = view.projection_matrix(0.1, 100.0) @ view.view_matrix(origin) @ np.append(point - origin, 1.0)
    x, y, z = clip[:3] / clip[3]
    assert [0.5 + 0.5 * x, 0.5 - 0.5 * y] == pytest.approx(picture(camera, point))
    assert -1.0 < z < 1.0


@BOTH
def test_orbit_keeps_the_pivot_where_it_is_and_the_horizon_level(camera):
    pivot = (0.4, 0.9, 0.3)
    before = picture(camera, pivot)
    turned = camera
    rng = np.random.default_rng(3)
    for dx, dy in rng.normal(0.0, 0.2, (500, 2)):
        turned = controls.orbit(turned, dx, dy, pivot)
    assert picture(turned, pivot) == pytest.approx(before, abs=1e-9)
    assert distance(turned, pivot) == pytest.approx(distance(camera, pivot))
    assert turned.up == camera.up
    assert View.of(turned, 1.0).right @ np.array(camera.up) == pytest.approx(0.0, abs=1e-12)
    assert distance(turned, turned.target) == pytest.approx(distance(camera, camera.target))


def test_a_drag_to_the_right_turns_the_scene_to_the_right():
    nearer = np.array([1.4, -1.0, 0.05])  # before the target
    turned = controls.orbit(PINHOLE, 0.05, 0.0)
    assert picture(turned, nearer)[0] > picture(PINHOLE, nearer)[0] + 0.01
    assert picture(controls.orbit(PINHOLE, 0.0, 0.05), nearer)[1] > picture(PINHOLE, nearer)[1]
    # Turning the head: the scene follows the hand's opposite, as in games.
    assert picture(controls.look(PINHOLE, 0.05, 0.0), nearer)[0] < picture(PINHOLE, nearer)[0]
    assert controls.look(PINHOLE, 0.05, 0.02).position == pytest.approx(PINHOLE.position)


def test_orbit_never_flips_over_the_pole():
    camera, sides = PINHOLE, []
    for _ in range(200):
        before = View.of(camera, 1.0).right
        camera = controls.orbit(camera, 0.0, 0.02)
        sides.append(float(View.of(camera, 1.0).right @ before))
    assert min(sides) > 0.999
    assert View.of(camera, 1.0).forward[2] == pytest.approx(-np.sin(controls.STEEPEST))


def test_orbit_leaves_a_view_straight_along_up():
    top = Camera(position=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0))
    tilted = controls.orbit(top, 0.1, -0.2)
    assert np.isfinite(tilted.position).all()
    assert View.of(tilted, 1.0).forward[2] == pytest.approx(-np.cos(0.2 * np.pi))


@BOTH
def test_pan_holds_the_point_under_the_cursor(camera):
    point = np.array([1.1, 0.2, 0.4])
    depth = float(View.of(camera, ASPECT).depth(point))
    moved = controls.pan(camera, 0.3, -0.2, depth)
    assert picture(moved, point) - picture(camera, point) == pytest.approx([0.3 / ASPECT, -0.2])


@BOTH
@pytest.mark.parametrize("amount", [1.0, -3.0, 12.0])
def test_zoom_holds_the_point_under_the_cursor(camera, amount):
    point = np.array([0.6, 0.9, 0.2])
    cursor = tuple(picture(camera, point))
    nearer = controls.zoom_to(camera, amount, cursor, ASPECT, point)
    assert picture(nearer, point) == pytest.approx(cursor)
    scale = controls.ZOOM_STEP**amount
    if camera.kind == "pinhole":
        assert distance(nearer, point) == pytest.approx(scale * distance(camera, point))
    else:
        assert nearer.vertical_extent == pytest.approx(scale * camera.vertical_extent)
    assert View.of(nearer, ASPECT).forward == pytest.approx(View.of(camera, ASPECT).forward)


def test_zoom_without_a_hit_holds_the_plane_of_the_target():
    on_plane = View.of(PINHOLE, ASPECT).on_plane(0.8, 0.3, np.array(PINHOLE.target), View.of(PINHOLE, ASPECT).forward)
    nearer = controls.zoom_to(PINHOLE, 2.0, (0.8, 0.3), ASPECT)
    assert picture(nearer, on_plane) == pytest.approx([0.8, 0.3])


def test_flying_is_measured_in_units_a_second():
    view = View.of(PINHOLE, 1.0)
    ahead = controls.fly(PINHOLE, (0.0, 0.0, 1.0), 2.0, 0.5)
    assert np.subtract(ahead.position, PINHOLE.position) == pytest.approx(view.forward)
    assert np.subtract(ahead.target, PINHOLE.target) == pytest.approx(view.forward)
    risen = controls.fly(PINHOLE, (0.0, 1.0, 0.0), 2.0, 0.5)
    assert np.subtract(risen.position, PINHOLE.position) == pytest.approx([0.0, 0.0, 1.0])
    slanted = controls.fly(PINHOLE, (1.0, 0.0, 1.0), 2.0, 0.5)
    assert distance(slanted, PINHOLE.position) == pytest.approx(1.0)
    assert controls.fly(ORTHOGRAPHIC, (0.0, 0.0, 1.0), 2.0, 0.5).vertical_extent < ORTHOGRAPHIC.vertical_extent


@BOTH
def test_framing_fills_the_view_and_cuts_nothing(camera):
    low, high = np.array([2.0, 3.0, -1.0]), np.array([2.5, 3.8, -0.4])
    framed = controls.frame(camera, low, high, ASPECT)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    spread = np.abs(picture(framed, corners) - 0.5).max()
    assert 0.5 / controls.FRAME_MARGIN - 0.03 < spread <= 0.5 / controls.FRAME_MARGIN + 1e-9
    assert framed.target == pytest.approx(0.5 * (low + high))
    assert np.isfinite(controls.frame(camera, low, low, ASPECT).position).all()


def test_looking_along_an_axis_keeps_the_distance():
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        along = controls.look_along(PINHOLE, direction)
        assert View.of(along, 1.0).forward == pytest.approx(direction, abs=0.01)
        assert distance(along, PINHOLE.target) == pytest.approx(distance(PINHOLE, PINHOLE.target))


@pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=lambda c: c.kind)
@pytest.mark.parametrize("aspect", [4 / 3, 1.0, 16 / 9, 2.4])
def test_every_picture_shows_all_of_the_scenes_frame(camera: Camera, aspect: float) -> None:
    frame = 16 / 9
    shown, meant = View.of(fitted(camera, frame, aspect), aspect), View.of(camera, frame)
    assert shown.half_height >= meant.half_height - 1e-12
    assert shown.half_height * aspect >= meant.half_height * frame - 1e-12
    assert aspect < frame or fitted(camera, frame, aspect) is camera


@pytest.mark.parametrize("zoom", [0.0, 3.0, -6.0])
def test_a_brush_is_as_large_in_every_view(zoom: float) -> None:
    before, after = View.of(PINHOLE, 1.0), View.of(controls.zoom_to(PINHOLE, zoom), 1.0)
    radius = followed(Brush(radius=0.1), before, after).radius
    share = [view.height_at(view.target_distance) for view in (before, after)]
    assert radius / share[1] == pytest.approx(0.1 / share[0])
