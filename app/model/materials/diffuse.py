"""The diffuse material, on which caustics are seen: two-sided, with a colour, a measured spectrum or a picture.

Its finish is an optional glossy coat, and the roughness of the diffuse base under it.
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
"""Default roughness of a coat that is added in the panel: a polished table."""
USUAL_COAT_INDEX = 1.5
SMOOTH_ROUGHNESS = 0.03
"""A coat less rough than this is treated as perfectly smooth: its lobe is narrower than a pixel."""

ROUGHNESS = Number(
    "roughness",
    None,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Roughness",
        "Of the coat: 0 is polished like glass, 0.25 a varnished table, 1 reflects to all sides.",
        reset=USUAL_ROUGHNESS,
        format="%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's coat"),
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
        format="%.3f",
        is_slider=True,
    ),
    animated=Animated("Refractive index of a receiver's coat"),
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
        format="%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's diffuse base"),
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
    """A two-sided receiver; `reflectance`, (401,) on the visible grid, overrides `reflectance_rgb`."""

    reflectance_rgb: Vec3 = (0.8, 0.8, 0.8)
    reflectance: np.ndarray | None = None
    texture: Texture | None = None
    """Multiplies `reflectance_rgb`, looked up by the mesh's texture coordinates; excludes `reflectance`."""
    roughness: float | None = None
    """Roughness of a clear dielectric coat over it, 0 to 1 (GGX's alpha is its square); None: there is no coat."""
    coat_index: float = USUAL_COAT_INDEX
    """Refractive index of the coat relative to the medium outside."""
    diffuse_roughness: float = 0.0
    """From 0, Lambertian, to 1 (`shaders/lib/rough_diffuse.glsl`); excludes `reflectance`."""

    kind: ClassVar = "diffuse"
    title: ClassVar = "Diffuse"
    gpu_code: ClassVar = 1
    receives: ClassVar = True

    @classmethod
    def read(cls, table: SceneTable, textures: TextureReader) -> Self:
        """From `colour`, with or without `texture`, or from `reflectance`, and the keys of the finish."""
        return cls._coloured(table, textures).changed(**read_finish(table))

    @classmethod
    def _coloured(cls, table: SceneTable, textures: TextureReader) -> Self:
        key = table.one_of(("colour", "reflectance"), "the colour")
        if table.one_of(("reflectance", "texture"), "the colour") == "texture":
            # The colour multiplies the picture, so the default of 1 leaves the picture unchanged.
            return cls(table.colour("colour", (1.0, 1.0, 1.0)), texture=textures.read(table))
        if key != "reflectance":
            return cls(table.colour("colour", (0.8, 0.8, 0.8)))
        inner = table.given_table(key, "{ csv = \"paint.csv\" } (an RGB goes under 'colour')")
        source, values = read_curve(inner, "values", "reflectance")
        if values.min() < 0.0 or values.max() > 1.0:
            inner.fail(source, "must hold reflectances between 0 and 1")
        inner.finish("a reflectance")
        return cls(reflectance_rgb=rgb_under_white(values), reflectance=values)

    def values(self, path: Path | None = None) -> dict[str, Any]:
        """Colour and picture, or reflectance, and finish: the keys of its table."""
        return self._colours(path) | write_fields(self.shown_numbers(), self, path)

    def _colours(self, path: Path | None) -> dict[str, Any]:
        values: dict[str, Any] = {"kind": self.kind}
        if self.reflectance is not None:
            return values | {"reflectance": {"nm": VISIBLE_NM.tolist(), "values": self.reflectance.tolist()}}
        values["colour"] = list(self.reflectance_rgb)
        image = self.texture
        if image is None:
            return values
        name = image.source or picture_name(image.rgb) if path is None else picture_file(image.rgb, image.source, path)
        return values | {"texture": {"file": name, "wrap": image.wrap}}

    @property
    def has_coat(self) -> bool:
        """A glossy coat covers its diffuse base."""
        return self.roughness is not None

    def shown_numbers(self) -> tuple[Number, ...]:
        """The numbers of its finish that apply: those of a coat only if it has one."""
        rough = (DIFFUSE_ROUGHNESS,) if self.reflectance is None else ()
        return (ROUGHNESS, COAT_INDEX, *rough) if self.has_coat else rough

    def content(self) -> tuple[object, ...]:
        """All that light depends on; the finish only where it is not the default."""
        plain = Diffuse()
        finish = (self.roughness, self.coat_index, self.diffuse_roughness)
        return super().content() + (
            () if finish == (plain.roughness, plain.coat_index, plain.diffuse_roughness) else finish
        )

    def words(self) -> str:
        """A short description for reports, with colour and finish."""
        words = "diffuse, spectral reflectance" if self.reflectance is not None else "diffuse "
        words += colour_words(self.reflectance_rgb) if self.reflectance is None else ""
        words += "" if self.texture is None else ", wears a picture"
        words += "" if self.diffuse_roughness == 0.0 else f", rough by {self.diffuse_roughness:g}"
        return words + ("" if self.roughness is None else f", a coat of roughness {self.roughness:g}")
