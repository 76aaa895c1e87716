"""What is found of a scene from its light: numbers with their uncertainty, glasses by how near they come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Ranked:
    """A glass of the catalogue."""

    name: str
    n_d: float
    V_d: float
    error: float
    """Norm of what its light differs by from the target, over the target's."""


@dataclass(frozen=True)
class Fit:
    """Numbers of a scene."""

    values: dict[str, float]
    deviations: dict[str, float]
    """Standard deviations, by what is left over between the target and the light that was found."""
    covariance: np.ndarray
    error: float
    """Norm of what is left over, over the target's."""
    steps: int


@dataclass(frozen=True)
class Match:
    """What glasses come near a target."""

    glasses: tuple[Ranked, ...]
    """Nearest first."""
    fit: Fit
    """n_d and V_d, of no particular glass."""
