"""What every material answers: does light go on, end, or land on it, and what is it called.

A kind of material is one class, which overrides what differs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from ..fields import Number, Part, read_fields, write_fields
from ..io.scene_table import SceneTable
from ..optics.colorimetry import rgb_basis
from ..texture import TextureReader
from ..vectors import Vec3

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh


@dataclass(frozen=True)
class Material:
    """What a surface, or the inside of a solid, does with light."""

    kind: ClassVar[str]
    """Its word in a scene file."""
    title: ClassVar[str]
    gpu_code: ClassVar[int]
    """Tells kinds apart on the GPU."""
    parts: ClassVar[tuple[Part, ...]] = ()
    """What the scene file says of it."""
    is_specular: ClassVar[bool] = False
    """Paths go on from it along rays: glass and mirrors. What is not ends them."""
    transmits: ClassVar[bool] = False
    """Light enters it: a dielectric."""
    is_mirror: ClassVar[bool] = False
    is_grating: ClassVar[bool] = False
    receives: ClassVar[bool] = False
    """Caustics are seen on it: it is diffuse."""
    # What a kind may have as fields of its own; without annotations, which would order those.
    reflectance_rgb = (0.0, 0.0, 0.0)
    """Linear Rec.709."""
    reflectance = cast(Any, None)
    """(401,) on the visible grid, instead of `reflectance_rgb`."""
    texture = cast(Any, None)
    absorption = cast(Any, None)
    roughness = cast(Any, None)
    """Roughness of the coat of a diffuse surface (None: no coat) or of a dielectric's surface (0: polished)."""
    coat_index = 1.0
    diffuse_roughness = 0.0
    dispersion = cast(Any, None)
    """What its deflection of light is a function of: a glass's index, a grating's wavelength."""
    priority = 0
    thin = False
    transmittance_rgb = (1.0, 1.0, 1.0)
    """Linear Rec.709 share of what enters glass that its colour leaves of light on the way through all of it."""

    @property
    def met_as(self) -> int:
        """KIND_… of shaders/lib/scene.glsl for its surface."""
        return self.gpu_code

    @property
    def is_solid(self) -> bool:
        """It is a transparent body with an inside."""
        return self.transmits and not self.thin

    @property
    def disperses(self) -> bool:
        """It sends wavelengths different ways."""
        return self.dispersion is not None and not self.thin and bool(self.dispersion.is_dispersive)

    @property
    def has_coat(self) -> bool:
        """It is diffuse, and glossy besides."""
        return False

    @property
    def is_black(self) -> bool:
        """It ends paths and sends nothing on."""
        return not (self.is_specular or self.receives)

    @property
    def is_rough(self) -> bool:
        """Its surface is ground, so that paths go on from it by chance."""
        return self.is_solid and self.roughness > 0.0

    @property
    def microfacet_width(self) -> float:
        """GGX's α, the tangent of the slope that half of its microfacets exceed; 0 is polished. As in glTF, the square
        of the roughness."""
        return self.roughness**2 if self.is_rough else 0.0

    @property
    def is_coloured(self) -> bool:
        """Its plain reflectance, or what a surface of it lets through, is not grey."""
        return len(set(self.reflectance_rgb)) > 1 or len(set(self.transmittance_rgb)) > 1

    @property
    def filters(self) -> bool:
        """A surface of it lets through less than enters."""
        return self.transmittance_rgb != (1.0, 1.0, 1.0)

    @property
    def surface_filter(self) -> np.ndarray:
        """Share that one surface lets through of what enters, float64 (401,) on the visible grid: white light has the
        colour `transmittance_rgb` behind a sheet, or a solid, which is entered and left."""
        passed: np.ndarray = rgb_basis() @ np.asarray(self.transmittance_rgb, float)
        return passed if self.thin else np.sqrt(passed)

    @classmethod
    def usual(cls) -> Self:
        """What somebody gets who asks for one of this kind and nothing more."""
        return cls()

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """One of this kind from its table; `textures` reads its pictures."""
        return cls(**read_fields(cls.parts, table))

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """The keys of its table in a scene file `path`.

        Without one, files are named absolutely, and a picture without a file by its content.
        """
        return {"kind": self.kind} | write_fields(self.parts, self, path)

    def changed(self, **values: Any) -> Self:
        """The same with other values of its kind's fields."""
        return replace(self, **values)

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Raise UserError where the mesh of object `name` cannot be of this material."""

    def shown_numbers(self) -> tuple[Number, ...]:
        """Its plain numbers with a row in the panel."""
        return tuple(part for part in self.parts if isinstance(part, Number) and part.row is not None)

    def is_like(self, other: Material) -> bool:
        """Whether programs and buffers made for the one serve the other, so that only values differ."""
        return False

    def words(self) -> str:
        """What it is, in a few words."""
        return self.kind

    def content(self) -> tuple[object, ...]:
        """What of it light depends on, as plain values and arrays: two that send light alike agree in it."""
        return (*(float(v) for v in self.reflectance_rgb), self.reflectance)


def colour_words(rgb: Vec3) -> str:
    """A colour in as few numbers as say it."""
    return f"{rgb[0]:.3g}" if len(set(rgb)) == 1 else "(" + ", ".join(f"{c:.3g}" for c in rgb) + ")"
