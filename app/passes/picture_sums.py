"""The camera's picture while samples are added: their sum in every pixel, and how many each row has."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.framebuffers import frame_of


class PictureSums:
    """Owns RGBA32F textures of one size, four channels each."""

    def __init__(self, ctx: moderngl.Context, targets: int) -> None:
        """`targets`: textures, made when a size is known."""
        self._ctx = ctx
        self._targets = targets
        self.textures: list[moderngl.Texture] = []
        self.samples_of_row = np.zeros(0, int)
        """(H,); in a row all pixels have as many."""

    @property
    def is_single(self) -> bool:
        """One texture holds all channels."""
        return self._targets == 1

    @property
    def size(self) -> tuple[int, int]:
        """Width and height; (0, 0) before there are any."""
        return self.textures[0].size if self.textures else (0, 0)

    @property
    def pixels(self) -> int:
        """How many there are."""
        return self.size[0] * self.size[1]

    def clear(self, width: int, height: int) -> bool:
        """Sums of 0 in a picture of this size; whether the size is new."""
        is_new = self.size != (width, height)
        if is_new:
            shader.release(*self.textures)
            self.textures = [self._ctx.texture((width, height), 4, dtype="f4") for _ in range(self._targets)]
        for texture in self.textures:
            frame_of(self._ctx, texture).clear()
        self.samples_of_row = np.zeros(height, int)
        return is_new

    def bind(self) -> None:
        """As images, from unit 0 on, to be read and written."""
        for unit, texture in enumerate(self.textures):
            texture.bind_to_image(unit, read=True, write=True)

    def mean(self) -> np.ndarray:
        """Sums over the samples of their row, float32 (H, W, 4·targets); row 0 on top."""
        if not self.textures:
            raise RuntimeError("the camera pass has not run yet")
        width, height = self.size
        sums = np.empty((height, width, 4 * len(self.textures)), np.float32)
        layer = np.empty((height, width, 4), np.float32)
        for t, texture in enumerate(self.textures):
            texture.read_into(layer)
            sums[:, :, 4 * t : 4 * t + 4] = layer
        sums /= np.maximum(self.samples_of_row, 1).astype(np.float32)[:, None, None]
        return sums

    def release(self) -> None:
        """Free the textures."""
        shader.release(*self.textures)
        self.textures = []
