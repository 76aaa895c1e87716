"""Rows of the inspector and of the view panel: a receiver's finish, a grating, the camera's lens; a long label."""

from __future__ import annotations

from dataclasses import replace

import pytest
from imgui_bundle import imgui
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Dielectric, Diffuse, Grating, Polariser
from spectrasplat.model.scene_camera import camera_frame
from spectrasplat.ui.panels.inspector import draw_inspector
from spectrasplat.ui.panels.spectrum import axis_labels
from spectrasplat.ui.panels.view_panel import draw_view
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, scene_state


def material(rig: PanelRig) -> Diffuse | Grating:
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


def test_a_grating_is_given_a_profile(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("spectrometer", Grating)) as rig:
        assert "Blaze" not in rig.items.items
        rig.click("Profile##combo" if "Profile##combo" in rig.items.items else "Profile")
        rig.frame(2)
        rig.click("Blazed")
        rig.frame(2)
        assert material(rig).profile == "blazed" and set(material(rig).efficiency) == {1.0}
        rig.type_into("Blaze", "480")
        assert material(rig).blaze_nm == pytest.approx(480.0)


def test_a_prism_is_made_of_calcite_and_turned(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("prism", Dielectric), (420, 1500)) as rig:
        rig.click("Crystal")
        rig.frame(2)
        rig.click("Calcite")
        rig.frame(2)
        assert material(rig).values() == {"crystal": "calcite"}
        assert "Roughness" not in rig.items.items and "Coating" not in rig.items.items
        rig.drag_slider("Optic axis", 0.1, 0.2)
        x, y, z = material(rig).axis
        assert x > 0.0 and y == 0.0 and x * x + z * z == pytest.approx(1.0)


def test_a_screen_can_be_made_a_polariser(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("spectrometer", Grating), (420, 1500)) as rig:
        rig.click("Kind##combo" if "Kind##combo" in rig.items.items else "Kind")
        rig.frame(2)
        rig.click("Polariser")
        rig.frame(2)
        assert material(rig) == Polariser()
        rig.type_into("Retardance", "140")
        assert material(rig).retardance_nm == 140.0


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
        low, high = rig.state.scene.objects[0].world_bounds
        depth = camera_frame(camera)[2] @ (0.5 * (low + high) - camera.position)
        assert rig.state.camera.focus_distance == pytest.approx(depth)
        rig.type_into("Focus distance", "2.5")
        assert rig.state.camera.focus_distance == pytest.approx(2.5)
        rig.click("Focus on the target")
        assert rig.state.camera == camera
        rig.click("Lens radius", count=2)
        assert rig.state.camera == before


def test_a_label_longer_than_its_axis_does_not_lie_over_what_is_above(gl: Context) -> None:
    found: dict[str, float | tuple[str, str]] = {}

    def labels(state: State, _model: ViewModel) -> State:
        found["length"] = length = imgui.calc_text_size("E (mW/unit²/nm)").x
        found["low"], found["high"] = axis_labels("mW/unit²/nm", length), axis_labels("mW/unit²/nm", 3.0 * length)
        return state

    with PanelRig(gl, labels, scene_state()):
        assert found["low"] == ("λ (nm), upward E (mW/unit²/nm)", "")
        assert found["high"] == ("λ (nm)", "E (mW/unit²/nm)")
