"""Writes a `Scene` as TOML, by description where there is one: loading it gives the same values.

Everything is written from the scene's values alone: a spectrum that is D65 is written "D65", an
absorption that a colour explains is written as that colour, a mesh that came from a shape or
a file is written as that. Only meshes nobody can name are stored as triangles. Saved over the file it came from,
a scene keeps there what a person wrote and nobody changed.
"""

from __future__ import annotations

import os
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ...base import files
from ...base.atomic import atomic_output, check_writable
from ...base.errors import UserError
from ..geometry.mesh import Mesh
from ..lights.light_file import light_values
from ..local_dispersion import DABS, describe_dabs
from ..naming import free_name
from ..placement import PLACEMENT_KEYS
from ..scene import Scene, SceneObject
from ..scene_camera import camera_values
from ..scene_defaults import environment_of
from ..scene_environment import ENVIRONMENT, environment_values
from ..scene_objects import INLINE, parameters_of
from ..scene_render import render_values
from ..texture import Environment
from .kept_words import kept_light, kept_placement, merged
from .scene_file import load_scene
from .scene_pictures import folder_beside, kept_name, relative_name
from .toml_text import toml_text

_OVER_GLASS = ("dispersion_gain", "priority", "roughness")
"""Keys that an object may have beside its `glass`."""
_FILE_KEYS = ("mesh", "heights", "texture", "file", "csv")
"""Keys whose texts name files (`SceneTable.existing_file`)."""
INLINE_TRIANGLES = 64
"""Flat meshes of no more triangles than this go into the scene file itself."""


