"""The host of the interface, with panels that are scripted functions and an engine that draws one colour."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit import requests
from spectrasplat.edit.picking import pick_in
from spectrasplat.edit.preferences import config_dir
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Camera, Dielectric
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.ui.crash_log import FILE_NAME
from spectrasplat.ui.frame import run_frame
from spectrasplat.ui.panels import numbers
from spectrasplat.ui.panels.timing import counts_of
from spectrasplat.ui.session import LAYOUT_FRAMES, Session
from spectrasplat.ui.view_model import ViewModel

from tests.interface.fake_engine import FakeEngine, dispersed
from tests.interface.soak import resident_bytes

Edit = Callable[[State], State]
ON_TABLE = 0.25, 0.75


@dataclass
class Rig:
    """A session whose panels do what the test says."""

    session: Session
    view_model: ViewModel = ViewModel()

    def frame(self, edit: Edit = lambda state: state) -> State:
        """One frame in which the panels return `edit(state)`; returns the state after it."""

        def draw(state: State, view_model: ViewModel) -> State:
            self.view_model = view_model
            return edit(replace(state, viewport_size=(64, 36)))

        self.session.prepare()
        run_frame(self.session, draw)
        self.session.finished()
        return self.session.state

    def settle(self) -> None:
        """Frames until the layout is done and the engine works."""
        for _ in range(LAYOUT_FRAMES + 1):
            self.frame()

    def ask(self, *asked: requests.Request) -> State:
        """A frame with requests and one more, whose view model tells what came of them."""
        self.frame(lambda state: state.asking(*asked))
        return self.frame()

    def rename(self, name: str, label: str = "Rename", interacting: bool = False) -> State:
        """A frame that edits the scene."""
        return self.frame(
            lambda state: replace(state.edited(replace(state.scene, name=name), label), interacting=interacting)
        )

    @property
    def engine(self) -> FakeEngine:
        engine = self.session.picture.engine
        assert isinstance(engine, FakeEngine)
        return engine


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A config folder of the test's own."""
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    return config_dir()


@pytest.fixture
def rig(gl: Context, config: Path) -> Iterator[Rig]:
    rig = Rig(Session(gl, make_engine=FakeEngine))
    rig.settle()
    yield rig
    rig.session.autosave.close()
    rig.session.release()


def test_the_picture_of_a_frame_answers_its_input(rig: Rig) -> None:
    rig.frame(lambda state: replace(state, camera=Camera((0, 0, 7.0), (0, 0, 0))))
    assert rig.engine.inputs is not None and rig.engine.inputs.camera.position == (0, 0, 7.0)
    assert rig.session.picture.pixel((0.5, 0.5)) == pytest.approx((0.7, 0.7, 0.7))
    rig.frame()
    assert rig.view_model.picture is not None
    assert set(rig.view_model.pass_ms) >= {"trace", "splats", "camera", "display", "interface"}


def test_shown_texture_stays_valid_in_the_frame_in_which_the_size_changes(rig: Rig) -> None:
    rig.frame()
    before = rig.session.picture.shown
    rig.session.prepare()
    run_frame(rig.session, lambda state, _view_model: replace(state, viewport_size=(128, 72)))
    assert rig.session.picture.shown is before  # imgui has yet to draw it
    rig.session.prepare()
    resized = rig.session.picture.shown
    assert resized is not None and resized.size == (128, 72)
    drawn: list[int | None] = []
    run_frame(
        rig.session,
        lambda state, view_model: drawn.append(view_model.picture) or replace(state, viewport_size=(128, 72)),
    )
    assert rig.session.picture.shown is resized and drawn == [resized.glo]


