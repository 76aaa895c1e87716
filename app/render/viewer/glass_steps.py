"""In what blocks of pixels glass and mirrors are followed, one path for each, by how fast these went before."""

from __future__ import annotations

STEPS = (1, 2, 3, 6, 12, 24)
"""Sides of the blocks of pixels that share one path through glass, in motion."""
REFINED = (6, 3, 1)
"""Sides of the blocks once nothing moves, one after the other."""
REFINED_SOON = (6, 1)
"""Sides where the last of them takes less than `SOON_S`: the one before would take a ninth of its time, for a
moment."""
SOON_S = 20.0
"""Seconds of glass, by the rate of the few paths of a picture in motion, which is a fifth of that of many: photons wait
so long for a whole picture."""
_FIRST_STEP = 12
"""Before anything was measured: coarse, so that the first picture comes at once."""
_RATE_BLEND = 0.5


class GlassSteps:
    """What is known of one device and view."""

    def __init__(self) -> None:
        self.rate: float | None = None
        """Paths through glass per second."""
        self.pixels = 0
        """Pixels of the last picture in motion that see glass or mirrors."""

    def learn(self, paths: float, seconds: float) -> None:
        """So many paths took `seconds`."""
        self.rate = blended(self.rate, paths, seconds)

    def within(self, seconds: float) -> int:
        """Side of the blocks of which one path each can be followed in that time."""
        if self.rate is None:
            return _FIRST_STEP
        return next((s for s in STEPS if self.pixels <= s * s * self.rate * seconds), STEPS[-1])

    @property
    def are_soon_done(self) -> bool:
        """Every pixel will have a path of its own before long."""
        return self.rate is None or self.pixels <= SOON_S * self.rate

    def after(self, side: float) -> list[int]:
        """Blocks that follow those of this side, once nothing moves."""
        return [step for step in (REFINED_SOON if self.are_soon_done else REFINED) if step < side]


def blended(rate: float | None, units: float, seconds: float) -> float:
    """A rate, units per second, with so many that were done in `seconds`."""
    measured = units / max(seconds, 1e-4)
    return measured if rate is None else rate + _RATE_BLEND * (measured - rate)
