"""How a gizmo moves a thing: its frame in the world, and the thing after that frame was moved, turned or scaled.

Pure functions over objects and lights. A frame is a right-handed orthonormal (4, 4) matrix at the thing's middle. The
change is worked out in float64 from where the drag began, so nothing drifts and sheared placements stay sheared.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..base.errors import UserError
from ..model.scene import Light, Scene
from ..model.scene_defaults import bounds_of
from ..model.vectors import unit, vec3
from .lights import set_light
from .matrices import nearest_orthogonal
from .objects import set_transform
from .state import Selection

Operation = Literal["move", "rotate", "scale"]
MIN_SCALE = 1e-3
"""Smallest factor of one drag: a flat thing could not be pulled apart again."""


def can_do(scene: Scene, selection: Selection, operation: Operation) -> bool:
    """Whether an operation means anything for the selection."""
    if selection.kind == "object":
        return selection.index < len(scene.objects)
    if selection.kind != "light" or selection.index >= len(scene.lights):
        return False
    light = scene.lights[selection.index]
    if operation == "move":
        return light.has_place
    if operation == "rotate":
        return light.has_direction
    return light.has_outline


def frame_of(scene: Scene, selection: Selection, is_local: bool) -> np.ndarray:
    """The selection's frame (4, 4): its own axes, or the world's."""
    frame = np.eye(4)
    if selection.kind == "light":
        light = scene.lights[selection.index]
        frame[:3, 3] = light_place(scene, light)
        if is_local:
            frame[:3, :3] = light.axes()
        return frame
    item = scene.objects[selection.index]
    frame[:3, 3] = item.world_bounds.mean(axis=0)
    if is_local:
        frame[:3, :3] = _nearest_rotation(item.object_to_world[:3, :3])
    return frame


def light_place(scene: Scene, light: Light) -> np.ndarray:
    """Where a light is drawn: a directional one, which is nowhere, beside what it shines on."""
    if light.has_place:
        return np.asarray(light.position, float)
    chosen = [o for o in scene.objects if o.material.is_specular] or list(scene.objects)
    low, high = bounds_of(chosen)
    return 0.5 * (low + high) - 0.9 * float(np.linalg.norm(high - low)) * unit(light.direction)


def change(before: np.ndarray, after: np.ndarray, operation: Operation) -> np.ndarray:
    """World matrix (4, 4) that takes the frame `before` to `after`, of which only the operation's own part counts."""
    delta = np.eye(4)
    centre = before[:3, 3]
    if operation == "move":
        delta[:3, 3] = after[:3, 3] - centre
        return delta
    if operation == "rotate":
        delta[:3, :3] = _nearest_rotation(after[:3, :3]) @ before[:3, :3].T
    else:
        factors = np.maximum(np.linalg.norm(after[:3, :3], axis=0), MIN_SCALE)
        delta[:3, :3] = before[:3, :3] @ np.diag(factors) @ before[:3, :3].T
    delta[:3, 3] = centre - delta[:3, :3] @ centre
    return delta


def changed(scene: Scene, selection: Selection, delta: np.ndarray) -> Scene:
    """`scene` with the selection moved by a world matrix. Raises `UserError` where the scene may not be so."""
    if selection.kind == "object":
        return set_transform(scene, selection.index, delta @ scene.objects[selection.index].object_to_world)
    if selection.kind != "light":
        raise UserError("nothing is selected")
    return set_light(scene, selection.index, moved_light(scene.lights[selection.index], delta))


def moved_light(light: Light, delta: np.ndarray) -> Light:
    """A light after a world matrix: its place, direction, and the size of what it opens with."""
    linear = delta[:3, :3]
    axes = light.axes()
    stretched = np.linalg.norm(linear @ axes, axis=0)
    position = (delta @ np.append(np.asarray(light.position, float), 1.0))[:3]
    moved = light.changed(position=vec3(position)) if light.has_place else light
    if light.has_direction and not np.allclose(linear, np.eye(3), atol=1e-12):
        moved = moved.changed(direction=vec3(unit(linear @ axes[:, 2])))
        if light.tangent is not None or light.has_roll:
            moved = moved.changed(tangent=vec3(unit(linear @ axes[:, 0])))
    # A disc stays round: whichever of its two directions was pulled counts.
    across = stretched[:2][np.argmax(np.abs(np.log(stretched[:2])))]
    return moved.resized(float(across), float(stretched[0]), float(stretched[1]))


def _nearest_rotation(linear: np.ndarray) -> np.ndarray:
    rotation = nearest_orthogonal(linear)
    if np.linalg.det(rotation) < 0.0:
        rotation[:, 2] *= -1.0
    return rotation
