"""Progress of long jobs on stderr: a bar in a terminal, a line now and then in a log.

Quick jobs show nothing: a bar that flashes by tells less than silence. stdout stays clean
for what the commands print.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Self, TextIO

from .errors import plain

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

SHOW_AFTER_S = 2.0
LOG_EVERY_S = 10.0
_BAR_EVERY_S = 0.05
_MARK_EVERY = 0.01
"""Share of a phase's time between two marks."""
_OBSERVED_S = 2.0
"""For which a part of the work must have gone on evenly before the time left is foretold: …"""
_EVEN = 1.5
"""… its rates before and after the middle of that time within this factor."""
_LEAST = 1e-3
"""Share of the whole that has been done by then."""
_UNKNOWN = 0.15
"""Share of what is left, that parts of the work whose rate nobody knows yet may be."""


class Phase(str):
    """What a job is at, in words; `ends`: the job's fraction at which that is done. What follows goes at a rate of its
    own."""

    ends: float

    def __new__(cls, text: str, ends: float) -> Self:
        phase = super().__new__(cls, text)
        phase.ends = ends
        return phase


class ProgressReporter:
    """Call it with (fraction 0…1, text, which may be a `Phase`); use it as a context manager so that the bar ends.
    The time left is shown once it is known.

    `clock` returns seconds and `stream` is stderr unless a test says otherwise.
    """

    def __init__(self, title: str, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._title = plain(title)
        self._stream = stream or sys.stderr
        self._clock = clock
        self._started = clock()
        self._told = self._started
        self._ends = 1.0
        self._marks = [(self._started, 0.0)]
        """When the phase's fraction was what, since it began to move."""
        self._furthest = 0.0
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __call__(self, fraction: float, text: str = "") -> None:
        """Report; cheap enough to be called for every batch."""
        now = self._clock()
        # What is left may turn out to be more than was thought; the bar then stands still.
        self._furthest = fraction = min(max(fraction, self._furthest), 1.0)
        self._mark(fraction, getattr(text, "ends", 1.0), now)
        if now - self._started < SHOW_AFTER_S:
            return
        if not self._stream.isatty():
            if now - self._told >= LOG_EVERY_S:
                self._told = now
                self._log(fraction, text, now)
            return
        if self._bar is None:
            self._open_bar()
        elif now - self._told < _BAR_EVERY_S and fraction < 1.0:
            return
        self._told = now
        assert self._bar is not None and self._task is not None
        self._bar.update(self._task, completed=fraction, text=text + (self._left_words(now) or ", estimating"))

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _mark(self, fraction: float, ends: float, now: float) -> None:
        if ends != self._ends or fraction == self._marks[0][1]:  # it begins, or compiles first
            self._ends, self._marks = ends, [(now, fraction)]
        elif now - self._marks[-1][0] >= _MARK_EVERY * (now - self._marks[0][0]):
            self._marks.append((now, fraction))

    def _left_words(self, now: float) -> str:
        """How long the rest takes; "" while that is not known."""
        (begun, first), fraction = self._marks[0], self._furthest
        middle = 0.5 * (begun + now)
        then, before = next(mark for mark in self._marks[::-1] if mark[0] <= middle)
        left = 1.0 - fraction
        if now - begun < _OBSERVED_S or fraction - first < _LEAST or 1.0 - self._ends > _UNKNOWN * left:
            return ""
        if not first < before < fraction:
            return ""
        change = (fraction - before) / (now - then) * (then - begun) / (before - first)
        if not 1.0 / _EVEN <= change <= _EVEN:
            return ""
        return f", about {left * (now - begun) / (fraction - first):.0f} s left"

    def _log(self, fraction: float, text: str, now: float) -> None:
        elapsed = now - self._started
        detail = (f", {text}" if text else "") + self._left_words(now)
        print(f"{self._title}: {100.0 * fraction:.0f} % after {elapsed:.0f} s{detail}", file=self._stream, flush=True)

    def _open_bar(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[text]}", markup=False),
            console=Console(file=self._stream),
            transient=True,
        )
        self._bar.start()
        self._task = self._bar.add_task(self._title, total=1.0, text="")
