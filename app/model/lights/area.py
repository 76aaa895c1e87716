"""A disc or rectangle that glows on one side, Lambertian; W/(sr unit²)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .light import FLUX_KEYS, RADIANCE_KEYS, OutlinedLight


@dataclass(frozen=True)
class AreaLight(OutlinedLight):
    """`spectral_power` is its radiance, W/(sr unit²)."""

    kind: ClassVar = "area"
    title: ClassVar = "Area"
    remark: ClassVar = "A shining disc or rectangle (cd/unit²)."
    emission: ClassVar = "area"
    gpu_code: ClassVar = 3
    own_keys: ClassVar = RADIANCE_KEYS
    power_keys: ClassVar = RADIANCE_KEYS + FLUX_KEYS

    @property
    def has_extent(self) -> bool:
        """Always."""
        return True

    @property
    def flux_factor(self) -> float:
        """π times its area: Lambertian, one-sided."""
        return math.pi * self.area

    def reach(self, distance: float) -> float:
        """As a point of its intensity straight ahead."""
        return distance**2 * math.pi / self.flux_factor

    def emits_toward(self, directions: np.ndarray) -> np.ndarray:
        """Those to its front."""
        return directions @ self.axes()[:, 2] > 0.0
