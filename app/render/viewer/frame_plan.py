"""How much light a frame is given on a GPU: by what the last frames took, so that the wanted rate is held.

Pure: `FramePlan.after` reads no clock and knows no device. A portion of photons costs something that does not depend on
their number besides what each of them costs; the next number is the last one times the time that there is over the time
that it took, so it comes to the right one from either side without passing it. One frame that took much too long says
nothing of the usual, but the next one is given what it shows to be safe: no two follow each other that stall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import median
from typing import TypeVar

T = TypeVar("T")

FEWEST, MOST = 1 << 11, 1 << 24
"""Photons of a frame."""
FIRST = 1 << 16
"""Photons of a frame while nothing is known of the device."""
PLENTY = 1 << 18
"""Photons of a frame above which they may go further, in finer maps."""
DEPTHS = (4, 8, 16, 64)
"""Specular events at most, while things are moved."""
SIDES = (0.5, 1.0, 2.0)
"""Side of the maps of a moving picture over the usual one."""
_GROWTH, _SHRINKING = 1.5, 0.25
"""Most by which photons grow and shrink from frame to frame: what they cost may be others' doing."""
_FULL, _AIM = 1.0, 0.85
"""Shares of the time there is: photons become fewer above the first, and more below three quarters; then this much is
used."""
_HELD = 3
"""Frames whose median counts: one that stalled says nothing."""
_DEAR = 2.0
"""Times the time there is that the usual photons would take by the newest frame alone: then there are fewer at once."""
_MAPS_SHARE = 0.25
"""Largest share of a frame for what maps cost whatever is in them."""
_PATIENCE = 24
"""Frames between two changes of the maps' size or of depth, which show."""


@dataclass(frozen=True)
class Spent:
    """What one frame did and took, s."""

    photons: int
    light: float
    """Tracing and splatting those."""
    maps: float = 0.0
    """Clearing and summing up maps."""
    rest: float = 0.0
    """Camera and all else that the frame's time is for."""

    @property
    def is_sane(self) -> bool:
        """A broken timer would end all light, or the frame."""
        times = self.light, self.maps, self.rest
        return all(math.isfinite(spent) and spent >= 0.0 for spent in times) and self.photons >= 0


@dataclass(frozen=True)
class FramePlan:
    """What the next frame does."""

    photons: int = FIRST
    usual: int = FIRST
    """Photons, but for frames after one that took much too long."""
    depth: int = 8
    side: float = 1.0
    known: tuple[Spent, ...] = ()
    """What the last frames took, newest last."""
    settled: int = 0
    """Frames since depth or side changed."""

    def after(self, spent: Spent, frame_s: float) -> FramePlan:
        """The plan once `spent` is known of a frame, of whose kind each shall take `frame_s`."""
        if not spent.is_sane or not spent.photons or not frame_s > 0.0:
            return self
        known = (*self.known[1 - _HELD :], spent)
        maps, rest = median(s.maps for s in known), median(s.rest for s in known)
        each = median(s.light / s.photons for s in known)
        used = each * self.usual / _room(frame_s, maps + rest)
        usual: float = self.usual
        if used > _FULL or used < 0.75 * _AIM:
            usual *= min(max(_AIM / max(used, 1e-9), _SHRINKING), _GROWTH)
        usual = photons = int(min(max(usual, FEWEST), MOST))
        room, newest = _room(frame_s, spent.maps + spent.rest), spent.light / spent.photons
        if newest * usual > _DEAR * room:
            photons = max(int(_AIM * room / newest), FEWEST)
        plan = replace(self, photons=photons, usual=usual, known=known, settled=self.settled + 1)
        return plan if plan.settled < _PATIENCE else plan._sized(maps / frame_s, used)

    def _sized(self, maps: float, used: float) -> FramePlan:
        """With other maps or another depth, one step of each, where photons are few or plenty. `maps`: their share of
        the frame, `used`: light's share of its time."""
        smaller, larger = _beside(SIDES, self.side)
        shallower, deeper = _beside(DEPTHS, self.depth)
        side, depth = self.side, self.depth
        if maps > _MAPS_SHARE:
            side = smaller
        elif self.usual <= FEWEST and used > _FULL:
            depth = shallower
        elif self.usual >= PLENTY:
            depth, side = deeper, larger if maps * (larger / side) ** 2 < 0.5 * _MAPS_SHARE else side
        if (side, depth) == (self.side, self.depth):
            return self
        return replace(self, side=side, depth=depth, known=(), settled=0)


def _room(frame_s: float, others_s: float) -> float:
    """What of a frame is left for light, a tenth at least."""
    return max(frame_s - others_s, 0.1 * frame_s)


def _beside(steps: tuple[T, ...], at: T) -> tuple[T, T]:
    """The step before and after."""
    i = steps.index(at)
    return steps[max(i - 1, 0)], steps[min(i + 1, len(steps) - 1)]
