"""Small parts of the viewer's host: pace, patience, messages, crash log, sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import requests
from spectrasplat.edit.stored_photons import index_in, photons_in
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.ui import live_picture
from spectrasplat.ui.crash_log import FILE_NAME, MAX_BYTES, write_crash
from spectrasplat.ui.live_picture import LivePicture
from spectrasplat.ui.message_box import ERROR_S, MAX_MESSAGES, NOTICE_S, READ_S, MessageBox, brief, sentence, words
from spectrasplat.ui.viewer import GPU_SHARE, LIGHT_SHARE, LONGEST_PATIENT_S, MIN_SHARE, SOFTWARE_FRAME_S, Pace

from tests.interface.fake_engine import dispersed


class Clock:
    """Stands until it is moved."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_the_engine_gets_what_the_rest_of_a_frame_leaves() -> None:
    pace = Pace(is_software=True)
    for _ in range(100):
        pace.note(0.015)
    assert pace.budget_s == pytest.approx(SOFTWARE_FRAME_S - 0.015)
    for _ in range(100):
        pace.note(3.0)  # however slow the interface is, the light goes on
    assert pace.budget_s == pytest.approx(MIN_SHARE * SOFTWARE_FRAME_S)


def test_the_first_picture_is_not_held_up_by_the_interface() -> None:
    pace = Pace(is_software=True)
    pace.note(0.02)
    assert pace.patient_budget_s > 3.0 * pace.budget_s
    for _ in range(100):
        pace.note(0.08)  # others use the machine too
    assert pace.patient_budget_s == pytest.approx(LIGHT_SHARE * 0.08)
    for _ in range(100):
        pace.note(3.0)
    assert pace.patient_budget_s == LONGEST_PATIENT_S
    pace = Pace(is_software=True)
    pace.note(0.02)
    pace.frame_s = 0.2  # whoever wants longer frames keeps them
    assert pace.patient_budget_s == pace.budget_s
    gpu = Pace(is_software=False)
    assert gpu.patient_budget_s == gpu.budget_s


def test_a_gpu_keeps_to_the_screen() -> None:
    assert Pace(is_software=False, refresh_s=1 / 144).budget_s == pytest.approx(GPU_SHARE / 144)


def test_notices_fade_errors_later_or_with_a_success_once_read() -> None:
    clock = Clock()
    box = MessageBox(clock)
    box.show("Saved\nmine.toml.")
    box.show("No.", is_error=True)
    assert [m.text for m in box.messages()] == ["Saved mine.toml.", "No."]
    assert box.is_fading
    clock.now = NOTICE_S + 1
    assert [m.text for m in box.messages()] == ["No."]
    box.show("Stopped.", is_error=True, stays=True)
    box.messages()
    clock.now += ERROR_S
    assert [m.text for m in box.messages()] == ["Stopped."]
    assert not box.is_fading
    box.show("Not saved.", is_error=True)
    box.messages()
    box.succeed()
    assert [m.text for m in box.messages()] == ["Not saved."]  # nobody can have read it yet
    clock.now += READ_S
    box.succeed()
    assert box.messages() == ()


def test_a_notice_stays_until_it_can_be_read() -> None:
    """Of a file that takes long to prepare, notes were gone before the first frame; four long ones had six seconds."""
    clock = Clock()
    box = MessageBox(clock)
    box.show("word " * 60)
    clock.now = 100.0  # nothing was drawn meanwhile
    assert len(box.messages()) == 1
    clock.now += 300 / 15 - 1
    assert len(box.messages()) == 1
    clock.now += 2
    assert box.messages() == ()


def test_a_message_that_is_said_again_is_shown_once_and_too_many_push_out_the_oldest() -> None:
    box = MessageBox(Clock())
    for number in range(MAX_MESSAGES + 3):
        box.show(f"Message {number}", is_error=True)
        box.show(f"Message {number}", is_error=True)
    texts = [m.text for m in box.messages()]
    assert texts == [f"Message {n}" for n in range(3, MAX_MESSAGES + 3)]


def test_crash_log_names_action_and_traceback_and_stays_small(tmp_path: Path) -> None:
    try:
        raise ZeroDivisionError("a fault")
    except ZeroDivisionError as error:
        path = write_crash(tmp_path / "new", "Save", error, "llvmpipe")
        assert path == tmp_path / "new" / FILE_NAME
        text = path.read_text()
        assert "while: Save" in text and "a fault" in text and "llvmpipe" in text and "test_ui_host_parts" in text
        path.write_bytes(b"x" * (3 * MAX_BYTES))
        write_crash(tmp_path / "new", "Open", error, "llvmpipe")
    assert path.stat().st_size < MAX_BYTES + 5000
    assert "while: Open" in path.read_text()


