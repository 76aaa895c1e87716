"""Keys and menus from anywhere, panels that Esc closes, typed names, what is remembered, importing, films, guesses that
are said to be guesses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import save_codes, write_image
from spectrasplat.base.movie import open_sink
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import requests
from spectrasplat.edit.opening import import_objects
from spectrasplat.edit.preferences import load_settings
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics import catalogue
from spectrasplat.ui import layout
from spectrasplat.ui.commands import command
from spectrasplat.ui.panels import file_browser
from spectrasplat.ui.session import Session

from tests.interface.fake_engine import FakeEngine
from tests.interface.shell_rig import ShellRig


@pytest.mark.parametrize("clicked", ["Shortcuts", "Outliner"])
def test_escape_closes_a_floating_panel_whoever_has_the_keyboard_and_no_other(gl: Context, clicked: str) -> None:
    with ShellRig(gl) as rig:
        rig.open_panel(abbe=clicked == "Shortcuts", shortcuts=True)
        rig.click(rig.find(f"Window: {clicked}").at(0.5, 0.5))
        rig.frame(2)
        rig.key(imgui.Key.escape)
        rig.frame(2)
        panels = rig.state.preferences.panels
        assert not panels.shortcuts and panels.outliner and panels.inspector and panels.abbe == (clicked == "Shortcuts")


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
    rig.state = replace(rig.state, compare=replace(rig.state.compare, mode="error"))
    rig.key(imgui.Key.h)  # panels out of the way: the pictures stay
    assert rig.state.compare.mode == "error"
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


SCENES = assets_dir() / "scenes"
CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 90) for y in (0, 90) for z in (0, 90)]
    + ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
)


def test_help_is_seen_on_the_start_page_and_quit_works_in_a_menu(gl: Context) -> None:
    with ShellRig(gl) as rig:
        rig.open_panel(start_page=True)
        rig.key(imgui.Key.f1)
        rig.frame(3)
        assert rig.find("Search shortcuts")
        rig.key(imgui.Key.escape)  # the list first, the page it lies on with the next one
        rig.frame(3)
        assert rig.state.preferences.panels.start_page and not rig.state.preferences.panels.shortcuts
        rig.open_panel(start_page=False, shortcuts=False)
        rig.click("Menu: View")
        rig.frame(2)
        rig.key(imgui.Key.q, [imgui.Key.mod_ctrl])
        assert requests.Quit() in rig.asked


def test_open_takes_a_typed_name_and_a_whole_path(gl: Context, tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    path = tmp_path / "own" / "vase.toml"
    path.write_bytes((SCENES / "prism.toml").read_bytes())
    with ShellRig(gl) as rig:
        rig.view_model = replace(rig.view_model, path=path)
        for typed in ("vase.toml", str(path)):
            rig.asked.clear()
            rig.menu("File", "Open…")
            rig.frame(3)
            rig.click("File name")
            rig.type(typed)
            rig.key(imgui.Key.enter)
            rig.frame(3)
            assert rig.asked == [requests.Open(path)]
        rig.menu("File", "Open…")
        rig.frame(3)
        rig.click("File name")
        rig.type("vsae.toml")
        rig.key(imgui.Key.enter)
        rig.frame(3)
        assert "did you mean 'vase.toml'?" in file_browser._browser.error
        rig.asked.clear()
        rig.click("File name")
        rig.key(imgui.Key.a, [imgui.Key.mod_ctrl])
        rig.type("lens")
        rig.key(imgui.Key.enter)
        rig.frame(3)
        assert rig.asked == [requests.Open(SCENES / "lens.toml")]  # a shipped one is found from anywhere
    file_browser.close()


def test_a_mesh_joins_the_scene_beside_the_others(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    scene = load_scene(SCENES / "prism.toml")
    once = import_objects(scene, tmp_path / "cube.obj")
    assert [item.name for item in once.objects] == ["prism", "table", "cube"]
    assert once.lights == scene.lights and once.camera == scene.camera
    low, high = once.objects[2].world_bounds
    assert 0.2 < np.max(high - low) < 3.0  # a cube of ninety units is millimetres
    other_low, other_high = scene.objects[0].world_bounds
    assert (low >= other_high - 1e-6).any() or (high <= other_low + 1e-6).any()
    twice = import_objects(once, SCENES / "lens.toml")
    assert [item.name for item in twice.objects[3:]] == ["lens", "table 2"]


def test_import_is_undone_by_its_name(gl: Context, tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    with ShellRig(gl) as rig:
        rig.view_model = replace(rig.view_model, path=tmp_path / "scene.toml")
        rig.menu("File", "Import…")
        rig.frame(3)
        rig.click("File name")
        rig.type("cube.obj")
        rig.key(imgui.Key.enter)
        rig.frame(3)
        assert rig.state.edit_label == "Import cube.obj" and rig.state.selection.index == 2


def test_the_start_page_is_shown_at_the_first_launch_only(
    gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    for expected in (True, False):
        session = Session(gl, make_engine=FakeEngine)
        session.welcome()
        assert session.state.preferences.panels.start_page is expected
        session.state = session.state.with_panels(start_page=False)
        session.close()
    assert not load_settings()[0].is_new


@pytest.mark.parametrize(
    ("suffix", "fps", "shown_ms", "tolerance"),
    [(".gif", 24.0, 40, 10), (".gif", 200.0, 20, 0), (".WebP", 24.0, 42, 1), (".webp", 200.0, 11, 0)],
)
def test_films_of_pictures_play_for_ever_at_their_pace_and_in_their_colours(
    tmp_path: Path, suffix: str, fps: float, shown_ms: int, tolerance: int
) -> None:
    path = tmp_path / f"a{suffix}"
    sink = open_sink(path, (33, 15), fps, {})
    for level in (0, 80, 160):
        codes = np.full((15, 33, 3), level, np.uint8)
        codes[:, :16, 0] = 200
        sink.write(level, codes)
    assert not path.exists() and not sink.has(0)
    sink.close()
    with Image.open(path) as image:
        assert image.n_frames == 3 and image.size == (33, 15) and image.info["loop"] == 0
        for index, level in enumerate((0, 80, 160)):
            image.seek(index)
            frame = np.asarray(image.convert("RGB")).astype(int)
            assert abs(image.info["duration"] - shown_ms) <= tolerance
            assert abs(frame[:, :14] - [200, level, level]).max() <= 6 and abs(frame[:, 20:] - level).max() <= 6
    open_sink(tmp_path / "none.webp", (8, 8), 24.0, {}).close()
    assert not (tmp_path / "none.webp").exists()  # without a frame nothing appears


def test_a_webp_larger_than_the_format_allows_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="at most 16383 pixels a side, not 20000×10; choose a smaller size or another"):
        open_sink(tmp_path / "a.webp", (20000, 10), 24.0, {})
    with pytest.raises(UserError, match="at most 16383 pixels"):
        save_codes(tmp_path / "still.webp", np.zeros((1, 20000, 3), np.uint8))


def test_a_guessed_glass_is_said_to_be_a_guess(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["glass", "diamant"]) == 0
    assert capsys.readouterr().out.startswith("Nothing in the catalogue is called 'diamant'.")
    assert main(["glass", "N-BK7"]) == 0
    assert "Nothing" not in capsys.readouterr().out and catalogue.is_guess("NBK77") and not catalogue.is_guess("bk7")
