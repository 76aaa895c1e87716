"""A thread with an OpenGL context of its own, for work that would hold the window up; and work done there in steps.

Whoever draws waits for a step as long as a frame may take, and draws on without it where it takes longer: the driver
compiles for seconds, a large picture is encoded at its end.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Generic, TypeVar

from .context import Context

T = TypeVar("T")

BUSY_FRAME_S, BUSY_GPU_FRAME_S = 0.08, 0.005
"""How long each frame waits for a step that has overrun: where the processor draws, it is that step's for most of the
time."""


SWITCH_S = 0.0005
"""After which one thread's Python makes way for another's that waits: a frame of the window waits dozens of times."""


def no_thread(*_name: str) -> None:
    """In place of what opens one: all work is done by the caller."""


class ContextThread:
    """One thread; what it is given is done in turn."""

    def __init__(self, begin: Callable[[], Context], end: Callable[[], None], name: str = "context") -> None:
        """Both are called on the new thread: `begin` makes a context current there, which shares objects with the
        window's, `end` leaves it."""
        sys.setswitchinterval(min(SWITCH_S, sys.getswitchinterval()))
        self._end, self._is_closed = end, False
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name)
        self.context = self._pool.submit(begin).result()
        """The thread's own: only what is submitted may use it."""

    def submit(self, work: Callable[[], T]) -> Future[T]:
        """Do `work` on the thread, after all that was submitted before."""
        return self._pool.submit(work)

    def run(self, work: Callable[[], T]) -> T:
        """`submit`, and wait for it."""
        return self._pool.submit(work).result()

    def close(self) -> None:
        """Finish what was submitted, and leave the context (once)."""
        if not self._is_closed:
            self._is_closed = True
            self._pool.submit(self._end).result()
            self._pool.shutdown()


class SteppedWork(Generic[T]):
    """Steps of one work, done on a thread where there is one, else at once."""

    def __init__(self, thread: ContextThread | None) -> None:
        self._thread = thread
        is_gpu = thread is not None and not thread.context.is_software
        self._busy_frame_s = BUSY_GPU_FRAME_S if is_gpu else BUSY_FRAME_S
        self._under_way: Future[T] | None = None

    @property
    def is_under_way(self) -> bool:
        """A step has overrun its time and is not done."""
        return self._under_way is not None

    def step(self, work: Callable[[], T], patience_s: float) -> T | None:
        """What `work` returns; None where it is not done after `patience_s`. Asked again, the first answer comes, and
        no second step is begun before. Raises what it raises."""
        if self._thread is None:
            return work()
        if self._under_way is None:
            self._under_way = self._thread.submit(work)
        else:
            patience_s = self._busy_frame_s
        wait((self._under_way,), patience_s)
        return self._taken() if self._under_way.done() else None

    def finish(self) -> None:
        """Wait for the step that is under way. Raises what it raises."""
        if self._under_way is not None:
            self._taken()

    def end(self, work: Callable[[], object], waits: bool = False) -> None:
        """Do `work` after the step that is under way, whatever becomes of that; there are no more steps. `waits`: until
        it is done."""
        self._under_way = None
        if self._thread is None:
            work()
            return
        done = self._thread.submit(work)
        if waits:
            done.result()

    def _taken(self) -> T:
        assert self._under_way is not None
        done, self._under_way = self._under_way, None
        return done.result()
