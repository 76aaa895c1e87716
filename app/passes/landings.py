"""Where pilot photons landed: what maps are fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Landings:
    """Pilot photons on one receiver: every place where some wavelength of theirs arrives."""

    positions: np.ndarray
    """float64 (n, 3), GPU space."""
    flux_w: np.ndarray
    """float64 (n,)."""