def test_the_engine_waits_for_the_layout_behind_the_start_page(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the first scene's long first frames show tabs that have no widths yet."""
    calls: list[int] = []
    advance = rig.session.picture.advance
    monkeypatch.setattr(rig.session.picture, "advance", lambda *a: (calls.append(1), advance(*a))[1])
    rig.settle()
    assert calls
    rig.frame(lambda state: state.with_panels(start_page=True))
    calls.clear()
    rig.frame()
    rig.frame(lambda state: state.with_panels(start_page=False))
    for _ in range(2 * LAYOUT_FRAMES - 1):
        rig.frame()
    assert not calls
    rig.frame()
    assert calls


def test_undo_of_a_deletion_keeps_the_selection_in_range(rig: Rig) -> None:
    scene = rig.session.state.scene
    last = len(scene.objects) - 1
    rig.frame(lambda state: replace(state, selection=Selection("object", last)))
    rig.frame(lambda state: state.edited(replace(scene, objects=(*scene.objects, scene.objects[0])), "Add"))
    rig.frame(lambda state: replace(state, selection=Selection("object", last + 1)))
    assert rig.ask(requests.Undo()).selection == Selection()


def test_what_cannot_be_opened_or_saved_is_told_and_changes_nothing(rig: Rig, tmp_path: Path) -> None:
    before = rig.rename("kept").scene
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ")
    rig.ask(requests.Open(broken), requests.Save(), requests.Save(tmp_path / "none" / "x.toml"))
    texts = [message.text for message in rig.view_model.messages if message.is_error]
    assert len(texts) == 3
    assert "broken.toml" in texts[0] and "no file yet" in texts[1] and "none" in texts[2]
    assert rig.session.state.scene is before and rig.view_model.unsaved
    rig.ask(requests.DismissMessage(texts[0]))
    assert texts[0] not in [message.text for message in rig.view_model.messages]


def test_quitting_asks_only_where_work_would_be_lost(rig: Rig) -> None:
    rig.rename("unsaved")
    rig.session.quit()
    rig.frame()
    assert rig.view_model.asks_to_quit and not rig.session.wants_to_close
    rig.ask(requests.CancelQuit())
    assert not rig.view_model.asks_to_quit
    rig.ask(requests.Quit())
    rig.ask(requests.Quit(discard=True))
    assert rig.session.wants_to_close


def test_a_bug_in_a_request_is_logged_and_the_work_autosaved(
    rig: Rig, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.rename("precious")

    def bug(*_arguments: object) -> None:
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr("spectrasplat.ui.session_requests.source_at", bug)
    rig.ask(requests.SelectAt(*ON_TABLE))
    assert any("a fault" in message.text and message.is_error for message in rig.view_model.messages)
    log = (config / FILE_NAME).read_text()
    assert "SelectAt" in log and "ZeroDivisionError" in log
    assert "precious" in rig.session.autosave.path.read_text()


def test_a_failed_engine_is_replaced_on_demand_and_the_work_kept(rig: Rig, config: Path) -> None:
    rig.rename("precious")
    failed = rig.engine
    failed.fails = RuntimeError("GL_CONTEXT_LOST")
    rig.frame()
    rig.frame()
    assert rig.session.picture.engine is None and failed.released
    assert any("GL_CONTEXT_LOST" in message.text and "F5" in message.text for message in rig.view_model.messages)
    assert "GL_CONTEXT_LOST" in (config / FILE_NAME).read_text()
    assert "precious" in rig.session.autosave.path.read_text()
    rig.rename("goes on")
    rig.ask(requests.ReloadShaders())
    assert rig.engine is not failed and rig.engine.advanced > 0
    assert rig.session.state.scene.name == "goes on"


def test_what_the_engine_cannot_show_is_told_once(rig: Rig) -> None:
    rig.engine.problem = "the maps of this scene are too large"
    for _ in range(3):
        rig.frame()
    assert [m.text for m in rig.view_model.messages].count("The maps of this scene are too large.") == 1
    rig.ask(requests.DismissMessage("The maps of this scene are too large."))
    rig.frame()
    assert "The maps of this scene are too large." not in [m.text for m in rig.view_model.messages]


def test_a_shader_error_is_shown_as_one(rig: Rig) -> None:
    rig.engine.problem = "trace.comp does not compile:\ntrace.comp:12 : syntax error"
    rig.frame()
    rig.frame()
    assert rig.view_model.shader_error == rig.engine.problem
    assert not any("light/trace.comp" in message.text for message in rig.view_model.messages)


def test_recovery_after_a_crash(gl: Context, rig: Rig, config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.rename("lost and found")
    session = rig.session
    session.autosave.write_now(session.document.scene, session.document.title, session.document.source)
    monkeypatch.setattr("spectrasplat.edit.autosave._is_held", lambda _path: False)  # as if that process were gone
    second = Rig(Session(gl, make_engine=FakeEngine))
    second.frame()
    assert second.view_model.recovery.path == session.autosave.path
    assert second.session.state.preferences.panels.start_page
    second.ask(requests.Recover())
    assert second.session.state.scene.name == "lost and found"
    assert second.view_model.unsaved and second.view_model.recovery is None
    second.session.autosave.close()
    second.session.release()


def test_a_click_selects_glass_or_whose_caustic_it_is(rig: Rig) -> None:
    place = ON_TABLE
    hit = pick_in(replace(rig.session.state, viewport_size=(64, 36)), *place)
    assert hit is not None
    objects, receiver = rig.session.state.scene.objects, hit.object_index
    glass = next(i for i, o in enumerate(objects) if isinstance(o.material, Dielectric))
    rig.engine.photons = dispersed(hit.position, glass, receiver)
    assert rig.ask(requests.SelectAt(*place)).selection == Selection("object", glass)
    assert rig.ask(requests.SelectAt(*place, itself=True)).selection == Selection("object", receiver)
    rig.engine.photons = None
    assert rig.ask(requests.SelectAt(*place)).selection == Selection("object", receiver)
    up = replace(rig.session.state.camera, target=tuple(np.add(rig.session.state.camera.position, (0.0, 0.1, 1.0))))
    rig.frame(lambda state: replace(state, camera=up))
    assert rig.ask(requests.SelectAt(0.5, 0.5)).selection == Selection()


def test_facts_under_the_cursor(rig: Rig) -> None:
    hover: Edit = lambda state: replace(state, hover=ON_TABLE)  # noqa: E731
    rig.frame(hover)
    rig.frame(hover)
    cursor = rig.view_model.cursor
    assert cursor is not None and cursor.pixel == (16, 27) and cursor.hit is not None and cursor.hit.is_receiver
    grey = 0.1 * rig.session.state.camera.position[2]
    assert cursor.rgb == pytest.approx((grey,) * 3)
    assert cursor.light is not None
    rig.frame()
    rig.frame()
    assert rig.view_model.cursor is None


def test_settings_reach_the_engine_and_the_next_session(gl: Context, config: Path) -> None:
    rig = Rig(Session(gl, make_engine=FakeEngine))
    rig.settle()
    rig.frame(
        lambda s: replace(s, playing=False, preferences=replace(s.preferences, theme="light", target_photons=5_000_000))
    )
    assert rig.engine.playing is False and rig.engine.target_photons == 5_000_000
    rig.session.close()
    second = Session(gl, make_engine=FakeEngine)
    assert second.state.preferences.theme == "light" and second.state.preferences.target_photons == 5_000_000
    second.release()


def test_idle_costs_nothing_once_converged(rig: Rig) -> None:
    rig.session.jobs.gallery.release()  # no thumbnails are waited for
    assert rig.session.wait_s() == 0.0
    for _ in range(10):
        rig.frame()
    for message in rig.session.messages.messages():
        rig.session.messages.close(message.text)
    assert rig.session.wait_s() > 0.1


def test_no_request_is_without_an_answer() -> None:
    from spectrasplat.ui import session_requests

    asked = set(requests.Request.__subclasses__())
    assert asked <= set(session_requests._HANDLERS)


def test_a_missing_scene_is_one_sentence(gl: Context, config: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nothing.toml"):
        Session(gl, tmp_path / "nothing.toml", make_engine=FakeEngine)


def test_exposure_is_automatic_until_it_is_set(rig: Rig) -> None:
    automatic = rig.session.picture.exposure_ev
    assert automatic != 0.0
    rig.frame(lambda s: replace(s, display=replace(s.display, auto_exposure=False, exposure_ev=-2.5)))
    rig.frame()
    assert rig.view_model.exposure_ev == -2.5


def test_the_timing_panel_tells_the_memory_of_the_whole_program(rig: Rig) -> None:
    rig.frame(lambda state: state.with_panels(timing=True))
    rig.frame()
    resident = resident_bytes()  # read in another way than the program does
    assert rig.view_model.process_bytes == pytest.approx(resident, rel=0.02)
    counts = {name: value for name, value, _ in counts_of(rig.session.state, rig.view_model)}
    assert counts["Process"] == numbers.size(rig.view_model.process_bytes) != counts["Maps, photons"]
    rig.frame(lambda state: state.with_panels(timing=False))
    rig.frame()
    assert rig.view_model.process_bytes == 0


def test_what_a_new_wish_asks_for_is_told_after_a_slice(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[float] = []
    advance = rig.engine.advance
    monkeypatch.setattr(
        rig.engine, "advance", lambda budget_s, interacting: (given.append(budget_s), advance(budget_s, interacting))
    )
    rig.session.picture.advance(rig.session.state, 0.15, 0.04)
    monkeypatch.setattr(rig.engine, "set", lambda inputs: DirtyLevel.NOTHING)
    rig.session.picture.advance(rig.session.state, 0.15)
    assert given == pytest.approx([0.04, 0.15], rel=0.05)
