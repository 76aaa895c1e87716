"""Rows for a camera in numbers: of the present view, and of the view that the scene is saved with."""

from __future__ import annotations

import math
from dataclasses import replace

from ...model.scene import Camera
from . import widgets

_KINDS = {"pinhole": "Perspective", "orthographic": "Orthographic"}


def draw_camera_rows(camera: Camera) -> Camera:
    """The camera as the user left it."""
    kind = widgets.combo("Projection", _KINDS, camera.kind, tip="Perspective, or orthographic for measuring.")
    if kind != camera.kind:
        camera = _converted(camera, kind)
    if camera.kind == "pinhole":
        tip, before = "Vertical angle of view.", camera.vertical_fov_deg
        fov = widgets.slider("Field of view", before, 2.0, 120.0, unit="°", format="%.1f", reset=35.0, tip=tip)
        camera = replace(camera, vertical_fov_deg=fov)
    else:
        tip = "Height of what is seen, in scene units."
        extent = widgets.drag("Height", camera.vertical_extent, 1e-4, 1e6, unit="units", tip=tip)
        camera = replace(camera, vertical_extent=extent)
    tip = "Where the camera is: x, y, z."
    position = widgets.vec3("Position", camera.position, unit="units", tip=tip, speed=0.02)
    tip = "The point in the middle of the picture: x, y, z."
    target = widgets.vec3("Target", camera.target, unit="units", tip=tip, speed=0.02)
    if position != target:  # a camera's target is not its own position
        camera = replace(camera, position=position, target=target)
    return _lens_rows(camera)


def _lens_rows(camera: Camera) -> Camera:
    """How wide the lens is open and what is in focus."""
    distance = camera.plane_of_focus
    tip = "Half the lens's aperture: the larger, the more blurred is what is out of focus. 0: all is in focus."
    radius = widgets.slider(
        "Lens radius",
        camera.lens_radius,
        0.0,
        0.1 * distance,
        unit="units",
        tip=tip,
        reset=0.0,
        format="%.4f",
        clamp=False,
    )
    camera = replace(camera, lens_radius=max(radius, 0.0))
    if camera.lens_radius > 0.0:
        tip = "From the lens to the plane of focus."
        wanted = widgets.drag("Focus distance", distance, 1e-6, 1e9, unit="units", tip=tip)
        if wanted != distance:
            camera = replace(camera, focus_distance=wanted)
        tip = "Keep the target in focus, wherever the camera moves."
        if camera.focus_distance is not None and widgets.button("Focus on the target", tip=tip):
            camera = replace(camera, focus_distance=None)
    return camera


def _converted(camera: Camera, kind: str) -> Camera:
    """The other projection, showing the target plane at the same size."""
    distance = math.dist(camera.position, camera.target)
    if kind == "orthographic":
        height = 2.0 * distance * math.tan(math.radians(camera.vertical_fov_deg) / 2)
        return replace(camera, kind="orthographic", vertical_extent=height)
    angle = 2.0 * math.degrees(math.atan(camera.vertical_extent / (2.0 * distance)))
    return replace(camera, kind="pinhole", vertical_fov_deg=min(max(angle, 2.0), 120.0))
