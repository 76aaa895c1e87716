"""Where camera paths start that carry on what beams have handed over (drawn by `drawn_starts`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ScreenStarts:
    """S paths, ordered by their pixels."""

    polygon: np.ndarray
    """int (S,)."""
    place: np.ndarray
    """(S, 2), pixels."""
    x: np.ndarray
    """(S,), place in the spectrum."""
    t: np.ndarray
    """(S,), the same within the polygon's band."""
    weight: np.ndarray
    """(S,): radiance of a pixel per radiance that arrives along the path and per chance with which a wavelength of the
    whole spectrum is drawn."""

    def __len__(self) -> int:
        return len(self.x)

    @staticmethod
    def none() -> ScreenStarts:
        """No path."""
        return ScreenStarts(np.zeros(0, int), np.zeros((0, 2)), *(np.zeros(0) for _ in range(3)))
