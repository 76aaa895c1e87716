"""Sliders: the handle stands where the mouse put it, and covers no digit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from interface.panel_rig import PanelRig, scene_state
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels import widgets
from spectrasplat.ui.view_model import ViewModel


class OneSlider:
    """A panel of one slider that keeps its value."""

    def __init__(self, low: float, high: float, **how: object) -> None:
        self.value, self._ends, self._how = high, (low, high), how

    def __call__(self, state: State, view_model: ViewModel) -> State:
        _, self.value, _ = widgets.slider("Amount", self.value, *self._ends, unit="", tip="Some.", **self._how)  # type: ignore[arg-type]
        return state


class OneReciprocal(OneSlider):
    """The same, even in one over the value."""

    def __call__(self, state: State, view_model: ViewModel) -> State:
        _, self.value, _ = widgets.reciprocal_slider("Amount", self.value, self._ends[0], unit="", tip="Some.")
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
