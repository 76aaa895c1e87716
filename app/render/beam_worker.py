"""Searches for beams in a thread of their own, beside whoever draws."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait

from ..beams.find import GoOn
from ..beams.light_beams import LIGHT_PARTS, BeamFinder, LightBeams

_PAUSE_S = 0.003
"""How long a pause lasts while a search runs."""


class BeamWorker:
    """Searches in its thread, or where it has none in the caller's."""

    def __init__(self, depth: int, *, beside: bool) -> None:
        """`depth`: specular events; `beside`: in a thread of its own, with pauses in which somebody draws."""
        self._depth = depth
        self._pool = ThreadPoolExecutor(1, "beams") if beside else None
        self._stop = threading.Event()

    def searched(
        self,
        finder: BeamFinder,
        threshold: float,
        word: int,
        light_parts: int = LIGHT_PARTS,
        go_on: GoOn = lambda steps: True,
        threads: int | None = 1,
        *,
        hands: bool = False,
    ) -> Iterator[float | LightBeams]:
        """`BeamFinder.find`, beside whoever draws if so asked (by `threads`); stopped where nobody waits for it any
        more."""
        if self._pool is None:
            yield from finder.find(threshold, self._depth, word, light_parts, None, go_on, hands=hands)
            return
        while True:
            self.pause()  # nobody waits for the one before
            stop, done = threading.Event(), [0.0]
            self._stop = stop
            future = self._pool.submit(
                self._search, finder, threshold, word, light_parts, threads, go_on, stop, done, hands
            )
            try:
                while not future.done():
                    wait([future], _PAUSE_S)
                    yield done[0]
                if not stop.is_set():
                    yield future.result()
                    return
            finally:
                stop.set()

    def _search(
        self,
        finder: BeamFinder,
        threshold: float,
        word: int,
        light_parts: int,
        threads: int | None,
        go_on: GoOn,
        stop: threading.Event,
        done: list[float],
        hands: bool,
    ) -> LightBeams:
        """In the thread; what is stopped returns nothing of use."""
        found = LightBeams({})
        for step in finder.find(
            threshold,
            self._depth,
            word,
            light_parts,
            threads,
            lambda steps: go_on(steps) and not stop.is_set(),
            hands=hands,
        ):
            if stop.is_set():
                break
            if isinstance(step, LightBeams):
                found = step
            else:
                done[0] = step
        return found

    def pause(self) -> None:
        """Stop the search that runs beside, for something more urgent; whoever goes on waiting for it begins again."""
        self._stop.set()

    def release(self) -> None:
        """A search that runs ends soon."""
        self.pause()
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
