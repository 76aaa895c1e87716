"""Progress: silent when quick, a line every ten seconds in a log, a bar in a terminal."""

from __future__ import annotations

import io

import pytest
from spectrasplat.base.progress import Phase, ProgressReporter


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


@pytest.mark.parametrize(
    ("course", "told"),
    [
        # A first phase that cannot tell its share: 40 million years were foretold.
        ([(10, 1e-8, 1.0), (20, 2e-8, 1.0), (30, 0.5, 1.0)], ["", "", ""]),
        # While the camera's program was compiled, half an hour was foretold of what took a minute.
        ([(50, 0.39, 1.0), (76, 0.395, 1.0)], ["", ""]),
        # What compiles before it begins to move is no part of its rate: 105 s were foretold of what took 12.
        ([(8, 0.0, 1.0), (10, 0.1, 1.0), (11, 0.15, 1.0), (12, 0.2, 1.0), (20, 0.6, 1.0)], ["", "8"]),
        # How long the camera takes is not known while photons are traced, unless it hardly matters.
        ([(5, 0.1, 0.4), (8, 0.2, 0.4), (10, 0.3, 0.4), (12, 0.4, 1.0), (16, 0.6, 1.0), (20, 0.8, 1.0)], ["", "4"]),
        ([(5, 0.1, 0.98), (7, 0.14, 0.98), (10, 0.2, 0.98), (20, 0.4, 0.98)], ["40", "30"]),
    ],
    ids=["nothing moved", "a pause", "compiled first", "photons first", "nearly all photons"],
)
def test_the_time_left_is_told_once_it_is_known(clock: Clock, course, told) -> None:
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    for seconds, fraction, ends in course:
        clock.now = 100.0 + seconds
        reporter(fraction, Phase("working", ends))
    lines = [line.partition("working")[2] for line in stream.getvalue().splitlines()]
    assert lines == [words and f", about {words} s left" for words in told]


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
    assert stream.getvalue() == "ball: 100 % after 10 s\n"


def test_a_share_is_never_taken_back(clock: Clock) -> None:
    """A rendering of the default scene said 19 %, 2 % and 19 % again while it learnt how long its parts take."""
    stream = io.StringIO()
    reporter = ProgressReporter("ball", stream, clock)
    for fraction in (0.19, 0.02, 0.3):
        clock.now += 10.0
        reporter(fraction)
    assert [line.split(": ")[1].split(" %")[0] for line in stream.getvalue().splitlines()] == ["19", "19", "30"]
