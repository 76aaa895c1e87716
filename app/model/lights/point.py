"""A point that shines alike in all directions; W/sr."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..vectors import Vec3
from .light import FLUX_KEYS, INTENSITY_KEYS, Light


@dataclass(frozen=True)
class PointLight(Light):
    """`spectral_power` is its radiant intensity, W/sr."""

    position: Vec3 = (0.0, 0.0, 0.0)

    kind: ClassVar = "point"
    title: ClassVar = "Point"
    remark: ClassVar = "Shines alike in all directions (cd)."
    emission: ClassVar = "point"
    gpu_code: ClassVar = 0
    own_keys: ClassVar = INTENSITY_KEYS
    power_keys: ClassVar = INTENSITY_KEYS + FLUX_KEYS
    has_direction: ClassVar = False
    is_intensity: ClassVar = True

    @property
    def flux_factor(self) -> float:
        """All directions, sr."""
        return 4.0 * math.pi
