"""How long the device itself worked for each pass: OpenGL's timer queries, where they are right.

Software renderers answer them with nonsense, and so have drivers; a probe finds out. Elsewhere the wall clock about
work that is waited for has to do.
"""

from __future__ import annotations

import ctypes
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import moderngl

from .linker import linker_of

_BYTES = 1 << 22
_REPEATS = 8
_TIME_ELAPSED, _RESULT, _IS_THERE = 0x88BF, 0x8866, 0x8867
Tell = Callable[[float], None]


@dataclass
class FrameTimes:
    """What the device took for one frame."""

    seconds: dict[str, float] = field(default_factory=dict)
    """By pass, as far as it is known."""
    awaited: int = 0
    """Blocks of which it is not."""


class Query:
    """What the device took for what was sent within its `with`; moderngl's own cannot be asked without waiting."""

    def __init__(self, gl: Any) -> None:
        """`gl`: OpenGL's functions (`Linker`)."""
        self._gl, name = gl, ctypes.c_uint()
        gl.GenQueries(1, name)
        self._name = name.value

    def __enter__(self) -> None:
        self._gl.BeginQuery(_TIME_ELAPSED, self._name)

    def __exit__(self, *_exception: object) -> None:
        self._gl.EndQuery(_TIME_ELAPSED)

    @property
    def is_known(self) -> bool:
        """`seconds` waits for nothing."""
        self._gl.GetQueryObjectuiv(self._name, _IS_THERE, there := ctypes.c_uint())
        return bool(there.value)

    @property
    def seconds(self) -> float:
        """The device is waited for."""
        self._gl.GetQueryObjectui64v(self._name, _RESULT, elapsed := ctypes.c_uint64())
        return 1e-9 * elapsed.value


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
        self._free: list[Query] = []
        self._asked: deque[tuple[str, Query, Tell | None, FrameTimes | None]] = deque()
        """Blocks that the device may not be done with, in their order."""
        self._inside = False
        self.frame: FrameTimes | None = None
        """Gets what is timed from now on as well."""

    @contextmanager
    def timing(self, name: str, tell: Tell | None = None) -> Iterator[None]:
        """Count the device's work within the block towards pass `name` and tell `tell` its seconds in `hear`, once they
        are known, so that nobody waits. A block within another counts as the other's.

        Where timers do not work nothing is counted, and who asks for times waits for the device."""
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
            self.hear()
            query = self._free.pop() if self._free else Query(linker_of(self._ctx).gl)
            with query:
                yield
            self._asked.append((name, query, tell, self.frame))
            if self.frame is not None:
                self.frame.awaited += 1
        finally:
            self._inside = False

    def hear(self, *, waits: bool = False) -> None:
        """Take in what is known by now; `waits`: all that was timed."""
        while self._asked and (waits or self._asked[0][1].is_known):
            name, query, tell, frame = self._asked.popleft()
            took = query.seconds
            self._free.append(query)
            self.seconds[name] = self.seconds.get(name, 0.0) + took
            if frame is not None:
                frame.seconds[name] = frame.seconds.get(name, 0.0) + took
                frame.awaited -= 1
            if tell is not None:
                tell(took)

    def since(self, before: dict[str, float], *, waits: bool = True) -> dict[str, float]:
        """Seconds by pass since `before`, a copy of `seconds`; `waits`: of all that was timed."""
        self.hear(waits=waits)
        return {name: spent - before.get(name, 0.0) for name, spent in self.seconds.items()}

    def _tells_truth(self) -> bool:
        """Whether copying some memory takes more than no time, and no more than the wall clock says."""
        if self._runs_at_once:
            return False
        query = Query(linker_of(self._ctx).gl)
        from_here, to_there = (self._ctx.buffer(reserve=_BYTES) for _ in range(2))
        try:
            self._ctx.finish()
            started = time.perf_counter()
            with query:
                for _ in range(_REPEATS):
                    self._ctx.copy_buffer(to_there, from_here)
            self._ctx.finish()
            wall = time.perf_counter() - started
            return 0.0 < query.seconds <= 1.1 * wall
        finally:
            from_here.release()
            to_there.release()
