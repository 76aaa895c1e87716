"""glTF materials to ours and back, and what glTF has no words for, kept under `extras.spectrasplat`.

A scene file's own words there win over everything: `glass` names a catalogue glass, `material` is a whole material
table. Without them transmission, ior, dispersion and volume make a glass that the base colour filters, iridescence a
film on it; what is blended by a small alpha is thin glass, a smooth metal a mirror, and the base colour makes anything
else a diffuse surface, with a coat where that is smooth. The extras of nodes hold the brush's dabs, those of the file
what lies behind everything and render defaults; those of lights are in `gltf`. Other programs' extras are left alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..fields import write_fields
from ..local_dispersion import DABS, describe_dabs, read_dabs
from ..materials.coating import FILM_INDEX, Coating
from ..materials.diffuse import USUAL_COAT_INDEX, read_finish
from ..materials.material_file import read_material
from ..naming import Unshown
from ..optics import catalogue, glass
from ..optics.thin_films import MAX_NM, Film, Layer
from ..scene import Absorption, Dab, Dielectric, Diffuse, Material, Mirror, RenderDefaults, Scene
from ..scene_environment import ENVIRONMENT, environment_values, read_environment
from ..scene_render import read_render, render_values
from ..texture import Environment
from ..vectors import Vec3, vec3
from .gltf_document import GltfDocument
from .gltf_textures import GltfTextures
from .scene_table import SceneTable

_GLASS_EXTENSIONS = tuple(f"KHR_materials_{n}" for n in ("transmission", "volume", "ior", "dispersion", "iridescence"))
TRANSMISSION, VOLUME, IOR, DISPERSION, IRIDESCENCE = _GLASS_EXTENSIONS
EXTRAS = "spectrasplat"
_MIRROR_ROUGHNESS = 0.2
_COAT_ROUGHNESS = 0.5
"""From here on what a dielectric reflects is a faint sheen, which is left out: 0.5 is what modellers give to all."""
_FINISH = "finish"
_BASE_COLOUR = "baseColorTexture"
_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"


def own_extras(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What an entry's extras hold of ours; empty where there is nothing."""
    extras = entry.get("extras")
    own = extras.get(EXTRAS) if isinstance(extras, dict) else None
    return own if isinstance(own, dict) else {}


def read_gltf_material(document: GltfDocument, index: int | None, textures: GltfTextures, unshown: Unshown) -> Material:
    """Material `index` of the document, None being glTF's default; what was assumed or is not shown goes to
    `unshown`."""
    if index is None:
        return Diffuse((0.8, 0.8, 0.8))
    values = document.item("materials", index)
    name = str(values.get("name", index))
    where = f"{document.path.name}: materials[{index}]"
    own, extras = own_extras(values), values.get("extras")
    named = own.get("glass", extras.get("glass") if isinstance(extras, dict) else None)
    if "material" in own:
        table = SceneTable(own["material"], document.path, f"materials[{index}].extras.{EXTRAS}.material")
        material = read_material(table)
    elif named is not None:
        dispersion = catalogue.find(str(named), f"{where}.extras.glass")
        material = Dielectric(dispersion, _absorption(values.get("extensions", {}), where))
    else:
        values = _metallic_roughness(values)
        material = _material(values, name, where, unshown)
        if material.receives and _FINISH in own:
            table = SceneTable(own[_FINISH], document.path, f"materials[{index}].extras.{EXTRAS}.{_FINISH}")
            material = material.changed(**read_finish(table))
        if material.receives:
            material = material.changed(texture=textures.base_colour(values, name, unshown))
    _note_unshown(values, material, name, unshown)
    return material


def _metallic_roughness(values: dict[str, Any]) -> dict[str, Any]:
    """`values`, with a KHR_materials_pbrSpecularGlossiness that is alone translated to the metallic-roughness model."""
    old = values.get("extensions", {}).get(_GLOSSINESS)
    if old is None or "pbrMetallicRoughness" in values:
        return values
    pbr = {"metallicFactor": 0.0, "roughnessFactor": 1.0 - float(old.get("glossinessFactor", 1.0))}
    for key, named in (("baseColorFactor", "diffuseFactor"), (_BASE_COLOUR, "diffuseTexture")):
        pbr |= {key: old[named]} if named in old else {}
    return {**values, "pbrMetallicRoughness": pbr}


