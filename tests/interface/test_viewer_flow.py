"""Whole flows through the real viewer, by mouse and keyboard: the picture follows each, and only what must be is
redone."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.state import Brush, Selection
from spectrasplat.gpu.context import Context

from tests.interface.rig import Hands, viewer

SAME = 1e-5
"""Largest difference of two pictures that are called the same, share of the brightest value."""
CTRL = (imgui.Key.mod_ctrl,)


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference, share of the brightest value of either."""
    assert a.shape == b.shape
    return float(np.abs(a - b).max() / max(a.max(), b.max()))


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The prism in a file of the user's own."""
    path = tmp_path_factory.mktemp("scenes") / "mine.toml"
    shutil.copy(assets_dir() / "scenes" / "prism.toml", path)
    return path


@pytest.fixture(scope="module")
def shared(gl: Context, scene_file: Path) -> Iterator[Hands]:
    gl.ctx.__enter__()
    with viewer(gl, scene_file) as hands:
        hands.settle()
        yield hands


@pytest.fixture
def hands(shared: Hands) -> Hands:
    """The viewer as at its start."""
    session = shared.session
    session.show_scene(session.document.history.go_to(0))
    session.state = session.state.with_panels(brush=False)
    session.state = replace(
        session.state, tool="select", selection=Selection(), camera=session.state.scene.camera, physical=False
    )
    shared.settle()
    return shared


def select_glass(hands: Hands) -> None:
    """Click the caustic: that selects the glass, and its dispersion is shown."""
    hands.interface.click(hands.caustic_place())
    hands.interface.frame(2)
    assert hands.session.state.selection == Selection("object", hands.glass())


def test_a_click_on_the_caustic_selects_its_glass(hands: Hands) -> None:
    select_glass(hands)
    assert hands.interface.find("Dispersion gain").is_visible
    hands.interface.click(hands.caustic_place(), keys=CTRL)
    assert hands.session.state.selection == Selection("object", hands.receiver())


def test_dragging_the_dispersion_moves_the_caustic_and_traces_nothing(hands: Hands) -> None:
    before, traced = hands.settle(), hands.rays_traced
    select_glass(hands)
    hands.interface.drag_slider("Dispersion gain", 0.1, 0.4)
    gain = hands.session.state.scene.objects[hands.glass()].material.dispersion.gain
    assert 3.0 < gain < 5.0
    after = hands.settle()
    assert hands.rays_traced == traced
    assert hands.session.picture.stats.first_order
    assert difference(before, after) > 0.1
    assert [entry.label for entry in hands.session.document.history.entries][-1].startswith("Dispersion gain")
    assert len(hands.session.document.history.entries) == 2  # one step for the whole drag


@pytest.mark.slow
def test_brushing_widens_the_colours_where_it_paints(hands: Hands) -> None:
    before = hands.settle()
    hands.interface.key(imgui.Key.b)
    assert hands.session.state.tool == "brush"
    hands.session.state = replace(hands.session.state, brush=Brush(radius=0.3, strength=8.0))
    start, end = hands.caustic_place(0.5), hands.caustic_place(0.6)
    hands.interface.drag(start, end, steps=5)
    dabs = hands.session.state.scene.objects[hands.receiver()].local_dispersion
    assert dabs and all(dab.log2_gain > 0 for dab in dabs)
    painted = hands.settle()
    assert difference(before, painted) > 0.01
    hands.interface.key(imgui.Key.v)  # the physical picture, for comparison
    assert hands.session.state.physical
    # What was painted goes by photons, what was not by beams.
    assert difference(hands.settle(), before) < 0.02
    hands.interface.key(imgui.Key.v)
    assert difference(hands.settle(), painted) < SAME


@pytest.mark.slow
def test_walking_round_traces_nothing(hands: Hands) -> None:
    before, traced = hands.settle(), hands.rays_traced
    middle = hands.interface.find("Picture").centre
    hands.interface.drag(middle, (middle[0] + 60, middle[1] + 10), button=2)
    assert hands.session.state.camera != hands.session.state.scene.camera
    assert difference(before, hands.settle()) > 0.1
    assert hands.rays_traced == traced
    hands.interface.key(imgui.Key._0)
    assert difference(before, hands.settle()) < SAME


def test_the_button_that_closes_the_window_asks(hands: Hands) -> None:
    select_glass(hands)
    hands.interface.drag_slider("Dispersion gain", 0.1, 0.2)
    hands.session.quit()
    hands.interface.frame(3)
    hands.interface.click("Cancel")
    assert not hands.session.wants_to_close and not hands.session.asks_to_quit
    hands.session.quit()
    hands.interface.frame(3)
    hands.interface.click("Discard")
    assert hands.session.wants_to_close
    hands.session.wants_to_close = hands.session.asks_to_quit = False
