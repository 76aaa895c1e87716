"""Framebuffers: how what is drawn is added up, and one to leave bound when others are released."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl


def park(ctx: moderngl.Context) -> None:
    """Bind a framebuffer that lives as long as the context.

    moderngl binds the last used framebuffer again after every clear; were it released meanwhile,
    that is GL_INVALID_OPERATION, and a context without a window has no screen to fall back on.
    """
    if ctx.extra is None:
        ctx.extra = ctx.simple_framebuffer((1, 1))
    ctx.extra.use()


def frame_of(ctx: moderngl.Context, texture: moderngl.Texture) -> moderngl.Framebuffer:
    """The framebuffer of a texture alone, to clear it or to copy from or to it; `shader.release` frees both."""
    if texture.extra is None:
        texture.extra = ctx.framebuffer([texture])
    return texture.extra


@contextmanager
def adding(ctx: moderngl.Context) -> Iterator[None]:
    """Within the block what is drawn is added to what there is."""
    ctx.enable_only(moderngl.BLEND)
    ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
    ctx.blend_func = moderngl.ONE, moderngl.ONE
    yield
    ctx.enable_only(moderngl.NOTHING)
