"""Opens a scene: our own TOML, a glTF file, or a bare mesh, always ending in one checked `Scene`.

The TOML format is described in `assets/scenes/README.md`. It is read strictly: a key that
is not understood is an error; what the file leaves out is filled in and noted in `Scene.notes`.
"""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...base import files
from ...base.errors import UserError
from ...base.paths import MESH_SUFFIXES, SCENE_SUFFIXES
from ..geometry.mesh import Mesh
from ..lights.light_file import read_light
from ..materials.material_file import read_materials
from ..naming import Names
from ..placement import Surroundings
from ..scene import Camera, Light, Scene, SceneObject
from ..scene_camera import read_camera
from ..scene_checks import check_scene
from ..scene_defaults import (
    default_camera,
    default_light,
    default_table,
    environment_of,
    framing_camera,
    parts_of,
    studio_environment,
    studio_lights,
)
from ..scene_environment import read_environment
from ..scene_objects import ObjectReader
from ..scene_render import read_render
from ..staging import AS_FOUND, Staging, with_glass
from ..texture import Environment, TextureReader
from ..vectors import Vec3
from .prescription_file import SUFFIXES as LENS_SUFFIXES
from .prescription_file import read_prescription
from .scene_table import SceneTable

GLTF_SUFFIXES = (".glb", ".gltf")


def load_scene(path: str | os.PathLike[str], staging: Staging = AS_FOUND) -> Scene:
    """The scene in `path` (.toml, .glb, .gltf, a mesh: .ply, .obj, .stl, a stone: .asc, or a lens: .zmx, .csv), with
    what `staging` asks for.

    Raises UserError, in one sentence with file, key and remedy, for anything that cannot be
    rendered as it stands.
    """
    path = Path(path)
    if not files.is_file(path):
        problem = "is a folder, not a scene file" if os.path.isdir(path) else "does not exist"
        if os.path.exists(path) and not os.path.isdir(path):
            problem = "is a device or a pipe, not a scene file"
        raise UserError(f"{path} {problem}; give one of {', '.join(SCENE_SUFFIXES)}")
    suffix = path.suffix.lower()
    if suffix == ".toml":
        if staging.up is not None:
            raise UserError(f"{path.name}: --up is for meshes and glTF files; in a scene file z is up")
        scene = _scene_from_table(SceneTable(read_toml(path), path), Kept(), staging)
    elif suffix in GLTF_SUFFIXES:
        from .gltf import load_gltf

        scene = load_gltf(path, staging)
    elif suffix in MESH_SUFFIXES:
        from .bare_mesh import objects_of_mesh

        notes: list[str] = []
        objects = objects_of_mesh(path, staging, notes)
        lights, camera, environment = _studio(objects, notes, len(parts_of(objects)) == len(objects))
        scene = Scene(path.stem, camera, lights, tuple(objects), environment=environment, notes=tuple(notes))
    elif suffix in LENS_SUFFIXES:
        from ..lens_scene import scene_of_lens

        if staging != AS_FOUND:
            raise UserError(f"{path.name}: a lens file names its axis and glasses; leave out those given besides")
        scene = scene_of_lens(read_prescription(path))
    else:
        raise UserError(f"{path}: '{path.suffix}' is not a kind of scene; use {', '.join(SCENE_SUFFIXES)}")
    return _checked(scene, path)


@dataclass(frozen=True)
class Kept:
    """What one reading of a scene's tables leaves for the next, so that what did not change is the same value."""

    meshes: dict[str, Mesh] = field(default_factory=dict)
    textures: TextureReader = field(default_factory=TextureReader)
    environments: dict[str, tuple[Vec3, Environment | None]] = field(default_factory=dict)


def scene_of(values: dict[str, Any], path: Path, kept: Kept | None = None) -> Scene:
    """The scene of the tables of a scene file in the file `path`, which need not exist.

    From Python, `mesh` may be a `Mesh`, `material` a `Material` and `environment` an `Environment`. Raises UserError
    as `load_scene`.
    """
    return _checked(_scene_from_table(SceneTable(values, path), kept or Kept(), AS_FOUND), path)


