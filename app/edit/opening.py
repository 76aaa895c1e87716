"""The scene in a file, with what the user wants in addition to what it says; and its objects, added to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..base.errors import UserError
from ..base.paths import MESH_SUFFIXES
from ..model.io.bare_mesh import objects_of_mesh
from ..model.io.scene_file import load_scene
from ..model.naming import free_name
from ..model.scene import Scene
from ..model.scene_checks import check_scene
from ..model.scene_defaults import environment_of
from ..model.scene_environment import STUDIO_MAP
from ..model.staging import Staging
from .adding import beside
from .environments import ENVIRONMENT_SUFFIXES, set_environment_kind, set_environment_map

STUDIO, SKY = "studio", "sky"
_TOO_LARGE, _TOO_SMALL = 20.0, 1.0 / 20.0
"""Sizes relative to the scene's own at which a mesh's unit is taken for another one."""


@dataclass(frozen=True)
class Opening:
    """What is wanted of a file: of its objects, and the environment ("studio", "sky" or a panorama's file)."""

    staging: Staging = field(default_factory=Staging)
    environment: str | None = None


AS_FOUND = Opening()


def open_scene(path: Path, opening: Opening = AS_FOUND) -> Scene:
    """The scene in `path` as wanted. Raises UserError for what cannot be opened or cannot be fulfilled."""
    scene = load_scene(path, opening.staging)
    wish = opening.environment
    source = None if scene.environment is None else scene.environment.source
    if wish is None or (wish == STUDIO and source == str(STUDIO_MAP.resolve())):
        return scene
    # Anew, so that its brightness is fitted to the lights.
    plain = replace(scene, environment=None)
    if wish == SKY:
        return set_environment_kind(plain, "sky")
    return set_environment_map(plain, STUDIO_MAP if wish == STUDIO else _panorama(wish))


def _panorama(name: str) -> Path:
    path = Path(name).expanduser()
    if path.suffix.lower() not in ENVIRONMENT_SUFFIXES:
        raise UserError(
            f"--environment '{name}' is neither {STUDIO} nor {SKY} nor a panorama; give a latitude-longitude picture "
            f"({', '.join(ENVIRONMENT_SUFFIXES)})"
        )
    return path


def import_objects(scene: Scene, path: Path) -> Scene:
    """`scene` with the objects of the file at `path` at its end, under names of their own.

    A bare mesh, which knows no unit, is brought to the scene's size where it is off by more than twenty times, and
    its parts are placed together next to the others; objects of scenes and glTF files stay where those have them.
    Lights, cameras and what was added to light and to catch a bare file's caustic are left out. Raises UserError for
    what cannot be opened.
    """
    is_mesh = path.suffix.lower() in MESH_SUFFIXES
    brought = objects_of_mesh(path, Staging(), []) if is_mesh else list(load_scene(path).objects)
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
