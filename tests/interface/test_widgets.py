"""Widgets: numbers and colours mean what is typed, what is no number changes nothing, a slider's handle stands where
the mouse put it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels import widgets
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, scene_state


class ColourField:
    """One colour field, and what it says."""

    def __init__(self, gl: Context) -> None:
        widgets._colour_numbers["linear"] = True
        self.rgb = (0.8, 0.4, 0.2)
        self.shown = ""
        self.rig = PanelRig(gl, self._draw, scene_state())

    def _draw(self, state: State, _view_model: ViewModel) -> State:
        self.rgb = widgets.colour("Reflectance", self.rgb, tip="Of the surface.")
        return state

    def type(self, number: str) -> None:
        """Another number for the first channel."""
        self.rig.click(self.rig.find("Reflectance").at(0.1), keys=[imgui.Key.mod_ctrl])
        self.rig.type(number)
        self.rig.key(imgui.Key.enter)
        self.rig.frame(2)


@pytest.mark.parametrize(("as_srgb", "typed", "expected"), [(False, "0.5", 0.5), (True, "0.5", 0.2140411)])
def test_numbers_are_what_the_button_says(gl: Context, as_srgb: bool, typed: str, expected: float) -> None:
    field = ColourField(gl)
    if as_srgb:
        field.rig.click("Reflectance: numbers")
        field.rig.frame(2)
    assert field.rgb == (0.8, 0.4, 0.2)  # only what is shown changed
    field.type(typed)
    assert field.rgb[0] == pytest.approx(expected, rel=1e-5)
    assert field.rgb[1:] == pytest.approx((0.4, 0.2), rel=1e-6)


def test_a_swatch_opens_a_picker(gl: Context) -> None:
    field = ColourField(gl)
    field.rig.click("Reflectance: swatch")
    field.rig.frame(3)
    picker, swatch = field.rig.find("Reflectance: picker"), field.rig.find("Reflectance: swatch")
    assert picker.top > swatch.bottom or picker.bottom < swatch.top or picker.right < swatch.left
    field.rig.click(picker.at(0.3, 0.5))
    field.rig.frame(2)
    assert field.rgb != (0.8, 0.4, 0.2) and all(0.0 <= c <= 1.0 for c in field.rgb)


class OneSlider:
    """A panel of one slider that keeps its value."""

    def __init__(self, low: float, high: float, **how: object) -> None:
        self.value, self._ends, self._how = high, (low, high), how

    def __call__(self, state: State, view_model: ViewModel) -> State:
        self.value = widgets.slider("Amount", self.value, *self._ends, unit="", tip="Some.", **self._how)  # type: ignore[arg-type]
        return state


class OneReciprocal(OneSlider):
    """The same, even in one over the value."""

    def __call__(self, state: State, view_model: ViewModel) -> State:
        self.value = widgets.reciprocal_slider("Amount", self.value, self._ends[0], unit="", tip="Some.")
        return state


PANELS: dict[str, Callable[[], OneSlider]] = {
    "linear": lambda: OneSlider(-1.0, 3.0),
    "logarithmic": lambda: OneSlider(5.0, 3600.0, logarithmic=True, format="%.0f"),
    "logarithmic from zero": lambda: OneSlider(0.0, 1.0, logarithmic=True, format="%.4f"),
    "reciprocal": lambda: OneReciprocal(8.0, 100.0),
}


@pytest.mark.parametrize("kind", PANELS)
@pytest.mark.parametrize("where", [0.25, 0.5, 0.8])
def test_the_handle_is_where_the_mouse_is_and_leaves_the_digits_free(gl: Context, kind: str, where: float) -> None:
    panel = PANELS[kind]()
    rig = PanelRig(gl, panel, scene_state(), size=(420, 120))
    rig.drag_slider("Amount", 0.1, where)
    rig.move((400, 110))
    item, picture = rig.find("Amount"), rig.screenshot().astype(float) / 255.0
    field = picture[round(item.top) : round(item.bottom), round(item.left) : round(item.right)]
    is_blue = field[..., 2] - field[..., 0] > 0.1
    height = field.shape[0]
    above_the_line = np.flatnonzero(is_blue[round(0.85 * height)])
    assert abs(above_the_line.mean() / field.shape[1] - where) < 0.03, "the handle"
    assert np.flatnonzero(is_blue[-1]).min() < 4, "the line, from the left end on"
    assert not is_blue[: round(0.7 * height)].any(), "where the digits stand"
    rig.release()


TYPED = ("nan", "-nan", "NAN", "inf", "-inf", "1e39", "-1e39")
Field = Callable[[float], float]


FIELDS: dict[str, Field] = {
    "slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="nm", tip="", clamp=False),
    "clamped slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="nm", tip=""),
    "logarithmic slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="", tip="", logarithmic=True),
    "drag": lambda v: widgets.drag("Field", v, unit="", tip=""),
    "drag above": lambda v: widgets.drag("Field", v, 0.0, unit="", tip="", logarithmic=True),
    "vec3": lambda v: widgets.vec3("Field", (0.0, v, 0.0), unit="", tip="")[1],  # the one in the middle
}


ENDS = {"clamped slider": (1.0, 9.0), "logarithmic slider": (1.0, 9.0), "drag above": (0.0,)}
"""Where what is out of range is brought back into it."""


@pytest.mark.parametrize("name", FIELDS)
def test_only_numbers_are_taken(gl: Context, name: str) -> None:
    values = [2.0]

    def draw(state: State, _view_model: ViewModel) -> State:
        values.append(FIELDS[name](values[-1]))
        assert math.isfinite(values[-1])
        return state

    panel = PanelRig(gl, draw, scene_state())
    try:
        for typed in TYPED:
            panel.type_into("Field", typed)
            panel.frame(3)
            assert set(values) <= {2.0, *ENDS.get(name, ())}, (typed, values)
        panel.type_into("Field", "3")
        assert values[-1] == 3.0
    finally:
        panel.release()


def test_infinity_is_taken_where_it_means_something(gl: Context) -> None:
    values = [50.0]

    def draw(state: State, _view_model: ViewModel) -> State:
        values.append(widgets.reciprocal_slider("Field", values[-1], 10.0, unit="", tip=""))
        return state

    panel = PanelRig(gl, draw, scene_state())
    try:
        panel.type_into("Field", "nan")
        panel.frame(3)
        assert set(values) == {50.0}
        panel.type_into("Field", "inf")
        assert math.isinf(values[-1])
    finally:
        panel.release()
