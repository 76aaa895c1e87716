"""Rows for the environment: its kind, and what belongs to that kind."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...edit import edits, environments
from ...edit.state import State
from ...model.environment import up_and_rotation
from ...model.scene import Scene, Vec3
from ...model.texture import Environment
from ..view_model import ViewModel
from . import picture_choice, widgets

Edit = Callable[..., Scene]
_KINDS = {"constant": "Plain colour", "gradient": "Gradient", "sky": "Sky", "map": "Picture all round"}
_RADIANCE = "cd/unit²"
_SKIES = {
    1: "Overcast, dark horizon",
    2: "Overcast, brighter to the sun",
    3: "Overcast, soft",
    4: "Overcast, soft, brighter to the sun",
    5: "Uniform",
    6: "Cloudy, level, faint sun",
    7: "Cloudy, level, bright about the sun",
    8: "Cloudy, level, corona",
    9: "Cloudy, sun hidden",
    10: "Cloudy, bright about the sun",
    11: "White-blue, corona",
    12: "Clear",
    13: "Clear, polluted",
    14: "Cloudless, turbid, wide corona",
    15: "White-blue, turbid, wide corona",
}
"""The CIE's fifteen types of sky (ISO 15469), shortened."""


def draw_environment(state: State, view_model: ViewModel) -> State:
    """Draw the rows."""
    environment, present = state.scene.environment, environments.environment_kind(state.scene)
    tip = "What is seen behind everything, in mirrors and through glass. All but a plain colour lights what is diffuse."
    kind = widgets.combo("Kind##environment", _KINDS, present, tip=tip)
    if kind != present and kind == "map":
        picture_choice.ask_environment(state, view_model)
        return state
    if kind != present:
        return edits.attempt(state, f"Environment: {_KINDS[kind].lower()}", environments.set_environment_kind, kind)
    if environment is None:
        tip, before = f"Radiance behind everything, {_RADIANCE}.", state.scene.background_rgb
        return _colour(state, "Background", before, tip, "Background", edits.set_background)
    tip = "Whether it lights what is diffuse, besides being seen."
    lights = widgets.toggle("Lights surfaces", environment.lights, tip=tip)
    if lights != environment.lights:
        return edits.attempt(state, "Light of the environment", environments.set_environment_lights, lights)
    match environment.kind:
        case "gradient":
            return _gradient(state, environment)
        case "sky":
            return _sky(state, environment)
        case "map":
            return _map(state, view_model, environment)
    tip, before = f"From everywhere, {_RADIANCE}.", _vector(environment.parameters["radiance"])
    return _colour(state, "Radiance", before, tip, "Radiance", environments.set_constant)


def _gradient(state: State, environment: Environment) -> State:
    parameters: Any = environment.parameters
    for key, label, where in (
        ("zenith", "Above", "straight up"),
        ("horizon", "Horizon", "all round"),
        ("nadir", "Below", "straight down"),
    ):
        tip, before = f"Colour seen {where}; the intensity below makes it a radiance.", _vector(parameters[key])
        state = _colour(state, label, before, tip, f"{label} of the gradient", environments.set_gradient, key)
    return _intensity(state, float(parameters.get("intensity", 1.0)), environments.set_gradient)


def _sky(state: State, environment: Environment) -> State:
    parameters: Any = environment.parameters
    skies = {str(number): f"{number}  {words}" for number, words in _SKIES.items()}
    tip = (
        "The CIE's fifteen types of sky: how bright it is towards the horizon and about the sun. Its disc is not "
        "drawn: a light shows it."
    )
    number = widgets.combo("Sky", skies, str(parameters["type"]), tip=tip)
    if number != str(parameters["type"]):
        return edits.attempt(state, "Type of sky", environments.set_sky, type=int(number))
    above, bearing = (
        "How high the sun is above the horizon.",
        "Compass bearing of the sun, about the up direction from x.",
    )
    for key, label, low, high, tip in (
        ("sun_elevation_deg", "Sun's height", 0.0, 90.0, above),
        ("sun_azimuth_deg", "Sun's azimuth", -180.0, 180.0, bearing),
    ):
        before = float(parameters[key])
        value = widgets.slider(label, before, low, high, unit="°", tip=tip, format="%.1f")
        if value != before:
            state = edits.attempt(state, label, environments.set_sky, **{key: value})
    tip, before = "Luminance straight above.", float(parameters["luminance"])
    value = widgets.drag("Luminance", before, 0.0, 1e9, unit=_RADIANCE, tip=tip, format="%.4g", logarithmic=True)
    if value != before:
        state = edits.attempt(state, "Luminance of the sky", environments.set_sky, luminance=value)
    tip, ground = "Reflectance of the ground below the horizon, which the sky lights.", _vector(parameters["ground"])
    return _colour(state, "Ground", ground, tip, "Ground of the sky", environments.set_sky, "ground", highest=1.0)


def _map(state: State, view_model: ViewModel, environment: Environment) -> State:
    height, width = environment.rgb.shape[:2]
    name = Path(environment.source).name if environment.source is not None else "From the scene's file"
    tip = (
        "A picture of all directions, twice as wide as high (.hdr, .exr). Click to choose another; one may also be "
        "dropped on the window."
    )
    if widgets.file_field("Picture", name, tip=tip):
        picture_choice.ask_environment(state, view_model)
    widgets.read_out("Size", f"{width} × {height}", tip="Pixels across and down.")
    tip, before = "Turns it about the up direction.", round(up_and_rotation(environment)[1], 4)
    angle = widgets.slider("Rotation", before, -180.0, 180.0, unit="°", format="%.1f", reset=0.0, tip=tip)
    if angle != before:
        state = edits.attempt(state, "Rotation of the environment", environments.set_map_rotation, angle)
    return _intensity(state, environments.map_intensity(environment), environments.set_map_intensity)


def _intensity(state: State, before: float, edit: Edit) -> State:
    how: dict[str, Any] = {"unit": "×", "reset": 1.0, "format": "%.4g", "logarithmic": True}
    value = widgets.drag("Intensity", before, 0.0, 1e9, tip="Factor on all of it.", **how)
    return state if value == before else edits.attempt(state, "Intensity of the environment", edit, intensity=value)


def _colour(
    state: State, label: str, before: Vec3, tip: str, undo: str, edit: Edit, key: str = "", highest: float = math.inf
) -> State:
    """A row for a colour that `edit` sets, by the name `key` or alone."""
    rgb = widgets.colour(label, before, tip=tip, highest=highest)
    if rgb == before:
        return state
    return edits.attempt(state, undo, edit, **{key: rgb}) if key else edits.attempt(state, undo, edit, rgb)


def _vector(value: Any) -> Vec3:
    r, g, b = (float(v) for v in value)
    return r, g, b
