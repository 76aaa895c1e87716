"""Random work on the real viewer for a long time: no exception, no OpenGL error, memory stays flat, undo leads back to
the first picture."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.preferences import config_dir
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui import layout
from spectrasplat.ui.crash_log import FILE_NAME

from tests.interface.rig import Hands, viewer
from tests.interface.soak import DATA, Guard, RandomHand, device_objects, resident_bytes

WARM = 0.4
"""Share of the actions after which every panel was open and every cache is full."""
LONG = 1000
"""Actions from which on memory must stand still; before, libraries are still being loaded."""
GROWTH_BYTES = 96 << 20
MORE_OBJECTS = 30
"""Of textures, buffers and the like at the end over those at the start: an overlay or a magnifier may have been used
since."""
SAME = 1e-5
BLURRED = 0.04


def soak(gl: Context, folder: Path, actions: int, seed: int) -> None:
    """`actions` random actions, and back to the start."""
    guard = Guard(folder)
    with viewer(
        gl, assets_dir() / "scenes" / "prism.toml", photons=1 << 12, size=(1100, 800), draw=guard.draw
    ) as hands:
        first = hands.settle()
        start, objects = hands.session.state, device_objects(DATA)
        hands.pace.frame_s = 0.006  # the picture may lag behind; the hand does not wait for it
        hand = RandomHand(hands, seed)
        resident = 0
        for number in range(actions):
            hand.act()
            crash = config_dir() / FILE_NAME
            assert not crash.exists(), f"action {number}: {hand.log[-20:]}\n{crash.read_text()}"
            gl.check(f"action {number}: {hand.log[-1]}")
            if number == int(WARM * actions):
                resident = resident_bytes()
        # It did work: scenes were edited, and the host was asked for things.
        least = min(5, actions // 30), min(3, actions // 25)
        assert guard.answered > least[0] and len(guard.labels) >= least[1], (guard.answered, guard.labels)
        grown = resident_bytes() - resident
        back = undo_everything(hands, start)
        assert hands.session.state.scene is start.scene
        assert hands.session.state.viewport_size == start.viewport_size
        # Maps stay as they were laid out for a view on the way as long as others would not be much finer (refit.PAYS):
        # then a caustic's edges are blurred otherwise. All else is the same.
        difference = np.abs(back - first)
        assert float(np.median(difference)) < SAME * float(first.max())
        assert float(difference.mean()) < BLURRED * float(first.mean())
        assert float(back.sum()) == pytest.approx(float(first.sum()), rel=0.1 * BLURRED)
        assert device_objects(DATA) <= objects + MORE_OBJECTS
        assert actions < LONG or grown < GROWTH_BYTES, f"{grown >> 20} MiB more after {actions} actions"


def undo_everything(hands: Hands, start: State) -> np.ndarray:
    """Undo to the start of the history; what undo does not cover (camera, display, panels) is set back."""
    hands.interface.key(hands.escape)
    hands.interface.key(hands.escape)
    session = hands.session
    while session.document.history.undo_label is not None:
        session.show_scene(session.document.history.undo())
        hands.interface.frame()
    session.state = replace(start, scene=session.state.scene)
    layout.reset()  # windows may have been dragged anywhere
    hands.interface.frame(4)
    return hands.settle()


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Everything that is written goes here."""
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_2000_random_actions(gl: Context, own_folder: Path) -> None:
    soak(gl, own_folder, 2000, seed=2)


@pytest.mark.skipif("SPECTRASPLAT_SOAK" not in os.environ, reason="./test --soak chooses seed and length")
def test_what_the_soak_asks_for(gl: Context, own_folder: Path) -> None:
    seed, actions = map(int, os.environ["SPECTRASPLAT_SOAK"].split(":"))
    soak(gl, own_folder, actions, seed)


@pytest.mark.slow
def test_a_closed_viewer_leaves_nothing_on_the_device(gl: Context, own_folder: Path) -> None:
    left = []
    for _ in range(2):  # programs are kept for the next viewer: only the first may leave some
        with viewer(gl, assets_dir() / "scenes" / "prism.toml", photons=1 << 12) as hands:
            hands.settle()
            inside = device_objects()
        left.append(device_objects())
        assert inside > left[-1]
    assert left[0] == left[1]
