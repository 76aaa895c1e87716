"""What the work of a live rendering took: in this frame by pass, and photons a second over the last one."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..light_stats import LightStats

_HISTORY_S = 1.0


class WorkTally:
    """Counts for one engine; times in seconds, wall clock, device finished."""

    def __init__(self) -> None:
        self.seconds = {"trace": 0.0, "splat": 0.0, "camera": 0.0}
        """Seconds of this frame, by pass."""
        self.photons = 0
        """Traced or splatted anew in the last frame that had any."""
        self._history: deque[tuple[float, int, float]] = deque()
        """When, how many photons, in what time."""

    def begin_frame(self) -> None:
        """Nothing was done yet."""
        self.seconds = dict.fromkeys(self.seconds, 0.0)

    def note_light(self, before: tuple[float, float, int], stats: LightStats) -> None:
        """A portion of photons: seconds of tracing and of splatting and photons `before` it (`light_counts`), and what
        the counts are now."""
        trace, splat, photons = (max(now - then, 0) for now, then in zip(light_counts(stats), before, strict=True))
        self.seconds["trace"] += trace
        self.seconds["splat"] += splat
        now = time.perf_counter()
        while self._history and self._history[0][0] <= now - _HISTORY_S:
            self._history.popleft()
        self._history.append((now, int(photons), trace + splat))

    @property
    def photons_per_second(self) -> float:
        """Emitted photons per second of trace and splat time."""
        seconds = sum(spent for _, _, spent in self._history)
        return sum(photons for _, photons, _ in self._history) / seconds if seconds > 0.0 else 0.0


def light_counts(stats: LightStats) -> tuple[float, float, int]:
    """Seconds of tracing and of splatting, photons."""
    return stats.trace_seconds, stats.splat_seconds, stats.photons
