"""Rows for the environment: its kind, and what belongs to that kind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ...edit import edits, environments
from ...edit.state import State
from ...model.environment import up_and_rotation
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
_ABOUT_SKIES = (
    "The CIE's fifteen types of sky: how bright it is towards the horizon and about the sun. Its disc is not drawn: a "
    "light shows it."
)


def _sky_type(label: str, number: int, *, tip: str) -> int:
    skies = {str(number): f"{number}  {words}" for number, words in _SKIES.items()}
    return int(widgets.combo(label, skies, str(number), tip=tip))


_angle = partial(widgets.slider, unit="°", format="%.1f")
_many = partial(widgets.drag, low=0.0, high=1e9, format="%.4g", logarithmic=True)
_factor = partial(_many, unit="×", reset=1.0)
_SEEN = "Colour seen {}; the intensity below makes it a radiance."
_ROWS: dict[str, tuple[tuple[str, str, Callable[..., Any], str, str], ...]] = {
    "constant": (("radiance", "Radiance", widgets.colour, f"From everywhere, {_RADIANCE}.", "Radiance"),),
    "gradient": (
        ("zenith", "Above", widgets.colour, _SEEN.format("straight up"), "Above of the gradient"),
        ("horizon", "Horizon", widgets.colour, _SEEN.format("all round"), "Horizon of the gradient"),
        ("nadir", "Below", widgets.colour, _SEEN.format("straight down"), "Below of the gradient"),
        ("intensity", "Intensity", _factor, "Factor on all of it.", "Intensity of the environment"),
    ),
    "sky": (
        (
            "type",
            "Sky",
            _sky_type,
            _ABOUT_SKIES,
            "Type of sky",
        ),
        (
            "sun_elevation_deg",
            "Sun's height",
            partial(_angle, low=0.0, high=90.0),
            "How high the sun is above the horizon.",
            "Sun's height",
        ),
        (
            "sun_azimuth_deg",
            "Sun's azimuth",
            partial(_angle, low=-180.0, high=180.0),
            "Compass bearing of the sun, about the up direction from x.",
            "Sun's azimuth",
        ),
        (
            "luminance",
            "Luminance",
            partial(_many, unit=_RADIANCE),
            "Luminance straight above.",
            "Luminance of the sky",
        ),
        (
            "ground",
            "Ground",
            partial(widgets.colour, highest=1.0),
            "Reflectance of the ground below the horizon, which the sky lights.",
            "Ground of the sky",
        ),
    ),
}
"""Parameters of each kind that is made of numbers: the labels, controls and tooltips of their rows, and the labels of
their edits."""


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
        before = state.scene.background_rgb
        rgb = widgets.colour("Background", before, tip=f"Radiance behind everything, {_RADIANCE}.")
        return state if rgb == before else edits.attempt(state, "Background", edits.set_background, rgb)
    tip = "Whether it lights what is diffuse, besides being seen."
    lights = widgets.toggle("Lights surfaces", environment.lights, tip=tip)
    if lights != environment.lights:
        return edits.attempt(state, "Light of the environment", environments.set_environment_lights, lights)
    if environment.kind == "map":
        return _map(state, view_model, environment)
    for key, label, control, tip, undo in _ROWS[environment.kind]:
        before = environment.parameters.get(key, 1.0)
        before = tuple(before) if isinstance(before, list) else before
        value = control(label, before, tip=tip)
        if value != before:
            state = edits.attempt(state, undo, environments.set_environment, **{key: value})
    return state


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
    before = environments.map_intensity(environment)
    value = _factor("Intensity", before, tip="Factor on all of it.")
    if value == before:
        return state
    return edits.attempt(state, "Intensity of the environment", environments.set_map_intensity, value)
