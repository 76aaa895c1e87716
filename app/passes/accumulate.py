"""Adds the scratch textures of the caustic maps to their total, and folds chart seams."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.gpu import shader

if TYPE_CHECKING:
    import moderngl

_SIDE = 16


class Accumulate:
    """total += scratch; scratch = 0."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = shader.compute(ctx, "accumulate.comp", {"SIDE": _SIDE})

    def run(self, scratch: moderngl.Texture, total: moderngl.Texture) -> None:
        """Both RGBA32F and of one size."""
        self._ctx.memory_barrier()
        scratch.bind_to_image(0, read=True, write=True)
        total.bind_to_image(1, read=True, write=True)
        width, height = total.size
        self._program.run(-(-width // _SIDE), -(-height // _SIDE))
        self._ctx.memory_barrier()

    def release(self) -> None:
        self._program.release()
