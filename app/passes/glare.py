"""Veiling glare on the device: the picture of the window with the light that a lens scatters (`base.glare`).

Octaves are shrunk copies of the picture; each adds its equal part on the way back up, where it is spread by as much
as its texels are wide. What a step reads is black beyond its border, as there.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from ..base.glare import OCTAVES, WIDEST
from ..gpu import shader
from ..gpu.context import Context

_SPREAD = 1.3
"""Standard deviation of an octave on its way back, texels of it: its own tent, its wider neighbours' and the shrinking
(measured, `tests/gpu/test_glare_pass.py`)."""
_GROUP = 32, 8


@dataclass(frozen=True)
class Halo:
    """What a lens makes of a picture: `kept` of it, and `light`, softened (shaders/display/softened.glsl)."""

    kept: float
    light: moderngl.Texture


class Glare:
    """Owns the programs, made when first needed, and the textures."""

    def __init__(self, context: Context) -> None:
        self._context, self._ctx = context, context.ctx
        self._programs: dict[tuple[str | int, ...], moderngl.ComputeShader] = {}
        self._sampler = self._ctx.sampler(filter=(moderngl.LINEAR, moderngl.LINEAR))
        self._sampler.border_color = (0.0, 0.0, 0.0, 0.0)
        self._textures: dict[tuple[str, int], moderngl.Texture] = {}

    def run(self, picture: moderngl.Texture, share: float, *, in_motion: bool = False) -> moderngl.Texture:
        """`picture` (RGBA32F, linear) of which the lens scatters `share`; itself where that is 0. The texture stays
        valid until the next call.

        `in_motion`: the light of the finest octave, a halo of two pixels at 540 rows, stays where it is; it alone costs
        a software renderer as much as all the rest of it."""
        if share <= 0.0:
            return picture
        halo = self.halo(picture, share, in_motion=in_motion)
        return self._step("JOIN", 0, picture.size, (picture, halo.light), 1.0 - halo.kept)

    def halo(self, picture: moderngl.Texture, share: float, *, in_motion: bool = False) -> Halo:
        """What `run` adds to the picture, for `Display.run` to add: joining takes a software
        renderer longer than finding it. Valid until the next call."""
        # Rows of the finest octave, whose texels are as wide as its Gaussian.
        rows = _SPREAD / WIDEST * 2.0 ** (OCTAVES - 1)
        octaves, finer = range(1 if in_motion else 0, OCTAVES), picture
        if in_motion:
            # Means of whole pixels: many lookups between them for each of the larger texels would take as long.
            finer = self._step("HALVE", 0, (-(-picture.width // 2), -(-picture.height // 2)), (picture, picture))
        shrunk: dict[int, moderngl.Texture] = {}
        for octave in octaves:
            height = max(1, round(rows / 2**octave))
            size = max(1, round(height * picture.width / picture.height)), height
            finer = shrunk[octave] = self._step("SHRINK", octave, size, (finer, finer))
        softened = self._texture(("EMPTY", 0), (1, 1))
        for octave in reversed(octaves):
            of = shrunk[octave]
            spread = self._step("SPREAD", octave, of.size, (of, softened), share / OCTAVES)
            ring = spread.width + 2, spread.height + 2
            softened = self._step("SOFTEN", octave, ring, (spread, spread))
        return Halo(1.0 - share * len(octaves) / OCTAVES, softened)

    def release(self) -> None:
        """Free everything."""
        shader.release(*self._programs.values(), self._sampler, *self._textures.values())
        self._programs.clear()
        self._textures.clear()

    def _step(
        self,
        step: str,
        octave: int,
        size: tuple[int, int],
        read: tuple[moderngl.Texture, moderngl.Texture],
        share: float = 0.0,
    ) -> moderngl.Texture:
        finer = zip(read[0].size, size, strict=True)
        taps = tuple(-(-fine // side) for fine, side in finer) if step == "SHRINK" else ()
        if (step, *taps) not in self._programs:
            defines = {step: 1} | dict(zip(("TAPS_ACROSS", "TAPS_DOWN"), taps, strict=False))
            self._programs[step, *taps] = shader.compute(self._ctx, "display/glare.comp", defines)
        program, made = self._programs[step, *taps], self._texture((step, octave), size)
        if "share" in program:
            program["share"].value = share
        self._ctx.memory_barrier()
        for unit, texture in enumerate(read):
            texture.use(unit)
            self._sampler.use(unit)
        made.bind_to_image(0, read=False, write=True)
        read[0].bind_to_image(1, read=True, write=False)
        program.run(-(-size[0] // _GROUP[0]), -(-size[1] // _GROUP[1]))
        for unit in (0, 1):
            self._sampler.clear(unit)
        self._ctx.memory_barrier()
        self._context.check("the glare pass")
        return made

    def _texture(self, key: tuple[str, int], size: tuple[int, int]) -> moderngl.Texture:
        texture = self._textures.get(key)
        if texture is None or texture.size != size:
            shader.release(texture)
            texture = self._textures[key] = self._ctx.texture(size, 4, bytes(16 * size[0] * size[1]), dtype="f4")
        return texture
