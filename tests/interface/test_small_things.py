"""Keys that always work, panels that Esc closes, what is remembered at once, folders that are the user's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image
from spectrasplat.base.image_io import write_image
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import requests
from spectrasplat.edit.preferences import load_settings
from spectrasplat.gpu.context import Context
from spectrasplat.ui import layout
from spectrasplat.ui.commands import command
from spectrasplat.ui.panels import dialogs
from spectrasplat.ui.session import Session
from spectrasplat.ui.view_model import ViewModel

from tests.interface.fake_engine import FakeEngine
from tests.interface.shell_rig import ShellRig


def test_escape_closes_the_floating_panel_that_has_the_keyboard_and_no_other(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.open_panel(abbe=True, shortcuts=True)
    rig.click(rig.find("Window: Shortcuts").at(0.5, 0.5))
    rig.frame(2)
    rig.key(imgui.Key.escape)
    rig.frame(2)
    panels = rig.state.preferences.panels
    assert not panels.shortcuts and panels.abbe and panels.inspector


def test_escape_closes_a_docked_panel_that_was_called_up_and_leaves_those_of_the_first_layout(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.open_panel(abbe=False, dispersion=True)
    rig.show_tab("Dispersion")
    rig.click("Dispersion/Abbe diagram")
    rig.frame(4)
    assert rig.state.preferences.panels.abbe
    rig.key(imgui.Key.escape)
    rig.frame(2)
    assert not rig.state.preferences.panels.abbe
    rig.click(rig.find("Window: Outliner").at(0.5, 0.9))
    rig.key(imgui.Key.escape)
    rig.frame(2)
    assert rig.state.preferences.panels.outliner and rig.state.preferences.panels.dispersion


def test_help_and_quit_work_while_a_text_is_typed(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.open_panel(abbe=False, dispersion=True)
    rig.show_tab("Inspector")
    rig.click("Name")
    rig.frame(2)
    assert imgui.get_io().want_text_input
    rig.key(imgui.Key.f1)
    rig.frame(2)
    assert rig.state.preferences.panels.shortcuts
    rig.click("Name")
    rig.frame(2)
    rig.key(imgui.Key.q, [imgui.Key.mod_ctrl])
    rig.frame(2)
    assert requests.Quit() in rig.asked


def test_the_recovery_says_whose_and_when(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.view_model = replace(
        rig.view_model, recovery=Path("a.toml"), recovery_title="vase.toml", recovery_time="22 November 2026, 14:05"
    )
    rig.open_panel(start_page=True)
    assert rig.find("Recover")


def test_what_is_remembered_is_written_at_once(gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    session = Session(gl, make_engine=FakeEngine)
    session.settings = session.settings.opened(tmp_path / "own.toml")
    session.state = replace(session.state, interacting=True)
    session.finished()
    assert load_settings()[0].recent == ()
    session.state = replace(session.state, interacting=False)
    session.finished()
    assert load_settings()[0].recent == (tmp_path / "own.toml",)
    session.autosave.close()
    session.release()


def test_saving_never_begins_in_the_programs_own_folder(tmp_path: Path) -> None:
    shipped, own = assets_dir() / "scenes" / "prism.toml", tmp_path / "own.toml"
    assert dialogs._recent_folder(ViewModel(recent=(shipped,))) == Path.home()
    assert dialogs._recent_folder(ViewModel(recent=(shipped, own))) == tmp_path


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".webp"])
def test_smaller_pictures_look_like_the_png(tmp_path: Path, suffix: str) -> None:
    x = np.linspace(0.05, 0.9, 64, dtype=np.float32)
    rgb = np.stack(np.broadcast_arrays(x[:, None], x[None], np.float32(0.3)), axis=-1)
    for name in ("a.png", f"a{suffix}"):
        write_image(tmp_path / name, rgb)
    png, other = (np.asarray(Image.open(tmp_path / name).convert("RGB"), float) for name in ("a.png", f"a{suffix}"))
    assert np.abs(png - other).mean() < 2.0


def test_opening_compare_begins_to_compare_and_closing_it_ends_it(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.state = command("Panel: Compare").act(rig.state, rig.view_model)
    rig.frame(3)
    assert rig.state.preferences.panels.compare and rig.state.compare.mode == "wipe"
    rig.state = replace(rig.state, compare=replace(rig.state.compare, mode="beside"))
    rig.key(imgui.Key.h)  # panels out of the way: the pictures stay
    assert rig.state.compare.mode == "beside"
    rig.key(imgui.Key.h)
    rig.frame(3)
    rig.show_tab("Compare")
    rig.key(imgui.Key.escape)
    rig.frame(2)
    assert not rig.state.preferences.panels.compare
    assert rig.state.compare.mode == "off"
    rig.release()


def test_the_escape_that_closes_a_list_leaves_the_panel_it_hangs_from(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.state = command("Panel: Compare").act(rig.state, rig.view_model)
    rig.frame(3)
    rig.frame(3)
    rig.click("Show")
    rig.frame(2)
    assert imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
    rig.key(imgui.Key.escape)
    rig.frame(2)
    assert not imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
    assert rig.state.preferences.panels.compare
    rig.release()


def test_a_panel_behind_a_tab_is_brought_to_the_front_and_not_closed(gl: Context) -> None:
    rig = ShellRig(gl)
    rig.show_tab("Timing")
    toggle = command("Panel: Spectrum").act
    rig.state = toggle(rig.state, rig.view_model)
    rig.frame(3)
    assert rig.state.preferences.panels.spectrum and "spectrum" not in layout.behind and "timing" in layout.behind
    rig.state = toggle(rig.state, rig.view_model)
    rig.frame(2)
    assert not rig.state.preferences.panels.spectrum
    rig.release()
