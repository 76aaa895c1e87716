"""Writes a `Scene` as TOML, by description where there is one: loading it gives the same values.

Everything is told from the scene's values alone: a spectrum that is D65 is written "D65", an
absorption that a colour explains is written as that colour, a mesh that came from a shape or
a file is written as that. Only meshes nobody can name are stored as triangles. Comments and
defaults of a file that was read are not kept.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh import Mesh
from ..geometry.mesh_recipes import recipe_of
from ..scene import (
    Camera,
    Diffuse,
    Light,
    RenderDefaults,
    Scene,
    SceneObject,
)
from ..scene_dabs import KEY as DABS
from ..scene_dabs import describe_dabs
from ..scene_describe import describe_material, describe_spectrum
from ..scene_environment import KEY as ENVIRONMENT
from ..scene_environment import environment_values
from ..scene_objects import INLINE
from .scene_pictures import picture_file, relative_name

INLINE_TRIANGLES = 64
"""Flat meshes of no more triangles than this go into the scene file itself."""

_POWER_KEY = {
    "point": "intensity_w_sr",
    "spot": "intensity_w_sr",
    "directional": "irradiance_w_m2",
    "collimated": "irradiance_w_m2",
    "area": "radiance_w_sr_m2",
}


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write `scene` to the TOML file `path`, whole or not at all.

    Meshes without a description go to PLY files in the folder `<stem>_meshes` beside it, pictures
    without a file to `<stem>_pictures`.
    Raises UserError when something cannot be written.
    """
    from ...base.atomic import atomic_output, check_writable

    path = Path(path)
    check_writable(path)
    text = scene_text(scene, path)
    with atomic_output(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def scene_text(scene: Scene, path: Path) -> str:
    """The TOML text of `scene` as it would stand in `path`; writes PLY and picture files where it must."""
    behind = {"background": list(scene.background_rgb)} if scene.environment is None else {}
    parts = [toml_block("", {"name": scene.name} | behind | ({} if scene.lights else {"lights": []}))]
    parts.append(toml_block("[camera]", camera_values(scene.camera)))
    parts.append(toml_block("[render]", render_values(scene.render)))
    if scene.environment is not None:
        parts.append(toml_block(f"[{ENVIRONMENT}]", environment_values(scene.environment, path)))
    parts += [toml_block("[[lights]]", light_values(light)) for light in scene.lights]
    materials: dict[str, dict[str, Any]] = {}
    objects = [toml_block("[[objects]]", _objects(group, materials, path)) for group in _groups(scene.objects)]
    parts += [toml_block(f"[materials.{toml_key(name)}]", values) for name, values in materials.items()]
    return "\n".join(parts + objects)


# -- parts of a scene ---------------------------------------------------------------------


def camera_values(camera: Camera) -> dict[str, Any]:
    """The [camera] table of a scene file."""
    values: dict[str, Any] = {
        "kind": camera.kind,
        "position": list(camera.position),
        "target": list(camera.target),
        "up": list(camera.up),
    }
    if camera.kind == "pinhole":
        return values | {"vertical_fov_deg": camera.vertical_fov_deg}
    return values | {"vertical_extent": camera.vertical_extent}


def render_values(render: RenderDefaults) -> dict[str, Any]:
    """The [render] table of a scene file."""
    return {
        "size": [render.width, render.height],
        "photons": render.photons,
        "exposure_ev": render.exposure_ev,
        "max_depth": render.max_depth,
    }


def light_values(light: Light) -> dict[str, Any]:
    """One of the [[lights]] of a scene file."""
    values: dict[str, Any] = {"name": light.name, "kind": light.kind}
    if light.kind != "directional":
        values["position"] = list(light.position)
    if light.kind != "point":
        values["direction"] = list(light.direction)
    if light.kind == "spot":
        values["half_angle_deg"] = light.outer_half_angle_deg
        values["inner_half_angle_deg"] = light.inner_half_angle_deg
    if light.kind == "directional":
        values["angular_diameter_deg"] = light.angular_diameter_deg
    if light.kind in ("collimated", "area"):
        values["shape"] = light.shape
        if light.shape == "disc":
            values["radius"] = light.radius
        else:
            values["size"] = [light.width, light.height]
            if light.tangent is not None:
                values["tangent"] = list(light.tangent)
    values["spectrum"] = describe_spectrum(light.spectral_power)
    values[_POWER_KEY[light.kind]] = light.spectral_power.power_w()
    return values


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
    values = describe_material(item.material)
    texture = item.material.texture if isinstance(item.material, Diffuse) else None
    if texture is not None:
        values["texture"] = {"file": picture_file(texture.rgb, texture.source, path), "wrap": texture.wrap}
    if set(values) == {"glass"}:
        return values
    for name, known in materials.items():
        if known == values:
            return {"material": name}
    stem = str(values.get("name") or values.get("glass") or values.get("kind") or "glass")
    name, number = stem, 1
    while name in materials:
        number += 1
        name = f"{stem} {number}"
    materials[name] = values
    return {"material": name}


def _mesh(mesh: Mesh, path: Path) -> dict[str, Any]:
    recipe = recipe_of(mesh)
    if recipe is not None:
        values = dict(recipe)
        for key in ("mesh", "heights"):
            if isinstance(values.get(key), str):
                values[key] = relative_name(values[key], path.parent)
        return values
    if mesh.corner_normals is None and len(mesh.triangles) <= INLINE_TRIANGLES:
        uv = {} if mesh.uv is None else {"uv": mesh.uv.reshape(-1, 2).tolist()}
        return {"shape": INLINE, "vertices": mesh.vertices.tolist(), "triangles": mesh.triangles.tolist()} | uv
    from .mesh_io import save_ply

    folder = path.parent / f"{path.stem}_meshes"
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot write the meshes of {path}: {folder} cannot be made ({error.strerror}); choose another name"
        ) from error
    target = folder / f"{_file_stem(mesh)}.ply"
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


# -- TOML ---------------------------------------------------------------------------------


def toml_block(header: str, values: dict[str, Any]) -> str:
    """A table with its header ("" for the top level), as TOML text."""
    lines = [header] if header else []
    return "\n".join(lines + [f"{toml_key(key)} = {_value(value)}" for key, value in values.items()]) + "\n"


def toml_key(key: str) -> str:
    """A key, in quotes where it needs them."""
    bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if bare else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value)) if math.isfinite(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    return "[" + ", ".join(_value(entry) for entry in value) + "]"
