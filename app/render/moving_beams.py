"""How fine the search for beams is while something is dragged.

In a file of its own so that what merely tells of beams does without their machine code, whose import takes 0.7 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SURVEY = 1e-3
"""Threshold of the search that tells which objects beams carry, and what they cost."""
MOVING_COARSEST, MOVING_FINEST = 2e-3, 1e-5
"""A coarser search takes hardly less time (a brilliant: 50 ms of the processor at 1e-2, 70 ms at 1e-3)."""


@dataclass
class MovingBeams:
    """How fine beams are while something is dragged: as fine as their time allows. One value for all light passes of a
    live rendering."""

    threshold: float = SURVEY

    def learn(self, took: float, seconds: float) -> None:
        """A search and its drawing `took` so long. Small changes are left out: other beams would play roulette."""
        if not 0.5 * seconds <= took <= 1.2 * seconds:
            self.threshold = float(
                np.clip(self.threshold * np.clip(took / seconds, 0.5, 2.0), MOVING_FINEST, MOVING_COARSEST)
            )
