"""Progress of long jobs on stderr: a bar in a terminal, a line now and then in a log.

Quick jobs show nothing: a bar that flashes by tells less than silence. stdout stays clean
for what the commands print.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

from .errors import plain

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

SHOW_AFTER_S = 2.0
LOG_EVERY_S = 10.0
_BAR_EVERY_S = 0.05
_TELLING_SHARE = 1e-3
"""Of the whole: less since the last line says nothing about what is left."""


class ProgressReporter:
    """Call it with (fraction 0…1, text); use it as a context manager so that the bar ends.

    `clock` returns seconds and `stream` is stderr unless a test says otherwise.
    """

    def __init__(
        self,
        title: str,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = plain(title)
        self._stream = stream or sys.stderr
        self._clock = clock
        self._started = clock()
        self._told = self._started
        self._last = (0.0, self._started)
        """What was told last, and when."""
        self._furthest = 0.0
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __call__(self, fraction: float, text: str = "") -> None:
        """Report; cheap enough to be called for every batch."""
        now = self._clock()
        if now - self._started < SHOW_AFTER_S:
            return
        # What is left may turn out to be more than was thought; the bar then stands still.
        self._furthest = fraction = min(max(fraction, self._furthest), 1.0)
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
        self._bar.update(self._task, completed=fraction, text=text)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self.close()

    def _log(self, fraction: float, text: str, now: float) -> None:
        elapsed = now - self._started
        detail = f", {text}" if text else ""
        # One phase may be slower than those before it, and begin with compiling: halfway between of late and so far.
        (before, then), self._last = self._last, (fraction, now)
        if fraction - before > _TELLING_SHARE:
            rate = 0.5 * ((fraction - before) / (now - then) + fraction / elapsed)
            detail += f", about {(1.0 - fraction) / rate:.0f} s left"
        print(
            f"{self._title}: {100.0 * fraction:.0f} % after {elapsed:.0f} s{detail}",
            file=self._stream,
            flush=True,
        )

    def _open_bar(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TaskProgressColumn,
            TextColumn,
            TimeRemainingColumn,
        )

        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[text]}", markup=False),
            console=Console(file=self._stream),
            transient=True,
        )
        self._bar.start()
        self._task = self._bar.add_task(self._title, total=1.0, text="")
