"""What is found of a scene from its light: numbers with their uncertainty, glasses by how near they come."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Rows = tuple[tuple[str, str], ...]


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

    def rows(self) -> Rows:
        """What was found and how sure it is, in words; of a width, how sure is not known."""
        sure = {path: f" ± {sd:.1g}" if math.isfinite(sd) else "" for path, sd in self.deviations.items()}
        found = ((path, f"{value:.8g}{sure[path]}") for path, value in self.values.items())
        return (*found, ("what is left", f"differs by {100.0 * self.error:.3g} %"))


@dataclass(frozen=True)
class Match:
    """What glasses come near a target."""

    glasses: tuple[Ranked, ...]
    """Nearest first."""
    fit: Fit
    """n_d and V_d, of no particular glass."""

    def rows(self) -> Rows:
        """Glasses and, without a name, the numbers that fit best, in words."""
        named = (
            (g.name, f"n_d {g.n_d:.5f}, V_d {g.V_d:.2f}, differs by {100.0 * g.error:.3g} %") for g in self.glasses
        )
        (n_d, v_d, _) = (text for _, text in self.fit.rows())
        told = "" if math.isfinite(self.fit.deviations["n_d"]) else "; glasses of quite another n_d were not compared"
        return (*named, ("without a name", f"n_d {n_d}, V_d {v_d}{told}"))
