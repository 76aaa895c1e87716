"""A traced path as the overlay draws it; no OpenGL, so that panels may know it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RayLine:
    """One path of the ray overlay."""

    wavelength_nm: float
    points: np.ndarray
    """float64 (n, 3), world."""
