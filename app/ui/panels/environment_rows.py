"""Rows for what lies behind everything: its kind, and what belongs to that kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...edit import edits, environments
from ...edit.state import State
from ...model.environment import up_and_rotation
from ...model.scene import Vec3
from ...model.texture import Environment
from ..view_model import ViewModel
from . import picture_choice, widgets

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
    scene = state.scene
    tip = "What is seen behind everything, in mirrors and through glass. All but a plain colour lights what is diffuse."
    changed, kind = widgets.combo("Kind##environment", _KINDS, environments.environment_kind(scene), tip=tip)
    if changed and kind == "map":
        picture_choice.ask_environment(state, view_model)
        return state
    if changed:
        return edits.attempt(state, f"Environment: {_KINDS[kind].lower()}", environments.set_environment_kind, kind)
    if scene.environment is None:
        return _constant(state)
    tip = "Whether it lights what is diffuse, besides being seen."
    changed, lights = widgets.toggle("Lights surfaces", scene.environment.lights, tip=tip)
    if changed:
        return edits.attempt(state, "Light of the environment", environments.set_environment_lights, lights)
    rows = {"gradient": _gradient, "sky": _sky, "constant": _radiance}
    if scene.environment.kind == "map":
        return _map(state, view_model, scene.environment)
    return rows[scene.environment.kind](state, scene.environment)


def _constant(state: State) -> State:
    changed, rgb, active = widgets.colour(
        "Background", state.scene.background_rgb, tip=f"Radiance behind everything, {_RADIANCE}."
    )
    if changed:
        state = edits.attempt(state, "Background", edits.set_background, rgb)
    return widgets.holding(state, active)


def _radiance(state: State, environment: Environment) -> State:
    rgb = _vector(environment.parameters["radiance"])
    changed, rgb, active = widgets.colour("Radiance", rgb, tip=f"From everywhere, {_RADIANCE}.")
    if changed:
        state = edits.attempt(state, "Radiance", environments.set_constant, tuple(max(c, 0.0) for c in rgb))
    return widgets.holding(state, active)


def _gradient(state: State, environment: Environment) -> State:
    parameters: Any = environment.parameters
    for key, label, where in (
        ("zenith", "Above", "straight up"),
        ("horizon", "Horizon", "all round"),
        ("nadir", "Below", "straight down"),
    ):
        changed, rgb, active = widgets.colour(
            label, _vector(parameters[key]), tip=f"Colour seen {where}; the intensity below makes it a radiance."
        )
        if changed:
            state = edits.attempt(
                state, f"{label} of the gradient", environments.set_gradient, **{key: tuple(max(c, 0.0) for c in rgb)}
            )
        state = widgets.holding(state, active)
    return _intensity(state, float(parameters.get("intensity", 1.0)), environments.set_gradient)


def _sky(state: State, environment: Environment) -> State:
    parameters: Any = environment.parameters
    skies = {str(number): f"{number}  {words}" for number, words in _SKIES.items()}
    tip = (
        "The CIE's fifteen types of sky: how bright it is towards the horizon and about the sun. Its disc is not "
        "drawn: a light shows it."
    )
    changed, number = widgets.combo("Sky", skies, str(parameters["type"]), tip=tip)
    if changed:
        return edits.attempt(state, "Type of sky", environments.set_sky, type=int(number))
    rows = (
        ("sun_elevation_deg", "Sun's height", 0.0, 90.0, "How high the sun stands above the horizon."),
        (
            "sun_azimuth_deg",
            "Sun's azimuth",
            -180.0,
            180.0,
            "Compass bearing of the sun, about the up direction from x.",
        ),
    )
    for key, label, low, high, tip in rows:
        changed, value, active = widgets.slider(
            label, float(parameters[key]), low, high, unit="°", tip=tip, format="%.1f"
        )
        if changed:
            state = edits.attempt(state, label, environments.set_sky, **{key: value})
        state = widgets.holding(state, active)
    tip = "Luminance straight above."
    changed, value, active = widgets.drag(
        "Luminance", float(parameters["luminance"]), 0.0, 1e9, unit=_RADIANCE, tip=tip, format="%.4g", logarithmic=True
    )
    if changed:
        state = edits.attempt(state, "Luminance of the sky", environments.set_sky, luminance=value)
    state = widgets.holding(state, active)
    changed, rgb, active = widgets.colour(
        "Ground",
        _vector(parameters["ground"]),
        tip="Reflectance of the ground below the horizon, which the sky lights.",
    )
    if changed:
        clipped = tuple(min(max(c, 0.0), 1.0) for c in rgb)
        state = edits.attempt(state, "Ground of the sky", environments.set_sky, ground=clipped)
    return widgets.holding(state, active)


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
    _, rotation_deg = up_and_rotation(environment)
    changed, angle, active = widgets.slider(
        "Rotation",
        round(rotation_deg, 4),
        -180.0,
        180.0,
        unit="°",
        format="%.1f",
        reset=0.0,
        tip="Turns it about the up direction.",
    )
    if changed:
        state = edits.attempt(state, "Rotation of the environment", environments.set_map_rotation, angle)
    state = widgets.holding(state, active)
    return _intensity(state, environments.map_intensity(environment), environments.set_map_intensity)


def _intensity(state: State, value: float, edit: Any) -> State:
    tip = "Factor on all of it."
    changed, value, active = widgets.drag(
        "Intensity", value, 0.0, 1e9, unit="×", tip=tip, reset=1.0, format="%.4g", logarithmic=True
    )
    if changed:
        state = edits.attempt(state, "Intensity of the environment", edit, intensity=value)
    return widgets.holding(state, active)


def _vector(value: Any) -> Vec3:
    r, g, b = (float(v) for v in value)
    return r, g, b
