"""The environment's rows and the picture of a surface, by mouse; files chosen and files dropped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import environments
from spectrasplat.edit.requests import Notice, Open
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.materials import Grating
from spectrasplat.ui.panels import dialogs, file_browser, picture_choice
from spectrasplat.ui.panels.inspector import draw_inspector
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, receiver_of, scene_state

STUDIO = assets_dir() / "environments" / "studio.hdr"


def draw(state: State, view_model: ViewModel) -> State:
    """The panel, with the dialogues that answer it."""
    return dialogs.draw_dialogs(draw_inspector(state, view_model), view_model)


@pytest.fixture
def nothing_selected() -> State:
    return replace(scene_state("spectrometer", Grating), selection=Selection())


@pytest.fixture
def panel(gl: Context, nothing_selected: State) -> Iterator[PanelRig]:
    dialogs.reset()
    with PanelRig(gl, draw, nothing_selected) as rig:
        yield rig
    dialogs.reset()


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "grey.png"
    Image.fromarray(np.full((4, 4, 3), 128, np.uint8)).save(path)
    return path


def choose(rig: PanelRig, label: str, option: str) -> None:
    rig.click(label)
    rig.frame(2)
    rig.click(option)
    rig.frame(2)


def open_file(rig: PanelRig, path: Path) -> None:
    """Answer the file dialogue, which shows the file's folder."""
    rig.frame(2)
    rig.click(path.name)
    rig.click("Open")
    rig.frame(2)


def test_a_gradient_is_chosen_and_its_intensity_typed(panel: PanelRig) -> None:
    choose(panel, "Kind", "Gradient")
    assert panel.state.scene.environment.kind == "gradient"
    panel.type_into("Intensity", "2.5")
    assert panel.state.scene.environment.parameters["intensity"] == 2.5
    choose(panel, "Kind", "Plain colour")
    assert panel.state.scene.environment is None
    assert panel.labels == ["Environment: gradient", "Intensity of the environment", "Environment: plain colour"]


def test_a_sky_has_a_type_and_a_sun_that_is_dragged(panel: PanelRig) -> None:
    choose(panel, "Kind", "Sky")
    choose(panel, "Sky", "11  White-blue, corona")
    assert panel.state.scene.environment.parameters["type"] == 11
    panel.drag_slider("Sun's height", 0.5, 0.25)
    assert panel.state.scene.environment.parameters["sun_elevation_deg"] == pytest.approx(22.5, abs=3.0)
    assert panel.was_held and panel.labels[-1] == "Sun's height"


def test_a_picture_all_round_asks_for_its_file(panel: PanelRig) -> None:
    panel.view_model = ViewModel(path=STUDIO.parent / "scene.toml")
    choose(panel, "Kind", "Picture all round")
    assert panel.state.scene.environment is None and file_browser.is_open("Choose environment")
    open_file(panel, STUDIO)
    made = panel.state.scene.environment
    assert made.kind == "map" and made.source == str(STUDIO.resolve())
    assert panel.find("Picture").is_visible
    panel.drag_slider("Rotation", 0.5, 0.75)
    assert panel.state.scene.environment.parameters["rotation_deg"] == pytest.approx(90.0, abs=10.0)
    assert panel.state.scene.environment.rgb is made.rgb


def test_a_file_that_is_no_picture_is_refused_in_words(panel: PanelRig, tmp_path: Path) -> None:
    broken = tmp_path / "broken.hdr"
    broken.write_bytes(b"no picture")
    state = dialogs.open_path(panel.state, panel.view_model, broken)
    assert state.scene.environment is None
    notices = [request for request in state.requests if isinstance(request, Notice)]
    assert notices and notices[-1].is_error and "broken.hdr" in notices[-1].text


def test_a_surface_wears_a_picture_and_takes_it_off(gl: Context, picture: Path) -> None:
    dialogs.reset()
    state = scene_state()
    table = receiver_of(state)
    with PanelRig(gl, draw, replace(state, selection=Selection("object", table))) as rig:
        rig.view_model = ViewModel(path=picture.parent / "scene.toml")
        rig.click("Picture")
        assert file_browser.is_open("Picture for table")
        open_file(rig, picture)
        texture = rig.state.scene.objects[table].material.texture
        assert texture is not None and texture.rgb.shape == (4, 4, 3)
        choose(rig, "Beyond its edge", "Its border continues")
        assert rig.state.scene.objects[table].material.texture.wrap == "clamp"
        rig.click("Clear Picture")
        assert rig.state.scene.objects[table].material.texture is None
        assert "Beyond its edge" not in rig.items.items
    dialogs.reset()


def test_dropped_pictures(nothing_selected: State, picture: Path) -> None:
    view_model = ViewModel(unsaved=True)
    round_it = dialogs.open_path(nothing_selected, view_model, STUDIO)
    assert round_it.scene.environment.kind == "map" and round_it.edit_label == "Environment studio.hdr"
    assert not round_it.requests
    lost = dialogs.open_path(nothing_selected, view_model, picture)
    assert lost.scene is nothing_selected.scene and "Select a diffuse object" in lost.requests[-1].text
    table = receiver_of(nothing_selected)
    worn = dialogs.open_path(replace(nothing_selected, selection=Selection("object", table)), view_model, picture)
    assert worn.scene.objects[table].material.texture is not None
    assert dialogs.open_path(nothing_selected, ViewModel(), Path("other.toml")).requests == (Open(Path("other.toml")),)
    assert picture_choice.is_part(Path("X.EXR")) and not picture_choice.is_part(Path("x.glb"))


def test_a_name_too_long_for_its_field_is_cut(gl: Context, nothing_selected: State) -> None:
    scene = environments.set_environment_map(nothing_selected.scene, STUDIO)
    long = replace(scene, environment=replace(scene.environment, source="/x/" + 30 * "panorama_" + ".hdr"))
    with PanelRig(gl, draw, replace(nothing_selected, scene=long), (300, 600)) as rig:
        field = rig.find("Picture")
        assert field.is_visible and field.at(1.0)[0] <= 300
