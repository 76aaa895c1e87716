"""The rows of a grating in the inspector."""

from __future__ import annotations

import pytest
from panel_rig import PanelRig, scene_state
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Diffuse, Grating
from spectrasplat.ui.panels.inspector import draw_inspector


def material(rig: PanelRig) -> Grating:
    return rig.state.scene.objects[rig.state.selection.index].material


def test_lines_are_typed_and_orders_thrown_back(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("spectrometer", Grating)) as rig:
        rig.type_into("Lines", "1200")
        assert material(rig).lines_per_mm == pytest.approx(1200.0)
        rig.click("Reflects")
        rig.frame(2)
        assert material(rig).reflects and material(rig).orders == (-2, -1, 0, 1, 2)
        assert set(rig.labels) == {"Grating of grating"}
        rig.type_into("Lines", "0")
        assert material(rig).lines_per_mm >= 1.0


def test_a_screen_can_be_made_a_grating(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("spectrometer", Diffuse)) as rig:
        rig.click("Kind##combo" if "Kind##combo" in rig.items.items else "Kind")
        rig.frame(2)
        rig.click("Grating")
        rig.frame(2)
        assert material(rig) == Grating()
