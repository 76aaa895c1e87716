"""Points that shine alike in all directions, or into a cone (spots); W/sr, of a spot on its axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...base.errors import UserError
from ..fields import Animated, Number, Part, Row
from ..io.scene_table import SceneTable
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


_HALF_ANGLE = Number(
    "outer_half_angle_deg",
    30.0,
    "half_angle_deg",
    unit="°",
    above=0.0,
    at_most=90.0,
    row=Row(
        "Half angle",
        "Half the opening angle of the cone; beyond it there is no light.",
        0.1,
        format="%.1f",
        is_slider=True,
    ),
    animated=Animated("Half angle of the cone", 0.01, 180.0, "half_angle_deg"),
)
_INNER = Number(
    "inner_half_angle_deg",
    unit="°",
    at_least=0.0,
    row=Row(
        "Full within",
        "Half angle up to which the cone is at full strength; between the two it fades. Equal: a hard edge.",
        format="%.1f",
        bounded_by="outer_half_angle_deg",
        is_slider=True,
    ),
    animated=Animated("Half angle of the cone's full brightness", high=180.0),
)


class _Cone(Part):
    """`half_angle_deg`, with `inner_half_angle_deg` or `softness` for a soft edge."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Both half angles."""
        outer = _HALF_ANGLE.value(table, "half_angle_deg")
        key = table.one_of(("inner_half_angle_deg", "softness"), "the soft edge")
        inner = outer
        if key == "inner_half_angle_deg":
            inner = _INNER.value(table, key)
            if inner > outer:
                table.fail(key, f"is {inner:g} but cannot exceed half_angle_deg, {outer:g}")
        elif key == "softness":
            inner = outer * (1.0 - table.number(key, at_least=0.0, at_most=1.0))
        return {"inner_half_angle_deg": inner, "outer_half_angle_deg": outer}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Both half angles."""
        return _HALF_ANGLE.write(value, path) | _INNER.write(value, path)


@dataclass(frozen=True)
class SpotLight(Light):
    """`spectral_power` is its radiant intensity on the axis, W/sr. Equal half angles are a hard edge."""

    position: Vec3 = (0.0, 0.0, 0.0)
    direction: Vec3 = (0.0, 0.0, -1.0)
    inner_half_angle_deg: float = 30.0
    outer_half_angle_deg: float = 30.0

    kind: ClassVar = "spot"
    title: ClassVar = "Spot"
    remark: ClassVar = "A point that shines into a cone (cd)."
    emission: ClassVar = "point"
    gpu_code: ClassVar = 0
    own_keys: ClassVar = INTENSITY_KEYS
    power_keys: ClassVar = INTENSITY_KEYS + FLUX_KEYS
    parts: ClassVar = (_Cone(),)
    numbers: ClassVar = (_HALF_ANGLE, _INNER)
    is_intensity: ClassVar = True

    @property
    def cone(self) -> tuple[float, float]:
        """Half angles, rad."""
        return math.radians(self.inner_half_angle_deg), math.radians(self.outer_half_angle_deg)

    @property
    def flux_factor(self) -> float:
        """Its solid angle weighted by the fall-off, sr."""
        return spot_solid_angle_sr(self.inner_half_angle_deg, self.outer_half_angle_deg)

    def emits_toward(self, directions: np.ndarray) -> np.ndarray:
        """Those within the cone."""
        return directions @ self.axes()[:, 2] > math.cos(self.cone[1])

    def words(self) -> str:
        """Kind and cone."""
        inner, outer = self.inner_half_angle_deg, self.outer_half_angle_deg
        return f"spot, half angle {outer:.4g}°, {'hard edge' if inner == outer else f'soft from {inner:.4g}°'}"

    def fitted(self) -> SpotLight:
        """A cone's bright part cannot be wider than the cone."""
        return replace(self, inner_half_angle_deg=min(self.inner_half_angle_deg, self.outer_half_angle_deg))

    def check(self) -> None:
        """Also that one half angle lies within the other."""
        super().check()
        if self.inner_half_angle_deg > self.outer_half_angle_deg:
            raise UserError(f"light '{self.name}': its inner half angle must lie within the outer one; make it smaller")


def spot_solid_angle_sr(inner_half_angle_deg: float, outer_half_angle_deg: float) -> float:
    """∫ fall-off dω of a spot, steradian, in closed form.

    The fall-off (`shaders/lib/spot.glsl`) is 1 inside the inner cone, 0 outside the outer one,
    and a smoothstep of the angle between. Integrated by parts, 2π (1 − cos m · g) remains with
    the middle angle m, half the soft width h, and g = 3 (sin h − h cos h)/h³.
    """
    inner, outer = math.radians(inner_half_angle_deg), math.radians(outer_half_angle_deg)
    middle, h = 0.5 * (inner + outer), 0.5 * (outer - inner)
    # 1 − g by its series where the closed form would cancel; the next term is below 1e-14.
    if h < 0.02:
        lack = h * h / 10.0 - h**4 / 280.0 + h**6 / 15120.0
    else:
        lack = 1.0 - 3.0 * (math.sin(h) - h * math.cos(h)) / h**3
    return 2.0 * math.pi * (2.0 * math.sin(0.5 * middle) ** 2 + math.cos(middle) * lack)
