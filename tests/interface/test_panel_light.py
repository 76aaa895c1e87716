"""The light panel and the brush panel: units, kinds, spectra, dabs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.lamps import isotropic
from spectrasplat.edit.brush import USUAL_RADIUS
from spectrasplat.edit.lights import light_power, spectrum_words
from spectrasplat.edit.objects import add_dabs
from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.model.lights import IesLight
from spectrasplat.model.scene import Dab
from spectrasplat.ui.panels import file_browser, light_panel, light_spectrum, picture_choice
from spectrasplat.ui.panels.brush_panel import draw_brush
from spectrasplat.ui.panels.light_panel import angles_of, direction_of, draw_light

from tests.interface.panel_rig import PanelRig, receiver_of, scene_state


@pytest.fixture(autouse=True)
def fresh_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_panel, "_power_key", {})
    monkeypatch.setattr(light_spectrum, "_memory", light_spectrum._Memory())


@pytest.fixture
def panel(gl: Context) -> Iterator[PanelRig]:
    with PanelRig(gl, draw_light, scene_state(select="light")) as rig:
        yield rig


def choose(rig: PanelRig, label: str, option: str) -> None:
    """Open a combo and take an option."""
    rig.click(label)
    rig.frame(2)
    rig.click(option)
    rig.frame(2)


def test_power_is_typed_in_its_unit(panel: PanelRig) -> None:
    panel.type_into("Power", "1234")
    assert panel.light.spectral_power.luminous() == pytest.approx(1234.0, rel=1e-6)
    assert panel.labels == ["Power of slit"]


def test_flux_of_a_beam_is_its_illuminance_times_its_area(panel: PanelRig) -> None:
    choose(panel, "Quantity", "Luminous flux (lm)")
    panel.type_into("Power", "50")
    area = panel.light.width * panel.light.height
    assert panel.light.spectral_power.luminous() * area == pytest.approx(50.0, rel=1e-6)


def test_another_kind_keeps_the_name_and_shows_its_own_rows(panel: PanelRig) -> None:
    choose(panel, "Kind", "Spot")
    assert panel.light.kind == "spot"
    assert "Half angle" in panel.items.items
    assert "Width" not in panel.items.items
    panel.type_into("Half angle", "12")
    assert panel.light.outer_half_angle_deg == 12.0
    assert panel.light.inner_half_angle_deg <= 12.0


def test_laser_slider_is_dragged_live(panel: PanelRig) -> None:
    choose(panel, "Spectrum", "Laser line")
    panel.was_held = False
    panel.drag_slider("Wavelength", 0.4, 0.75)
    kind, nm = spectrum_words(panel.light.spectral_power)
    assert kind == "laser"
    assert nm == pytest.approx(680.0, abs=8.0)
    assert panel.was_held


def test_a_measured_spectrum_is_read_from_a_file(panel: PanelRig, tmp_path: Path) -> None:
    file = tmp_path / "lamp.csv"
    file.write_text("wavelength_nm, power\n400, 0\n500, 1\n600, 0\n")
    choose(panel, "Spectrum", "Measured, from file")
    panel.click("Spectrum file")
    panel.type(str(file))
    panel.click("Read file")
    density = panel.light.spectral_power.density
    assert int(np.argmax(density)) + 380 == 500
    assert panel.state.requests == ()


def test_a_missing_file_is_said_and_changes_nothing(panel: PanelRig) -> None:
    before = panel.light
    choose(panel, "Spectrum", "Measured, from file")
    panel.click("Spectrum file")
    panel.type("/nowhere/lamp.csv")
    panel.click("Read file")
    assert panel.light == before
    assert "/nowhere/lamp.csv" in panel.state.requests[0].text


def test_direction_is_turned_by_angles(panel: PanelRig) -> None:
    panel.type_into("Elevation", "-45")
    panel.type_into("Azimuth", "90")
    assert panel.light.direction == pytest.approx((0.0, 0.5**0.5, -(0.5**0.5)), abs=1e-4)


def test_azimuth_survives_straight_down() -> None:
    azimuth, elevation = angles_of(direction_of(40.0, -90.0))
    assert azimuth == pytest.approx(40.0, abs=1e-6)
    assert elevation == pytest.approx(-89.999)


def test_name_is_taken_when_the_field_is_left(panel: PanelRig) -> None:
    panel.click("Name", count=2)
    panel.type("sunbeam")
    panel.click("Light spectrum")
    assert panel.light.name == "sunbeam"


# ---- lamps from files ---------------------------------------------------------------------


def test_a_lamp_is_made_turned_and_given_lumens(panel: PanelRig) -> None:
    choose(panel, "Kind", "Photometric (IES)")
    assert isinstance(panel.light, IesLight)
    assert "File" in panel.items.items and "Width" not in panel.items.items
    panel.type_into("Rotation", "45")
    assert panel.light.rotation_deg == 45.0
    panel.type_into("Power", "800")
    assert light_power(panel.light, "lumens") == pytest.approx(800.0)


def test_a_lamp_is_chosen_from_a_file(panel: PanelRig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    choose(panel, "Kind", "Photometric (IES)")
    asked = []
    monkeypatch.setattr(file_browser, "ask", asked.append)
    panel.click("File")
    assert [question.suffixes for question in asked] == [(".ies", ".ldt")]
    chosen = tmp_path / "mine.ies"
    chosen.write_text(isotropic(), encoding="ascii")
    panel.state = asked[0].then(panel.state, panel.view_model, chosen)
    assert Path(panel.light.profile.source) == chosen
    assert panel.light.spectral_power.luminous() == pytest.approx(100.0)


def test_a_dropped_lamp_file(panel: PanelRig, tmp_path: Path) -> None:
    path = tmp_path / "MINE.IES"
    path.write_text(isotropic(), encoding="ascii")
    assert picture_choice.is_part(path)
    count = len(panel.state.scene.lights)
    selected = picture_choice.dropped(panel.state, path)
    assert isinstance(selected.scene.lights[0], IesLight) and len(selected.scene.lights) == count
    unselected = picture_choice.dropped(replace(panel.state, selection=Selection()), path)
    assert isinstance(unselected.scene.lights[-1], IesLight) and len(unselected.scene.lights) == count + 1
    path.write_text("nothing", encoding="ascii")
    refused = picture_choice.dropped(panel.state, path)
    assert refused.scene is panel.state.scene and "TILT=" in refused.requests[0].text


# ---- brush --------------------------------------------------------------------------------


@pytest.fixture
def painted(gl: Context) -> Iterator[PanelRig]:
    state = scene_state()
    dabs = [Dab((0.1 * i, 0.0, 0.0), 0.2, 1.0) for i in range(3)]
    state = replace(state, scene=add_dabs(state.scene, receiver_of(state), dabs))
    with PanelRig(gl, draw_brush, state) as rig:
        yield rig


def test_physical_picture_is_a_switch_that_edits_nothing(painted: PanelRig) -> None:
    scene = painted.state.scene
    painted.click("Physical picture")
    assert painted.state.physical
    assert painted.state.scene is scene


def test_brush_settings_and_tools(painted: PanelRig) -> None:
    painted.click("Brush")
    assert painted.state.tool == "brush"
    choose(painted, "Mode", "Erase")
    painted.type_into("Radius", "0.25")
    painted.drag_slider("Falloff", 0.7, 0.1)
    brush = painted.state.brush
    assert (brush.mode, brush.radius) == ("erase", 0.25)
    assert brush.falloff == pytest.approx(0.1, abs=0.05)
    painted.click("Radius", count=2)
    view = painted.state.view
    assert painted.state.brush.radius == pytest.approx(USUAL_RADIUS * view.height_at(view.target_distance))
