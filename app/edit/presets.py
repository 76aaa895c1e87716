"""Ready-made glasses and lights: what is most often wanted, as data. A preset of a light changes its spectrum and
keeps place, kind and brightness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..model.lights.directional import SUN_DIAMETER_DEG
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
    value: str | float | Path | tuple[tuple[float, float], ...]
    remark: str = ""
    angular_diameter_deg: float | None = None
    """What directional lights get; None keeps theirs."""


_GLASSES = (
    ("Crown", "Schott N-BK7", "Borosilicate crown, the glass of most lenses: n_d 1.517, V_d 64"),
    ("Window glass", "soda-lime glass", "Soda-lime glass: n_d 1.523, V_d 64"),
    ("Low dispersion", "Schott N-FK51A", "Fluor crown, almost no colour: n_d 1.487, V_d 84"),
    ("Light flint", "Schott LLF1", "n_d 1.548, V_d 46"),
    ("Flint", "Schott F2", "The classic prism: n_d 1.620, V_d 36"),
    ("Dense flint", "Schott N-SF11", "Wide spectra: n_d 1.785, V_d 26"),
    ("Very dense flint", "Schott N-SF66", "Among the most dispersive glasses: n_d 1.923, V_d 21"),
    ("Fused silica", "fused silica", "n_d 1.458, V_d 68"),
    ("Acrylic", "PMMA", "Plexiglas: n_d 1.491, V_d 53"),
    ("Polycarbonate", "polycarbonate", "A plastic with much colour: n_d 1.585, V_d 28"),
    ("Water", "water", "At 20 °C: n_d 1.333, V_d 56"),
    ("Ice", "ice", "n_d 1.310"),
    ("Quartz", "quartz (ordinary)", "Rock crystal, ordinary ray: n_d 1.544, V_d 70"),
    ("Sapphire", "sapphire (ordinary)", "Ruby and sapphire, ordinary ray: n_d 1.768, V_d 72"),
    ("Cubic zirconia", "cubic zirconia", "Diamond's imitation, with more fire: n_d 2.159, V_d 34"),
    ("Diamond", "diamond", "n_d 2.417, V_d 55"),
    ("Moissanite", "moissanite (ordinary)", "More than twice the fire of diamond: n_d 2.648, V_d 26"),
)

_SUN_REMARK = "A black body of 5772 K; a directional light becomes as wide as the sun, 0.53°"
_MERCURY = ((404.656, 11.0), (435.833, 20.2), (546.074, 24.5), (576.960, 10.0), (579.066, 10.0))
"""Watts by line of a medium-pressure lamp, after Calvert and Pitts, Photochemistry, Wiley 1966; the yellow pair shared
evenly."""
_SODIUM = ((588.995, 2.0), (589.592, 1.0))
_HYDROGEN = ((410.174, 0.05), (434.047, 0.09), (486.135, 0.36), (656.279, 1.0))
_HELIUM = (
    (447.148, 0.4),
    (471.314, 0.06),
    (492.193, 0.04),
    (501.568, 0.2),
    (587.562, 1.0),
    (667.815, 0.2),
    (706.519, 0.4),
)
_CADMIUM = ((467.815, 0.6), (479.991, 0.9), (508.582, 1.0), (643.847, 0.7))
"""Lines in air, nm (NIST Atomic Spectra Database), with relative powers as low-pressure lamps roughly have them."""
_FRAUNHOFER = ((486.1327, 1.0), (587.5618, 1.0), (656.2725, 1.0))
_LASERS = ((450.0, 1.0), (532.0, 1.0), (638.0, 1.0))

_LIGHTS = (
    LightPreset("Daylight", "illuminant", "D65", "CIE D65, average daylight of 6500 K"),
    LightPreset("Sun", "blackbody", 5772.0, _SUN_REMARK, SUN_DIAMETER_DEG),
    LightPreset("Equal energy", "illuminant", "E", "As much power at every wavelength"),
    LightPreset("Candle", "blackbody", 1900.0, "A black body of 1900 K"),
    LightPreset("Tungsten", "illuminant", "A", "CIE A, a bulb of 2856 K"),
    LightPreset("Halogen", "blackbody", 3200.0, "A black body of 3200 K, studio tungsten"),
    LightPreset("White LED", "illuminant", "LED-B3", "CIE LED-B3, a phosphor LED of 4100 K"),
    LightPreset("RGB LED", "illuminant", "LED-RGB1", "CIE LED-RGB1, three coloured LEDs mixed to white"),
    LightPreset("Fluorescent tube", "illuminant", "FL11", "CIE F11, narrow bands of 4000 K"),
    LightPreset("Sodium street lamp", "illuminant", "HP1", "CIE HP1, high-pressure sodium"),
    LightPreset("Mercury lamp", "lines", _MERCURY, "Lines at 405, 436, 546, 577 and 579 nm"),
    LightPreset("Sodium lamp", "lines", _SODIUM, "The yellow pair at 589.0 and 589.6 nm, low pressure"),
    LightPreset("Hydrogen lamp", "lines", _HYDROGEN, "Lines at 410, 434, 486 and 656 nm, low pressure"),
    LightPreset("Helium lamp", "lines", _HELIUM, "Seven lines, the strongest at 588 nm, low pressure"),
    LightPreset("Cadmium lamp", "lines", _CADMIUM, "Lines at 468, 480, 509 and 644 nm, low pressure"),
    LightPreset("Fraunhofer F, d, C", "lines", _FRAUNHOFER, "The three lines that define V_d, equally strong"),
    LightPreset("RGB lasers", "lines", _LASERS, "Lines at 450, 532 and 638 nm, equally strong"),
    LightPreset("Blue laser", "laser", 450.0, "One line at 450 nm"),
    LightPreset("Green laser", "laser", 532.0, "One line at 532 nm"),
    LightPreset("Red laser", "laser", 632.8, "Helium and neon, one line at 632.8 nm"),
)


@cache
def material_presets() -> tuple[MaterialPreset, ...]:
    """Glasses from the catalogue, by what people call them, least refracting families first; then tinted ones."""
    clear = (MaterialPreset(name, Dielectric(catalogue.find(glass)), remark) for name, glass, remark in _GLASSES)
    by_bands = "Approximated by its bands; {}".format
    coloured = (
        MaterialPreset(tint.name.capitalize(), Dielectric(tint.dispersion), by_bands(tint.colourant), tint)
        for tint in tints()
    )
    return (*clear, *coloured)


def light_presets() -> tuple[LightPreset, ...]:
    """Spectra of lamps and lasers."""
    return _LIGHTS


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
