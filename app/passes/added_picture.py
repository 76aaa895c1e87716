"""A picture that is drawn once for a view and added to the camera's sums with every sample."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from ..gpu import shader
from ..gpu.framebuffers import adding, park


class AddedPicture:
    """Owns RGBA32F textures of one size, four channels each, and the program that adds them to others."""

    def __init__(self, ctx: moderngl.Context, targets: int) -> None:
        """`targets`: textures, made when a size is known."""
        self._ctx = ctx
        self._targets = targets
        self._program = shader.program(
            ctx, "camera/add_picture.vert", "camera/add_picture.frag", {"TARGETS": targets}, ()
        )
        self._triangle = ctx.vertex_array(self._program, [])
        self.textures: list[moderngl.Texture] = []

    def clear(self, size: tuple[int, int]) -> None:
        """Black, in this size."""
        if not self.textures or self.textures[0].size != size:
            self._release_textures()
            self.textures = [self._ctx.texture(size, 4, dtype="f4") for _ in range(self._targets)]
        zeros = bytes(16 * size[0] * size[1])
        for texture in self.textures:
            texture.write(zeros)

    def add(self, sums: Sequence[moderngl.Texture], first_row: int, rows: int) -> None:
        """Add what was drawn to these rows of other textures of the same size."""
        framebuffer = self._ctx.framebuffer(list(sums))
        framebuffer.use()
        framebuffer.scissor = 0, first_row, framebuffer.size[0], rows
        for unit, texture in enumerate(self.textures):
            texture.use(unit)
        with adding(self._ctx):
            self._triangle.render(moderngl.TRIANGLES, 3)
        park(self._ctx)
        framebuffer.release()

    def _release_textures(self) -> None:
        shader.release(*self.textures)
        self.textures = []

    def release(self) -> None:
        """Free everything."""
        self._triangle.release()
        shader.release(self._program)
        self._release_textures()
