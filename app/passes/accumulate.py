"""Adds the scratch textures of the caustic maps to their total."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..gpu import shader
from ..gpu.framebuffers import frame_of

if TYPE_CHECKING:
    import moderngl


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
