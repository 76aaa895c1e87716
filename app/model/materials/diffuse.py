"""What receives caustics: a two-sided Lambertian surface, plain, measured, or wearing a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..io.scene_pictures import picture_file, picture_name
from ..io.scene_table import SceneTable
from ..optics.colorimetry import VISIBLE_NM
from ..optics.spectrum import Spectrum, illuminant, xyz_to_rgb709
from ..scene_textures import TextureReader
from ..texture import Texture
from ..vectors import Vec3
from .absorption import read_curve
from .material import Material, colour_words


@dataclass(frozen=True)
class Diffuse(Material):
    """A two-sided Lambertian receiver; `reflectance` (401,) on the visible grid overrides RGB."""

    reflectance_rgb: Vec3 = (0.8, 0.8, 0.8)
    reflectance: np.ndarray | None = None
    texture: Texture | None = None
    """Multiplies `reflectance_rgb` by the mesh's texture coordinates; never beside `reflectance`."""

    kind: ClassVar = "diffuse"
    title: ClassVar = "Diffuse"
    gpu_code: ClassVar = 1
    receives: ClassVar = True

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """`colour`, with a `texture`, or `reflectance`."""
        key = table.one_of(("colour", "reflectance"), "the colour")
        if table.one_of(("reflectance", "texture"), "the colour") == "texture":
            # Beside a picture the colour is a factor, so that nothing given leaves the picture as it is.
            return cls(table.colour("colour", (1.0, 1.0, 1.0)), texture=textures.read(table))
        if key != "reflectance":
            return cls(table.colour("colour", (0.8, 0.8, 0.8)))
        inner = table.table(key)
        if inner is None:
            table.fail(key, "must be a table such as {csv = \"paint.csv\"}; an RGB goes under 'colour'")
        source, values = read_curve(inner, "values")
        if values.min() < 0.0 or values.max() > 1.0:
            inner.fail(source, "must hold reflectances between 0 and 1")
        inner.finish("a reflectance")
        return cls(reflectance_rgb=_rgb_under_white(values), reflectance=values)

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """Its colour and picture, or its reflectance."""
        told: dict[str, Any] = {"kind": self.kind}
        if self.reflectance is not None:
            return told | {"reflectance": {"nm": VISIBLE_NM.tolist(), "values": self.reflectance.tolist()}}
        told["colour"] = list(self.reflectance_rgb)
        worn = self.texture
        if worn is None:
            return told
        name = worn.source or picture_name(worn.rgb) if path is None else picture_file(worn.rgb, worn.source, path)
        return told | {"texture": {"file": name, "wrap": worn.wrap}}

    def words(self) -> str:
        """With its colour."""
        if self.reflectance is not None:
            return "diffuse, spectral reflectance"
        return f"diffuse {colour_words(self.reflectance_rgb)}" + ("" if self.texture is None else ", wears a picture")


def _rgb_under_white(reflectance: np.ndarray) -> Vec3:
    """Linear Rec.709 of a reflectance (401,) under D65, clipped to [0, 1]."""
    white = illuminant("D65")
    seen = Spectrum(white.density * reflectance).xyz() / white.luminous()
    r, g, b = (float(v) for v in np.clip(xyz_to_rgb709(seen), 0.0, 1.0))
    return r, g, b
