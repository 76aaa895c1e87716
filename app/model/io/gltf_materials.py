"""glTF materials to ours and back.

A scene file's own words, kept under `extras.spectrasplat`, win over everything: `glass`
names a catalogue glass, `material` is a whole material table. Without them transmission,
ior, dispersion and volume make a glass, a smooth metal makes a mirror, and the base colour
anything else a diffuse surface, with a coat where that is smooth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..fields import write_fields
from ..materials.finish import USUAL_COAT_INDEX, read_finish
from ..materials.material_file import read_material
from ..optics import catalogue, glass
from ..scene import (
    Absorption,
    Dielectric,
    Diffuse,
    Material,
    Mirror,
)
from ..vectors import vec3
from .gltf_document import GltfDocument
from .gltf_textures import GltfTextures
from .scene_table import SceneTable

TRANSMISSION, VOLUME, IOR, DISPERSION = (f"KHR_materials_{n}" for n in ("transmission", "volume", "ior", "dispersion"))
EXTRAS = "spectrasplat"
_GLASS_EXTENSIONS = (TRANSMISSION, VOLUME, IOR, DISPERSION)
_MIRROR_ROUGHNESS = 0.2
_COAT_ROUGHNESS = 0.5
"""From here on what a dielectric reflects is a faint sheen, which is left out: 0.5 is what modellers give to all."""
_FINISH = "finish"
_BASE_COLOUR = "baseColorTexture"


def own_extras(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What an entry's extras hold of ours; empty where there is nothing."""
    extras = entry.get("extras")
    own = extras.get(EXTRAS) if isinstance(extras, dict) else None
    return own if isinstance(own, dict) else {}


def read_gltf_material(document: GltfDocument, index: int | None, textures: GltfTextures, notes: list[str]) -> Material:
    """Material `index` of the document, None being glTF's default; what was assumed goes to `notes`."""
    if index is None:
        return Diffuse((0.8, 0.8, 0.8))
    values = document.item("materials", index)
    label = f"material '{values.get('name', index)}'"
    where = f"{document.path.name}: materials[{index}]"
    own, extras = own_extras(values), values.get("extras")
    if "material" in own:
        table = SceneTable(own["material"], document.path, f"materials[{index}].extras.{EXTRAS}.material")
        return _with_textures_told(read_material(table), values, label, notes)
    named = own.get("glass", extras.get("glass") if isinstance(extras, dict) else None)
    extensions = values.get("extensions", {})
    if named is not None:
        dispersion = catalogue.find(str(named), f"{where}.extras.glass")
        return _with_textures_told(Dielectric(dispersion, _absorption(extensions, where)), values, label, notes)
    pbr = values.get("pbrMetallicRoughness", {})
    rgb = vec3(min(1.0, max(0.0, float(c))) for c in (*pbr.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)),)[:3])
    roughness = float(pbr.get("roughnessFactor", 1.0))
    transmission = float(extensions.get(TRANSMISSION, {}).get("transmissionFactor", 0.0))
    if transmission >= 0.5:
        return _with_textures_told(_glass(document, values, label, where, notes), values, label, notes)
    if transmission > 0.0:
        notes.append(f"{label}: transmission {transmission:g} is less than one half and is taken as opaque.")
    is_metal = float(pbr.get("metallicFactor", 1.0)) >= 0.5
    if is_metal and roughness <= _MIRROR_ROUGHNESS:
        return _with_textures_told(Mirror(rgb), values, label, notes)
    finish: dict[str, Any] = {}
    if _FINISH in own:
        finish = read_finish(SceneTable(own[_FINISH], document.path, f"materials[{index}].extras.{EXTRAS}.{_FINISH}"))
    elif roughness < _COAT_ROUGHNESS and not is_metal:
        ior = float(extensions.get(IOR, {}).get("ior", USUAL_COAT_INDEX))
        finish = {"roughness": max(roughness, 0.0), "coat_index": min(max(ior, 1.0), 4.0)}
    material = Diffuse(rgb, texture=textures.base_colour(values, label), **finish)
    return _with_textures_told(material, values, label, notes)


def _with_textures_told(material: Material, values: dict[str, Any], label: str, notes: list[str]) -> Material:
    """`material`, after a note on the textures it does not show."""
    shown = {_BASE_COLOUR} if material.receives else set()
    if any("Texture" in key for key in _all_keys(values) if key not in shown):
        others = "other " if getattr(material, "texture", None) is not None else ""
        notes.append(f"{label}: its {others}textures are not shown, only its factors (they are kept when saving).")
    return material


def _all_keys(values: Any) -> list[str]:
    if isinstance(values, dict):
        return [k for key, value in values.items() for k in (str(key), *_all_keys(value)) if key != "extras"]
    return []


