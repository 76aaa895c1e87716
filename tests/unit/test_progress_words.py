"""Progress: how far a frame is, what is said of it, how long a picture takes, how an engine's work is counted."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.progress import Phase, ProgressReporter
from spectrasplat.render.frame_progress import PHOTON_S, SAMPLE_S, FrameProgress
from spectrasplat.render.light_stats import LightStats
from spectrasplat.render.time_budget import TimeBudget
from spectrasplat.render.viewer.stats import LiveStats, WorkTally, light_counts
from spectrasplat.ui.message_box import broken
from spectrasplat.ui.panels.status_bar import progress_words


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


PHOTONS, SAMPLES = 100_000, 1_000_000


@pytest.mark.parametrize("environment_s", [0.0, 1.0, 50.0])
def test_progress_is_the_share_of_the_time(environment_s: float) -> None:
    progress = FrameProgress()
    progress.expect_photons(PHOTONS)
    progress.expect_samples(SAMPLES)
    whole = environment_s + PHOTONS * PHOTON_S + SAMPLES * SAMPLE_S
    shares = np.linspace(0.0, 1.0, 5)
    if environment_s:
        asked = [progress.environment(share, share * environment_s) for share in shares[1:]]
        assert asked == pytest.approx(shares[1:] * environment_s / whole)
    traced = [progress.light(share) for share in shares]
    assert traced == pytest.approx((environment_s + shares * PHOTONS * PHOTON_S) / whole)
    assert progress.ends == traced[-1]
    seen = [progress.camera(share) for share in shares]
    assert seen == pytest.approx((environment_s + PHOTONS * PHOTON_S + shares * SAMPLES * SAMPLE_S) / whole)
    assert seen[-1] == 1.0 == progress.ends


def test_progress_never_falls_when_a_part_takes_longer_than_it_seemed() -> None:
    progress = FrameProgress()
    progress.expect_samples(SAMPLES)
    shares = [progress.environment(0.1, 0.1), progress.environment(0.2, 1.0), progress.environment(0.3, 9.0)]
    assert shares == sorted(shares)


def test_a_frame_of_nothing_has_no_progress() -> None:
    progress = FrameProgress()
    assert progress.light(1.0) == 0.0 == progress.camera(1.0)


def test_nothing_accumulates_while_all_time_is_an_export_s() -> None:
    stats = LiveStats(photons=1_250_000, camera_samples=3.0)
    assert progress_words(stats, True, rests=True) == "Waiting, 1.25 M photons"
    assert progress_words(replace(stats, converged=True), True, rests=True) == "Done, 1.25 M photons"


def test_a_message_breaks_between_words_and_not_within_endings_of_files() -> None:
    said = "notes.txt: '.txt' is not a kind of scene; use .toml, .glb, .gltf, .ply, .obj, .stl."
    lines = broken(said, 66.0, len).splitlines()
    assert " ".join(lines) == said and max(map(len, lines)) <= 66 and lines[1].startswith(".ply,")
    assert broken("a_name_that_is_wider.png is saved", 10.0, len) == "a_name_that_is_wider.png\nis saved"


SIZE = 320, 160


class SlowCamera:
    """A camera pass whose samples take a time by the pixel."""

    def __init__(self, sample_s: float) -> None:
        self.pixel_s = sample_s / (SIZE[0] * SIZE[1])
        self.sizes: list[tuple[int, int]] = []

    def samples(self, _camera: Any, width: int, height: int, *_rest: Any) -> Iterator[float]:
        self.sizes.append((width, height))
        time.sleep(self.pixel_s * width * height)
        yield 1.0


@pytest.mark.parametrize(("seconds", "probed"), [(2.0, [(80, 40)]), (60.0, [(80, 40), (160, 80)])])
def test_a_sample_is_measured_on_as_large_a_picture_as_the_time_allows(
    seconds: float, probed: list[tuple[int, int]]
) -> None:
    budget, camera = TimeBudget(seconds, time.perf_counter()), SlowCamera(1.0)
    for _ in budget.measuring(camera, None, *SIZE):  # type: ignore[arg-type]
        pass
    assert camera.sizes == probed
    assert budget.sample_s == pytest.approx(1.0, rel=0.5)


def test_what_compiling_takes_is_told_from_the_sample() -> None:
    budget, camera = TimeBudget(2.0, time.perf_counter()), SlowCamera(1.0)
    for _ in budget.measuring(camera, None, *SIZE, first=True):  # type: ignore[arg-type]
        pass
    assert camera.sizes == [(80, 40)] * 2
    assert abs(budget.compile_s) < 0.1


def test_seconds_are_of_one_frame_and_the_rate_is_of_the_last_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    tally, stats = WorkTally(), LightStats()
    for _ in range(2):
        before = light_counts(stats)
        stats.trace_seconds, stats.splat_seconds = stats.trace_seconds + 0.03, stats.splat_seconds + 0.01
        stats.photons += 1000
        tally.note_light(before, stats)
    assert tally.seconds == pytest.approx({"trace": 0.06, "splat": 0.02, "camera": 0.0})
    assert tally.photons_per_second == pytest.approx(2000 / 0.08)
    tally.begin_frame()
    assert not any(tally.seconds.values()) and tally.photons_per_second > 0.0
    # Counts that were set back (passes began anew) are no negative work; what is old is forgotten.
    now[0] += 2.0
    tally.note_light((stats.trace_seconds + 1.0, 0.0, stats.photons + 1), stats)
    assert tally.seconds["trace"] == 0.0 and tally.photons_per_second == 0.0
