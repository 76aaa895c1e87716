"""The camera's rows: a lens is opened, and focused on the target, at a distance, on what is selected."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spectrasplat.edit.state import Selection
from spectrasplat.model.camera_rays import camera_frame
from spectrasplat.model.contacts import world_bounds
from spectrasplat.ui.panels.view_panel import draw_view

from tests.interface.panel_rig import PanelRig, scene_state


def test_the_lens_is_opened_and_focused(gl) -> None:
    with PanelRig(gl, draw_view, scene_state(), (420, 1500)) as rig:
        rig.state = replace(rig.state, selection=Selection("object", 0))
        before = rig.state.camera
        rig.drag_slider("Lens radius", 0.0, 0.5)
        camera = rig.state.camera
        assert camera.lens_radius == pytest.approx(0.05 * camera.plane_of_focus, rel=0.1)
        assert camera.focus_distance is None and rig.was_held
        rig.frame(2)
        rig.click("Focus on the selected")
        low, high = world_bounds(rig.state.scene.objects[0])
        depth = camera_frame(camera)[2] @ (0.5 * (low + high) - camera.position)
        assert rig.state.camera.focus_distance == pytest.approx(depth)
        rig.type_into("Focus distance", "2.5")
        assert rig.state.camera.focus_distance == pytest.approx(2.5)
        rig.click("Focus on the target")
        assert rig.state.camera == camera
        rig.double_click("Lens radius")
        assert rig.state.camera == before
