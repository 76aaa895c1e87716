"""While nobody touches anything the engine works on between two frames of the interface, but not past input or a new
picture."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.ui import live_picture
from spectrasplat.ui.live_picture import LivePicture

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
