"""Everything a panel can do to a scene: pure functions `edit(scene, …) -> Scene`, checked like a scene file.

A panel writes `return edits.attempt(state, "Move prism", set_position, index, position)`: what is refused
becomes a sentence on the screen and the scene stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..base.errors import UserError
from ..model.scene import Camera, RenderDefaults, Scene, Vec3
from ..model.scene_render import check_render
from ..model.vectors import unit, vec3
from .requests import Notice
from .state import State


def attempt(state: State, label: str, edit: Callable[..., Scene], *args: object, **kwargs: object) -> State:
    """`state` with `edit(state.scene, …)` done, undone as `label`; a refusal is shown as a notice instead."""
    try:
        return state.edited(edit(state.scene, *args, **kwargs), label)
    except UserError as error:
        text = str(error)
        return state.asking(Notice(text[:1].upper() + text[1:] + ".", is_error=True))


def render_changed(state: State, label: str, **changes: float) -> State:
    """`state` with other defaults of its scene's rendering (`set_render_defaults`), as it is where they are those."""
    is_same = all(getattr(state.scene.render, key) == value for key, value in changes.items())
    return state if is_same else attempt(state, label, set_render_defaults, **changes)


def set_background(scene: Scene, rgb: Vec3) -> Scene:
    """Linear Rec.709 radiance behind everything, 0 or more."""
    if not all(math.isfinite(c) and 0.0 <= c <= 1e30 for c in rgb):
        raise UserError("the background must be three radiances of 0 or more")
    return replace(scene, background_rgb=vec3(rgb))


def set_render_defaults(scene: Scene, **changes: float) -> Scene:
    """Picture size (`width`, `height`), `photons`, `exposure_ev`, `max_depth`, `glare`, `antialias_highlights`,
    `polarisation`, `bounces`, `haze` and `haze_anisotropy` that the scene asks for."""
    render: RenderDefaults = replace(scene.render, **changes)  # type: ignore[arg-type]
    check_render(render)
    return replace(scene, render=render)


def set_camera(scene: Scene, camera: Camera) -> Scene:
    """Make `camera` the view the scene is saved with; an up direction along the view, which a file may not hold, is
    turned aside."""
    forward = np.subtract(camera.target, camera.position)
    if not np.isfinite(forward).all() or np.linalg.norm(forward) < 1e-150:
        raise UserError("the camera's target is its own position; choose another target")
    forward = unit(forward)
    if np.linalg.norm(np.cross(forward, camera.up)) < 1e-6 * np.linalg.norm(camera.up):
        camera = replace(camera, up=vec3(np.eye(3)[int(np.argmin(np.abs(forward)))]))
    return replace(scene, camera=camera)
