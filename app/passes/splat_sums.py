"""Sums of splats: scratch textures that the rasteriser adds them to, and their total; a buffer that compute shaders add
them to where a device's rasteriser blends slowly."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from ..gpu import shader
from ..gpu.framebuffers import frame_of
from ..gpu.splat_way import sums_bytes, way_of
from .light_programs import sum_defines

BIND_SUMS = 2
ROWS = 16
"""Rows, and columns, of a work group."""


class Accumulate:
    """total += scratch; scratch keeps what rounding left out (under half a unit of the total's last place)."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = shader.compute(ctx, "light/accumulate.comp", {"SIDE": ROWS})

    def run(self, scratch: moderngl.Texture, total: moderngl.Texture) -> None:
        """Both RGBA32F and of one size."""
        self.run_rows(scratch, total, 0, total.height)

    def run_rows(self, scratch: moderngl.Texture, total: moderngl.Texture, first: int, rows: int) -> None:
        """`run` for some rows, a multiple of `ROWS` but for the last."""
        self._ctx.memory_barrier()
        scratch.bind_to_image(0, read=True, write=True)
        total.bind_to_image(1, read=True, write=True)
        self._program["first_row"].value = first
        self._program.run(-(-total.width // ROWS), -(-rows // ROWS))
        self._ctx.memory_barrier()

    def release(self) -> None:
        shader.release(self._program)


def copy_texture(ctx: moderngl.Context, source: moderngl.Texture, target: moderngl.Texture) -> None:
    """Copy a whole texture to another of the same size and format."""
    ctx.memory_barrier()
    ctx.copy_framebuffer(frame_of(ctx, target), frame_of(ctx, source))


class SplatSums:
    """Owns the sums of an atlas: blocks of texels for each of its targets, as `light/splat_sums.glsl` lays them out."""

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], targets: int) -> None:
        self._ctx = ctx
        self._size = size
        self._targets = targets
        way = way_of(ctx)
        self.buffer = ctx.buffer(reserve=sums_bytes(size, targets))
        defines = sum_defines(way) | {"SIDE": ROWS}
        self._program = shader.compute(ctx, "light/splat_sums.comp", defines, extensions=way.extensions)
        self.clear()

    def move(self, textures: Sequence[moderngl.Texture]) -> None:
        """Add the sums to `textures`, RGBA32F of the atlas's size, one a target; they are zero then."""
        for target, texture in enumerate(textures):
            texture.bind_to_image(0, read=True, write=True)
            self._run(target, 1, counts=True)

    def clear(self) -> None:
        """Make them zero."""
        self._run(0, self._targets, counts=False)

    def _run(self, first: int, targets: int, *, counts: bool) -> None:
        self._ctx.memory_barrier()
        self.buffer.bind_to_storage_buffer(BIND_SUMS)
        width, height = self._size
        for name, value in (("size", self._size), ("target", first), ("counts", int(counts))):
            self._program[name].value = value
        self._program.run(-(-width // ROWS), -(-height // ROWS), targets)
        self._ctx.memory_barrier()

    @property
    def bytes(self) -> int:
        """Device memory of the sums."""
        return self.buffer.size

    def release(self) -> None:
        """Free sums and program."""
        shader.release(self.buffer, self._program)
