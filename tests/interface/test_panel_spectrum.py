"""The spectrum panel in little room."""

from __future__ import annotations

from imgui_bundle import imgui
from panel_rig import PanelRig, scene_state
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.panels.spectrum import axis_labels
from spectrasplat.ui.view_model import ViewModel


def test_a_label_longer_than_its_axis_does_not_lie_over_what_is_above(gl: Context) -> None:
    found: dict[str, float | tuple[str, str]] = {}

    def labels(state: State, _model: ViewModel) -> State:
        found["length"] = length = imgui.calc_text_size("E (mW/unit²/nm)").x
        found["low"], found["high"] = axis_labels("mW/unit²/nm", length), axis_labels("mW/unit²/nm", 3.0 * length)
        return state

    with PanelRig(gl, labels, scene_state()):
        assert found["low"] == ("λ (nm), upward E (mW/unit²/nm)", "")
        assert found["high"] == ("λ (nm)", "E (mW/unit²/nm)")
