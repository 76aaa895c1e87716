"""All receivers' caustic maps as tiles of one texture, and the sums kept in it.

Splats are added to a scratch texture, or to sums in a buffer, and from there to the total after fixed numbers of
photons: a float32 sum of a million small numbers loses digits that a sum of sums keeps.
"""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.framebuffers import frame_of, park
from ..gpu.records import NONE, PLACEMENT
from ..gpu.tiles import Tile
from .splat_sums import Accumulate, SplatSums

KIND_FLAT, KIND_CHART, KIND_PICTURE = 0, 1, 2


def placement_rows(
    tile: Tile, world_to_texel: np.ndarray, texel_area: np.ndarray | float, rects: np.ndarray | None = None
) -> np.ndarray:
    """Placements: `world_to_texel` maps GPU space to the tile's own texels, (n, 2, 4) of charts, one a triangle, (2, 4)
    of a flat window, (3, 4) of one on a picture's pixels, whose texels are the first two rows' over the last one's.

    `rects` (n, 4): the part of the tile each may draw to, in its own texels; None is all of it.
    `texel_area`: scene unit², where the last row is 1. Returns PLACEMENT records whose `next` is NONE.
    """
    rows = np.asarray(world_to_texel, np.float64)
    flat = rows.ndim == 2
    rows = rows.reshape(-1, *rows.shape[-2:])
    weight = rows[:, 2] if rows.shape[1] == 3 else np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(rows), 4))
    records = PLACEMENT.zeros(len(rows))
    records["row_u"], records["row_v"] = rows[:, 0] + tile.x * weight, rows[:, 1] + tile.y * weight
    records["row_w"] = weight
    whole = np.array([[0.0, 0.0, tile.width, tile.height]])
    records["rect"] = (whole if rects is None else np.asarray(rects, np.float64)) + (tile.x, tile.y, tile.x, tile.y)
    records["texel_area"] = texel_area
    records["next"] = NONE
    records["blurred"] = NONE
    records["kind"] = KIND_CHART if not flat else KIND_PICTURE if rows.shape[1] == 3 else KIND_FLAT
    return records


class MapAtlas:
    """The textures of the caustic maps: RGBA32F of one size, `targets` totals and scratch textures for the first of
    them."""

    def __init__(
        self,
        ctx: moderngl.Context,
        size: tuple[int, int],
        placements: np.ndarray,
        targets: int = 1,
        scratched: int | None = None,
    ) -> None:
        """`size` from `pack`; `placements`: PLACEMENT records, indexed by the receivers. `scratched`: targets that have
        a scratch texture, None for all; splats are added to the others' totals at once, which is right to about
        1e-4."""
        self.ctx = ctx
        self.size = size
        self.targets = targets
        self.placements = (
            ctx.buffer(np.ascontiguousarray(placements)) if len(placements) else ctx.buffer(reserve=PLACEMENT.stride)
        )
        self.total_textures = [self._texture() for _ in range(targets)]
        self.scratch_textures = [self._texture() for _ in range(targets if scratched is None else scratched)]
        self._framebuffer = ctx.framebuffer(self.drawn_into)
        self.has_totals = False
        """The totals hold something; else they may hold anything, and count as zero."""
        self.is_drawn = False
        """Something was drawn since `clear`: scratch textures hold what is pending, and what totals left of it."""
        self.is_added = False
        """The sums hold something."""
        self._accumulate = Accumulate(ctx)
        self._sums: SplatSums | None = None
        self.pending = 0
        """Photons in the scratch textures and sums."""
        self.contact_words: moderngl.Texture | None = None
        """Words of `contact_lines`, where maps have such lines; the atlas's own."""
        self.borders: moderngl.Texture | None = None
        """Receivers' `borders`, where light lands near them; the atlas's own."""
        self._framebuffer.clear()

    def _texture(self) -> moderngl.Texture:
        texture = self.ctx.texture(self.size, 4, dtype="f4")
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return texture

    @property
    def drawn_into(self) -> list[moderngl.Texture]:
        """What splats are added to: a texture for each target, in their order."""
        return self.scratch_textures + self.total_textures[len(self.scratch_textures) :]

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """To draw into: a texture for each target, in their order."""
        if len(self.scratch_textures) < self.targets:
            self.ready_totals()
        self.is_drawn = True
        return self._framebuffer

    @property
    def sums(self) -> SplatSums:
        """What compute shaders add splats to; made when it is first needed."""
        if self._sums is None:
            self._sums = SplatSums(self.ctx, self.size, self.targets)
        return self._sums

    def ready_totals(self) -> None:
        """Totals can be added to, read and written; what compute shaders added is in them."""
        if not self.has_totals:
            for texture in self.total_textures:
                frame_of(self.ctx, texture).clear()
            self.has_totals = True
        if self._sums is not None and self.is_added:
            self._sums.move(self.total_textures)
            self.is_added = False

    def flush(self) -> None:
        """Add all that is pending to the totals."""
        self.ready_totals()
        if self.pending and self.is_drawn:
            for scratch, total in zip(self.scratch_textures, self.total_textures, strict=False):
                self._accumulate.run(scratch, total)
        self.pending = 0

    def settle(self) -> None:
        """Flush for the last time: nothing is added any more, and the scratch textures are given back."""
        self.flush()
        park(self.ctx)
        shader.release(self._framebuffer, *self.scratch_textures)
        self.scratch_textures = []
        self._release_sums()

    def _release_sums(self) -> None:
        if self._sums is not None:
            self._sums.release()
            self._sums = None

    @property
    def bytes(self) -> int:
        """Device memory of the textures, and of the sums that go to them."""
        width, height = self.size
        return 16 * width * height * len(self.total_textures) + self.scratch_bytes

    @property
    def scratch_bytes(self) -> int:
        """The part of `bytes` that only adding takes."""
        width, height = self.size
        return 16 * width * height * len(self.scratch_textures) + (self._sums.bytes if self._sums is not None else 0)

    def clear(self) -> None:
        """Forget everything deposited."""
        if self.is_drawn:
            self._framebuffer.clear()
        if self._sums is not None and self.is_added:
            self._sums.clear()
        self.has_totals = self.is_drawn = self.is_added = False
        self.pending = 0

    def read_total(self) -> np.ndarray:
        """Everything deposited so far: float32 (height, width, 4 · targets), row 0 at texel y = 0."""
        self.flush()
        self.ctx.memory_barrier()
        width, height = self.size
        layers = []
        for texture in self.total_textures:
            layer = np.empty((height, width, 4), np.float32)
            texture.read_into(layer)
            layers.append(layer)
        return np.concatenate(layers, axis=-1) if len(layers) > 1 else layers[0]

    def read_tile(self, tile: Tile) -> np.ndarray:
        """One tile of `read_total`: float32 (tile.height, tile.width, 4 · targets)."""
        x0, y0, x1, y1 = tile.rect
        return self.read_total()[y0:y1, x0:x1]

    def release(self) -> None:
        self._release_sums()
        park(self.ctx)
        shader.release(
            self._framebuffer,
            self._accumulate,
            *self.scratch_textures,
            *self.total_textures,
            self.placements,
        )
        shader.release(self.contact_words, self.borders)
