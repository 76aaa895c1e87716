"""One export that takes long: a generator of shares, driven in steps while the window is drawn, and what is said of
it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from ..base.errors import UserError
from ..base.memory import MAX_SIDE_PX
from ..edit.state import State
from ..gpu.context_thread import ContextThread, SteppedWork
from ..model.settings import RenderSettings
from ..render.notices import FrameNotices
from .view_model import JobInfo


@dataclass
class Course:
    """What a finished picture reports while it is made, and whether it is to end."""

    phase: str = "preparing"
    is_stopped: bool = False
    """Somebody waited long enough: what is done by then becomes the picture."""

    def stops(self) -> bool:
        """`is_stopped`, to be called."""
        return self.is_stopped


@dataclass(frozen=True)
class Words:
    """What is said of an export."""

    title: str
    finished: str
    cancelled: str
    when_stopped: str = "nothing is written"
    """What becomes of it where somebody stops it once, within a sentence."""


class ExportJob:
    """A generator of shares on the thread of exports, with a sentence about it at its end."""

    def __init__(
        self,
        words: Words,
        work: Iterator[float],
        notices: FrameNotices,
        thread: ContextThread | None,
        frames: int = 0,
        seconds: float | None = None,
        course: Course | None = None,
    ) -> None:
        """`seconds`: what it takes, where that is known; `course`: of a finished picture; `thread`: where all of `work`
        is done, None for the caller's own."""
        self._course = course
        self._words, self._work, self._notices = words, work, notices
        self._stepped: SteppedWork[bool] = SteppedWork(thread)
        self._frames = frames
        self._fraction, self._seconds = 0.0, seconds
        self._started_s = time.monotonic()
        self._is_cancelled = False

    @property
    def is_picture(self) -> bool:
        """A finished picture, all of which is written to one file."""
        return self._course is not None

    @property
    def is_stopped(self) -> bool:
        return self._course is not None and self._course.is_stopped

    @property
    def view_model(self) -> JobInfo:
        return JobInfo(self._words.title, self._fraction, self._text(), self.is_stopped, self._words.when_stopped)

    def stop(self) -> bool:
        """Whether it will end by itself with what is done."""
        if self._course is None or self._course.is_stopped:
            return False
        self._course.is_stopped = True
        return True

    def step(self, budget_s: float) -> str | None:
        """Work for about `budget_s`; the sentence once it is over. What takes longer continues on the thread."""
        is_over = self._stepped.step(lambda: self._advance(budget_s), budget_s)
        if is_over is None:
            return None
        if is_over:
            early = " It was stopped early, and is what was done until then." if self.is_stopped else ""
            return self._noted(self._words.finished + early)
        return self.cancel() if self._is_cancelled else None

    def _advance(self, budget_s: float) -> bool:
        """Whether it is over."""
        started = time.perf_counter()
        while time.perf_counter() - started < budget_s:
            share = next(self._work, None)
            if share is None:
                return True
            self._fraction = max(self._fraction, share)
        return False

    def cancel(self) -> str | None:
        """End it; None where it is in the middle of a step, after which `step` returns the note."""
        if self._stepped.is_under_way:
            self._is_cancelled = True
            return None
        self._stepped.end(self._close, waits=True)
        return self._noted(self._words.cancelled)

    def release(self) -> None:
        """End it now, and wait for that."""
        self._stepped.end(self._close, waits=True)

    def _close(self) -> None:
        close = getattr(self._work, "close", None)
        if close is not None:
            close()

    def _noted(self, sentence: str) -> str:
        """With the notices of its pictures."""
        notices = self._notices.lines(of_frames=self._frames > 1)
        return " ".join([sentence, *(f"Note: {notice}." for notice in notices)])

    def _text(self) -> str:
        if self._is_cancelled:
            return "Stopping"
        if self.is_stopped:
            return "Finishing with what is done so far"
        phase = "tracing photons and taking camera samples" if self._course is None else self._course.phase
        frame = (
            f"Frame {min(int(self._fraction * self._frames) + 1, self._frames)} of {self._frames}"
            if self._frames
            else phase[:1].upper() + phase[1:]
        )
        left = self._left_s()
        return frame if left is None else f"{frame}, {left_words(left, datetime.now().astimezone())}"

    def _left_s(self) -> float | None:
        """Seconds until it ends at the pace so far; None where that is not known yet."""
        worked = time.monotonic() - self._started_s
        if self._seconds is not None:
            return max(self._seconds - worked, 0.0)
        return None if self._fraction < 0.02 else worked * (1.0 - self._fraction) / self._fraction


def settings_of(state: State, size: tuple[int, int], **changes: Any) -> RenderSettings:
    """What is shown, in another size and with `changes`."""
    width, height = size
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise UserError(f"a size of {width} × {height} pixels is out of range: no side may exceed {MAX_SIDE_PX}")
    return RenderSettings(
        width=width,
        height=height,
        method=state.method,
        smoothing=state.smoothing,
        max_depth=state.scene.render.max_depth,
        local_gain=not state.physical,
        **changes,
    )


def left_words(left_s: float, now: datetime) -> str:
    """ "about 40 s left, until 14:05"."""
    about = f"{left_s:.0f} s" if left_s < 90 else f"{left_s / 60:.0f} min"
    return f"about {about} left, until {now + timedelta(seconds=left_s):%H:%M}"
