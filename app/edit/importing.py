"""Objects of a mesh, a glTF file or another scene, added to the scene that is open."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..base.errors import UserError
from ..base.paths import MESH_SUFFIXES
from ..model.io.bare_mesh import objects_of_mesh
from ..model.naming import free_name
from ..model.scene import Scene
from ..model.scene_checks import check_scene
from ..model.scene_defaults import environment_of
from ..model.staging import AS_FOUND
from .adding import beside
from .opening import open_scene

_TOO_LARGE, _TOO_SMALL = 20.0, 1.0 / 20.0
"""Sizes relative to the scene's own at which a mesh's unit is taken for another one."""


def import_objects(scene: Scene, path: Path) -> Scene:
    """`scene` with the objects of the file at `path` at its end, under names of their own.

    A bare mesh, which knows no unit, is brought to the scene's size where it is off by more than twenty times, and
    its parts are placed together next to the others; objects of scenes and glTF files stay where those have them.
    Lights, cameras and what was added to light and to catch a bare file's caustic are left out. Raises UserError for
    what cannot be opened.
    """
    is_mesh = path.suffix.lower() in MESH_SUFFIXES
    brought = objects_of_mesh(path, AS_FOUND, []) if is_mesh else list(open_scene(path).objects)
    if not brought:
        raise UserError(f"{path.name} holds no objects to import")
    if is_mesh and scene.objects:
        around = environment_of(scene.objects)
        share = environment_of(brought).radius / max(around.radius, 1e-12)
        if not _TOO_SMALL < share < _TOO_LARGE:
            scaled = np.diag([*(3 * [0.6 / share]), 1.0])
            brought = [replace(item, object_to_world=scaled @ item.object_to_world) for item in brought]
        brought = beside(scene, brought)
    taken = [item.name for item in scene.objects]
    named = []
    for item in brought:
        name = free_name(item.name, taken)
        taken.append(name)
        named.append(replace(item, name=name))
    changed = replace(scene, objects=(*scene.objects, *named))
    check_scene(changed, scene.name)
    return changed
