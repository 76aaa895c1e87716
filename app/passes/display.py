"""From the linear picture to the 8-bit texture that the window shows; two pictures where they are compared.

Nothing here changes light: exposure, tone curves, false colour and the error map are ways to look at it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import moderngl
import numpy as np

from ..base.colour_maps import ERROR, FALSE_COLOUR, glsl_table
from ..edit.state import Compare
from ..edit.state import Display as Settings
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.schema import Field, Struct
from .glare import Halo

DISPLAY_PARAMETERS = Struct(
    "DisplayParameters",
    (
        Field("origin", "vec2", "texture coordinate of the output's corner"),
        Field("step_uv", "vec2", "texture coordinates an output pixel covers"),
        Field("beside_px", "vec2", "output pixels to the pixel beside one: one of the picture's where that is larger"),
        Field("false_stops", "vec2", "ends of the false-colour scale, stops about display white"),
        Field("gain", "float", "2^exposure"),
        Field("wipe_px", "float", "place of the wipe's line"),
        Field("error_floor", "float", "reference below which errors count less, share of display white"),
        Field("error_range", "float", "relative error at the ends of the scale"),
    ),
)
Shows = Literal["picture", "other", "wipe", "error"]
ERROR_RANGE = 0.5
"""Relative error at the ends of the error map's scale."""
ERROR_FLOOR = 0.02
"""Share of display white added to the reference's brightness there: what is nearly black on the screen is not called
wrong."""
NEAREST_FROM = 4.0
"""Enlarged more than this, pixels are shown as squares."""
_MAX_TAPS = 4
_GROUP = 32, 8
"""Wide: a software renderer dispatches groups one by one."""
_ROWS = 16
_HALO = 2
"""Texture unit."""
_SHOWN_IMAGE = 1
"""Image unit."""


@dataclass(frozen=True)
class _Variant:
    """What a program is made for."""

    tone: str
    """A tone curve, or "false_colour"; unused in the error map."""
    shows: Shows
    taps: int
    """Lookups along a side of an output pixel."""
    antialias: bool
    """Whether edges of what is overexposed have no steps."""
    same_size: bool = False
    """Output pixels are the picture's."""
    enlarged: bool = True
    """Output pixels are smaller than the picture's."""
    has_halo: bool = False
    """Glare is added on the way."""
    as_image: bool = False
    """Pixels are read by `imageLoad` (`DeviceTraits.texels_as_images`); only of a picture alone, pixel for pixel."""

    @property
    def rows(self) -> int:
        """Pixels of a column that an invocation develops."""
        return _ROWS if self.shows in ("picture", "other") else 1

    def defines(self) -> dict[str, int | str]:
        table = ERROR if self.shows == "error" else FALSE_COLOUR
        antialias = self.antialias and self.tone != "false_colour" and self.shows == "picture"
        return {
            **({"ROWS": self.rows} if self.rows > 1 else {}),
            **({"ANTIALIAS": 1} if antialias else {}),
            **({"AS_IMAGE": 1} if self.as_image else {}),
            **({"SAME_SIZE": 1} if self.same_size else {}),
            **({"HALO": 1} if self.has_halo else {}),
            **({} if self.enlarged else {"BESIDE_IS_NEXT": 1}),
            "COLOUR_TABLE": glsl_table(table),
            "TAPS": self.taps,
            f"TONE_{self.tone.upper()}": 1,
            f"SHOW_{self.shows.upper()}": 1,
        }


