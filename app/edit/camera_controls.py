"""How the camera moves: pure functions from a camera to a camera.

Drags are given in picture heights (a drag over the whole height is 1; x to the right, y down), so that
the feel does not depend on the window's size. The camera's `up` stays what it is, so the horizon never
tilts, and the view stops short of going straight along it, so nothing flips.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.placement import rotation_about
from ..model.scene import Camera, Vec3
from ..model.scene_camera import camera_frame
from ..model.vectors import vec3
from .projection import View

ORBIT_PER_HEIGHT = np.pi
"""Radians that a drag over the picture's height turns."""
LOOK_PER_HEIGHT = 0.6 * np.pi
STEEPEST = np.radians(89.5)
"""Largest elevation of the view."""
ZOOM_STEP = 0.88
"""Distance that is left after one notch of the wheel, as a share."""
FAST, SLOW = 4.0, 0.25
"""Flying with Shift, with Ctrl."""
FRAME_MARGIN = 1.12
_MIN_DISTANCE = 1e-4
"""Share of the pivot's distance that a zoom may come near in one step."""


def _rotated(camera: Camera, pivot: np.ndarray, yaw: float, pitch: float) -> Camera:
    """Turned by `yaw` about `up` and by `pitch` (positive is upwards) about the camera's right, both through
    `pivot`."""
    axis = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    right, _, forward = camera_frame(camera)
    elevation = float(np.arcsin(np.clip(forward @ axis, -1.0, 1.0)))
    limit = max(STEEPEST, abs(elevation))
    pitch = float(np.clip(elevation + pitch, -limit, limit)) - elevation
    turn = rotation_about(vec3(axis), yaw) @ rotation_about(vec3(right), pitch)
    position, target = np.asarray(camera.position, float), np.asarray(camera.target, float)
    new_position = pivot + turn @ (position - pivot)
    # The distance is restored, so that thousands of small turns do not drift.
    direction = turn @ forward
    return replace(
        camera, position=vec3(new_position), target=vec3(new_position + np.linalg.norm(target - position) * direction)
    )


def orbit(camera: Camera, dx: float, dy: float, pivot: Vec3 | np.ndarray | None = None) -> Camera:
    """Walk round `pivot` (else the target): the scene follows the drag."""
    centre = np.asarray(camera.target if pivot is None else pivot, float)
    return _rotated(camera, centre, -ORBIT_PER_HEIGHT * dx, -ORBIT_PER_HEIGHT * dy)


def look(camera: Camera, dx: float, dy: float) -> Camera:
    """Turn the head: the camera stays where it is."""
    return _rotated(camera, np.asarray(camera.position, float), -LOOK_PER_HEIGHT * dx, -LOOK_PER_HEIGHT * dy)


def pan(camera: Camera, dx: float, dy: float, depth: float | None = None) -> Camera:
    """Move across the view so that what is at `depth` (scene units ahead; else the target's) follows the cursor."""
    view = View.of(camera, 1.0)
    height = view.height_at(depth if depth is not None and depth > 0.0 else view.target_distance)
    return _moved(camera, height * (-dx * view.right + dy * view.up))


def _moved(camera: Camera, step: np.ndarray) -> Camera:
    return replace(
        camera, position=vec3(np.asarray(camera.position) + step), target=vec3(np.asarray(camera.target) + step)
    )


def zoom_to(
    camera: Camera,
    amount: float,
    cursor: tuple[float, float] = (0.5, 0.5),
    aspect: float = 1.0,
    hit: Vec3 | np.ndarray | None = None,
) -> Camera:
    """Come nearer by `amount` notches (negative: go back) while the point under `cursor` stays there.

    `cursor` is in picture coordinates; `hit` the world position under it (else on the plane through the target).
    An orthographic camera changes its extent instead of its place.
    """
    view = View.of(camera, aspect)
    factor = float(ZOOM_STEP**amount)
    if view.is_orthographic:
        origin, _ = view.ray(*cursor)
        shifted = _moved(camera, (1.0 - factor) * (origin - view.position))
        return replace(shifted, vertical_extent=camera.vertical_extent * factor)
    if hit is None or view.depth(np.asarray(hit)) <= 0.0:
        hit = view.on_plane(*cursor, np.asarray(camera.target, float), view.forward)
    focus = np.asarray(camera.target if hit is None else hit, float)
    position = focus + factor * (view.position - focus)
    distance = max(view.target_distance * factor, _MIN_DISTANCE * view.target_distance)
    return replace(camera, position=vec3(position), target=vec3(position + distance * view.forward))


