"""A real window: on a virtual X server where there is no other, from the command line as a user would; and what is said
where there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from spectrasplat.__main__ import main

ROOT = Path(__file__).resolve().parents[2]


def run(folder: Path, display: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Python with `arguments` on a display, or without any."""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment |= {"PYTHONPATH": str(ROOT), "SPECTRASPLAT_CONFIG": str(folder / "config")}
    if display:
        environment["DISPLAY"] = display
    command = [sys.executable, "-P", *arguments]
    return subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.core
@pytest.mark.parametrize("theme", ["dark", pytest.param("light", marks=pytest.mark.slow)])
def test_the_window_shows_interface_and_caustic(tmp_path: Path, display: str, theme: str) -> None:
    options = f"view prism --size 1000x700 --theme {theme} --screenshot window.png --after 5"
    done = run(tmp_path, display, "-m", "spectrasplat", *options.split())
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(tmp_path / "window.png")
    picture = np.asarray(Image.open(tmp_path / "window.png").convert("RGB")).astype(int)
    assert picture.shape == (700, 1000, 3)
    # The panels on the left have the theme's neutral grey …
    left = picture[300:600, 20:120]
    grey = np.median(left)
    assert (grey < 60) if theme == "dark" else (grey > 180)
    # … and the picture holds the colours of the spectrum.
    spread = picture.max(axis=2) - picture.min(axis=2)
    strong = picture[spread > 90]
    assert len(strong) > 1000
    for channel in range(3):
        assert (strong.argmax(axis=1) == channel).mean() > 0.03
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config", "window.png"]  # no imgui.ini


