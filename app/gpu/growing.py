"""Buffers that live as long as their owner: they are written again, and replaced only where they are too small."""

from __future__ import annotations

import moderngl
import numpy as np

from . import shader


def filled(ctx: moderngl.Context, before: moderngl.Buffer | None, data: np.ndarray) -> moderngl.Buffer:
    """A buffer that begins with `data`: `before`, unless that is too small. Then it is released, and there is room for
    twice as much."""
    data = np.ascontiguousarray(data)
    if before is None:
        return ctx.buffer(data)
    if before.size < data.nbytes:
        shader.release(before)
        before = ctx.buffer(reserve=2 * data.nbytes)
    before.write(data)
    return before
