"""Progress: silent when quick, a line every ten seconds in a log, a bar in a terminal."""

from __future__ import annotations

import io

import pytest
from spectrasplat.base.progress import ProgressReporter


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock() -> Clock:
    return Clock()


def drive(reporter: ProgressReporter, clock: Clock, seconds: int) -> None:
    for second in range(1, seconds + 1):
        clock.now = 100.0 + second
        reporter(second / seconds, f"{second} photons")


def test_log_gets_a_line_every_ten_seconds(clock: Clock) -> None:
    stream = io.StringIO()
    with ProgressReporter("ball", stream, clock) as reporter:
        drive(reporter, clock, 40)
    assert stream.getvalue().splitlines() == [
        "ball: 25 % after 10 s, 10 photons, about 30 s left",
        "ball: 50 % after 20 s, 20 photons, about 20 s left",
        "ball: 75 % after 30 s, 30 photons, about 10 s left",
        "ball: 100 % after 40 s, 40 photons, about 0 s left",
    ]


def test_what_hardly_moved_foretells_nothing(clock: Clock) -> None:
    """A first phase that cannot tell its share: 40 million years were foretold."""
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    for fraction in (1e-8, 2e-8, 0.5):
        clock.now += 10.0
        reporter(fraction)
    assert [line.partition(", ")[2] for line in stream.getvalue().splitlines()] == ["", "", "about 15 s left"]


def test_a_pause_does_not_foretell_hours(clock: Clock) -> None:
    """While the camera's program was compiled, half an hour was foretold of what took a minute."""
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    for seconds, fraction in ((50.0, 0.39), (76.0, 0.395)):
        clock.now = 100.0 + seconds
        reporter(fraction)
    assert stream.getvalue().splitlines()[-1].endswith("about 225 s left")


def test_quick_jobs_are_silent(clock: Clock) -> None:
    for stream in (io.StringIO(), Terminal()):
        with ProgressReporter("ball", stream, clock) as reporter:
            drive(reporter, clock, 1)
        assert stream.getvalue() == ""


def test_terminal_gets_a_bar(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    with ProgressReporter("ball [1]", stream, clock) as reporter:
        drive(reporter, clock, 4)
    assert "ball [1]" in stream.getvalue()
    assert "100%" in stream.getvalue()


def test_fractions_outside_are_clamped(clock: Clock) -> None:
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    clock.now += 10.0
    reporter(1.7)
    assert stream.getvalue() == "ball: 100 % after 10 s, about 0 s left\n"


def test_a_share_is_never_taken_back(clock: Clock) -> None:
    """A rendering of the default scene said 19 %, 2 % and 19 % again while it learnt how long its parts take."""
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    for fraction in (0.19, 0.02, 0.3):
        clock.now += 10.0
        reporter(fraction)
    assert [line.split(": ")[1].split(" %")[0] for line in stream.getvalue().splitlines()] == ["19", "19", "30"]
