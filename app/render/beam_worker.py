"""Searches for beams in a thread of their own, while the caller draws."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor, wait

from ..beams.find import GoOn
from ..beams.light_beams import LightBeams

_PAUSE_S = 0.003
"""How long a pause lasts while a search runs."""
Found = Generator[float, None, LightBeams]


class BeamWorker:
    """Searches in its thread, or where it has none in the caller's."""

    def __init__(self, *, in_thread: bool) -> None:
        self._pool = ThreadPoolExecutor(1, "beams") if in_thread else None
        self._stop = threading.Event()

    def searched(
        self, search: Callable[..., Found], go_on: GoOn = lambda steps: True, threads: int | None = 1
    ) -> Found:
        """What `search(go_on=…, threads=…)` finds (`BeamFinder.find`). In the thread it takes so many `threads`, and is
        stopped when the caller drops the generator."""
        if self._pool is None:
            return (yield from search(go_on=go_on, threads=None))
        while True:
            self.pause()  # the one before is no longer needed
            stop, done = threading.Event(), [0.0]
            self._stop = stop
            steps = search(go_on=lambda n, stop=stop: go_on(n) and not stop.is_set(), threads=threads)
            future = self._pool.submit(_run, steps, stop, done)
            try:
                while not future.done():
                    wait([future], _PAUSE_S)
                    yield done[0]
                if not stop.is_set():
                    return future.result()
            finally:
                stop.set()

    def pause(self) -> None:
        """Stop the search that runs in the thread, for something more urgent; a generator that waits for it begins it
        again."""
        self._stop.set()

    def release(self) -> None:
        """A search that runs ends soon."""
        self.pause()
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


def _run(steps: Found, stop: threading.Event, done: list[float]) -> LightBeams:
    """In the thread; what is stopped returns nothing of use."""
    try:
        while not stop.is_set():
            done[0] = next(steps)
    except StopIteration as end:
        return end.value
    return LightBeams({})