def _checked(scene: Scene, path: Path) -> Scene:
    return replace(scene, notes=tuple(dict.fromkeys((*scene.notes, *check_scene(scene, path.name)))))


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a scene file. Raises UserError where it is no TOML."""
    try:
        return tomllib.loads(files.read_text(path, files.SCENE_BYTES))
    except tomllib.TOMLDecodeError as error:
        hint = "texts need quotes, numbers a digit before the point, and keys one line each"
        raise UserError(f"{path.name} is not valid TOML: {error}; {hint}") from error
    except RecursionError as error:
        raise UserError(
            f"{path.name} is not a scene: its lists are nested too deeply; see assets/scenes for examples"
        ) from error
    except UnicodeDecodeError as error:
        raise UserError(f"{path.name} is not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except ValueError as error:  # Python's own, about an integer of thousands of digits
        raise UserError(f"{path.name} holds a whole number that is too long; write it as 1e30, say") from error
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}; give another scene file") from error


def _scene_from_table(table: SceneTable, kept: Kept, staging: Staging) -> Scene:
    name = table.string("name", table.file.stem)
    units = table.string("units", "")
    notes = table.notes
    background, environment = _read_environment(table, kept)
    render = read_render(table.table("render"))
    textures = kept.textures
    reader = ObjectReader(read_materials(table, textures), textures, kept.meshes, staging.smooth)
    placed = [(item, entry.raw("material", "")) for entry in table.tables("objects") for item in reader.read(entry)]
    objects = [item for item, _ in placed]
    if not objects:
        table.given(("camera", "lights"))
        table.finish("a scene")  # a misspelt [[object]] is the likelier mistake
        table.fail("objects", "is missing or empty; add at least one [[objects]]")
    materials = [name if isinstance(name, str) else "" for _, name in placed]
    objects = with_glass(objects, staging, table.file.name, materials)
    notes += textures.notes + reader.notes
    if environment is None and not table.given(("camera", "lights", "background")):
        table.finish("a scene")
        lights, camera, environment = _studio(objects, notes)
        return Scene(name, camera, lights, tuple(objects), background, environment, render, tuple(notes), units)
    around = environment_of(objects)
    lights = _read_lights(table, around, notes, dark_without=environment is None or _has_diffuse(objects))
    camera = _read_camera(table, around, notes)
    table.finish("a scene")
    if environment is None and not (table.has("camera") or table.has("lights")):
        _add_table(objects, notes)
    return Scene(name, camera, lights, tuple(objects), background, environment, render, tuple(notes), units)


def _read_environment(table: SceneTable, kept: Kept) -> tuple[Vec3, Environment | None]:
    given = table.given(("background", "environment"))
    if given == ["environment"] and isinstance(table.raw("environment"), Environment):
        return (0.0, 0.0, 0.0), table.raw("environment")
    identity = repr([(key, table.raw(key)) for key in given])
    if identity not in kept.environments:
        kept.environments[identity] = read_environment(table)
    return kept.environments[identity]


def _read_lights(table: SceneTable, around: Surroundings, notes: list[str], dark_without: bool) -> tuple[Light, ...]:
    """The lights; a sun where none are given and nothing would be seen without (an environment shows glass and
    mirrors)."""
    if not table.has("lights"):
        if not dark_without:
            return ()
        notes.append("No lights given: a white sun from behind on the left was added.")
        return (default_light(),)
    lights = tuple(read_light(entry, i, around) for i, entry in enumerate(table.tables("lights")))
    seen: set[str] = set()
    for i, light in enumerate(lights):
        if light.name in seen:
            table.fail(f"lights[{i}].name", f"is '{light.name}', which another light has already; give each its own")
        seen.add(light.name)
    return lights


def _read_camera(table: SceneTable, around: Surroundings, notes: list[str]) -> Camera:
    inner = table.table("camera")
    if inner is None:
        notes.append("No camera given: one that sees the objects and what falls beside them was added.")
        return default_camera(around)
    return read_camera(inner, around)


def _add_table(objects: list[SceneObject], notes: list[str], needed: bool = False) -> None:
    """A receiver for a file that gives neither camera nor lights nor anything diffuse, or that is `needed` all the
    same."""
    diffuse = _has_diffuse(objects)
    if diffuse and not needed:
        return
    table, names = default_table(objects), Names()
    names.update(item.name for item in objects)
    objects.append(replace(table, name=names.unique(table.name)))
    notes.append(f"Nothing {'to stand on' if diffuse else 'diffuse'} given: a grey table was put below the objects.")


def _has_diffuse(objects: list[SceneObject]) -> bool:
    return any(o.material.receives for o in objects)


def _studio(
    objects: list[SceneObject], notes: list[str], needs_table: bool = False
) -> tuple[tuple[Light, ...], Camera, Environment]:
    """For a file that says nothing of light or camera: a table where nothing receives or it `needs_table`, lamps, a
    camera, a room."""
    lights, camera = studio_lights(environment_of(objects)), framing_camera(objects)
    _add_table(objects, notes, needs_table)
    notes.append("A lamp, weak light from above, a camera and a quiet studio round it were added.")
    return lights, camera, studio_environment()
