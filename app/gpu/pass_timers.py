"""How long the device itself worked for each pass: OpenGL's timer queries, where they are right.

Software renderers answer them with nonsense, and so have drivers; a probe finds out. Elsewhere the wall clock about
work that is waited for has to do.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

_BYTES = 1 << 22
_REPEATS = 8


class PassTimers:
    """Sums of device time by pass."""

    def __init__(self, ctx: moderngl.Context, may_work: bool) -> None:
        """`may_work`: the device is no software renderer."""
        self._ctx = ctx
        self.seconds: dict[str, float] = {}
        """Since the context was made; empty where timers do not work."""
        self._query = ctx.query(time=True) if may_work else None
        if self._query is not None and not self._tells_truth():
            self._query = None

    @property
    def work(self) -> bool:
        """There are sums."""
        return self._query is not None

    @contextmanager
    def timing(self, name: str) -> Iterator[None]:
        """Count the device's work within the block towards pass `name`, and wait for it. Blocks do not nest."""
        if self._query is None:
            yield
            return
        with self._query:
            yield
        self.seconds[name] = self.seconds.get(name, 0.0) + 1e-9 * self._query.elapsed

    def since(self, before: dict[str, float]) -> dict[str, float]:
        """Seconds by pass since `before`, a copy of `seconds`."""
        return {name: spent - before.get(name, 0.0) for name, spent in self.seconds.items()}

    def _tells_truth(self) -> bool:
        """Whether copying some memory takes more than no time, and no more than the wall clock says."""
        assert self._query is not None
        from_here, to_there = (self._ctx.buffer(reserve=_BYTES) for _ in range(2))
        try:
            self._ctx.finish()
            started = time.perf_counter()
            with self._query:
                for _ in range(_REPEATS):
                    self._ctx.copy_buffer(to_there, from_here)
            self._ctx.finish()
            wall = time.perf_counter() - started
            return 0.0 < 1e-9 * self._query.elapsed <= 1.1 * wall
        finally:
            from_here.release()
            to_there.release()
