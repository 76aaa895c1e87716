"""Lights of a scene file: shape, spectrum and one physical quantity with its unit in the key's name.

All areas are in scene units: `illuminance_lx` is lumen per square scene unit, and so on, so
that a scene in centimetres needs no conversion of its brightness. Photometric quantities use
K_m = 683.002 lm/W.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from .io.scene_table import SceneTable
from .optics import spectrum as spectra
from .optics.spectrum import Spectrum
from .scene import Light

KINDS = ("point", "spot", "directional", "collimated", "area")

DEFAULT_ILLUMINANCE = 3.0
"""Lumen per square unit on a plane across the light where a file states no power: with
exposure 0 a white table then shows mid-grey and leaves room for the caustic above it."""

PHOTOMETRIC = "photometric"
RADIOMETRIC = "radiometric"
INTENSIVE = "intensive"
FLUX = "flux"

# kind -> key -> (photometric or radiometric, the light's own quantity or its total flux)
POWER_KEYS: dict[str, dict[str, tuple[str, str]]] = {
    "point": {
        "intensity_cd": (PHOTOMETRIC, INTENSIVE),
        "intensity_w_sr": (RADIOMETRIC, INTENSIVE),
        "flux_lm": (PHOTOMETRIC, FLUX),
        "flux_w": (RADIOMETRIC, FLUX),
    },
    "directional": {
        "illuminance_lx": (PHOTOMETRIC, INTENSIVE),
        "irradiance_w_m2": (RADIOMETRIC, INTENSIVE),
    },
    "collimated": {
        "illuminance_lx": (PHOTOMETRIC, INTENSIVE),
        "irradiance_w_m2": (RADIOMETRIC, INTENSIVE),
        "flux_lm": (PHOTOMETRIC, FLUX),
        "flux_w": (RADIOMETRIC, FLUX),
    },
    "area": {
        "luminance_nt": (PHOTOMETRIC, INTENSIVE),
        "radiance_w_sr_m2": (RADIOMETRIC, INTENSIVE),
        "flux_lm": (PHOTOMETRIC, FLUX),
        "flux_w": (RADIOMETRIC, FLUX),
    },
}
POWER_KEYS["spot"] = POWER_KEYS["point"]


@dataclass(frozen=True)
class Surroundings:
    """What a light without a target, a distance or a power is fitted to."""

    centre: np.ndarray
    """float64 (3,), middle of the objects that are not receivers."""
    radius: float
    """Half the diagonal of their bounds, scene units."""


def read_light(table: SceneTable, index: int, environment: Surroundings) -> Light:
    """One entry of [[lights]], its power already in the quantity of `Light.spectral_power`."""
    kind = table.choice("kind", KINDS, "point")
    name = table.string("name", f"{kind} {index + 1}")
    shape_fields = _read_shape(table, kind)
    placement = _read_placement(table, kind, environment)
    distance = placement.pop("distance")
    spectrum = _read_spectrum(table)
    light = Light(name=name, kind=kind, spectral_power=spectrum, **placement, **shape_fields)  # type: ignore[arg-type]
    power = _read_power(table, light, distance)
    table.finish(f"a light of kind '{kind}'")
    return Light(name=name, kind=kind, spectral_power=power, **placement, **shape_fields)  # type: ignore[arg-type]


def flux_factor(light: Light) -> float:
    """Total flux divided by the quantity of `spectral_power`; infinite for a directional light.

    point 4π sr; spot: its solid angle weighted by the fall-off; collimated: its area;
    area: π times its area (Lambertian, one-sided).
    """
    area = light.width * light.height if light.shape == "rectangle" else math.pi * light.radius**2
    return {
        "point": lambda: 4.0 * math.pi,
        "spot": lambda: spot_solid_angle_sr(light.inner_half_angle_deg, light.outer_half_angle_deg),
        "directional": lambda: math.inf,
        "collimated": lambda: area,
        "area": lambda: math.pi * area,
    }[light.kind]()


def spot_solid_angle_sr(inner_half_angle_deg: float, outer_half_angle_deg: float) -> float:
    """∫ fall-off dω of a spot, steradian, in closed form.

    The fall-off (`shaders/lib/spot.glsl`) is 1 inside the inner cone, 0 outside the outer one,
    and a smoothstep of the angle between. Integrated by parts, 2π (1 − cos m · g) remains with
    the middle angle m, half the soft width h, and g = 3 (sin h − h cos h)/h³.
    """
    inner, outer = math.radians(inner_half_angle_deg), math.radians(outer_half_angle_deg)
    middle, h = 0.5 * (inner + outer), 0.5 * (outer - inner)
    # 1 − g by its series where the closed form would cancel; the next term is below 1e-14.
    if h < 0.02:
        lack = h * h / 10.0 - h**4 / 280.0 + h**6 / 15120.0
    else:
        lack = 1.0 - 3.0 * (math.sin(h) - h * math.cos(h)) / h**3
    return 2.0 * math.pi * (2.0 * math.sin(0.5 * middle) ** 2 + math.cos(middle) * lack)


def _read_shape(table: SceneTable, kind: str) -> dict[str, object]:
    if kind == "spot":
        return _read_cone(table)
    if kind == "directional":
        return {"angular_diameter_deg": table.number("angular_diameter_deg", 0.0, at_least=0.0, at_most=90.0)}
    if kind in ("collimated", "area"):
        shape = table.choice("shape", ("disc", "rectangle"), "rectangle" if table.has("size") else "disc")
        if shape == "disc":
            return {"shape": shape, "radius": table.number("radius", 1.0, above=0.0)}
        size = table.numbers("size", (1.0, 1.0), count=2)
        if min(size) <= 0.0:
            table.fail("size", "must be a width and a height above 0")
        tangent = table.unit_vector("tangent") if table.has("tangent") else None
        return {"shape": shape, "width": size[0], "height": size[1], "tangent": tangent}
    return {}


def _read_cone(table: SceneTable) -> dict[str, object]:
    outer = table.number("half_angle_deg", 30.0, above=0.0, at_most=90.0)
    key = table.one_of(("inner_half_angle_deg", "softness"), "the soft edge")
    inner = outer
    if key == "inner_half_angle_deg":
        inner = table.number(key, at_least=0.0)
        if inner > outer:
            table.fail(key, f"is {inner:g} but cannot exceed half_angle_deg, {outer:g}")
    elif key == "softness":
        inner = outer * (1.0 - table.number(key, at_least=0.0, at_most=1.0))
    return {"inner_half_angle_deg": inner, "outer_half_angle_deg": outer}


def _read_placement(table: SceneTable, kind: str, around: Surroundings) -> dict[str, object]:
    """Position and direction, and the distance to what is lit (scene units)."""
    directed = kind != "point"
    aim = table.one_of(("target", "direction"), "the aim") if directed else None
    direction = table.unit_vector("direction") if aim == "direction" else None
    target = np.array(table.vector("target")) if aim == "target" else around.centre
    reach = 6.0 * around.radius
    if kind == "directional":
        if aim == "target":
            # Only the direction of a sun matters; "from" is where the target sees it.
            position = np.array(table.vector("position"))
            direction = _unit(table, target - position)
        return {"direction": direction or default_direction(), "distance": 1.0}
    if table.has("position"):
        position = np.array(table.vector("position"))
    else:
        position = target - reach * np.array(direction or default_direction())
    if directed and direction is None:
        direction = _unit(table, target - position)
    placement: dict[str, object] = {
        "position": tuple(float(v) for v in position),
        "distance": max(float(np.linalg.norm(target - position)), 1e-3 * around.radius),
    }
    if directed:
        placement["direction"] = direction
    return placement


def default_direction() -> tuple[float, float, float]:
    """A low afternoon sun from behind on the left: long caustics that run towards the viewer."""
    azimuth, elevation = math.radians(25.0), math.radians(38.0)
    return (
        math.cos(elevation) * math.cos(azimuth),
        -math.cos(elevation) * math.sin(azimuth),
        -math.sin(elevation),
    )


def _unit(table: SceneTable, vector: np.ndarray) -> tuple[float, float, float]:
    length = float(np.linalg.norm(vector))
    if length < 1e-150:
        table.fail("target", "lies at the light's own position and so gives no direction")
    x, y, z = (float(v) / length for v in vector)
    return x, y, z


def _read_power(table: SceneTable, light: Light, distance: float) -> Spectrum:
    keys = POWER_KEYS[light.kind]
    key = table.one_of(tuple(keys), "the power")
    spectrum = light.spectral_power
    if key is None:
        return _scaled(table, "spectrum", spectrum, PHOTOMETRIC, _default_power(light, distance))
    measure, quantity = keys[key]
    value = table.number(key, at_least=0.0)
    if quantity == FLUX:
        value /= flux_factor(light)
    return _scaled(table, key, spectrum, measure, value)


def _default_power(light: Light, distance: float) -> float:
    """The photometric quantity that puts DEFAULT_ILLUMINANCE on what the light aims at."""
    if light.kind in ("directional", "collimated"):
        return DEFAULT_ILLUMINANCE
    if light.kind == "area":
        return DEFAULT_ILLUMINANCE * distance**2 * math.pi / flux_factor(light)
    return DEFAULT_ILLUMINANCE * distance**2


def _scaled(table: SceneTable, key: str, spectrum: Spectrum, measure: str, value: float) -> Spectrum:
    try:
        scaled = spectrum.scaled_to_luminous(value) if measure == PHOTOMETRIC else spectrum.scaled_to_power(value)
    except UserError as error:
        table.fail(key, f"cannot be applied: {error}")
    return scaled


# -- spectra ------------------------------------------------------------------------------


def _read_spectrum(table: SceneTable) -> Spectrum:
    """`spectrum`: a name, a table, or a list of tables that are added by weight."""
    value = table.raw("spectrum", "D65")
    if isinstance(value, str):
        return _named(table, "spectrum", value)
    if isinstance(value, list):
        parts = table.tables("spectrum")
        if not parts:
            table.fail("spectrum", "is an empty list; name at least one spectrum")
        total = None
        for part in parts:
            weight = part.number("weight", 1.0, above=0.0)
            term = _read_spectrum_table(part).scaled_to_power(weight)
            total = term if total is None else total + term
        return total
    inner = table.table("spectrum")
    if inner is None:
        table.fail("spectrum", 'must be a name such as "D65" or a table such as {blackbody = 3200}')
    return _read_spectrum_table(inner)


_SPECTRUM_KEYS = ("illuminant", "blackbody", "laser", "csv", "nm", "constant")


def _read_spectrum_table(table: SceneTable) -> Spectrum:
    key = table.one_of(_SPECTRUM_KEYS, "the spectrum")
    spectrum = _spectrum_of(table, key)
    if table.has("lines"):
        for wavelength_nm, power in table.rows("lines", 2, at_least=1):
            spectrum = _laser(table, "lines", wavelength_nm, power) + spectrum
    table.finish("a spectrum")
    return spectrum


def _spectrum_of(table: SceneTable, key: str | None) -> Spectrum:
    if key == "illuminant":
        return _named(table, key, table.string(key))
    if key == "blackbody":
        return spectra.blackbody(table.number(key, at_least=500.0, at_most=1e6))
    if key == "laser":
        return _laser(table, key, table.number(key), 1.0)
    if key == "csv":
        return spectra.from_csv(table.existing_file(key))
    if key == "constant":
        return spectra.constant(table.number(key, above=0.0))
    if key == "nm":
        wavelengths = table.numbers("nm", at_least=2)
        values = table.numbers("values", count=len(wavelengths))
        return spectra.from_table(np.array(wavelengths), np.array(values), table.where("values"))
    if table.has("lines"):
        return spectra.constant(0.0)
    table.fail("", f"names no spectrum: give one of {', '.join(_SPECTRUM_KEYS)} or lines")


def _named(table: SceneTable, key: str, name: str) -> Spectrum:
    try:
        return spectra.illuminant(name)
    except UserError as error:
        table.fail(key, f"is not known: {error}")


def _laser(table: SceneTable, key: str, wavelength_nm: float, power: float) -> Spectrum:
    low, high = spectra.VISIBLE_NM[0], spectra.VISIBLE_NM[-1]
    if not low <= wavelength_nm <= high:
        table.fail(key, f"is at {wavelength_nm:g} nm, outside the visible {low:g} to {high:g} nm that is computed")
    return spectra.laser(wavelength_nm, power)