def _material(values: dict[str, Any], name: str, where: str, unshown: Unshown) -> Material:
    """By its factors alone."""
    extensions, pbr = values.get("extensions", {}), values.get("pbrMetallicRoughness", {})
    *rgb, alpha = (min(1.0, max(0.0, float(c))) for c in (*pbr.get("baseColorFactor", (1.0,)), 1.0, 1.0, 1.0)[:4])
    roughness = float(pbr.get("roughnessFactor", 1.0))
    transmission = float(extensions.get(TRANSMISSION, {}).get("transmissionFactor", 0.0))
    blends, is_metal = values.get("alphaMode") == "BLEND", float(pbr.get("metallicFactor", 1.0)) >= 0.5
    if transmission >= 0.5:
        if transmission < 1.0:
            unshown.add(
                "Glass of a transmissionFactor below 1 lets through that share; the rest, which its base would "
                "scatter, is absorbed",
                name,
            )
        return _glass(values, name, where, vec3(transmission * c for c in rgb), unshown)
    if transmission > 0.0:
        unshown.add("A transmissionFactor of less than one half is taken as opaque", name)
    elif blends and alpha <= 0.5 and _BASE_COLOUR not in pbr:
        unshown.add(
            "Materials that are alpha-blended by one half or less are taken as thin glass, which light passes straight "
            "(--glass makes an object solid)",
            name,
        )
        return _sheet(_glass(values, name, where, vec3(1.0 - alpha * (1.0 - c) for c in rgb), unshown))
    elif blends and (alpha < 1.0 or _BASE_COLOUR in pbr):
        unshown.add("Alpha-blended materials are shown opaque", name)
    # A file that says nothing has metal of roughness 1 by glTF's defaults.
    if is_metal and _BASE_COLOUR not in pbr and ("metallicFactor" in pbr or roughness <= _MIRROR_ROUGHNESS):
        return Mirror(vec3(rgb), roughness=min(max(roughness, 0.0), 1.0))
    if roughness < _COAT_ROUGHNESS and not is_metal:
        ior = float(extensions.get(IOR, {}).get("ior", USUAL_COAT_INDEX))
        return Diffuse(vec3(rgb), roughness=max(roughness, 0.0), coat_index=min(max(ior, 1.0), 4.0))
    if "metallicFactor" in pbr and is_metal:
        unshown.add("Metals with a picture are shown as diffuse surfaces", name)
    return Diffuse(vec3(rgb))


_NOT_SHOWN: dict[str, tuple[str, tuple[str, ...]]] = {
    "anisotropy": ("Anisotropy is", ("anisotropyStrength",)),
    "clearcoat": ("A clear coat of its own is", ("clearcoatFactor",)),
    "diffuse_transmission": ("Light that is scattered through a sheet is", ("diffuseTransmissionFactor",)),
    "iridescence": ("Iridescence is", ("iridescenceFactor",)),
    "sheen": ("Sheen is", ("sheenColorFactor",)),
    "specular": ("A specular strength or colour other than 1 is", ("specularFactor", "specularColorFactor")),
    "volume_scatter": ("Scattering inside a volume is", ("multiscatterColor", "scatterDistance")),
    "pbrSpecularGlossiness": ("A specular colour beside the diffuse one is", ()),
    "unlit": ("A constant colour without light is", ()),
}
"""KHR_materials_…: what is not shown where one of these keys has an effect."""
UNDERSTOOD_MATERIALS = frozenset(
    {*_GLASS_EXTENSIONS, "KHR_materials_emissive_strength", *(f"KHR_materials_{name}" for name in _NOT_SHOWN)}
)
_NEUTRAL: dict[str, Any] = {"specularFactor": 1.0, "specularColorFactor": [1.0, 1.0, 1.0]}


def _note_unshown(values: dict[str, Any], material: Material, name: str, unshown: Unshown) -> None:
    """Name what of a material has an effect and is not shown."""
    extensions = values.get("extensions", {})
    for short, (words, keys) in _NOT_SHOWN.items():
        given = extensions.get(f"KHR_materials_{short}")
        if given is None or (short == "iridescence" and getattr(material, "film", None) is not None):
            continue
        if not keys or any(np.any(np.subtract(given[key], _NEUTRAL.get(key, 0.0))) for key in keys if key in given):
            unshown.add(f"{words} not shown (KHR_materials_{short})", name)
    if any(values.get("emissiveFactor", ())):
        unshown.add("Surfaces that give off light (emissiveFactor) are dark; add a light for them", name)
    if values.get("alphaMode") == "MASK" and _BASE_COLOUR in values.get("pbrMetallicRoughness", {}):
        unshown.add("Surfaces that are cut out by their texture's alpha (alphaMode MASK) are shown whole", name)
    shown = {_BASE_COLOUR} if material.receives else set()
    for key in dict.fromkeys(_all_keys(values)):
        if key.endswith("Texture") and key not in shown | {"diffuseTexture"}:
            unshown.add(f"{key} is not shown, only its factor (it is kept when saving)", name)


def _all_keys(values: Any) -> list[str]:
    if isinstance(values, dict):
        return [k for key, value in values.items() for k in (str(key), *_all_keys(value)) if key != "extras"]
    return []


def _glass(values: dict[str, Any], name: str, where: str, rgb: Vec3, unshown: Unshown) -> Dielectric:
    """`rgb`: what gets through it."""
    extensions = values.get("extensions", {})
    n_d = float(extensions.get(IOR, {}).get("ior", 1.5))
    if n_d == 0.0:
        unshown.add("ior 0 stands for total reflection in old files; 1.5 is used", name)
        n_d = 1.5
    strength = float(extensions.get(DISPERSION, {}).get("dispersion", 0.0))
    v_d = glass.gltf_dispersion_to_abbe(strength)
    dispersion = glass.from_abbe(n_d, v_d, str(values.get("name", "")), f"{where}.extensions.{IOR}.ior")
    given = values.get("pbrMetallicRoughness", {}).get("roughnessFactor")
    if given is None and values.get("alphaMode") != "BLEND":
        unshown.add("Glass without a roughnessFactor is taken as polished instead of fully rough", name)
    roughness = min(1.0, max(0.0, float(given or 0.0)))
    film_index, film_nm = _film(extensions.get(IRIDESCENCE, {}), name, unshown)
    return Dielectric(
        dispersion,
        _absorption(extensions, where),
        roughness=roughness,
        transmittance_rgb=rgb,
        film_nm=film_nm,
        film_index=film_index,
    )


