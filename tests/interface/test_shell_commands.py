"""Menu, shortcuts and dialogues: what reaches the state and what is asked of the host."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import pytest
from imgui_bundle import imgui
from spectrasplat.edit import requests
from spectrasplat.edit.state import Panels, Selection
from spectrasplat.gpu.context import Context
from spectrasplat.ui.commands import COMMANDS, PANELS, VIEWS
from spectrasplat.ui.shortcuts import chord, listed
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import scene_state
from tests.interface.shell_rig import ShellRig

CTRL, SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift


@pytest.fixture
def rig(gl: Context) -> Iterator[ShellRig]:
    with ShellRig(gl) as made:
        yield made


def test_no_two_commands_share_a_key_and_every_key_is_one() -> None:
    taken: dict[int, str] = {}
    for entry in (*COMMANDS, *PANELS, *VIEWS):
        for keys in entry.keys:
            code = chord(keys)
            assert code not in taken, f"{entry.name} and {taken.get(code)} are both {keys}"
            taken[code] = entry.name
    # Keys that fly while the right button is held, and the one that compares, are no commands.
    assert not {chord(letter) for letter in "WASDQEC"} & set(taken)


def test_every_command_says_what_it_does_and_is_listed() -> None:
    for entry in (*COMMANDS, *PANELS, *VIEWS):
        assert entry.tip.endswith((".", ")")), entry.name
    shown = {what for lines in listed().values() for _, what in lines}
    assert {entry.name for entry in COMMANDS if entry.keys} <= shown


def test_every_panel_has_a_command() -> None:
    reachable = {entry.act.keywords.get("field") or entry.act.args[0] for entry in PANELS}
    elsewhere = {"shortcuts", "start_page", "about"}
    assert {field.name for field in fields(Panels)} == reachable | elsewhere


@pytest.mark.parametrize(
    ("key", "modifiers", "expected"),
    [
        (imgui.Key.s, [CTRL], requests.Save()),
        (imgui.Key.q, [CTRL], requests.Quit()),
        (imgui.Key.z, [CTRL], requests.Undo()),
        (imgui.Key.z, [CTRL, SHIFT], requests.Redo()),
        (imgui.Key.y, [CTRL], requests.Redo()),
        (imgui.Key.f, [], requests.FrameSelection()),
        (imgui.Key.f5, [], requests.ReloadShaders()),
        (imgui.Key.r, [CTRL], requests.Retrace()),
        (imgui.Key.c, [CTRL], requests.CopyMaterial(0)),
    ],
)
def test_shortcuts_ask_the_host_once(
    rig: ShellRig, key: imgui.Key, modifiers: list[imgui.Key], expected: requests.Request
) -> None:
    rig.view_model = replace(rig.view_model, path=Path("prism.toml"), undo="Move prism", redo="Move prism")
    rig.key(key, modifiers)
    assert rig.asked == [expected]


def test_letters_do_nothing_while_text_is_typed_or_the_right_button_flies(rig: ShellRig) -> None:
    rig.open_panel(shortcuts=True)
    rig.click("Search shortcuts")
    rig.key(imgui.Key.b)
    rig.key(imgui.Key.space)
    assert rig.state.tool == "select" and rig.state.playing
    rig.click((600.0, 690.0))
    rig.open_panel(shortcuts=False)
    rig.move((600.0, 250.0))
    rig.press(1)
    rig.key(imgui.Key.b)
    rig.let_go(1)
    assert rig.state.tool == "select"
    rig.key(imgui.Key.b)
    assert rig.state.tool == "brush"


def test_numbered_views_are_stored_and_come_back(rig: ShellRig) -> None:
    rig.key(imgui.Key._3, [CTRL])
    kept = rig.state.camera
    rig.state = replace(rig.state, camera=replace(kept, vertical_fov_deg=70.0))
    rig.key(imgui.Key._3)
    assert rig.state.camera == kept
    before = rig.state
    rig.key(imgui.Key._4)
    assert rig.state.camera == before.camera


def test_compare_is_held_only_while_its_key_is_down(rig: ShellRig) -> None:
    with rig.held([imgui.Key.c]):
        rig.frame()
        assert rig.state.compare.holding
    rig.frame()
    assert not rig.state.compare.holding


def test_hiding_panels_brings_the_same_ones_back(rig: ShellRig) -> None:
    rig.open_panel(history=True, timing=False)
    before = rig.state.preferences.panels
    rig.key(imgui.Key.h)
    hidden = rig.state.preferences.panels
    assert not any(getattr(hidden, field.name) for field in fields(Panels))
    rig.key(imgui.Key.h)
    assert rig.state.preferences.panels == before


def test_menu_undo_is_named_and_off_without_history(rig: ShellRig) -> None:
    rig.menu("Edit", "Undo")
    assert rig.asked == []
    rig.key(imgui.Key.escape)
    rig.view_model = replace(rig.view_model, undo="Move prism")
    rig.menu("Edit", "Undo")
    assert rig.asked == [requests.Undo()]


def test_theme_and_layout_from_the_menu(rig: ShellRig) -> None:
    before = rig.screenshot()
    rig.menu("View", "Light theme")
    assert rig.state.preferences.theme == "light"
    assert rig.screenshot().mean() > before.mean() + 40
    rig.open_panel(outliner=False, export=True)
    rig.menu("View", "Reset layout")
    rig.frame(4)
    assert rig.state.preferences.panels == Panels()


def test_delete_removes_the_selection_and_refuses_the_last_receiver(gl: Context) -> None:
    with ShellRig(gl, scene_state("default")) as rig:
        count = len(rig.state.scene.objects)
        rig.key(imgui.Key.d, [CTRL])
        assert len(rig.state.scene.objects) == count + 1
        assert rig.state.selection == Selection("object", count)
        rig.key(imgui.Key.delete)
        assert len(rig.state.scene.objects) == count
        assert rig.state.edit_label.startswith("Delete ")
        assert rig.state.selection == Selection()


def test_unsaved_work_is_asked_about_before_another_scene(rig: ShellRig) -> None:
    rig.view_model = replace(rig.view_model, unsaved=True, path=Path("prism.toml"))
    rig.key(imgui.Key.n, [CTRL])
    assert rig.asked == []
    rig.click("Cancel")
    assert rig.asked == []
    rig.key(imgui.Key.n, [CTRL])
    rig.click("Discard")
    assert rig.asked == [requests.NewScene()]
    rig.asked.clear()
    rig.key(imgui.Key.n, [CTRL])
    rig.move("Save")
    rig.press()
    rig.let_go()
    assert rig.asked == [requests.Save()]
    rig.view_model = replace(rig.view_model, unsaved=False)
    rig.frame(2)
    assert rig.asked == [requests.Save(), requests.NewScene()]


def test_a_failed_save_opens_nothing(rig: ShellRig) -> None:
    rig.view_model = replace(rig.view_model, unsaved=True, path=Path("prism.toml"))
    rig.key(imgui.Key.n, [CTRL])
    rig.click("Save")
    rig.frame(4)
    assert rig.asked == [requests.Save()]


def test_quit_question_answers(rig: ShellRig) -> None:
    rig.view_model = replace(rig.view_model, unsaved=True, asks_to_quit=True, path=Path("prism.toml"))
    rig.frame(3)
    rig.click("Discard")
    assert rig.asked[0] == requests.Quit(discard=True)
    rig.asked.clear()
    rig.view_model = replace(rig.view_model, asks_to_quit=False)
    rig.frame(3)
    rig.view_model = replace(rig.view_model, asks_to_quit=True)
    rig.frame(3)
    rig.move("Save")
    rig.press()
    rig.let_go()
    assert rig.asked[:2] == [requests.CancelQuit(), requests.Save()]
    rig.view_model = replace(rig.view_model, asks_to_quit=False, unsaved=False)
    rig.frame(2)
    assert rig.asked[-1] == requests.Quit()


def test_file_browser_opens_and_saves(rig: ShellRig, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("x")
    (tmp_path / "ignored.txt").write_text("x")
    (tmp_path / "folder").mkdir()
    rig.view_model = replace(rig.view_model, recent=(tmp_path / "mine.toml",))
    rig.key(imgui.Key.o, [CTRL])
    rig.frame(2)
    assert "ignored.txt" not in rig.items.items and "folder" in rig.items.items
    rig.click("mine.toml", count=2)
    rig.frame(2)
    assert rig.asked == [requests.Open(tmp_path / "mine.toml")]
    rig.asked.clear()
    rig.key(imgui.Key.s, [CTRL])  # never saved: asks where
    rig.frame(3)
    rig.key(imgui.Key.a, [CTRL])
    rig.type("mine")
    rig.key(imgui.Key.enter)
    rig.frame(2)
    assert rig.asked == []  # it exists: asked first
    rig.click("Replace")
    rig.frame(2)
    assert rig.asked == [requests.Save(tmp_path / "mine.toml")]


def test_recent_files_of_one_name_are_told_apart_by_their_folders() -> None:
    recent = Path("/a/first/prism.toml"), Path("/a/second/prism.toml"), Path("/a/second/ball.toml")
    names = [ViewModel(recent=recent).called(path) for path in recent]
    assert names == ["prism.toml (first)", "prism.toml (second)", "ball.toml"]


def test_a_folder_that_cannot_be_read_is_said(rig: ShellRig, tmp_path: Path) -> None:
    rig.view_model = replace(rig.view_model, recent=(tmp_path / "gone" / "mine.toml",))
    rig.key(imgui.Key.o, [CTRL])
    rig.frame(2)
    assert "Cancel" in rig.items.items
    rig.key(imgui.Key.escape)
    rig.frame(2)
    assert "Folder" not in rig.items.items
