"""The camera of a scene file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .io.scene_table import SceneTable
from .scene import Camera
from .scene_lights import Surroundings


def read_camera(table: SceneTable, around: Surroundings) -> Camera:
    """A [camera] table; what it leaves out is fitted to `around`."""
    kind = table.choice("kind", ("pinhole", "orthographic"), "pinhole")
    position = table.vector("position")
    x, y, z = (float(v) for v in around.centre)
    target = table.vector("target", (x, y, z))
    up = table.vector("up", (0.0, 0.0, 1.0), nonzero=True)
    forward = np.subtract(target, position)
    if np.linalg.norm(forward) < 1e-150:
        table.fail("target", "lies at the camera's own position and so gives no direction")
    sine = np.linalg.norm(np.cross(forward, up)) / (np.linalg.norm(forward) * np.linalg.norm(up))
    if sine < 1e-9:
        table.fail("up", "is parallel to the viewing direction; give a direction across it")
    camera = Camera(position, target, up, kind)  # type: ignore[arg-type]
    if kind == "pinhole":
        camera = replace(camera, vertical_fov_deg=table.number("vertical_fov_deg", 35.0, above=0.0, below=180.0))
    else:
        extent = table.number("vertical_extent", 4.0 * around.radius, above=0.0)
        camera = replace(camera, vertical_extent=extent)
    table.finish(f"a camera of kind '{kind}'")
    return camera
