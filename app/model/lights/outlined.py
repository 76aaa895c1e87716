"""Lights that leave a disc or a rectangle: a surface that glows on one side, and a parallel beam."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np

from ..fields import Animated, Number, Part, Row
from ..io.scene_table import SceneTable
from ..vectors import Vec3
from .light import FLUX_KEYS, IRRADIANCE_KEYS, RADIANCE_KEYS, Light

_FAR = 1e9


class _OutlineFile(Part):
    """`shape` with `radius`, or with `size` and `tangent`."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The shape, and what belongs to it."""
        shape = table.choice("shape", SHAPES, "rectangle" if table.has("size") else "disc")
        if shape == "disc":
            return {"shape": shape} | RADIUS.read(table)
        width, height = table.numbers("size", (1.0, 1.0), count=2)
        if min(width, height) <= 0.0:
            table.fail("size", "must be a width and a height above 0")
        tangent = table.unit_vector("tangent") if table.has("tangent") else None
        return {"shape": shape, "width": width, "height": height, "tangent": tangent}

    def write(self, value: Any, path: object) -> dict[str, Any]:
        """The keys of its shape."""
        if value.is_disc:
            return {"shape": value.shape, "radius": value.radius}
        values = {"shape": value.shape, "size": [value.width, value.height]}
        return values if value.tangent is None else values | {"tangent": list(value.tangent)}


SHAPES = ("disc", "rectangle")
RADIUS = Number(
    "radius",
    1.0,
    unit="units",
    above=0.0,
    row=Row("Radius", "Radius of the disc."),
    animated=Animated("Radius", 1e-9, _FAR),
)
_WIDTH, _HEIGHT = (
    Number(
        name.lower(),
        1.0,
        unit="units",
        above=0.0,
        row=Row(name, "Side of the rectangle."),
        animated=Animated(name, 1e-9, _FAR),
    )
    for name in ("Width", "Height")
)


@dataclass(frozen=True)
class OutlinedLight(Light):
    """A light that leaves a disc or a rectangle."""

    position: Vec3 = (0.0, 0.0, 0.0)
    direction: Vec3 = (0.0, 0.0, -1.0)
    tangent: Vec3 | None = None
    shape: Literal["disc", "rectangle"] = "disc"
    radius: float = 1.0
    width: float = 1.0
    height: float = 1.0

    parts: ClassVar = (_OutlineFile(),)
    numbers: ClassVar = (RADIUS, _WIDTH, _HEIGHT)
    has_outline: ClassVar = True

    def resized(self, across: float, wide: float, high: float) -> Self:
        """With another opening."""
        return self.changed(radius=self.radius * across, width=self.width * wide, height=self.height * high)

    @property
    def is_disc(self) -> bool:
        """Disc or rectangle."""
        return self.shape == "disc"

    @property
    def half_extent(self) -> tuple[float, float]:
        """Half of its width and height, scene units."""
        return (self.radius, self.radius) if self.is_disc else (0.5 * self.width, 0.5 * self.height)

    @property
    def has_roll(self) -> bool:  # type: ignore[override]
        """A rectangle's."""
        return not self.is_disc

    @property
    def area(self) -> float:
        """Scene units²."""
        return math.pi * self.radius**2 if self.is_disc else self.width * self.height

    def shown_numbers(self) -> tuple[Number, ...]:
        """Its radius, or its sides."""
        return (RADIUS,) if self.is_disc else (_WIDTH, _HEIGHT)

    def words(self) -> str:
        """Kind and size."""
        if self.is_disc:
            return f"{self.kind} disc, radius {self.radius:.4g}"
        return f"{self.kind} rectangle, {self.width:.4g} × {self.height:.4g}"


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
