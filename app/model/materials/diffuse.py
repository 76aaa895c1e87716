"""What receives caustics: a two-sided diffuse surface, plain, measured or wearing a picture, coated or not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..fields import Number, write_fields
from ..io.scene_pictures import picture_file, picture_name
from ..io.scene_table import SceneTable
from ..optics.colorimetry import VISIBLE_NM
from ..optics.spectrum import rgb_under_white
from ..scene_textures import TextureReader
from ..texture import Texture
from ..vectors import Vec3
from .absorption import read_curve
from .finish import COAT_INDEX, DIFFUSE_ROUGHNESS, ROUGHNESS, USUAL_COAT_INDEX, read_finish
from .material import Material, colour_words


@dataclass(frozen=True)
class Diffuse(Material):
    """A two-sided receiver; `reflectance` (401,) on the visible grid overrides RGB."""

    reflectance_rgb: Vec3 = (0.8, 0.8, 0.8)
    reflectance: np.ndarray | None = None
    texture: Texture | None = None
    """Multiplies `reflectance_rgb` by the mesh's texture coordinates; never beside `reflectance`."""
    roughness: float | None = None
    """Of a clear dielectric coat over it, 0 to 1 (GGX's alpha is its square); None: there is no coat."""
    coat_index: float = USUAL_COAT_INDEX
    """The coat's refractive index over that of what is before it."""
    diffuse_roughness: float = 0.0
    """0: Lambertian, up to 1 (`optics.rough_diffuse`); never beside `reflectance`."""

    kind: ClassVar = "diffuse"
    title: ClassVar = "Diffuse"
    gpu_code: ClassVar = 1
    receives: ClassVar = True

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """`colour`, with a `texture`, or `reflectance`; its finish."""
        return cls._coloured(table, textures).changed(**read_finish(table))

    @classmethod
    def _coloured(cls, table: SceneTable, textures: TextureReader) -> Self:
        key = table.one_of(("colour", "reflectance"), "the colour")
        if table.one_of(("reflectance", "texture"), "the colour") == "texture":
            # Beside a picture the colour is a factor, so that nothing given leaves the picture as it is.
            return cls(table.colour("colour", (1.0, 1.0, 1.0)), texture=textures.read(table))
        if key != "reflectance":
            return cls(table.colour("colour", (0.8, 0.8, 0.8)))
        inner = table.table(key)
        if inner is None:
            table.fail(key, "must be a table such as {csv = \"paint.csv\"}; an RGB goes under 'colour'")
        source, values = read_curve(inner, "values", "reflectance")
        if values.min() < 0.0 or values.max() > 1.0:
            inner.fail(source, "must hold reflectances between 0 and 1")
        inner.finish("a reflectance")
        return cls(reflectance_rgb=rgb_under_white(values), reflectance=values)

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """Its colour and picture, or its reflectance, and its finish."""
        return self._colours(path) | write_fields(self.shown_numbers(), self, path)

    def _colours(self, path: Path | None) -> dict[str, Any]:
        told: dict[str, Any] = {"kind": self.kind}
        if self.reflectance is not None:
            return told | {"reflectance": {"nm": VISIBLE_NM.tolist(), "values": self.reflectance.tolist()}}
        told["colour"] = list(self.reflectance_rgb)
        worn = self.texture
        if worn is None:
            return told
        name = worn.source or picture_name(worn.rgb) if path is None else picture_file(worn.rgb, worn.source, path)
        return told | {"texture": {"file": name, "wrap": worn.wrap}}

    @property
    def has_coat(self) -> bool:
        """It reflects besides what its base sends back."""
        return self.roughness is not None

    def shown_numbers(self) -> tuple[Number, ...]:
        """Of its finish; a coat's only where it has one."""
        rough = (DIFFUSE_ROUGHNESS,) if self.reflectance is None else ()
        return (ROUGHNESS, COAT_INDEX, *rough) if self.has_coat else rough

    def content(self) -> tuple[object, ...]:
        """Its finish counts where it has one."""
        plain = Diffuse()
        finish = (self.roughness, self.coat_index, self.diffuse_roughness)
        return super().content() + (
            () if finish == (plain.roughness, plain.coat_index, plain.diffuse_roughness) else finish
        )

    def words(self) -> str:
        """With its colour and finish."""
        words = "diffuse, spectral reflectance" if self.reflectance is not None else "diffuse "
        words += colour_words(self.reflectance_rgb) if self.reflectance is None else ""
        words += "" if self.texture is None else ", wears a picture"
        words += "" if self.diffuse_roughness == 0.0 else f", rough by {self.diffuse_roughness:g}"
        return words + ("" if self.roughness is None else f", a coat of roughness {self.roughness:g}")