def test_a_crash_log_that_cannot_be_written_is_no_second_crash(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert write_crash(tmp_path / "file" / "folder", "Save", ValueError(), "llvmpipe") is None


def test_sentences() -> None:
    assert sentence("the scene has no file yet") == "The scene has no file yet."
    assert sentence("prism.toml is broken.") == "prism.toml is broken."
    assert words(requests.SelectAt) == "Select at"
    error = RuntimeError("outer")
    error.__cause__ = ValueError("inner  fault")
    assert brief(error) == "ValueError: inner fault"
    assert brief(KeyError()) == "KeyError"


def test_an_object_of_a_picture_that_lags_behind_is_found_again() -> None:
    shown = load_scene(assets_dir() / "scenes" / "default.toml")
    prism, diamond, table = shown.objects
    edited = replace(shown, objects=(replace(prism, name="other"), diamond, table))
    assert [index_in(edited, shown, i) for i in range(3)] == [0, 1, 2]
    deleted = replace(shown, objects=(diamond, replace(table, object_to_world=2 * table.object_to_world)))
    assert [index_in(deleted, shown, i) for i in (0, 1, 2, 7)] == [None, 0, 1, None]
    photons = dispersed((0.0, 0.0, 0.0), 0, 2, 3)
    photons = replace(photons, source=np.array([0, 1, -1]), receiver=np.array([2, 2, 0]))
    photons = photons_in(deleted, shown, replace(photons, group_of_object={0: 0, 1: 1}))
    assert photons.source.tolist() == [-1, 0, -1] and photons.receiver.tolist() == [1, 1, -1]
    assert photons.group_of_object == {0: 1}


SLICE_S, BUDGET_S = 0.04, 0.15


class Worker:
    """An engine that takes all the time it is given, and a clock that goes with it."""

    def __init__(self) -> None:
        self.now = 0.0
        self.given: list[float] = []
        self.picture_version = 0
        self.stats = LiveStats()
        self.does: Callable[[], None] = lambda: None
        """After each slice."""
        self.share = 1.0
        """Of the time that is given."""
        self.is_busy = False

    def perf_counter(self) -> float:
        return self.now

    def advance(self, budget_s: float, interacting: bool) -> None:
        self.given.append(budget_s)
        self.now += self.share * budget_s
        self.stats = LiveStats(camera_s=self.share * budget_s, converged=self.stats.converged)
        self.does()


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Worker:
    worker = Worker()
    monkeypatch.setattr(live_picture, "time", SimpleNamespace(perf_counter=worker.perf_counter))
    return worker


def advance(worker: Worker, stops: Callable[[], bool] = lambda: False, slice_s: float = SLICE_S) -> LiveStats:
    return LivePicture._advance(worker, False, BUDGET_S, slice_s, stops)  # type: ignore[arg-type]


def test_slices_fill_the_budget_and_their_times_are_told_together(worker: Worker) -> None:
    stats = advance(worker)
    assert worker.given == pytest.approx([SLICE_S] * 3 + [BUDGET_S - 3 * SLICE_S])
    assert stats.camera_s == pytest.approx(BUDGET_S)


def test_without_slices_there_is_one(worker: Worker) -> None:
    advance(worker, slice_s=float("inf"))
    assert worker.given == [BUDGET_S]


def test_input_is_not_kept_waiting_for_more_than_a_slice(worker: Worker) -> None:
    advance(worker, stops=lambda: len(worker.given) >= 2)
    assert len(worker.given) == 2


def test_another_picture_is_shown_at_once(worker: Worker) -> None:
    def publish() -> None:
        worker.picture_version += len(worker.given) == 2

    worker.does = publish
    advance(worker)
    assert len(worker.given) == 2


def test_who_has_little_to_do_is_not_asked_again_and_again(worker: Worker) -> None:
    worker.share = 0.1  # waits for stillness, say
    advance(worker)
    assert len(worker.given) == 1
    worker.share, worker.given = 1.0, []
    worker.stats = LiveStats(converged=True)
    advance(worker)
    assert len(worker.given) == 1
