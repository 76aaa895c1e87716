"""Ready-made glasses and lights, of assets/presets.toml: what is most often wanted. A preset of a light changes its
spectrum and keeps place, kind and brightness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import msgspec

from ..base import files
from ..base.paths import assets_dir
from ..model.optics import catalogue
from ..model.optics.tints import Tint, tints
from ..model.scene import (
    Dielectric,
    Material,
    Scene,
)
from ..model.staging import tinted
from .lights import SpectrumKind, light_power, set_light, set_light_power, set_light_spectrum
from .objects import set_material


@dataclass(frozen=True)
class MaterialPreset:
    """A material by name."""

    name: str
    material: Material
    remark: str = ""
    """One line for the tooltip."""
    tint: Tint | None = None
    """How deep it is follows the object's size."""


@dataclass(frozen=True)
class LightPreset:
    """A spectrum by name, as `set_light_spectrum` takes it."""

    name: str
    kind: SpectrumKind
    value: str | float | tuple[tuple[float, float], ...]
    remark: str = ""
    angular_diameter_deg: float | None = None
    """What directional lights get; None keeps theirs."""


@dataclass(frozen=True)
class _Presets:
    """assets/presets.toml."""

    glasses: tuple[tuple[str, str, str], ...]
    """Name, entry of the catalogue, remark."""
    lights: tuple[LightPreset, ...]


@cache
def _presets() -> _Presets:
    path = assets_dir() / "presets.toml"
    return msgspec.toml.decode(files.read_bytes(path, files.SETTINGS_BYTES), type=_Presets)


@cache
def material_presets() -> tuple[MaterialPreset, ...]:
    """Glasses from the catalogue, by what people call them, least refracting families first; then tinted ones."""
    glasses = _presets().glasses
    clear = (MaterialPreset(name, Dielectric(catalogue.find(glass)), remark) for name, glass, remark in glasses)
    by_bands = "Approximated by its bands; {}".format
    coloured = (
        MaterialPreset(tint.name.capitalize(), Dielectric(tint.dispersion), by_bands(tint.colourant), tint)
        for tint in tints()
    )
    return (*clear, *coloured)


def light_presets() -> tuple[LightPreset, ...]:
    """Spectra of lamps and lasers."""
    return _presets().lights


def apply_material(scene: Scene, index: int, preset: MaterialPreset) -> Scene:
    """Give object `index` the preset's material; a glass keeps its surface and its priority among overlapping
    solids."""
    before, material = scene.objects[index].material, preset.material
    if preset.tint is not None:
        material = tinted(scene.objects[index], preset.tint)
    if before.transmits and material.transmits:
        material = material.changed(priority=before.priority, roughness=before.roughness, thin=before.thin)
    return set_material(scene, index, material)


def apply_light(scene: Scene, index: int, preset: LightPreset) -> Scene:
    """Give light `index` the preset's spectrum at the brightness it had."""
    light = scene.lights[index]
    changed = set_light_spectrum(scene, index, preset.kind, preset.value)
    if preset.angular_diameter_deg is not None and not light.has_place:
        wide = changed.lights[index].changed(angular_diameter_deg=preset.angular_diameter_deg)
        changed = set_light_power(set_light(changed, index, wide), index, light_power(light))
    return changed
