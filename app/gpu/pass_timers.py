"""How long the device itself worked for each pass: OpenGL's timer queries, where they are right.

Software renderers answer them with nonsense, and so have drivers; a probe finds out. Elsewhere the wall clock about
work that is waited for has to do.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import moderngl

_BYTES = 1 << 22
_REPEATS = 8
_LATE = 4
"""Blocks of a pass that are timed before the first of them is asked for: by then the device is done with it."""
Tell = Callable[[float], None]


@dataclass
class FrameTimes:
    """What the device took for one frame."""

    seconds: dict[str, float] = field(default_factory=dict)
    """By pass, as far as it is known."""
    awaited: int = 0
    """Blocks of which it is not."""


class PassTimers:
    """Sums of device time by pass."""

    def __init__(self, ctx: moderngl.Context, may_work: bool, runs_at_once: bool = False) -> None:
        """`may_work`: the device is no software renderer. `runs_at_once`: a dispatch is done when it returns."""
        self._ctx = ctx
        self._runs_at_once = runs_at_once
        self.seconds: dict[str, float] = {}
        """Since the context was made; empty where timers do not work."""
        self.work = may_work and self._tells_truth()
        """There are sums."""
        self._free: dict[str, list[moderngl.Query]] = {}
        self._asked: dict[str, deque[tuple[moderngl.Query, Tell | None, FrameTimes | None]]] = {}
        self._inside = False
        self.frame: FrameTimes | None = None
        """Gets what is timed from now on as well."""

    @contextmanager
    def timing(self, name: str, tell: Tell | None = None) -> Iterator[None]:
        """Count the device's work within the block towards pass `name` and tell `tell` its seconds, some blocks of the
        pass later, so that nobody waits. A block within another counts as the other's.

        Where timers do not work nothing is counted, and who wants to be told waits for the device."""
        if not self.work:
            started = time.perf_counter()
            yield
            if tell is not None:
                if not self._runs_at_once:
                    self._ctx.finish()
                tell(time.perf_counter() - started)
            return
        if self._inside:
            yield
            return
        self._inside = True
        try:
            free = self._free.setdefault(name, [])
            asked = self._asked.setdefault(name, deque())
            if not (free or asked):
                free += [self._ctx.query(time=True) for _ in range(_LATE)]
            if not free:
                self._hear(name)
            query = free.pop()
            with query:
                yield
            asked.append((query, tell, self.frame))
            if self.frame is not None:
                self.frame.awaited += 1
        finally:
            self._inside = False

    def _hear(self, name: str) -> None:
        query, tell, frame = self._asked[name].popleft()
        took = 1e-9 * query.elapsed
        self._free[name].append(query)
        self.seconds[name] = self.seconds.get(name, 0.0) + took
        if frame is not None:
            frame.seconds[name] = frame.seconds.get(name, 0.0) + took
            frame.awaited -= 1
        if tell is not None:
            tell(took)

    def since(self, before: dict[str, float], *, waits: bool = True) -> dict[str, float]:
        """Seconds by pass since `before`, a copy of `seconds`; `waits`: of all that was timed."""
        for name, asked in self._asked.items() if waits else ():
            while asked:
                self._hear(name)
        return {name: spent - before.get(name, 0.0) for name, spent in self.seconds.items()}

    def _tells_truth(self) -> bool:
        """Whether copying some memory takes more than no time, and no more than the wall clock says."""
        if self._runs_at_once:
            return False
        query = self._ctx.query(time=True)
        from_here, to_there = (self._ctx.buffer(reserve=_BYTES) for _ in range(2))
        try:
            self._ctx.finish()
            started = time.perf_counter()
            with query:
                for _ in range(_REPEATS):
                    self._ctx.copy_buffer(to_there, from_here)
            self._ctx.finish()
            wall = time.perf_counter() - started
            return 0.0 < 1e-9 * query.elapsed <= 1.1 * wall
        finally:
            from_here.release()
            to_there.release()
