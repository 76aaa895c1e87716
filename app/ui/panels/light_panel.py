"""The selected light: kind, place, size, power in its own unit, spectrum. The inspector shows this for lights."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ...edit import edits
from ...edit.lights import light_power, photometric_key, rename_light, set_light, set_light_kind, set_light_power
from ...edit.state import Selection, State
from ...model.fields import FileName
from ...model.lights import LIGHT_KINDS
from ...model.scene import Light, Vec3
from ...model.scene_defaults import environment_of
from ...model.vectors import vec3
from ..view_model import ViewModel
from . import picture_choice, widgets
from .declared_rows import draw_numbers
from .light_spectrum import draw_spectrum_choice

_SHAPES = {"disc": "Disc", "rectangle": "Rectangle"}

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
        selected = Selection("light", index)
        state = widgets.unless_locked(state, selected, lambda state: _draw_place(state, index))
    if widgets.section("Size##light"):
        state = _draw_file(state, view_model, index)
        state = _draw_size(state, index)
    if widgets.section("Power and spectrum##light"):
        state = _draw_power(state, index)
        state = draw_spectrum_choice(state, index)
    return state


def _draw_name(state: State, index: int) -> State:
    light = state.scene.lights[index]
    name = widgets.text_field("Name", light.name, tip="Name of the light; each has its own.")
    if name != light.name:
        state = edits.attempt(state, f"Rename {light.name}", rename_light, index, name)
    tip = "How the light leaves it. Another kind aims at the same place and lights it as brightly."
    kind = widgets.combo("Kind", {k: cls.title for k, cls in LIGHT_KINDS.items()}, light.kind, tip=tip)
    if kind != light.kind:
        state = edits.attempt(state, f"Kind of {light.name}", set_light_kind, index, kind)
    return state


def _edit(state: State, index: int, light: Light, what: str) -> State:
    return edits.attempt(state, f"{what} {state.scene.lights[index].name}", set_light, index, light)


# ---- place --------------------------------------------------------------------------------


def _draw_place(state: State, index: int) -> State:
    light = state.scene.lights[index]
    if light.has_place:
        speed = 0.005 * environment_of(state.scene.objects).radius
        tip = "Where the light is: x, y, z in scene units."
        position = widgets.vec3("Position", light.position, unit="units", tip=tip, speed=speed)
        if position != light.position:
            state = _edit(state, index, light.changed(position=position), "Move")
    return _draw_direction(state, index) if light.has_direction else state


def _draw_direction(state: State, index: int) -> State:
    light = state.scene.lights[index]
    before = angles_of(light.direction)
    tip = "Compass bearing that the light travels towards, about z from x."
    azimuth = widgets.slider("Azimuth", before[0], -180.0, 180.0, unit="°", tip=tip, format="%.1f")
    tip = "Slope of the light's path: −90° straight down, 0° level, 90° straight up."
    elevation = widgets.slider("Elevation", before[1], -90.0, 90.0, unit="°", tip=tip, format="%.1f")
    if (azimuth, elevation) != before:
        return _edit(state, index, light.changed(direction=direction_of(azimuth, elevation)), "Turn")
    if not light.has_place:
        return state
    tip = "Turn the light towards the middle of the objects that are not receivers."
    if widgets.button("Aim at the objects", tip=tip):
        toward = environment_of(state.scene.objects).centre - np.array(light.position)
        return _edit(state, index, light.changed(direction=vec3(toward)), "Aim")
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


def _draw_file(state: State, view_model: ViewModel, index: int) -> State:
    """The file that a light shines by, where its kind has one."""
    light = state.scene.lights[index]
    for part in light.parts:
        if isinstance(part, FileName) and part.row is not None:
            name = Path(getattr(light, part.attribute).source).name
            if widgets.file_field(part.row.label, name, tip=part.row.tip, enabled=True, clear_tip=""):
                picture_choice.ask_lamp(state, view_model, index)
    return state


def _draw_size(state: State, index: int) -> State:
    """Rows for the shape, as the kind of light declares them."""
    light = state.scene.lights[index]
    if not light.numbers:
        widgets.hint("A point has no size: shadows and caustics are sharp.")
        return state
    changed = light
    if light.has_outline:
        shape = widgets.combo("Shape", _SHAPES, light.shape, tip="Outline of the beam or of the glowing surface.")
        changed = changed.changed(shape=shape)
    changed = draw_numbers(changed, changed.shown_numbers())
    return state if changed == light else _edit(state, index, changed.fitted(), "Size of")


# ---- power --------------------------------------------------------------------------------


def _draw_power(state: State, index: int) -> State:
    light = state.scene.lights[index]
    keys = {key.key: key for key in light.power_keys}
    key = _power_key.get(light.kind, photometric_key(light))
    tip = "In which quantity the power is shown and typed. Photometric ones weigh each colour as the eye does."
    key = widgets.combo("Quantity", {k: each.label for k, each in keys.items()}, key, tip=tip)
    _power_key[light.kind] = key
    before = light_power(light, key)
    shown: dict[str, Any] = {"unit": keys[key].unit, "tip": keys[key].tip, "format": "%.6g", "logarithmic": True}
    power = widgets.drag("Power", before, 0.0, 1e12, **shown)
    if power == before:
        return state
    return edits.attempt(state, f"Power of {light.name}", set_light_power, index, power, key)
