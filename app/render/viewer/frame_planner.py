"""Which plan a frame of a live rendering follows, and what becomes known, some frames later, of what it took."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Literal, get_args

from ...gpu.context import Context
from ...gpu.pass_timers import FrameTimes
from .frame_plan import FEWEST, FramePlan, Spent

Kind = Literal["stored", "moved", "refining"]
"""What a frame's photons are for: stored ones shown otherwise, new ones through what is moved, or more of the same."""
LIGHT = ("trace", "splat", "beams")
"""Passes that take as long as photons are many."""
_LATEST = 12
"""Frames after which nothing more is expected of one."""
BEHIND_S = 0.05
"""The device is not done with a frame that began so long ago: until it is, it gets next to no light."""


@dataclass
class _Frame:
    times: FrameTimes
    began: float
    kind: Kind | None = None
    """None: nothing is to be learnt of it."""
    photons: int = 0
    frame_s: float = 0.0
    """What there was time for."""


class FramePlanner:
    """A plan for each kind of frame."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self.restart()
        self._frames: deque[_Frame] = deque(maxlen=_LATEST)
        self._frame = _Frame(FrameTimes(), 0.0)
        self._started = 0.0

    def restart(self) -> None:
        """Another scene: what is known of this one's light says nothing of it."""
        self._plans: dict[Kind, FramePlan] = dict.fromkeys(get_args(Kind), FramePlan())
        self._unpaired = 0.0

    def __getitem__(self, kind: Kind) -> FramePlan:
        plan, waits = self._plans[kind], self._frames
        is_behind = waits and self._frame.began - waits[0].began > BEHIND_S
        return replace(plan, photons=FEWEST) if is_behind else plan

    def begin(self) -> None:
        """A frame begins."""
        self._context.timers.hear()
        for frame in [frame for frame in self._frames if not frame.times.awaited]:
            self._frames.remove(frame)
            self._learn(frame)
        self._started = time.perf_counter()
        self._frame = _Frame(FrameTimes(), self._started)
        self._context.timers.frame = self._frame.times

    def count(self, kind: Kind, photons: int, frame_s: float) -> None:
        """The frame has had so many photons of this kind; it has so much time for these and what goes with them."""
        frame = self._frame
        if frame.kind in (None, "refining"):
            frame.kind, frame.photons, frame.frame_s = kind, photons, frame_s
            self._clock("splat")

    def end(self) -> None:
        """The frame is over. Where the device has no timers it is waited for."""
        self._clock("camera")
        self._context.timers.frame = None
        self._frames.append(self._frame)

    def _clock(self, name: str) -> None:
        """Where the device has no timers: wait for it, what it did was all for this pass."""
        if not self._context.timers.work:
            self._context.finish()
            now = time.perf_counter()
            self._frame.times.seconds[name] = now - self._started
            self._started = now

    def _learn(self, frame: _Frame) -> None:
        if frame.kind is None:
            return
        seconds = dict(frame.times.seconds)
        light, maps = sum(seconds.pop(name, 0.0) for name in LIGHT), seconds.pop("resolve", 0.0)
        rest = sum(seconds.values())
        if frame.kind == "refining":
            # All else fills what light leaves. A frame may trace what the next one splats.
            light, rest = light + self._unpaired, 0.0
            self._unpaired = 0.0 if frame.photons else light
        spent = Spent(frame.photons, light, maps, rest)
        self._plans[frame.kind] = self._plans[frame.kind].after(spent, frame.frame_s)
