"""The selected light: kind, place, size, power in its own unit, spectrum. The inspector shows this for lights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...edit import edits
from ...edit.state import State
from ...model.scene import Light, Vec3
from ...model.scene_defaults import environment_of
from ...model.scene_lights import POWER_KEYS
from ..view_model import ViewModel
from . import widgets
from .light_spectrum import draw_spectrum_choice

_KINDS = {
    "directional": "Sun (directional)",
    "collimated": "Collimated beam",
    "point": "Point",
    "spot": "Spot",
    "area": "Area",
}
_SHAPES = {"disc": "Disc", "rectangle": "Rectangle"}

_POWER_NAMES = {
    "intensity_cd": "Luminous intensity (cd)",
    "intensity_w_sr": "Radiant intensity (W/sr)",
    "flux_lm": "Luminous flux (lm)",
    "flux_w": "Radiant flux (W)",
    "illuminance_lx": "Illuminance (lm/unit²)",
    "irradiance_w_m2": "Irradiance (W/unit²)",
    "luminance_nt": "Luminance (cd/unit²)",
    "radiance_w_sr_m2": "Radiance (W/(sr unit²))",
}
_POWER_TIPS = {
    "intensity": "Power into each direction; for a spot, on its axis.",
    "flux": "All the light that leaves it.",
    "illuminance": "Light on a plane across the beam; lux where a scene unit is a metre.",
    "irradiance": "Power on a plane across the beam.",
    "luminance": "How bright its surface looks; nits where a scene unit is a metre.",
    "radiance": "How bright its surface is, as power.",
}

_power_key: dict[str, str] = {}
"""Kind of light -> the quantity in which its power is shown. A way of display, not part of the document."""


def draw_light(state: State, view_model: ViewModel) -> State:
    """Rows for the selected light; a hint where none is selected."""
    index = state.selection.index
    if state.selection.kind != "light" or not 0 <= index < len(state.scene.lights):
        widgets.hint("Select a light in the outliner to edit it.")
        return state
    state = _draw_name(state, index)
    if widgets.section("Placement##light"):
        state = _draw_place(state, index)
    if widgets.section("Size##light"):
        state = _draw_size(state, index)
    if widgets.section("Power and spectrum##light"):
        state = _draw_power(state, index)
        state = draw_spectrum_choice(state, index)
    return state


def _draw_name(state: State, index: int) -> State:
    light = state.scene.lights[index]
    changed, name = widgets.text_field("Name", light.name, tip="Name of the light; each has its own.")
    if changed:
        state = edits.attempt(state, f"Rename {light.name}", edits.rename_light, index, name)
    tip = "How the light leaves it. Another kind aims at the same place and lights it as brightly."
    changed, kind = widgets.combo("Kind", _KINDS, light.kind, tip=tip)
    if changed:
        state = edits.attempt(state, f"Kind of {light.name}", edits.set_light_kind, index, kind)
    return state


def _edit(state: State, index: int, light: Light, what: str) -> State:
    return edits.attempt(state, f"{what} {state.scene.lights[index].name}", edits.set_light, index, light)


# ---- place --------------------------------------------------------------------------------


def _draw_place(state: State, index: int) -> State:
    light = state.scene.lights[index]
    if light.kind != "directional":
        speed = 0.005 * environment_of(state.scene.objects).radius
        tip = "Where the light stands: x, y, z in scene units."
        changed, position, active = widgets.vec3("Position", light.position, unit="units", tip=tip, speed=speed)
        state = widgets.holding(state, active)
        if changed:
            state = _edit(state, index, replace(light, position=position), "Move")
    return state if light.kind == "point" else _draw_direction(state, index)


def _draw_direction(state: State, index: int) -> State:
    light = state.scene.lights[index]
    azimuth, elevation = angles_of(light.direction)
    tip = "Compass bearing that the light travels towards, about z from x."
    turned, azimuth, held_a = widgets.slider("Azimuth", azimuth, -180.0, 180.0, unit="°", tip=tip, format="%.1f")
    tip = "Slope of the way the light travels: −90° straight down, 0° level, 90° straight up."
    tilted, elevation, held_e = widgets.slider("Elevation", elevation, -90.0, 90.0, unit="°", tip=tip, format="%.1f")
    state = widgets.holding(state, held_a or held_e)
    if turned or tilted:
        aimed = replace(light, direction=direction_of(azimuth, elevation))
        return _edit(state, index, aimed, "Turn")
    if light.kind == "directional":
        return state
    tip = "Turn the light towards the middle of the objects that are not receivers."
    if widgets.button("Aim at the objects", tip=tip):
        toward = environment_of(state.scene.objects).centre - np.array(light.position)
        x, y, z = (float(v) for v in toward)
        return _edit(state, index, replace(light, direction=(x, y, z)), "Aim")
    return state


def angles_of(direction: Vec3) -> tuple[float, float]:
    """Azimuth (about z from x) and elevation of a direction, degrees; straight up or down has azimuth 0."""
    x, y, z = direction
    across = math.hypot(x, y)
    azimuth = math.degrees(math.atan2(y, x)) if across > 1e-9 else 0.0
    return azimuth, math.degrees(math.atan2(z, across))


def direction_of(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Unit direction of these angles. Held a hair off the poles, so that the azimuth is not forgotten there."""
    azimuth = math.radians(azimuth_deg)
    elevation = math.radians(min(max(elevation_deg, -89.999), 89.999))
    across = math.cos(elevation)
    return across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)