def dolly(camera: Camera, dy: float) -> Camera:
    """Zoom by a drag: down comes nearer, a whole picture height about eight times."""
    return zoom_to(camera, 16.0 * dy)


def fly(camera: Camera, keys: tuple[float, float, float], speed: float, dt: float) -> Camera:
    """Fly by `keys` (right, up, forward; −1 to 1 each) at `speed` scene units a second for `dt` seconds.

    Up is the camera's `up`, so that E rises and Q sinks whatever the view. Ahead of an
    orthographic camera nothing grows, so forward shrinks its extent.
    """
    right, _, forward = camera_frame(camera)
    wish = np.asarray(keys, float)
    if not wish.any() or dt <= 0.0:
        return camera
    wish = wish / max(1.0, float(np.linalg.norm(wish)))
    axis = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    across = wish[0] * right + wish[1] * axis
    if camera.kind == "orthographic":
        return replace(
            _moved(camera, speed * dt * across), vertical_extent=camera.vertical_extent * float(np.exp(-wish[2] * dt))
        )
    return _moved(camera, speed * dt * (across + wish[2] * forward))


def frame(camera: Camera, low: Vec3 | np.ndarray, high: Vec3 | np.ndarray, aspect: float) -> Camera:
    """From the same direction, just far enough that the box from `low` to `high` fills the view."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    centre = 0.5 * (low + high)
    view = View.of(camera, aspect)
    corners = (
        np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]) - centre
    )
    across, upward, ahead = np.abs(corners @ view.right) / aspect, np.abs(corners @ view.up), corners @ view.forward
    radius = float(np.linalg.norm(corners, axis=1).max())
    if radius == 0.0:
        return replace(camera, position=vec3(centre - view.target_distance * view.forward), target=vec3(centre))
    if view.is_orthographic:
        extent = 2.0 * FRAME_MARGIN * max(float(across.max()), float(upward.max()), 0.05 * radius)
        distance = max(view.target_distance, 2.0 * radius)
        return replace(
            camera, position=vec3(centre - distance * view.forward), target=vec3(centre), vertical_extent=extent
        )
    distance = float((np.maximum(across, upward) * FRAME_MARGIN / view.half_height - ahead).max())
    return replace(camera, position=vec3(centre - distance * view.forward), target=vec3(centre))


def focus_at(camera: Camera, point: Vec3 | np.ndarray) -> Camera:
    """The lens focused on the plane through a point; where that is behind it, as it was."""
    depth = float(camera_frame(camera)[2] @ np.subtract(point, camera.position))
    return replace(camera, focus_distance=depth) if depth > 0.0 else camera


def look_along(camera: Camera, direction: Vec3 | np.ndarray) -> Camera:
    """Round the target, to look along a world `direction`; along `up` itself as steeply as orbiting allows."""
    axis = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    wanted = np.asarray(direction, float) / np.linalg.norm(direction)
    level = wanted - (wanted @ axis) * axis
    if np.linalg.norm(level) < 1e-6:
        _, up, forward = camera_frame(camera)
        level = forward - (forward @ axis) * axis
        level = up if np.linalg.norm(level) < 1e-6 else level
        wanted = np.sign(wanted @ axis) * np.sin(STEEPEST) * axis + np.cos(STEEPEST) * level / np.linalg.norm(level)
    target = np.asarray(camera.target, float)
    distance = float(np.linalg.norm(target - np.asarray(camera.position, float)))
    return replace(camera, position=vec3(target - distance * wanted))
