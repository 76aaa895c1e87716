"""A parallel beam that leaves a disc or a rectangle; W/unit²."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .light import FLUX_KEYS, IRRADIANCE_KEYS, OutlinedLight


@dataclass(frozen=True)
class CollimatedLight(OutlinedLight):
    """`spectral_power` is the irradiance on a plane across the beam, W/unit²."""

    kind: ClassVar = "collimated"
    title: ClassVar = "Collimated beam"
    remark: ClassVar = "A beam with an edge (lx)."
    emission: ClassVar = "plane"
    gpu_code: ClassVar = 2
    own_keys: ClassVar = IRRADIANCE_KEYS
    power_keys: ClassVar = IRRADIANCE_KEYS + FLUX_KEYS
    is_parallel: ClassVar = True

    @property
    def flux_factor(self) -> float:
        """Its area."""
        return self.area

    def reach(self, distance: float) -> float:
        """The same at every distance."""
        return 1.0