def test_without_a_display_one_sentence_names_the_way_out(tmp_path: Path) -> None:
    done = run(tmp_path, "", "-m", "spectrasplat", "view")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "spectrasplat render" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("nosuch", "scene 'nosuch' is neither a file nor shipped"),
        ("--theme blue", "--theme 'blue' is unknown"),
        ("--size 10", "--size '10' is not WIDTHxHEIGHT"),
        ("--after 3", "--after says when the --screenshot is taken"),
        ("--screenshot x.jpg", "must end in .png"),
    ],
)
def test_wrong_options_are_told_before_a_window_is_opened(
    arguments: str, told: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    assert main(["view", *arguments.split()]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


LETTER_OUTLIVES_CTRL = """
import ctypes, glfw
from imgui_bundle import imgui
from spectrasplat.ui.window import Window

with Window() as window:
    window._host.make_current()
    exchange = ctypes.CFUNCTYPE(*[ctypes.c_void_p] * 3)(("glfwSetKeyCallback", glfw._glfw))
    handle = ctypes.cast(window._handle, ctypes.c_void_p).value
    installed = exchange(handle, None)  # imgui's, which calls the window's own before
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *[ctypes.c_int] * 4)(installed)
    seen = []
    def frame():
        imgui.backends.glfw_new_frame()
        with window._host.frame():
            if imgui.is_key_pressed(imgui.Key.r, False):
                seen.append(imgui.get_io().key_ctrl)
    io = imgui.get_io()
    io.add_key_event(imgui.Key.mod_ctrl, True)
    frame()
    io.add_key_event(imgui.Key.r, True)
    call(handle, glfw.KEY_LEFT_CONTROL, 37, glfw.RELEASE, 0)
    io.add_key_event(imgui.Key.mod_ctrl, False)
    for _ in range(4):
        frame()
    print("letter", seen)
"""


INPUT_IS_SEEN_WHILE_A_FRAME_IS_DRAWN = """
import glfw
from imgui_bundle import imgui
from spectrasplat.ui.viewer import Viewer
from spectrasplat.ui.session import Session
from spectrasplat.ui.window import Window

with Window() as window:
    session = Session(window.context)
    session.input_waits = window.input_waits
    viewer, seen = Viewer(session), []
    for _ in range(10):
        window.frame(viewer)
    while window.input_waits():  # what the window itself has been told
        window.frame(viewer)
    def draw(state, _model):
        before = window.input_waits()
        glfw.set_window_size(window._handle, 700, 500)
        glfw.wait_events_timeout(2.0)
        seen.append((before, window.input_waits()))
        return state
    viewer._draw = draw
    window.frame(viewer)
    print("input", seen)
"""


A_PICTURE_IS_DROPPED = """
import ctypes
import glfw
from spectrasplat.ui.session import Session
from spectrasplat.ui.viewer import Viewer
from spectrasplat.ui.window import Window

with Window() as window:
    session = Session(window.context)
    session.state = session.state.with_panels(compare=True)
    viewer = Viewer(session, lambda state, _model: state)
    window.frame(viewer)
    exchange = ctypes.CFUNCTYPE(*[ctypes.c_void_p] * 3)(("glfwSetDropCallback", glfw._glfw))
    handle = ctypes.cast(window._handle, ctypes.c_void_p).value
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))
    drop = kind(exchange(handle, None))
    drop(handle, 2, (ctypes.c_char_p * 2)("größer.exr".encode(), b"second.exr"))
    window._take_events(viewer)
    window.frame(viewer)
    compare = session.state.compare
    print("drop", [compare.mode, compare.method, str(compare.file)], len(session.state.requests))
"""


A_PATH_IS_TYPED_IN_ONE_FRAME = """
import ctypes, glfw, shutil
from pathlib import Path
from spectrasplat.base.paths import assets_dir
from spectrasplat.ui.panels import dialogs
from spectrasplat.ui.session import Session
from spectrasplat.ui.shell import draw_interface
from spectrasplat.ui.viewer import Viewer
from spectrasplat.ui.window import Window
from tests.interface.fake_engine import FakeEngine

with Window() as window:
    session = Session(window.context, make_engine=FakeEngine)
    opens = []
    def draw(state, model):
        state = draw_interface(state, model)
        return dialogs.open_file(state, model) if opens and opens.pop() else state
    viewer = Viewer(session, draw)
    handle = ctypes.cast(window._handle, ctypes.c_void_p).value
    def installed(name, numbers):
        exchange = ctypes.CFUNCTYPE(*[ctypes.c_void_p] * 3)((name, glfw._glfw))
        call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *[ctypes.c_int] * numbers)(exchange(handle, None))
        return lambda *event: call(handle, *event)
    key, character = installed("glfwSetKeyCallback", 4), installed("glfwSetCharCallback", 1)
    button = installed("glfwSetMouseButtonCallback", 3)
    def stroke(code, modifiers=0, text=""):
        key(code, 0, glfw.PRESS, modifiers)
        for letter in text:
            character(ord(letter))
        key(code, 0, glfw.RELEASE, modifiers)
    path = Path("Grass__lens.toml").absolute()
    shutil.copy(assets_dir() / "scenes" / "prism.toml", path)
    for _ in range(10):
        window.frame(viewer)
    for action in (glfw.PRESS, glfw.RELEASE):
        button(0, action, 0)
    opens.append(True)  # what the click does
    for letter in str(path):
        shifted = letter.isupper() or letter == "_"
        if shifted:
            key(glfw.KEY_LEFT_SHIFT, 0, glfw.PRESS, 0)
        stroke(ord(letter.upper()) if letter.isascii() else 32, glfw.MOD_SHIFT * shifted, letter)
        if shifted:
            key(glfw.KEY_LEFT_SHIFT, 0, glfw.RELEASE, 0)
    stroke(glfw.KEY_ENTER)
    for frames in range(1, 40):
        window.frame(viewer)
        if session.document.source == path:
            break
    print("path", session.document.source == path, frames <= 9, frames)
"""


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("letter", "[True]"),
        ("input", "[(False, True)]"),
        ("drop", "['wipe', 'file', 'größer.exr'] 0"),
        ("path", "True True"),
    ],
)
def test_what_a_window_hears_of(heard: dict[str, str], what: str, told: str) -> None:
    """Ctrl stays down for the letter of a long frame; a long frame knows of input; a picture that is dropped while
    comparing is compared with; a click on Open, a whole path and Enter, all while one long frame is drawn, take few."""
    assert what in heard, heard["errors"]
    assert heard[what].startswith(told)


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory, display: str) -> dict[str, str]:
    """What one process says of a window after the other, each by what glfw itself calls."""
    scripts = LETTER_OUTLIVES_CTRL, INPUT_IS_SEEN_WHILE_A_FRAME_IS_DRAWN, A_PICTURE_IS_DROPPED
    done = run(tmp_path_factory.mktemp("window"), display, "-c", "".join((*scripts, A_PATH_IS_TYPED_IN_ONE_FRAME)))
    return {"errors": done.stderr} | dict(line.split(" ", 1) for line in done.stdout.splitlines())