# ---- size ---------------------------------------------------------------------------------


def _draw_size(state: State, index: int) -> State:
    light = state.scene.lights[index]
    if light.kind == "point":
        widgets.hint("A point has no size: shadows and caustics are sharp.")
        return state
    rows = {"spot": _draw_cone, "directional": _draw_sun}
    changed, active = rows.get(light.kind, _draw_outline)(light)
    state = widgets.holding(state, active)
    return state if changed == light else _edit(state, index, changed, "Size of")


def _draw_sun(light: Light) -> tuple[Light, bool]:
    tip = (
        "How large the source looks from the scene. The sun has 0.53°; 0 is perfectly parallel and gives the "
        "sharpest colours."
    )
    _, angle, active = widgets.slider(
        "Angular diameter", light.angular_diameter_deg, 0.0, 20.0, unit="°", tip=tip, reset=0.53, format="%.2f"
    )
    return replace(light, angular_diameter_deg=min(max(angle, 0.0), 90.0)), active


def _draw_cone(light: Light) -> tuple[Light, bool]:
    tip = "Half the opening angle of the cone; beyond it there is no light."
    _, outer, outer_held = widgets.slider(
        "Half angle", light.outer_half_angle_deg, 0.1, 90.0, unit="°", tip=tip, reset=30.0, format="%.1f"
    )
    tip = "Half angle up to which the cone is at full strength; between the two it fades. Equal: a hard edge."
    _, inner, inner_held = widgets.slider(
        "Full within", min(light.inner_half_angle_deg, outer), 0.0, outer, unit="°", tip=tip, reset=outer, format="%.1f"
    )
    shaped = replace(light, outer_half_angle_deg=outer, inner_half_angle_deg=min(inner, outer))
    return shaped, outer_held or inner_held


def _draw_outline(light: Light) -> tuple[Light, bool]:
    tip = "Outline of the beam or of the glowing surface."
    _, shape = widgets.combo("Shape", _SHAPES, light.shape, tip=tip)
    sized = replace(light, shape=shape)  # type: ignore[arg-type]
    if shape == "disc":
        tip = "Radius of the disc."
        _, radius, active = widgets.drag(
            "Radius", light.radius, 1e-6, 1e6, unit="units", tip=tip, format="%.4g", logarithmic=True
        )
        return replace(sized, radius=radius), active
    tip = "Side of the rectangle."
    _, width, width_held = widgets.drag(
        "Width", light.width, 1e-6, 1e6, unit="units", tip=tip, format="%.4g", logarithmic=True
    )
    _, height, height_held = widgets.drag(
        "Height", light.height, 1e-6, 1e6, unit="units", tip=tip, format="%.4g", logarithmic=True
    )
    return replace(sized, width=width, height=height), width_held or height_held


# ---- power --------------------------------------------------------------------------------


def _draw_power(state: State, index: int) -> State:
    light = state.scene.lights[index]
    keys = POWER_KEYS[light.kind]
    key = _power_key.get(light.kind, edits.photometric_key(light))
    tip = "In which quantity the power is shown and typed. Photometric ones weight each colour as the eye does."
    _, key = widgets.combo("Quantity", {k: _POWER_NAMES[k] for k in keys}, key, tip=tip)
    _power_key[light.kind] = key
    power = edits.light_power(light, key)
    changed, power, active = widgets.drag(
        "Power",
        power,
        0.0,
        1e12,
        unit=edits.POWER_UNITS[key],
        tip=_POWER_TIPS[key.split("_")[0]],
        format="%.6g",
        logarithmic=True,
    )
    state = widgets.holding(state, active)
    return (
        edits.attempt(state, f"Power of {light.name}", edits.set_light_power, index, power, key) if changed else state
    )
