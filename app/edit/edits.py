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
from ..model.scene_render import MAX_ANISOTROPY, MAX_BOUNCES, MAX_DEPTH, MAX_GLARE, MAX_HAZE, MAX_PICTURE_SIDE
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
    return replace(scene, background_rgb=(float(rgb[0]), float(rgb[1]), float(rgb[2])))


def set_render_defaults(scene: Scene, **changes: float) -> Scene:
    """Picture size (`width`, `height`), `photons`, `exposure_ev`, `max_depth`, `glare`, `antialias_highlights`,
    `polarisation`, `bounces`, `haze` and `haze_anisotropy` that the scene asks for."""
    render: RenderDefaults = replace(scene.render, **changes)  # type: ignore[arg-type]
    limits: dict[str, tuple[float, float]] = {
        "width": (1, MAX_PICTURE_SIDE),
        "height": (1, MAX_PICTURE_SIDE),
        "photons": (1, 10**12),
    }
    limits |= {"max_depth": (1, MAX_DEPTH), "exposure_ev": (-64, 64), "glare": (0, MAX_GLARE)}
    limits |= {"bounces": (0, MAX_BOUNCES), "haze": (0, MAX_HAZE)}
    limits["haze_anisotropy"] = (-MAX_ANISOTROPY, MAX_ANISOTROPY)
    for key, (low, high) in limits.items():
        value = getattr(render, key)
        if not low <= value <= high:
            raise UserError(f"{key.replace('_', ' ')} is {value:g} but must be between {low} and {high}")
    return replace(scene, render=render)


def set_camera(scene: Scene, camera: Camera) -> Scene:
    """Make `camera` the view the scene is saved with; an up direction along the view, which a file may not hold, is
    turned aside."""
    forward = np.subtract(camera.target, camera.position)
    if not np.isfinite(forward).all() or np.linalg.norm(forward) < 1e-150:
        raise UserError("the camera's target is its own position; choose another target")
    forward = forward / np.linalg.norm(forward)
    if np.linalg.norm(np.cross(forward, camera.up)) < 1e-6 * np.linalg.norm(camera.up):
        across = np.eye(3)[int(np.argmin(np.abs(forward)))]
        camera = replace(camera, up=(float(across[0]), float(across[1]), float(across[2])))
    return replace(scene, camera=camera)
