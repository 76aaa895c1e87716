"""Parallel light from infinitely far away, or from a small disc there, such as the sun; W/unit²."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..fields import Animated, Number, Row
from ..vectors import Vec3
from .light import IRRADIANCE_KEYS, Light

SUN_DIAMETER_DEG = 0.53
_DIAMETER = Number(
    "angular_diameter_deg",
    0.0,
    unit="°",
    at_least=0.0,
    at_most=90.0,
    row=Row(
        "Angular diameter",
        "How large the source looks from the scene. The sun has 0.53°; 0 is perfectly parallel and gives the sharpest "
        "colours.",
        high=20.0,
        reset=SUN_DIAMETER_DEG,
        format="%.2f",
        is_slider=True,
    ),
    animated=Animated("Angular diameter"),
)


@dataclass(frozen=True)
class DirectionalLight(Light):
    """`spectral_power` is the irradiance on a plane across the direction, W/unit²."""

    direction: Vec3 = (0.0, 0.0, -1.0)
    angular_diameter_deg: float = 0.0

    kind: ClassVar = "directional"
    title: ClassVar = "Sun (directional)"
    remark: ClassVar = "Sunlight: parallel, everywhere (lx)."
    emission: ClassVar = "plane"
    gpu_code: ClassVar = 1
    own_keys: ClassVar = IRRADIANCE_KEYS
    power_keys: ClassVar = IRRADIANCE_KEYS
    parts: ClassVar = (_DIAMETER,)
    numbers: ClassVar = (_DIAMETER,)
    has_place: ClassVar = False
    is_parallel: ClassVar = True

    @property
    def is_disc(self) -> bool:
        """The sun's."""
        return True

    @property
    def angular_radius(self) -> float:
        """Half of the diameter, rad."""
        return math.radians(0.5 * self.angular_diameter_deg)

    @property
    def has_extent(self) -> bool:
        """Unless it is strictly parallel."""
        return self.angular_diameter_deg > 0.0

    @property
    def flux_factor(self) -> float:
        """It is everywhere."""
        return math.inf

    def reach(self, distance: float) -> float:
        """The same at every distance."""
        return 1.0

    def words(self) -> str:
        """Kind and width."""
        return f"directional, {self.angular_diameter_deg:.4g}° wide"