def save_scene(scene: Scene, path: str | os.PathLike[str], words_from: Path | None = None) -> None:
    """Write `scene` to the TOML file `path`, whole or not at all.

    Meshes without a description go to PLY files in the folder `<stem>_meshes` beside it, pictures without a file to
    `<stem>_pictures`, copies of files that the scene may not read from there to `<stem>_files`. `words_from`: the
    scene file it was opened from, perhaps `path` itself; what did not change keeps the words, order and comments it has
    there.
    Raises UserError when something cannot be written.
    """
    path = Path(path)
    check_writable(path)
    values, before = scene_values(scene, path), ""
    if words_from is not None and words_from.suffix.lower() == ".toml" and files.is_file(words_from):
        with suppress(UserError, OSError, ValueError):
            text = files.read_text(words_from, files.SCENE_BYTES)
            raw = tomllib.loads(text)
            if words_from.parent.resolve() != path.parent.resolve():
                raw = _renamed_files(raw, words_from.parent, path)
            values, before = _kept(scene, path, raw, words_from), text
    text = toml_text(values, before)
    with atomic_output(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def scene_values(scene: Scene, path: Path) -> dict[str, Any]:
    """The tables of `scene` as they would stand in `path`; writes PLY and picture files where it must."""
    values: dict[str, Any] = {"name": scene.name} | ({"units": scene.units} if scene.units else {})
    if scene.environment is None:
        values["background"] = list(scene.background_rgb)
    if not scene.lights:
        values["lights"] = []
    values["camera"] = camera_values(scene.camera)
    values["render"] = render_values(scene.render)
    if scene.environment is not None:
        values[ENVIRONMENT] = environment_values(scene.environment, path)
    if scene.lights:
        values["lights"] = [light_values(light, path) for light in scene.lights]
    materials: dict[str, dict[str, Any]] = {}
    objects = [_objects(group, materials, path) for group in _groups(scene.objects)]
    return values | ({"materials": materials} if materials else {}) | {"objects": objects}


# -- over what a person wrote -------------------------------------------------------------


def _renamed_files(raw: Any, folder: Path, path: Path) -> Any:
    """`raw`, written in `folder`, with files called what the scene file `path` has to call them; else as it was."""
    if isinstance(raw, list):
        return [_renamed_files(value, folder, path) for value in raw]
    if not isinstance(raw, dict):
        return raw
    return {
        key: kept_name(str(folder / value), path)
        if key in _FILE_KEYS and isinstance(value, str) and files.is_file(folder / value)
        else _renamed_files(value, folder, path)
        for key, value in raw.items()
    }


def _kept(scene: Scene, path: Path, raw: dict[str, Any], written: Path) -> dict[str, Any]:
    """`raw`, the tables that stand in the file `written`, with what differs in `scene` replaced."""
    before = load_scene(written)
    values = dict(raw)
    if scene.name != before.name:
        values["name"] = scene.name
    for key, describe in (("camera", camera_values), ("render", render_values)):
        old, new = (describe(getattr(each, key)) for each in (before, scene))
        if old != new:
            values[key] = merged(raw[key], old, new) if key in raw else new
    if scene.background_rgb != before.background_rgb or not _same_environment(scene.environment, before.environment):
        for key in ("background", ENVIRONMENT):
            values.pop(key, None)
        if scene.environment is None:
            values["background"] = list(scene.background_rgb)
        else:
            values[ENVIRONMENT] = environment_values(scene.environment, path)
    if scene.lights != before.lights:
        values["lights"] = _kept_lights(scene, before, raw.get("lights", []), path)
    materials = dict(raw.get("materials", {}))
    values["objects"] = _kept_objects(scene, before, raw["objects"], materials, path)
    if materials:
        values["materials"] = materials
    return values


def _kept_lights(scene: Scene, before: Scene, raw: list[dict[str, Any]], path: Path) -> list[dict[str, Any]]:
    """The [[lights]]: one that was there keeps its words, or those of them that still hold."""
    pairs = list(zip(before.lights, raw, strict=False))
    by_name = {light.name: (light, entry) for light, entry in pairs}
    around = environment_of(scene.objects)
    entries = []
    for index, light in enumerate(scene.lights):
        known = by_name.get(light.name)
        if known is None and len(scene.lights) == len(pairs):
            known = pairs[index]  # renamed
        if known is None:
            entries.append(light_values(light, path))
        elif known[0] == light:
            entries.append(known[1])
        else:
            entries.append(kept_light(known[1], known[0], light, path, index, around))
    return entries


def _kept_objects(
    scene: Scene, before: Scene, raw: list[dict[str, Any]], materials: dict[str, dict[str, Any]], path: Path
) -> list[dict[str, Any]]:
    """The [[objects]]: an entry whose objects are all as they were stays as it is written."""
    entries: dict[str, tuple[dict[str, Any], tuple[SceneObject, ...]]] = {}
    first = 0
    for entry in raw:
        of_entry = before.objects[first : first + len(entry.get("instances", (None,)))]
        entries[of_entry[0].name] = entry, of_entry
        first += len(of_entry)
    written: list[dict[str, Any]] = []
    changed: list[SceneObject] = []

    def write_changed() -> None:
        written.extend(_objects(group, materials, path) for group in _groups(tuple(changed)))
        changed.clear()

    at = 0
    while at < len(scene.objects):
        entry, old = entries.get(scene.objects[at].name, ({}, ()))
        if not old and len(scene.objects) == len(before.objects):
            # Renamed: what stood at its place.
            entry, old = entries.get(before.objects[at].name, ({}, ()))
        new = scene.objects[at : at + len(old)]
        if old and len(new) == len(old) and all(map(_same_object, new, old)):
            write_changed()
            written.append(entry)
            at += len(old)
        elif len(old) == 1 and "instances" not in entry:
            write_changed()
            written.append(_kept_object(entry, old[0], scene.objects[at], materials, path))
            at += 1
        else:
            changed.append(scene.objects[at])
            at += 1
    write_changed()
    return written


def _kept_object(
    entry: dict[str, Any], old: SceneObject, new: SceneObject, materials: dict[str, dict[str, Any]], path: Path
) -> dict[str, Any]:
    """The entry of an object that was edited, with the words that still hold."""
    values = {key: value for key, value in entry.items() if key not in (*PLACEMENT_KEYS, "rests_at_z")}
    if old.name != new.name:
        values["name"] = new.name
    if not _same_mesh(old.mesh, new.mesh):
        # Those of the entry's own shape are others where it is one of `primitives.SPECIAL`.
        written = parameters_of(entry["shape"]) if "shape" in entry else ()
        for key in (*(old.mesh.recipe or ("vertices", "triangles", "uv", "mesh")), "shape", *written):
            values.pop(key, None)
        values |= _mesh(new.mesh, path)
    if old.material.values() != new.material.values():
        values = _kept_material(values, old, new, materials, path)
    values.pop(DABS, None)
    placed = kept_placement(entry, new.mesh, new.object_to_world, path)
    # In the order in which they were written, so that comments stay where they are.
    order = {key: i for i, key in enumerate(entry)}
    table = values | placed | _dabs(new)
    return dict(sorted(table.items(), key=lambda item: order.get(item[0], len(order))))


def _kept_material(
    values: dict[str, Any], old: SceneObject, new: SceneObject, materials: dict[str, dict[str, Any]], path: Path
) -> dict[str, Any]:
    """`values` with the words of another material; its glass keeps the name that it was given."""
    wanted = new.material.values(path)
    written, was = values.get("glass"), old.material.values().get("glass")
    kept = {key: value for key, value in values.items() if key not in ("glass", "material", *_OVER_GLASS)}
    if isinstance(written, str) and wanted.get("glass") == was:
        wanted = wanted | {"glass": written}
        if wanted.keys() <= {"glass", *_OVER_GLASS}:
            return kept | wanted
    if isinstance(values.get("material"), dict):
        before, words = old.material.values(path), values["material"]
        # A grey of one number, say, where something else of the material changed.
        same = {key: words[key] for key in wanted if key in words and before.get(key) == wanted[key]}
        return kept | {"material": wanted | same}
    return kept | _material(new, materials, path)


def _same_mesh(a: Mesh, b: Mesh) -> bool:
    recipe = a.recipe
    return recipe == b.recipe and (recipe is not None or np.array_equal(a.vertices, b.vertices))


def _same_object(a: SceneObject, b: SceneObject) -> bool:
    return (
        a.name == b.name
        and np.array_equal(a.object_to_world, b.object_to_world)
        and a.local_dispersion == b.local_dispersion
        and _same_mesh(a.mesh, b.mesh)
        and a.material.values() == b.material.values()
    )


def _same_environment(a: Environment | None, b: Environment | None) -> bool:
    if a is None or b is None:
        return a is b
    words = [(e.kind, dict(e.parameters), e.source) for e in (a, b)]
    return words[0] == words[1] and np.array_equal(a.world_to_local, b.world_to_local) and np.array_equal(a.rgb, b.rgb)


# -- objects ------------------------------------------------------------------------------


def _groups(objects: tuple[SceneObject, ...]) -> list[list[SceneObject]]:
    """Neighbours that share mesh and material: written once, with instances."""
    groups: list[list[SceneObject]] = []
    for item in objects:
        if groups and groups[-1][0].mesh is item.mesh and groups[-1][0].material is item.material:
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups


def _objects(group: list[SceneObject], materials: dict[str, dict[str, Any]], path: Path) -> dict[str, Any]:
    first = group[0]
    values: dict[str, Any] = {"name": first.name} if len(group) == 1 else {}
    values |= _mesh(first.mesh, path) | _material(first, materials, path)
    if len(group) > 1:
        values["instances"] = [{"name": item.name, "matrix": _matrix(item)} | _dabs(item) for item in group]
        return values
    if not np.array_equal(first.object_to_world, np.eye(4)):
        values["matrix"] = _matrix(first)
    return values | _dabs(first)


def _dabs(item: SceneObject) -> dict[str, Any]:
    return {DABS: describe_dabs(item.local_dispersion)} if item.local_dispersion else {}


def _matrix(item: SceneObject) -> list[float]:
    return [float(v) for v in item.object_to_world.ravel()]


def _material(item: SceneObject, materials: dict[str, dict[str, Any]], path: Path) -> dict[str, Any]:
    """`glass = …` where that says it all, else `material = …` naming an entry of `materials`."""
    values = item.material.values(path)
    if set(values) == {"glass"}:
        return values
    for name, known in materials.items():
        if known == values:
            return {"material": name}
    stem = str(values.get("name") or values.get("glass") or values.get("kind") or "glass")
    name = stem if stem not in materials else free_name(f"{stem} 2", [*materials])
    materials[name] = values
    return {"material": name}


def _mesh(mesh: Mesh, path: Path) -> dict[str, Any]:
    recipe = mesh.recipe
    if recipe is not None:
        values = dict(recipe)
        for key in ("mesh", "heights"):
            if isinstance(values.get(key), str):
                values[key] = kept_name(values[key], path)
        return values
    if mesh.corner_normals is None and len(mesh.triangles) <= INLINE_TRIANGLES:
        uv = {} if mesh.uv is None else {"uv": mesh.uv.reshape(-1, 2).tolist()}
        return {"shape": INLINE, "vertices": mesh.vertices.tolist(), "triangles": mesh.triangles.tolist()} | uv
    from .mesh_io import save_ply

    target = folder_beside(path, "meshes") / f"{_file_stem(mesh)}.ply"
    save_ply(mesh, target)
    return {"mesh": relative_name(str(target), path.parent)}


def _file_stem(mesh: Mesh) -> str:
    """A file name that holds the mesh's name and is the same only for the same triangles."""
    import hashlib

    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.triangles.tobytes())
    for more in (mesh.corner_normals, mesh.uv):
        if more is not None:
            digest.update(more.tobytes())
    plain = "".join(c if c.isalnum() else "_" for c in mesh.name)[:40]
    return f"{plain}_{digest.hexdigest()[:12]}"
