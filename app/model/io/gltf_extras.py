"""What of a scene glTF has no place for, kept under `extras.spectrasplat`: the brush's dabs, what lies behind, render
defaults.

Materials and lights keep theirs in `gltf_materials` and `gltf`; other programs' extras are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..scene import Dab, Material, RenderDefaults, Scene, Vec3
from ..scene_dabs import KEY, describe_dabs, read_dabs
from ..scene_environment import KEY as ENVIRONMENT
from ..scene_environment import environment_values, read_environment
from ..scene_render import read_render, render_values
from ..texture import Environment
from .gltf_document import GltfDocument
from .gltf_materials import EXTRAS, own_extras
from .scene_table import SceneTable

_SCENE = "scene"


def read_node_dabs(document: GltfDocument, index: int, number: int, material: Material) -> tuple[Dab, ...]:
    """Dabs on primitive `number` of node `index`, in the mesh's own coordinates."""
    where = f"nodes[{index}].extras.{EXTRAS}"
    kept = SceneTable(own_extras(document.item("nodes", index)), document.path, where)
    found: tuple[Dab, ...] = ()
    for entry in kept.tables(KEY):
        if entry.integer("primitive", 0, at_least=0, at_most=1 << 31) == number:
            found += read_dabs(SceneTable({KEY: entry.raw("dabs")}, document.path, entry.path), material)
    return found


def write_node_dabs(node: dict[str, Any], dabs: Mapping[int, Sequence[Dab]]) -> None:
    """Keep the dabs of a node's primitives, by number; none of them takes out what was there."""
    told = [{"primitive": number, "dabs": describe_dabs(each)} for number, each in sorted(dabs.items()) if each]
    _keep(node, KEY, told or None)


def read_scene_extras(document: GltfDocument, notes: list[str]) -> tuple[Vec3, Environment | None, RenderDefaults]:
    """Background, environment and render defaults; those of an empty scene file where there are none."""
    values = own_extras(document.json).get(_SCENE, {})
    table = SceneTable(values if isinstance(values, dict) else {}, document.path, f"extras.{EXTRAS}.{_SCENE}", notes)
    background, environment = read_environment(table)
    return background, environment, read_render(table.table("render"))


def write_scene_extras(json: dict[str, Any], scene: Scene, path: Path) -> None:
    """Keep background or environment, and render defaults, where they are not the usual ones, for a file at `path`.

    An environment's map stays in a file of its own, named relative to `path`.
    """
    usual = (0.0, 0.0, 0.0), None, RenderDefaults()
    told: dict[str, Any] = {"render": render_values(scene.render)}
    if scene.environment is None:
        told["background"] = list(scene.background_rgb)
    else:
        told[ENVIRONMENT] = environment_values(scene.environment, path)
    _keep(json, _SCENE, None if (scene.background_rgb, scene.environment, scene.render) == usual else told)


def _keep(entry: dict[str, Any], key: str, value: object) -> None:
    """Set or (None) remove `key` of our extras; nothing else is touched, and no empty dictionary stays behind."""
    own = own_extras(entry)
    if value is None and key not in own:
        return
    changed = {k: v for k, v in own.items() if k != key} | ({} if value is None else {key: value})
    extras = entry.get("extras")
    # Extras may be anything: what is no dictionary moves into one.
    others = dict(extras) if isinstance(extras, dict) else ({} if extras is None else {"value": extras})
    others.pop(EXTRAS, None)
    entry["extras"] = others | ({EXTRAS: changed} if changed else {})
    if not entry["extras"]:
        del entry["extras"]