def _film(iridescence: Mapping[str, Any], name: str, unshown: Unshown) -> tuple[float, float]:
    """Index and thickness (nm) of what makes glass iridescent: all of it from one half of its factor on, else none."""
    factor = float(iridescence.get("iridescenceFactor", 0.0))
    if factor < 0.5:
        return FILM_INDEX.default, 0.0
    if factor < 1.0:
        unshown.add("Iridescence of a factor below 1 is taken as whole", name)
    index = float(iridescence.get("iridescenceIor", 1.3))
    thickness = float(iridescence.get("iridescenceThicknessMaximum", 400.0))
    return min(max(index, 1.0), 5.0), min(max(thickness, 0.0), MAX_NM)


def _sheet(material: Dielectric, **changes: Any) -> Dielectric:
    """A thin one. A film becomes a coating: `film_nm` would make the sheet itself the film."""
    if material.film_nm > 0.0:
        coating = Coating(Film((Layer(glass.constant(material.film_index), material.film_nm),)))
        changes |= {"coating": coating, "film_nm": 0.0}
    return material.changed(thin=True, **changes)


def formed(document: GltfDocument, index: int, material: Material, is_sheet: bool, unshown: Unshown) -> Material:
    """The glass of material `index`, unless words of ours say what it is, on a mesh of this form: a sheet is thin, and
    absorption acts over the thickness that the file gives."""
    values = document.item("materials", index)
    extras = values.get("extras")
    if own_extras(values).keys() & {"material", "glass"} or "glass" in (extras or {}):
        return material
    volume, name = values.get("extensions", {}).get(VOLUME, {}), str(values.get("name", index))
    thickness = float(volume.get("thicknessFactor", 0.0))
    if not is_sheet and thickness == 0.0:
        unshown.add("Closed meshes of glass that glTF calls thin-walled (no thicknessFactor) are solid", name)
    if not is_sheet or not isinstance(material, Dielectric):
        return material
    if thickness > 0.0:
        unshown.add("Glass with a thickness on an open mesh is taken as a thin sheet", name)
    depth = thickness / float(volume.get("attenuationDistance", math.inf))
    within = (float(c) ** depth for c in volume.get("attenuationColor", (1.0, 1.0, 1.0)))
    rgb = vec3(c * w for c, w in zip(material.transmittance_rgb, within, strict=True))
    return _sheet(material, absorption=None, transmittance_rgb=rgb)


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
    number of the document's texture of a diffuse material, if any.
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
        extensions |= _glass_extensions(material, 0.0 if material.thin else thickness)
        roughness, rgb = material.roughness, material.transmittance_rgb
    elif material.is_mirror:
        rgb, metallic, roughness = material.reflectance_rgb, 1.0, material.roughness
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
    exact = not (material.is_mirror or material.receives) or material.reflectance is not None or bool(material.metal)
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
    if material.film_nm > 0.0:
        thickness_nm = {f"iridescenceThickness{end}": material.film_nm for end in ("Minimum", "Maximum")}
        extensions[IRIDESCENCE] = {"iridescenceFactor": 1.0, "iridescenceIor": material.film_index, **thickness_nm}
    return extensions


_SCENE = "scene"


def read_node_dabs(document: GltfDocument, index: int, number: int, material: Material) -> tuple[Dab, ...]:
    """Dabs on primitive `number` of node `index`, in the mesh's own coordinates."""
    where = f"nodes[{index}].extras.{EXTRAS}"
    kept = SceneTable(own_extras(document.item("nodes", index)), document.path, where)
    found: tuple[Dab, ...] = ()
    for entry in kept.tables(DABS):
        if entry.integer("primitive", 0, at_least=0, at_most=1 << 31) == number:
            found += read_dabs(SceneTable({DABS: entry.raw("dabs")}, document.path, entry.path), material)
    return found


def write_node_dabs(node: dict[str, Any], dabs: Mapping[int, Sequence[Dab]]) -> None:
    """Keep the dabs of a node's primitives, by number; none of them takes out what was there."""
    entries = [{"primitive": number, "dabs": describe_dabs(each)} for number, each in sorted(dabs.items()) if each]
    _keep(node, DABS, entries or None)


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
    values: dict[str, Any] = {"render": render_values(scene.render)}
    if scene.environment is None:
        values["background"] = list(scene.background_rgb)
    else:
        values[ENVIRONMENT] = environment_values(scene.environment, path)
    _keep(json, _SCENE, None if (scene.background_rgb, scene.environment, scene.render) == usual else values)


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
