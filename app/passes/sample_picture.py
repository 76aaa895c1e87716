"""Reads a lattice of a picture's pixels back: enough for an automatic exposure, too little to stall a frame."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.context import Context

LATTICE = (160, 90)
"""Pixels read across and down."""
_GROUP = 64
_BIND_PIXELS = 8


class SamplePicture:
    """Owns the program and the buffer that is read."""

    def __init__(self, context: Context, lattice: tuple[int, int] = LATTICE) -> None:
        self._ctx = context.ctx
        self._lattice = lattice
        self._program = shader.compute(
            self._ctx, "display/sample_picture.comp", {"GROUP": _GROUP, "BIND_PIXELS": _BIND_PIXELS}
        )
        self._pixels = self._ctx.buffer(reserve=16 * lattice[0] * lattice[1])

    def run(self, picture: moderngl.Texture) -> np.ndarray:
        """float32 (rows, columns, 3) of an RGBA32F texture, at the middles of a lattice of cells."""
        columns, rows = self._lattice
        picture.use(0)
        self._pixels.bind_to_storage_buffer(_BIND_PIXELS)
        self._program["lattice"].value = self._lattice
        self._ctx.memory_barrier()
        self._program.run(-(-columns * rows // _GROUP))
        self._ctx.memory_barrier()
        return np.frombuffer(self._pixels.read(), np.float32).reshape(rows, columns, 4)[..., :3].copy()

    def release(self) -> None:
        """Free the program and the buffer."""
        shader.release(self._program)
        self._pixels.release()
