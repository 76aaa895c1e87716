"""What receives caustics: a two-sided diffuse surface, plain, measured or with a picture on it.

Its finish is a glossy coat over the diffuse base, and how rough that base is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..fields import Animated, Number, Row, write_fields
from ..io.scene_pictures import picture_file, picture_name
from ..io.scene_table import SceneTable
from ..optics.colorimetry import VISIBLE_NM
from ..optics.spectrum import rgb_under_white
from ..texture import Texture, TextureReader
from ..vectors import Vec3
from .absorption import read_curve
from .material import Material, colour_words

USUAL_ROUGHNESS = 0.25
"""Roughness of a coat that somebody adds without saying more: a polished table."""
USUAL_COAT_INDEX = 1.5
SMOOTH_ROUGHNESS = 0.03
"""A coat less rough than this is met as a perfectly smooth one: its lobe is narrower than a pixel."""

ROUGHNESS = Number(
    "roughness",
    None,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Roughness",
        "Of the coat: 0 is polished like glass, 0.25 a varnished table, 1 reflects to all sides.",
        0.0,
        1.0,
        USUAL_ROUGHNESS,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's coat", 0.0, 1.0),
)
COAT_INDEX = Number(
    "coat_index",
    USUAL_COAT_INDEX,
    optional=True,
    at_least=1.0,
    at_most=4.0,
    row=Row(
        "Coat's index",
        "Refractive index of the coat: how much it reflects, 4 % at 1.5 where it is seen from straight above.",
        1.0,
        4.0,
        USUAL_COAT_INDEX,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Refractive index of a receiver's coat", 1.0, 4.0),
)
DIFFUSE_ROUGHNESS = Number(
    "diffuse_roughness",
    0.0,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Diffuse roughness",
        "0 is Lambertian; with 1 (plaster, clay, the moon) what is lit from behind the camera looks flat.",
        0.0,
        1.0,
        0.0,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's diffuse base", 0.0, 1.0),
)


def read_finish(table: SceneTable) -> dict[str, Any]:
    """`roughness`, `coat_index` and `diffuse_roughness` as attributes of a `Diffuse`."""
    found: dict[str, Any] = COAT_INDEX.read(table) | DIFFUSE_ROUGHNESS.read(table)
    if table.has("roughness"):
        found |= ROUGHNESS.read(table)
    elif table.has("coat_index"):
        table.fail("coat_index", "is that of a coat, and there is none; give its 'roughness' (0 to 1) as well")
    if found["diffuse_roughness"] > 0.0 and table.has("reflectance"):
        table.fail(
            "diffuse_roughness", "goes with 'colour' only; leave it out, or give a 'colour' in place of 'reflectance'"
        )
    return found


@dataclass(frozen=True)
class Diffuse(Material):
    """A two-sided receiver; `reflectance` (401,) on the visible grid overrides RGB."""

    reflectance_rgb: Vec3 = (0.8, 0.8, 0.8)
    reflectance: np.ndarray | None = None
    texture: Texture | None = None
    """Multiplies `reflectance_rgb` by the mesh's texture coordinates; never beside `reflectance`."""
    roughness: float | None = None
    """Roughness of a clear dielectric coat over it, 0 to 1 (GGX's alpha is its square); None: there is no coat."""
    coat_index: float = USUAL_COAT_INDEX
    """The coat's refractive index over that of what is before it."""
    diffuse_roughness: float = 0.0
    """0: Lambertian, up to 1 (`shaders/lib/rough_diffuse.glsl`); never beside `reflectance`."""

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
        values: dict[str, Any] = {"kind": self.kind}
        if self.reflectance is not None:
            return values | {"reflectance": {"nm": VISIBLE_NM.tolist(), "values": self.reflectance.tolist()}}
        values["colour"] = list(self.reflectance_rgb)
        worn = self.texture
        if worn is None:
            return values
        name = worn.source or picture_name(worn.rgb) if path is None else picture_file(worn.rgb, worn.source, path)
        return values | {"texture": {"file": name, "wrap": worn.wrap}}

    @property
    def has_coat(self) -> bool:
        """It reflects besides what its base sends back."""
        return self.roughness is not None

    def shown_numbers(self) -> tuple[Number, ...]:
        """Numbers of its finish; a coat's only where it has one."""
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
