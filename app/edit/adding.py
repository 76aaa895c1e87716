"""New objects: the primitives by name, placed where there is room and where they can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..base.errors import UserError, suggestion
from ..model.materials.dielectric import DEFAULT_GLASS
from ..model.naming import free_name
from ..model.optics import catalogue
from ..model.scene import Dielectric, Diffuse, Material, Scene, SceneObject
from ..model.scene_checks import check_scene
from ..model.scene_defaults import bounds_of, environment_of
from ..model.scene_objects import INLINE, make_shape
from ..model.scene_objects import SHAPES as ALL_SHAPES
from ..model.vectors import frozen

SHAPES = tuple(shape for shape in ALL_SHAPES if shape not in ("doublet", "revolution", "height_field", INLINE))
"""What can be added, by its name in the scene file."""
RECEIVERS = ("plane", "disc")
"""Those of them that are open and become diffuse."""


def add_object(scene: Scene, shape: str) -> Scene:
    """With one of `SHAPES` at the end: glass beside the other objects, or a diffuse receiver below them.

    Its size suits the rest of the scene, and it is upright, whichever axis is up.
    """
    if shape not in SHAPES:
        raise UserError(f"there is no shape '{shape}'{suggestion(shape, SHAPES) or '; known are ' + ', '.join(SHAPES)}")
    receiver = shape in RECEIVERS
    material: Material = Diffuse() if receiver else Dielectric(catalogue.find(DEFAULT_GLASS))
    name = free_name(shape.replace("_", " "), [o.name for o in scene.objects])
    item = SceneObject(name, make_shape(shape), material)
    low, high = item.mesh.bounds()
    around = environment_of(scene.objects)
    scale = (8.0 if receiver else 1.2) * around.radius / float(np.linalg.norm(high - low))
    matrix = np.eye(4)
    matrix[:3, :3] = up_frame(scene) * scale
    matrix[:3, 3] = around.centre - matrix[:3, :3] @ (0.5 * (low + high))
    item = _standing(scene, replace(item, object_to_world=matrix), below=receiver)
    changed = replace(scene, objects=(*scene.objects, item if receiver else beside(scene, [item])[0]))
    check_scene(changed, scene.name)
    return changed


def up_frame(scene: Scene) -> np.ndarray:
    """Rotation from a z-up world to this scene's (glTF has y up), float64 (3, 3), by the camera's up direction."""
    axis = int(np.argmax(np.abs(scene.camera.up)))
    # A quarter turn about x, as glTF has it; a third of a turn about the diagonal.
    if axis == 1:
        return np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
    return np.eye(3) if axis == 2 else np.array([(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])


def beside(scene: Scene, items: Sequence[SceneObject]) -> list[SceneObject]:
    """`items` moved sideways together to the first place where they overlap no other object and hold no light."""
    low, high = bounds_of(items)
    sideways, forward, _ = up_frame(scene).T
    solid = [o.world_bounds for o in scene.objects if not o.material.receives]
    lights = [np.array(light.position) for light in scene.lights if light.has_place]
    step = 1.1 * np.abs(high - low)
    for ring in range(64):
        for direction in (sideways, -sideways, forward, -forward):
            offset = ring * step * direction
            box = (low + offset, high + offset)
            free = not any(_overlap(box, other) for other in solid)
            if free and not any((box[0] <= p).all() and (p <= box[1]).all() for p in lights):
                return [_moved(item, offset) for item in items]
    return [_moved(item, 64 * step * sideways) for item in items]


def _standing(scene: Scene, item: SceneObject, below: bool) -> SceneObject:
    """`item` with its lowest point where the other objects have theirs, or a hair below that."""
    up = up_frame(scene)[:, 2]
    around = environment_of(scene.objects)
    floor = min(
        float(corner @ up)
        for corner in bounds_of([o for o in scene.objects if not o.material.receives] or scene.objects)
    )
    lowest = float(item.world_vertices.dot(up).min())
    # As for the default table: two surfaces must not coincide.
    hair = -1e-3 if below else 1e-3
    return _moved(item, (floor + hair * around.radius - lowest) * up)


def _overlap(a: tuple[np.ndarray, np.ndarray] | np.ndarray, b: np.ndarray) -> bool:
    return bool(np.all(a[0] <= b[1]) and np.all(b[0] <= a[1]))


def _moved(item: SceneObject, offset: np.ndarray) -> SceneObject:
    matrix = item.object_to_world.copy()
    matrix[:3, 3] += offset
    return replace(item, object_to_world=frozen(matrix))
