"""What every light answers: where it is, how it shines, what its power is called, what a panel shows of it.

A kind of light is one class, which overrides what differs. Whoever needs to know something about a light asks it, and
never which kind it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, cast

import numpy as np

from ...base.errors import UserError
from ..fields import Number, Part, check_numbers
from ..io.scene_table import MAX_MAGNITUDE
from ..optics.spectrum import Spectrum
from ..vectors import Vec3, frame_about, unit

if TYPE_CHECKING:
    from .ies_file import Profile

DEFAULT_ILLUMINANCE = 3.0
"""Lumen per square unit on a plane across the light where a file states no power: with
exposure 0 a white table then shows mid-grey and leaves room for the caustic above it."""


@dataclass(frozen=True)
class PowerKey:
    """One physical quantity that a light's power may be given in; areas count in scene units."""

    key: str
    unit: str
    label: str
    tip: str
    is_photometric: bool
    is_flux: bool = False
    """All the light that leaves it, rather than the kind's own quantity."""


_INTENSITY = "Power into each direction; for a spot, on its axis."
_FLUX = "All the light that leaves it."
FLUX_KEYS = (
    PowerKey("flux_lm", "lm", "Luminous flux (lm)", _FLUX, True, True),
    PowerKey("flux_w", "W", "Radiant flux (W)", _FLUX, False, True),
)
INTENSITY_KEYS = (
    PowerKey("intensity_cd", "cd", "Luminous intensity (cd)", _INTENSITY, True),
    PowerKey("intensity_w_sr", "W/sr", "Radiant intensity (W/sr)", _INTENSITY, False),
)
IRRADIANCE_KEYS = (
    PowerKey(
        "illuminance_lx",
        "lm/unit²",
        "Illuminance (lm/unit²)",
        "Light on a plane across the beam; lux where a scene unit is a metre.",
        True,
    ),
    PowerKey("irradiance_w_m2", "W/unit²", "Irradiance (W/unit²)", "Power on a plane across the beam.", False),
)
RADIANCE_KEYS = (
    PowerKey(
        "luminance_nt",
        "cd/unit²",
        "Luminance (cd/unit²)",
        "How bright its surface looks; nits where a scene unit is a metre.",
        True,
    ),
    PowerKey(
        "radiance_w_sr_m2", "W/(sr unit²)", "Radiance (W/(sr unit²))", "How bright its surface is, as power.", False
    ),
)