class Display:
    """Owns the programs, made when first needed, and the textures they write; a texture stays valid until the next call
    that writes it."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._ctx = context.ctx
        self._programs: dict[_Variant, moderngl.ComputeShader] = {}
        self._parameters = self._ctx.buffer(reserve=DISPLAY_PARAMETERS.stride)
        self._samplers = {
            kind: self._ctx.sampler(repeat_x=False, repeat_y=False, filter=(kind, kind))
            for kind in (moderngl.NEAREST, moderngl.LINEAR)
        }
        self._outputs: dict[str, moderngl.Texture] = {}

    def run(
        self,
        picture: moderngl.Texture,
        settings: Settings,
        exposure_ev: float,
        size: tuple[int, int],
        other: moderngl.Texture | None = None,
        compare: Compare | None = None,
        antialias: bool = False,
        halo: Halo | None = None,
    ) -> moderngl.Texture:
        """`picture` (RGBA32F, linear Rec.709, row 0 on top) as an RGBA8 texture of `size` (width, height), sRGB codes,
        row 0 on top.

        `exposure_ev` is absolute (as `tone_map.to_display` takes it). `other` is what `compare` shows beside it, over
        it or takes the error against; without it the picture alone is shown. `antialias`: see `base.highlights`; of a
        picture that is shown alone. `halo`: glare, of a picture that is shown alone, pixel for pixel and not
        antialiased.
        """
        parameters = self._develop(settings, exposure_ev)
        parameters["step_uv"] = 1.0 / size[0], 1.0 / size[1]
        parameters["beside_px"] = np.maximum(np.array(size, float) / picture.size, 1.0)
        shows: Shows = "picture"
        if other is not None and compare is not None:
            shows = _shown(compare)
            parameters["wipe_px"] = np.clip(compare.wipe, 0.0, 1.0) * size[0]
        if shows == "other" and other is not None:
            picture = other
        shrunk = max(picture.width / size[0], picture.height / size[1])
        taps = int(np.clip(np.ceil(shrunk - 0.01), 1, _MAX_TAPS))
        enlarged = max(size[0] / picture.width, size[1] / picture.height)
        same_size = picture.size == size
        if halo is not None and not (same_size and shows == "picture" and not antialias):
            raise ValueError("glare is added on the way to a picture alone, pixel for pixel and not antialiased")
        as_image = same_size and shows == "picture" and self._context.traits.texels_as_images
        sizes = same_size, enlarged > 1.0
        variant = _Variant(_tone(settings), shows, taps, antialias, *sizes, halo is not None, as_image)
        # Pixel for pixel nothing is blended, so that one broken pixel stays one.
        nearest = enlarged > NEAREST_FROM or same_size
        return self._dispatch("picture", variant, parameters, (picture, other or picture), size, nearest, halo)

    def magnify(
        self,
        picture: moderngl.Texture,
        pixel: tuple[int, int],
        settings: Settings,
        exposure_ev: float,
        zoom: int = 12,
        pixels: int = 15,
        antialias: bool = False,
    ) -> moderngl.Texture:
        """`pixels`² pixels of `picture` about `pixel` (column, row from the top), each `zoom`² large, as `run` would
        show them.

        Beyond the border the outermost pixels go on.
        """
        parameters = self._develop(settings, exposure_ev)
        corner = np.array(pixel, float) - (pixels - 1) / 2
        parameters["origin"] = corner / picture.size
        parameters["step_uv"] = 1.0 / (zoom * np.array(picture.size, float))
        parameters["beside_px"] = zoom
        variant = _Variant(_tone(settings), "picture", 1, antialias)
        return self._dispatch(
            "magnifier", variant, parameters, (picture, picture), (pixels * zoom, pixels * zoom), nearest=True
        )

    def reload(self) -> None:
        """Compile the programs from disk again; raises `ShaderError` and keeps all of them when one does not
        compile."""
        fresh: dict[_Variant, moderngl.ComputeShader] = {}
        try:
            for variant in self._programs:
                fresh[variant] = self._compiled(variant)
        except shader.ShaderError:
            for program in fresh.values():
                shader.release(program)
            raise
        for program in self._programs.values():
            shader.release(program)
        self._programs = fresh

    def release(self) -> None:
        """Free programs, buffers and textures."""
        shader.release(*self._programs.values(), self._parameters, *self._samplers.values(), *self._outputs.values())
        self._programs.clear()
        self._outputs.clear()

    def _develop(self, settings: Settings, exposure_ev: float) -> np.ndarray:
        """Parameters that only the settings decide."""
        parameters = DISPLAY_PARAMETERS.zeros(1)
        parameters["gain"] = 2.0 ** float(np.clip(exposure_ev, -60.0, 60.0))
        low, high = settings.false_colour_stops
        parameters["false_stops"] = low, max(high, low + 0.01)
        parameters["error_floor"], parameters["error_range"] = ERROR_FLOOR, ERROR_RANGE
        return parameters

    def _dispatch(
        self,
        name: str,
        variant: _Variant,
        parameters: np.ndarray,
        pictures: tuple[moderngl.Texture, moderngl.Texture],
        size: tuple[int, int],
        nearest: bool,
        halo: Halo | None = None,
    ) -> moderngl.Texture:
        output = self._output(name, size)
        self._parameters.write(parameters.tobytes())
        self._parameters.bind_to_uniform_block(0)
        sampler = self._samplers[moderngl.NEAREST if nearest else moderngl.LINEAR]
        self._ctx.memory_barrier()
        for unit, texture in enumerate(pictures):
            texture.use(unit)
            sampler.use(unit)
        output.bind_to_image(0, read=False, write=True)
        if variant.as_image:
            pictures[0].bind_to_image(_SHOWN_IMAGE, read=True, write=False)
        program = self._program(variant)
        if halo is not None:
            halo.light.use(_HALO)
            self._samplers[moderngl.LINEAR].use(_HALO)
            program["kept"].value = halo.kept
        program.run(-(-size[0] // _GROUP[0]), -(-size[1] // (_GROUP[1] * variant.rows)))
        for unit in (0, 1, _HALO):
            sampler.clear(unit)
        self._ctx.memory_barrier()
        self._context.check("the display pass")
        return output

    def _program(self, variant: _Variant) -> moderngl.ComputeShader:
        if variant not in self._programs:
            self._programs[variant] = self._compiled(variant)
        return self._programs[variant]

    def _compiled(self, variant: _Variant) -> moderngl.ComputeShader:
        return shader.compute(self._ctx, "display/display.comp", variant.defines(), [DISPLAY_PARAMETERS])

    def _output(self, name: str, size: tuple[int, int]) -> moderngl.Texture:
        texture = self._outputs.get(name)
        if texture is None or texture.size != size:
            shader.release(texture)
            texture = self._outputs[name] = self._ctx.texture(size, 4, dtype="f1")
            texture.repeat_x = texture.repeat_y = False
        return texture


def _tone(settings: Settings) -> str:
    return "false_colour" if settings.false_colour else settings.tone


def _shown(compare: Compare) -> Shows:
    if compare.holding:
        return "other"
    match compare.mode:
        case "off" | "hold":
            return "picture"
        case mode:
            return mode
