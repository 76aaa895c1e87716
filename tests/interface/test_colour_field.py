"""Colour fields: the numbers are those of the scene file, or sRGB's where that is asked for, and they say which."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels import widgets
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, scene_state


class Field:
    """One colour field, and what it says."""

    def __init__(self, gl: Context) -> None:
        widgets._colour_numbers["linear"] = True
        self.rgb = (0.8, 0.4, 0.2)
        self.shown = ""
        self.rig = PanelRig(gl, self._draw, scene_state())

    def _draw(self, state: State, _view_model: ViewModel) -> State:
        _, self.rgb, _ = widgets.colour("Reflectance", self.rgb, tip="Of the surface.")
        return state

    def type(self, number: str) -> None:
        """Another number for the first channel."""
        self.rig.click(self.rig.find("Reflectance").at(0.1), keys=[imgui.Key.mod_ctrl])
        self.rig.type(number)
        self.rig.key(imgui.Key.enter)
        self.rig.frame(2)


@pytest.mark.parametrize(("as_srgb", "typed", "expected"), [(False, "0.5", 0.5), (True, "0.5", 0.2140411)])
def test_numbers_are_what_the_button_says(gl: Context, as_srgb: bool, typed: str, expected: float) -> None:
    field = Field(gl)
    if as_srgb:
        field.rig.click("Reflectance: numbers")
        field.rig.frame(2)
    assert field.rgb == (0.8, 0.4, 0.2)  # only what is shown changed
    field.type(typed)
    assert field.rgb[0] == pytest.approx(expected, rel=1e-5)
    assert field.rgb[1:] == pytest.approx((0.4, 0.2), rel=1e-6)


def test_a_swatch_opens_a_picker(gl: Context) -> None:
    field = Field(gl)
    field.rig.click("Reflectance: swatch")
    field.rig.frame(3)
    picker, swatch = field.rig.find("Reflectance: picker"), field.rig.find("Reflectance: swatch")
    assert picker.top > swatch.bottom or picker.bottom < swatch.top or picker.right < swatch.left
    field.rig.click(picker.at(0.3, 0.5))
    field.rig.frame(2)
    assert field.rgb != (0.8, 0.4, 0.2) and all(0.0 <= c <= 1.0 for c in field.rgb)
