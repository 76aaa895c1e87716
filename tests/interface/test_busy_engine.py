"""While the renderer is busy the window answers what the processor can, at once, and says of the rest that it is still
being found: never a default in place of an answer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.state import Brush, Selection
from spectrasplat.gpu.context import Context
from spectrasplat.ui import layout
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.session import LAYOUT_FRAMES, Session
from spectrasplat.ui.viewer import Viewer, headless_viewer

from tests.interface.fake_engine import FakeEngine, dispersed

PRISM, TABLE = 0, 1
SPOT = np.array([0.9, 0.3, 0.0])
"""On the table, in view."""


class Busy:
    """A window over an engine that never has time, and where things are in its picture."""

    def __init__(self, session: Session, interface: HeadlessInterface) -> None:
        self.session, self.interface = session, interface

    @property
    def messages(self) -> str:
        return " ".join(message.text for message in self.session.messages.messages())

    def at(self, point: np.ndarray) -> tuple[float, float]:
        state = self.session.state
        view = state.view
        x, y = view.project(point)[0]
        return self.interface.find("Picture").at(float(x), float(y))

    @property
    def stone(self) -> tuple[float, float]:
        item = self.session.state.scene.objects[PRISM]
        return self.at(item.mesh.vertices.mean(axis=0) @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3])

    def answer(self, context: Context) -> None:
        """It has time after all: photons about `SPOT` through the prism, a reddish picture."""
        engine, state = self.session.picture.engine, self.session.state
        assert isinstance(engine, FakeEngine)
        engine.photons, engine.inputs, engine.is_busy = dispersed(SPOT, PRISM, TABLE), state.live_inputs, False
        red = np.tile(np.array([0.9, 0.05, 0.02, 1.0], "f4"), state.viewport_size[0] * state.viewport_size[1])
        engine.picture = context.ctx.texture(state.viewport_size, 4, red.tobytes(), dtype="f4")
        engine.advance = lambda *_times: None  # type: ignore[method-assign]
        self.interface.frame(2)


@pytest.fixture
def busy(gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Busy]:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    session = Session(gl, assets_dir() / "scenes" / "prism.toml", make_engine=FakeEngine.busy)
    session.jobs.gallery.release()
    session.state = replace(session.state, selection=Selection("light", 0), brush=Brush(radius=0.3))
    with headless_viewer(Viewer(session)) as interface:
        interface.frame(LAYOUT_FRAMES + 3)
        yield Busy(session, interface)
    session.autosave.close()
    session.release()


def test_a_click_on_a_stone_selects_it_and_one_on_nothing_clears(busy: Busy) -> None:
    busy.interface.click(busy.stone)
    assert busy.session.state.selection == Selection("object", PRISM) and not busy.session.awaited
    camera = busy.session.state.camera
    away = replace(camera, target=tuple(np.add(camera.position, (0.0, 0.3, 1.0))))
    busy.session.state = replace(busy.session.state, camera=away)
    busy.interface.frame()
    busy.interface.click(busy.interface.find("Picture").at(0.5, 0.5))
    assert busy.session.state.selection == Selection()


@pytest.mark.parametrize("changes_mind", [False, True])
def test_whose_light_lies_on_a_table_is_told_later(gl: Context, busy: Busy, changes_mind: bool) -> None:
    busy.interface.click(busy.at(SPOT))
    assert busy.session.state.selection == Selection("object", TABLE) and "still being found" in busy.messages
    if changes_mind:
        busy.session.state = replace(busy.session.state, selection=Selection("camera"))
    busy.answer(gl)
    assert busy.session.state.selection == (Selection("camera") if changes_mind else Selection("object", PRISM))
    assert not busy.session.awaited


def test_every_click_of_the_ruler_is_a_point(busy: Busy) -> None:
    busy.session.state = replace(busy.session.state, tool="measure")
    busy.interface.frame()
    places = [SPOT, SPOT + [0.5, 0.0, 0.0], SPOT + [0.0, 0.6, 0.0]]
    for place in places:
        busy.interface.click(busy.at(place))
    assert np.array(busy.session.state.measured) == pytest.approx(np.array(places), abs=0.02)


def test_the_brush_begins_where_it_is_put(busy: Busy) -> None:
    busy.session.state = replace(busy.session.state, tool="brush")
    busy.interface.frame()
    busy.interface.move(busy.at(SPOT))
    busy.interface.press()
    item = busy.session.state.scene.objects[TABLE]
    assert len(item.local_dispersion) == 1
    assert (item.object_to_world @ (*item.local_dispersion[0].position, 1.0))[:3] == pytest.approx(SPOT, abs=0.02)
    busy.interface.let_go()


def test_a_colour_that_is_pulled_meanwhile_is_pulled_as_far(gl: Context, busy: Busy) -> None:
    busy.session.state = replace(busy.session.state, tool="pull")
    busy.interface.frame()
    busy.interface.drag(busy.at(SPOT), busy.at(SPOT - [0.3, 0.0, 0.0]))
    item = busy.session.state.scene.objects[PRISM]
    assert item.material.dispersion.gain == 1.0 and "still being found" in busy.messages
    busy.answer(gl)
    busy.interface.frame()
    assert busy.session.state.scene.objects[PRISM].material.dispersion.gain > 1.1
    assert busy.session.document.history.undo_label == "Pull colour of prism"


def test_the_spectrum_of_a_table_is_still_being_found(gl: Context, busy: Busy, monkeypatch: pytest.MonkeyPatch) -> None:
    hints: list[str] = []
    layout.raise_panel("spectrum")
    monkeypatch.setattr("spectrasplat.ui.panels.spectrum.widgets.hint", hints.append)
    for place, said in ((busy.at(SPOT), "still being found"), (busy.stone, "is no receiver")):
        busy.interface.move(place)
        busy.interface.frame(2)
        hints.clear()
        busy.interface.frame()
        assert said in " ".join(hints)
    busy.answer(gl)
    busy.interface.move(busy.at(SPOT))
    for _ in range(100):  # what rests is asked for at intervals
        busy.interface.frame()
        if (cursor := busy.session.jobs.cursor.view_model) is not None and cursor.light is not None:
            break
    assert cursor is not None and cursor.light is not None and cursor.rgb is not None