def _glass(document: GltfDocument, values: dict[str, Any], label: str, where: str, notes: list[str]) -> Dielectric:
    extensions = values["extensions"]
    n_d = float(extensions.get(IOR, {}).get("ior", 1.5))
    if n_d == 0.0:
        notes.append(f"{label}: ior 0 stands for total reflection in old files; 1.5 is used.")
        n_d = 1.5
    if float(extensions.get(VOLUME, {}).get("thicknessFactor", 0.0)) == 0.0:
        notes.append(f"{label} is thin-walled in glTF (thicknessFactor 0); its meshes are taken as solid glass.")
    strength = float(extensions.get(DISPERSION, {}).get("dispersion", 0.0))
    name = str(values.get("name", ""))
    dispersion = glass.from_abbe(n_d, glass.gltf_dispersion_to_abbe(strength), name, f"{where}.extensions.{IOR}.ior")
    given = values.get("pbrMetallicRoughness", {}).get("roughnessFactor")
    if given is None:
        notes.append(f"{label} names no roughnessFactor, and is taken as polished instead of fully rough.")
    roughness = min(1.0, max(0.0, float(given or 0.0)))
    return Dielectric(dispersion, _absorption(extensions, where), roughness=roughness)


def _absorption(extensions: dict[str, Any], where: str) -> Absorption | None:
    volume = extensions.get(VOLUME, {})
    distance = float(volume.get("attenuationDistance", math.inf))
    colour = vec3(float(c) for c in volume.get("attenuationColor", (1.0, 1.0, 1.0)))
    if math.isinf(distance) or colour == (1.0, 1.0, 1.0):
        return None
    return Absorption.of_colour(colour, distance, f"{where}.extensions.{VOLUME}.attenuationDistance")


def write_gltf_material(values: dict[str, Any], material: Material, thickness: float, texture: int | None) -> set[str]:
    """Make the glTF material `values` show `material`, leaving what else it holds; returns extensions used.

    Other viewers get the nearest they can show; `extras.spectrasplat.material` keeps the exact
    values where glTF has no word for them. `thickness` (scene units) is for their volume look. `texture`:
    number of the document's texture that a diffuse material wears, if any.
    """
    pbr = values.setdefault("pbrMetallicRoughness", {})
    extensions = {k: v for k, v in values.pop("extensions", {}).items() if k not in _GLASS_EXTENSIONS}
    extras = values.pop("extras", None)
    extras = dict(extras) if isinstance(extras, dict) else ({} if extras is None else {"value": extras})
    own = {k: v for k, v in extras.pop(EXTRAS, {}).items() if k not in ("material", "glass", _FINISH)}
    extras.pop("glass", None)
    rgb = (1.0, 1.0, 1.0)
    metallic, roughness = 0.0, 0.0
    if isinstance(material, Dielectric):
        extensions |= _glass_extensions(material, thickness)
        roughness = material.roughness
    elif material.is_mirror:
        rgb, metallic = material.reflectance_rgb, 1.0
    elif not material.is_specular:
        rgb, roughness = (0.0, 0.0, 0.0) if material.is_black else material.reflectance_rgb, 1.0
        if material.has_coat:
            roughness = float(material.roughness)
            extensions |= {} if material.coat_index == USUAL_COAT_INDEX else {IOR: {"ior": material.coat_index}}
        if finish := write_fields(material.shown_numbers(), material):
            own[_FINISH] = finish
    pbr |= {"baseColorFactor": [*map(float, rgb), 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    if material.receives:
        _wear(pbr, texture)
    exact = not (material.is_mirror or material.receives) or material.reflectance is not None
    if exact:
        own["material"] = material.values()
    if own:
        extras[EXTRAS] = own
    values |= {key: content for key, content in (("extensions", extensions), ("extras", extras)) if content}
    return set(extensions)


def _wear(pbr: dict[str, Any], texture: int | None) -> None:
    """Set or remove the base colour texture; what else its entry says stays where the texture does."""
    if texture is None:
        pbr.pop(_BASE_COLOUR, None)
    elif pbr.get(_BASE_COLOUR, {}).get("index") != texture:
        pbr[_BASE_COLOUR] = {"index": texture}


def _glass_extensions(material: Dielectric, thickness: float) -> dict[str, Any]:
    dispersion = material.dispersion
    volume: dict[str, Any] = {"thicknessFactor": float(thickness)}
    described = material.values().get("absorption", {})
    if "colour" in described:
        volume |= {"attenuationColor": described["colour"], "attenuationDistance": described["distance"]}
    extensions: dict[str, Any] = {
        TRANSMISSION: {"transmissionFactor": 1.0},
        IOR: {"ior": dispersion.n_d},
        VOLUME: volume,
    }
    # The extension knows normal dispersion only.
    if dispersion.is_dispersive and dispersion.V_d > 0.0:
        extensions[DISPERSION] = {"dispersion": glass.abbe_to_gltf_dispersion(dispersion.V_d)}
    return extensions