@dataclass(frozen=True)
class Light:
    """One emitter.

    `spectral_power` holds the spectral density per nanometre of the quantity that belongs to the kind
    (`own_keys` names it), already scaled to absolute units. A photometric scene file (cd, lm, lux, nits) is converted
    with K_m = 683.002 lm/W, so the renderer's Y is always in lm/(sr unit²).
    """

    name: str
    spectral_power: Spectrum

    kind: ClassVar[str]
    """Its word in a scene file."""
    title: ClassVar[str]
    remark: ClassVar[str]
    """Name and one line for menus."""
    emission: ClassVar[Literal["point", "plane", "area", "profile"]]
    """Variant of emit.comp, and whether its domain is of directions or of positions."""
    gpu_code: ClassVar[int]
    """LIGHT_KIND_… of shaders/lib/lights.glsl."""
    own_keys: ClassVar[tuple[PowerKey, ...]]
    """Its own quantity, photometric and radiometric."""
    power_keys: ClassVar[tuple[PowerKey, ...]]
    """All that its power may be given in; the first is shown first."""
    parts: ClassVar[tuple[Part, ...]] = ()
    """What the scene file says of its shape."""
    numbers: ClassVar[tuple[Number, ...]] = ()
    """Numbers of its shape: their bounds, rows of a panel, ways to animate them."""
    has_place: ClassVar[bool] = True
    has_direction: ClassVar[bool] = True
    has_roll: ClassVar[bool] = False
    """Whether turning it about its own axis changes it."""
    has_outline: ClassVar[bool] = False
    """Whether it is a disc or a rectangle that can be scaled."""
    is_parallel: ClassVar[bool] = False
    is_intensity: ClassVar[bool] = False
    """Whether its quantity is an intensity, which falls off with distance²."""
    # What a kind may have as attributes, without annotations: an annotated one would order the kinds' own fields.
    profile = cast("Profile | None", None)
    """Table of its intensity over directions, where it has one."""
    position = (0.0, 0.0, 0.0)
    direction = (0.0, 0.0, -1.0)
    """Unit propagation direction of the axis."""
    tangent = cast(Vec3 | None, None)
    """Direction of a rectangle's width; None picks one."""
    shape = "disc"
    """Outline, where it has one."""

    @property
    def across(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions (3,) in which the profile's horizontal angle is 0 and 90°."""
        return np.zeros(3), np.zeros(3)

    @property
    def is_disc(self) -> bool:
        """Its outline is round."""
        return False

    @property
    def half_extent(self) -> tuple[float, float]:
        """Half of its width and height, scene units."""
        return 0.0, 0.0

    @property
    def area(self) -> float:
        """Scene units²."""
        return 0.0

    @property
    def angular_radius(self) -> float:
        """Angular radius of a light that is infinitely far away, rad."""
        return 0.0

    @property
    def cone(self) -> tuple[float, float]:
        """Inner and outer half angle of its cone, rad; beyond π for none."""
        return 4.0, 4.0

    @property
    def has_hard_edge(self) -> bool:
        """Whether its light ends abruptly, at its aperture or the border of its cone."""
        inner, outer = self.cone
        return (self.is_parallel and self.has_place) or (inner == outer < math.pi)

    @property
    def has_extent(self) -> bool:
        """Whether it is more than a point or a strictly parallel beam, so that a camera ray can run into it."""
        return False

    @property
    def variant(self) -> tuple[Any, ...]:
        """What programs and buffers are built for: lights of equal variant can stand in for each other."""
        return type(self), self.is_disc, self.profile

    @property
    def flux_factor(self) -> float:
        """Total flux divided by the quantity of `spectral_power`; infinite for a directional light."""
        raise NotImplementedError

    def reach(self, distance: float) -> float:
        """Its quantity over the irradiance it gives at `distance`, on a plane across it."""
        return distance**2

    def axes(self) -> np.ndarray:
        """Columns tangent, bitangent and axis (propagation), unit and right-handed, float64 (3, 3)."""
        return self._axes

    @cached_property
    def _axes(self) -> np.ndarray:
        return frame_about(unit(self.direction), self.tangent).T

    def emits_toward(self, directions: np.ndarray) -> np.ndarray:
        """Which of the unit directions (..., 3) it emits into, bool (...)."""
        return np.ones(np.shape(directions)[:-1], bool)

    def default_power(self, distance: float) -> float:
        """The photometric quantity where a scene file states none: DEFAULT_ILLUMINANCE at `distance`."""
        return DEFAULT_ILLUMINANCE * self.reach(distance)

    def words(self) -> str:
        """Kind and shape in a few words."""
        return self.kind

    def resized(self, across: float, wide: float, high: float) -> Self:
        """With an outline so many times as large; a disc knows one factor only."""
        return self

    def changed(self, **values: Any) -> Self:
        """The same with other values of its kind's fields."""
        return replace(self, **values)

    def fitted(self) -> Light:
        """The same with numbers that bound each other brought in line."""
        return self

    def shown_numbers(self) -> tuple[Number, ...]:
        """Those of `numbers` that count for it as it is."""
        return self.numbers

    def check(self) -> None:
        """Raise UserError for a place, size or angle that no scene file could hold."""
        values = (float(getattr(self, number.attribute)) for number in self.numbers)
        if not all(math.isfinite(v) and abs(v) <= MAX_MAGNITUDE for v in (*self.position, *values)):
            raise UserError(f"light '{self.name}': its place or size is not finite or too large; choose another")
        check_numbers(self.numbers, self, f"light '{self.name}': its ")

    def power(self, key: PowerKey) -> float:
        """Its power as `key` states it."""
        spectrum = self.spectral_power
        value = spectrum.luminous() if key.is_photometric else spectrum.power_w()
        return value * self.flux_factor if key.is_flux else value

    def with_power(self, key: PowerKey, value: float) -> Light:
        """The same light of power `value` in the unit of `key`. Raises UserError where its spectrum cannot have it."""
        own = value / self.flux_factor if key.is_flux else value
        spectrum = self.spectral_power
        return replace(
            self,
            spectral_power=spectrum.scaled_to_luminous(own) if key.is_photometric else spectrum.scaled_to_power(own),
        )

    def given(self) -> dict[str, Any]:
        """Its attributes by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def made(kind: type[Light], attributes: dict[str, Any]) -> Light:
    """A light of class `kind` with those of `attributes` that it has."""
    known = {field.name for field in fields(kind)}
    return kind(**{name: value for name, value in attributes.items() if name in known})
