"""Export and compare panels with a synthetic mouse: what they ask the host for, and what they show of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from imgui_bundle import imgui
from spectrasplat.edit import requests
from spectrasplat.edit.state import Key, State
from spectrasplat.ui.panels import export_panel, file_browser
from spectrasplat.ui.panels.compare_panel import draw_compare
from spectrasplat.ui.panels.export_panel import draw_export
from spectrasplat.ui.view_model import JobInfo, ViewModel

from tests.interface.panel_rig import PanelRig, scene_state


def with_browser(state: State, view_model: ViewModel) -> State:
    """The panel with the file dialogue, as the shell draws them."""
    state = draw_export(state, view_model)
    return file_browser.draw(state, view_model)


@pytest.fixture
def rig(gl, tmp_path: Path):
    export_panel.reset()
    file_browser.close()
    with PanelRig(gl, with_browser, scene_state(), (900, 1250)) as made:
        made.view_model = ViewModel(path=tmp_path / "scene.toml", title="scene")
        made.frame(2)
        yield made
    file_browser.close()


def choose(rig: PanelRig, label: str, text: str) -> None:
    rig.click(label)
    rig.click(text)


def test_a_screenshot_goes_where_the_dialogue_says(rig: PanelRig, tmp_path: Path) -> None:
    rig.click("Save screenshot…")
    rig.click("Save")
    assert rig.state.requests == (requests.Screenshot(tmp_path / "scene.png"),)
    rig.state = replace(rig.state, requests=())
    rig.click("With interface")
    rig.click("Save screenshot…")
    rig.click("Save")
    assert rig.state.requests == (requests.Screenshot(tmp_path / "scene.png", with_interface=True),)


def test_a_baked_map(rig: PanelRig, tmp_path: Path) -> None:
    choose(rig, "Texels", "512 × 512")
    rig.click("Bake map…")
    rig.click("Save")
    assert rig.state.requests == (requests.Bake(tmp_path / "scene_table.exr", "table", (512, 512), 4_000_000),)


def test_a_turntable_as_a_sequence_is_a_folder(rig: PanelRig, tmp_path: Path) -> None:
    choose(rig, "File", "Sequence (PNG)")
    choose(rig, "Size", "1280 × 720")
    rig.click("Frames", keys=[imgui.Key.mod_ctrl])
    rig.type("48")
    rig.key(imgui.Key.enter)
    rig.click("Render animation…")
    rig.click("Save")
    wanted = requests.Animate(tmp_path / "scene_turntable", "turntable", 48, 24.0, (1280, 720), 1_000_000)
    assert rig.state.requests == (wanted,)


def test_the_ending_of_a_film_decides_what_it_becomes(rig: PanelRig, tmp_path: Path) -> None:
    rig.view_model = replace(rig.view_model, title="scene.toml")
    rig.click("Render animation…")
    rig.click("Save")
    rig.click("Render animation…")
    rig.key(imgui.Key.a, [imgui.Key.mod_ctrl])
    rig.type("turn.gif")
    rig.click("Save")
    choose(rig, "File", "Animated WebP")
    rig.click("Render animation…")
    rig.click("Save")
    names = ["scene_turntable.mp4", "turn.gif", "scene_turntable.webp"]
    assert [asked.path for asked in rig.state.requests] == [tmp_path / name for name in names]


def test_keys_are_added_changed_and_deleted(rig: PanelRig, tmp_path: Path) -> None:
    choose(rig, "Kind", "Keys")
    rig.click("Render animation…")
    assert not file_browser.is_open("Render animation")  # nothing to render yet
    rig.click("Add key")
    rig.click("Add key")
    assert rig.state.animation == (
        Key(0.0, "objects.prism.dispersion_gain", 1.0),
        Key(2.0, "objects.prism.dispersion_gain", 1.0),
    )
    rig.type_into("Key 1 value", "3")
    rig.type_into("Key 1 time", "1.5")
    assert rig.state.animation[1] == Key(1.5, "objects.prism.dispersion_gain", 3.0)
    rig.click("Key this view")
    assert {key.path for key in rig.state.animation if key.path.startswith("camera")} == {
        f"camera.{f}.{a}" for f in ("position", "target") for a in "xyz"
    }
    count = len(rig.state.animation)
    rig.click("Key 0 delete")
    assert len(rig.state.animation) == count - 1
    rig.click("Render animation…")
    rig.click("Save")
    (asked,) = rig.state.requests
    assert isinstance(asked, requests.Animate) and asked.kind == "keys" and asked.frames is None


def test_while_an_export_runs_it_can_only_be_cancelled(rig: PanelRig) -> None:
    rig.view_model = replace(rig.view_model, job=JobInfo("Turntable: a.mp4", 0.4, "Frame 3 of 8"))
    rig.frame(2)
    for label in ("Render…", "Bake map…"):
        rig.click(label)
        assert not imgui.is_popup_open("", imgui.PopupFlags_.any_popup.value)
    rig.click("Cancel export")
    assert rig.state.requests == (requests.CancelJob(),)
    rig.click("Save screenshot…")  # which is only written, and waits for nothing
    assert file_browser.is_open("Save screenshot")


def test_a_starting_export_moves_no_control_under_the_mouse(rig: PanelRig) -> None:
    labels = ("Render…", "Samples", "Save screenshot…", "Render animation…")
    before = {label: rig.find(label) for label in labels}
    job = JobInfo("Turntable: a.mp4", 0.4, "Frame 3 of 8, and words that are so long that they need a second line")
    rig.view_model = replace(rig.view_model, job=job)
    rig.frame(3)
    assert {label: rig.find(label) for label in labels} == before
    assert before["Render animation…"].bottom < rig.find("Cancel export").top
    assert rig.find("Cancel export").bottom < rig.size[1]
    rig.view_model = replace(rig.view_model, job=None)
    rig.frame(3)
    assert {label: rig.find(label) for label in labels} == before


def test_comparing(gl) -> None:
    with PanelRig(gl, draw_compare, scene_state(), (420, 640)) as rig:
        assert "Start again" not in rig.items.items
        choose(rig, "Show", "Wipe")
        rig.drag_slider("Line at", 0.5, 0.25)
        assert rig.state.compare.mode == "wipe" and rig.state.compare.wipe == pytest.approx(0.25, abs=0.03)
        assert rig.was_held
        choose(rig, "With", "Even random wavelengths")
        assert rig.state.compare.method == "stochastic-even"
        rig.click("Start again")
        assert rig.state.requests == (requests.ComputeReference(),)
        choose(rig, "Show", "Error map")
        assert "Scale" in rig.items.items and "Line at" not in rig.items.items
