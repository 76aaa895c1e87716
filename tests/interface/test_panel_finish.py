"""The rows of a receiver's finish in the inspector."""

from __future__ import annotations

import pytest
from panel_rig import PanelRig, scene_state
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Diffuse
from spectrasplat.ui.panels.inspector import draw_inspector


def material(rig: PanelRig) -> Diffuse:
    return rig.state.scene.objects[rig.state.selection.index].material


def test_a_coat_is_put_on_edited_and_taken_off(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("prism", Diffuse)) as rig:
        colour = material(rig).reflectance_rgb
        assert not material(rig).has_coat and "Roughness" not in rig.items.items
        rig.click("Coat")
        rig.frame(2)
        assert material(rig) == Diffuse(colour, roughness=0.25)
        rig.type_into("Roughness", "0.1")
        rig.type_into("Coat's index", "1.8")
        rig.type_into("Diffuse roughness", "0.5")
        finish = material(rig).roughness, material(rig).coat_index, material(rig).diffuse_roughness
        assert finish == pytest.approx((0.1, 1.8, 0.5))
        rig.type_into("Roughness", "7")
        assert material(rig).roughness <= 1.0
        rig.click("Coat")
        rig.frame(2)
        assert material(rig).values() == Diffuse(colour, diffuse_roughness=0.5).values()
