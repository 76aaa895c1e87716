"""What a live rendering took and reports about itself, for the timing panel and for tests."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Literal

from ..light_stats import LightStats

_HISTORY_S = 1.0


@dataclass(frozen=True)
class LiveStats:
    """One moment of a `LiveEngine`; times of the last `advance` in seconds (wall clock, device finished)."""

    renderer: str = ""
    is_software: bool = True
    device_advice: str = ""
    """How to choose a better GPU, where one may be there."""
    rays_traced: int = 0
    """Rays emitted since the engine was made. Does not move when photons are only splatted again."""
    photons: int = 0
    """Emitted photons that the shown map holds."""
    photons_stored: int = 0
    """Photon records kept for splatting again."""
    passes: int = 0
    camera_samples: float = 0.0
    """Camera samples a pixel of the shown picture."""
    camera_bands: int = 1
    """Stretches of the spectrum that the shown picture's samples are divided over."""
    camera_fallbacks: dict[str, int] = field(default_factory=dict)
    """What camera rays met: columns dropped, paths given up."""
    frame_photons: int = 0
    """Photons that were traced, or shown otherwise, in the last frame that had any."""
    trace_s: float = 0.0
    splat_s: float = 0.0
    resolve_s: float = 0.0
    """Summing maps up for the camera; only where the device has timers, else with `splat_s`."""
    camera_s: float = 0.0
    photons_per_second: float = 0.0
    """Emitted photons per second of trace and splat time, over the last second."""
    shows_other: bool = False
    """There is no picture yet of the scene that is prepared or was: what is shown is the one before."""
    differs: Literal["", "light", "scene", "moved"] = ""
    """What of the wanted scene the picture does not show yet: nothing is missing, its light is being traced, all of it
    is being prepared, or light is shown by a few photons while something is moved."""
    preparing: str = ""
    """What the preparation of a scene is at, up to its first picture; empty where nothing is prepared."""
    preparing_s: float = 0.0
    """For how long it has been prepared."""
    first_order: bool = False
    """The stored paths belong to a glass of another dispersion; the picture follows the edit to first order."""
    converged: bool = False
    """Nothing is left to do: the target is reached."""
    resolution_scale: float = 1.0
    """Side of the shown picture over the side wanted, where glass and mirrors are seen; 1: every pixel has its own
    path."""
    direct_scale: float = 1.0
    """That of what is seen directly."""
    bytes: int = 0
    """GPU memory held."""
    fallbacks: dict[str, int] = field(default_factory=dict)
    lost: dict[str, float] = field(default_factory=dict)
    """Shares of the emitted flux by how it ended."""
    beams: int = 0
    """Beams followed by the last search."""
    polygons: int = 0
    """What they threw on the receivers."""
    only_beams: bool = False
    """Beams carry all light: photons say how finely those are followed."""
    bands: dict[str, int] = field(default_factory=dict)
    """Spectral bands of each light."""


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
