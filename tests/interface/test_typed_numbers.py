"""What is typed into a field of numbers and is none changes nothing: "nan", infinities, what no scene could hold."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels import widgets
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, scene_state

TYPED = ("nan", "-nan", "NAN", "inf", "-inf", "1e39", "-1e39")
Field = Callable[[float], tuple[bool, float, bool]]


def _vec3(value: float) -> tuple[bool, float, bool]:
    changed, (_, y, _), active = widgets.vec3("Field", (0.0, value, 0.0), unit="", tip="")  # the one in the middle
    return changed, y, active


FIELDS: dict[str, Field] = {
    "slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="nm", tip="", clamp=False),
    "clamped slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="nm", tip=""),
    "logarithmic slider": lambda v: widgets.slider("Field", v, 1.0, 9.0, unit="", tip="", logarithmic=True),
    "drag": lambda v: widgets.drag("Field", v, unit="", tip=""),
    "drag above": lambda v: widgets.drag("Field", v, 0.0, unit="", tip="", logarithmic=True),
    "vec3": _vec3,
}


ENDS = {"clamped slider": (1.0, 9.0), "logarithmic slider": (1.0, 9.0), "drag above": (0.0,)}
"""Where what is out of range is brought back into it."""


@pytest.mark.parametrize("name", FIELDS)
def test_only_numbers_are_taken(gl: Context, name: str) -> None:
    values = [2.0]

    def draw(state: State, _view_model: ViewModel) -> State:
        changed, after, _ = FIELDS[name](values[-1])
        assert math.isfinite(after)
        if changed:
            values.append(after)
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
        changed, after, _ = widgets.reciprocal_slider("Field", values[-1], 10.0, unit="", tip="")
        if changed:
            values.append(after)
        return state

    panel = PanelRig(gl, draw, scene_state())
    try:
        panel.type_into("Field", "nan")
        panel.frame(3)
        assert values == [50.0]
        panel.type_into("Field", "inf")
        assert math.isinf(values[-1])
    finally:
        panel.release()
