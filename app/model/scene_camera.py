"""A camera: its frame and rays in float64, for fitting maps and for tests, and its table in a scene file.

The camera pass makes its rays in GLSL.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .fields import Animated, Number, Vector, read_fields, write_fields
from .io.scene_table import SceneTable
from .placement import Surroundings
from .scene import Camera


def camera_frame(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit right, up and forward of a camera, float64 (3,) each."""
    forward = np.asarray(camera.target, float) - np.asarray(camera.position, float)
    forward /= np.linalg.norm(forward)
    up = np.asarray(camera.up, float)
    right = _cross(forward, up)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(up):  # looking along `up`: any upright will do
        right = _cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right /= np.linalg.norm(right)
    return right, _cross(right, forward), forward


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product; numpy's own, made for arrays of vectors, takes ten times as long; this runs in every frame."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def camera_rays(camera: Camera, picture: tuple[int, int], grid: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions (grid, grid, 3), world, of rays spread over the whole picture to its edges."""
    right, up, forward = camera_frame(camera)
    x, y = np.meshgrid(np.linspace(-1, 1, grid), np.linspace(-1, 1, grid))
    aspect = picture[0] / picture[1]
    position = np.asarray(camera.position, float)
    if camera.kind == "orthographic":
        half = 0.5 * camera.vertical_extent
        origins = position + half * (aspect * x[..., None] * right + y[..., None] * up)
        return origins, np.broadcast_to(forward, origins.shape).copy()
    half = np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    directions = forward + half * (aspect * x[..., None] * right + y[..., None] * up)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.broadcast_to(position, directions.shape).copy(), directions


_PLACE = (Vector("position"), Vector("target", None), Vector("up", (0.0, 0.0, 1.0), nonzero=True))
_FIELD = Animated("Vertical field of view", 0.01, 179.0, "fov_deg")
_EXTENT = Animated("Height of the picture of an orthographic camera", 1e-9, 1e9, "extent")
_APERTURE = Animated("Half the aperture of the camera's lens; 0: all is in focus")
_FOCUS = Animated("Distance from the lens to the plane of focus", 1e-6)
_VIEW = {
    "pinhole": Number("vertical_fov_deg", 35.0, above=0.0, below=180.0, unit="°", animated=_FIELD),
    "orthographic": Number("vertical_extent", None, above=0.0, unit="units", animated=_EXTENT),
}
LENS_RADIUS = Number("lens_radius", 0.0, at_least=0.0, at_most=1e6, optional=True, unit="units", animated=_APERTURE)
FOCUS_DISTANCE = Number("focus_distance", None, above=0.0, at_most=1e9, unit="units", animated=_FOCUS)
LENS = (LENS_RADIUS, FOCUS_DISTANCE)


def camera_numbers(camera: Camera) -> tuple[Number, ...]:
    """What it sees of the scene, and its lens."""
    return _VIEW[camera.kind], *LENS


def read_camera(table: SceneTable, around: Surroundings) -> Camera:
    """A [camera] table; what it leaves out is fitted to `around`."""
    kind = table.choice("kind", tuple(_VIEW), "pinhole")
    x, y, z = (float(v) for v in around.centre)
    fitted: dict[str, Any] = {"target": (x, y, z)}
    if kind == "orthographic":
        fitted["vertical_extent"] = 4.0 * around.radius
    given = read_fields((*_PLACE, _VIEW[kind], *LENS), table)
    camera = Camera(kind=kind, **fitted | {k: v for k, v in given.items() if v is not None})  # type: ignore[arg-type]
    up, forward = camera.up, np.subtract(camera.target, camera.position)
    if np.linalg.norm(forward) < 1e-150:
        table.fail("target", "lies at the camera's own position and so gives no direction")
    sine = np.linalg.norm(np.cross(forward, up)) / (np.linalg.norm(forward) * np.linalg.norm(up))
    if sine < 1e-9:
        table.fail("up", "is parallel to the viewing direction; give a direction across it")
    table.finish(f"a camera of kind '{kind}'")
    return camera


def camera_values(camera: Camera) -> dict[str, Any]:
    """The [camera] table of a scene file."""
    return {"kind": camera.kind} | write_fields((*_PLACE, *camera_numbers(camera)), camera)
