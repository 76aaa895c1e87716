"""A lamp that shines as its maker measured it: a photometric file's intensity over directions; W/sr at its peak."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from ..fields import Animated, Direction, FileName, Number, Row
from ..vectors import Vec3
from .ies_file import Profile, default_profile, read_ies
from .light import FLUX_KEYS, INTENSITY_KEYS, Light, PowerKey

_ROTATION = Number(
    "rotation_deg",
    0.0,
    unit="°",
    row=Row(
        "Rotation",
        "Turn of the lamp about its own axis, from the file's C0 plane.",
        -180.0,
        180.0,
        format="%.1f",
        is_slider=True,
    ),
    animated=Animated("Turn of the lamp about its own axis", -1e5, 1e5),
    optional=True,
)
_LUMENS = PowerKey("lumens", "lm", "Luminous flux (lm)", "All the light that leaves it.", True, True)


@dataclass(frozen=True)
class IesLight(Light):
    """`spectral_power` is its radiant intensity where it is brightest, W/sr; `profile` has it elsewhere."""

    profile: Profile = field(default_factory=default_profile)
    position: Vec3 = (0.0, 0.0, 0.0)
    direction: Vec3 = (0.0, 0.0, -1.0)
    """Where the file's vertical angle is 0."""
    tangent: Vec3 | None = None
    """Across it, where the horizontal angle is 0; None picks one."""
    rotation_deg: float = 0.0
    """Turns that about the axis, right-handed about the direction away from what is lit."""

    kind: ClassVar = "ies"
    title: ClassVar = "Photometric (IES)"
    remark: ClassVar = "A lamp as its maker measured it, from a .ies file (lm)."
    emission: ClassVar = "profile"
    gpu_code: ClassVar = 0
    own_keys: ClassVar = INTENSITY_KEYS
    power_keys: ClassVar = (_LUMENS, FLUX_KEYS[1], *INTENSITY_KEYS)
    parts: ClassVar = (
        FileName("profile", key="file", load=read_ies, row=Row("File", "The lamp's photometric file (.ies).")),
        Direction("tangent", None),
        _ROTATION,
    )
    numbers: ClassVar = (_ROTATION,)
    is_intensity: ClassVar = True
    has_roll: ClassVar = True

    @property
    def cone(self) -> tuple[float, float]:
        """A hard edge where the file ends."""
        return self.profile.cone_rad, self.profile.cone_rad

    @property
    def across(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit directions (3,) in which the horizontal angle is 0 and 90°."""
        first, second, _ = self.axes().T
        turn = math.radians(self.rotation_deg)
        # Seen from behind the lamp angles turn right-handed about the way back, so the second axis runs the other way.
        return math.cos(turn) * first - math.sin(turn) * second, -math.sin(turn) * first - math.cos(turn) * second

    @property
    def flux_factor(self) -> float:
        """The profile's integral, sr."""
        return self.profile.integral_sr

    def emits_toward(self, directions: np.ndarray) -> np.ndarray:
        """Where the profile is above 0."""
        axis = np.asarray(self.direction, float) / np.linalg.norm(self.direction)
        u, v = self.across
        theta = np.arctan2(np.linalg.norm(np.cross(directions, axis), axis=-1), directions @ axis)
        return self.profile.at(theta, np.arctan2(directions @ v, directions @ u)) > 0.0

    def default_power(self, distance: float) -> float:
        """The file's own candela."""
        return self.profile.peak_cd

    def words(self) -> str:
        """Kind and file."""
        return f"ies, {Path(self.profile.source).name}, {self.profile.peak_cd:.4g} cd at most in the file"
