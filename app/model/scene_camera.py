"""The camera of a scene file."""

from __future__ import annotations

from typing import Any

import numpy as np

from .fields import Number, Vector, read_fields, write_fields
from .io.scene_table import SceneTable
from .placement import Surroundings
from .scene import Camera

_PLACE = (Vector("position"), Vector("target", None), Vector("up", (0.0, 0.0, 1.0), nonzero=True))
_VIEW = {
    "pinhole": Number("vertical_fov_deg", 35.0, above=0.0, below=180.0),
    "orthographic": Number("vertical_extent", None, above=0.0),
}
LENS_RADIUS = Number("lens_radius", 0.0, at_least=0.0, at_most=1e6, optional=True)
FOCUS_DISTANCE = Number("focus_distance", None, above=0.0, at_most=1e9)
LENS = (LENS_RADIUS, FOCUS_DISTANCE)


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
    return {"kind": camera.kind} | write_fields((*_PLACE, _VIEW[camera.kind], *LENS), camera)
