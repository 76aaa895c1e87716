"""Adds the scratch textures of the caustic maps to their total, and assembles the maps for reading."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..gpu import shader
from ..gpu.framebuffers import frame_of

if TYPE_CHECKING:
    import moderngl

    from ..gpu.tiles import Tile
    from ..model.geometry.charts import ChartAtlas

ROWS = 16
"""Rows, and columns, of a work group."""
_GROUP = 64


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


class SeamFold:
    """Returns what fell into chart gutters to its own texels, from the total into a resolved copy.

    The gathering order is fixed, so the result is the same every time. Gutters then hold what is across their seam,
    for interpolated lookups; those beyond an open border keep what fell there, which is lost to the receiver.
    """

    def __init__(self, ctx: moderngl.Context, charts: Sequence[tuple[Tile, ChartAtlas]]) -> None:
        """Each `ChartAtlas` with its tile of the map atlas."""
        self._ctx = ctx
        gather, fill, sources, ratios = [], [], [], []
        first = 0
        for tile, chart in charts:
            corner = np.array([tile.x, tile.y], np.int64)
            destinations, offsets, gutters = chart.gather_lists()
            gather.append(np.column_stack([destinations + corner, first + offsets[:-1], np.diff(offsets)]))
            first += len(gutters)
            sources.append(gutters + corner)
            kept = chart.destination_xy[:, 0] >= 0
            fill.append(np.column_stack([chart.gutter_texel_xy[kept] + corner, chart.destination_xy[kept] + corner]))
            ratios.append(chart.fill_ratio[kept])
        self._counts = sum(map(len, gather)), sum(map(len, fill))
        self._gather_buffer = _uints(ctx, gather, 4)
        self._fill_buffer = _uints(ctx, fill, 4)
        self._source_buffer = _uints(ctx, sources, 2)
        self._ratio_buffer = ctx.buffer(np.concatenate([*ratios, np.ones(1)]).astype(np.float32))
        self._gather = shader.compute(ctx, "light/seam_fold.comp", {"WORKGROUP": _GROUP})
        self._fill = shader.compute(ctx, "light/seam_fold.comp", {"WORKGROUP": _GROUP, "FILL": 1})

    def run(self, total: Sequence[moderngl.Texture], resolved: Sequence[moderngl.Texture]) -> None:
        """All RGBA32F and of the atlas size; `total` stays as it is."""
        for source, target in zip(total, resolved, strict=True):
            copy_texture(self._ctx, source, target)
            source.bind_to_image(0, read=True, write=False)
            target.bind_to_image(1, read=True, write=True)
            self._source_buffer.bind_to_storage_buffer(1)
            self._ratio_buffer.bind_to_storage_buffer(2)
            for program, buffer, count in zip(
                (self._gather, self._fill), (self._gather_buffer, self._fill_buffer), self._counts, strict=True
            ):
                if count:
                    buffer.bind_to_storage_buffer(0)
                    program["count"].value = count
                    self._ctx.memory_barrier()
                    program.run(-(-count // _GROUP))
        self._ctx.memory_barrier()

    def release(self) -> None:
        shader.release(
            self._gather,
            self._fill,
            self._gather_buffer,
            self._fill_buffer,
            self._source_buffer,
            self._ratio_buffer,
        )


class LevelsFold:
    """Adds what is in a window's wide texels (broad splats, footprint.comp) to its fine ones, in place."""

    def __init__(self, ctx: moderngl.Context, folds: Sequence[tuple[Tile, Tile]]) -> None:
        """`folds`: (wide tile, fine tile) in the order in which they are added up."""
        self._ctx = ctx
        self._folds = folds
        self._program = shader.compute(ctx, "light/levels_fold.comp")

    def run(self, maps: Sequence[moderngl.Texture]) -> None:
        """RGBA32F textures of the atlas size."""
        for texture in maps:
            texture.bind_to_image(0, read=True, write=True)
            for wide, fine in self._folds:
                self._program["wide"].value = wide.rect
                self._program["fine"].value = fine.rect
                self._ctx.memory_barrier()
                self._program.run(-(-fine.width // 8), -(-fine.height // 8))
        self._ctx.memory_barrier()

    def release(self) -> None:
        shader.release(self._program)


def copy_texture(ctx: moderngl.Context, source: moderngl.Texture, target: moderngl.Texture) -> None:
    """Copy a whole texture to another of the same size and format."""
    ctx.memory_barrier()
    ctx.copy_framebuffer(frame_of(ctx, target), frame_of(ctx, source))


def _uints(ctx: moderngl.Context, parts: list[np.ndarray], width: int) -> moderngl.Buffer:
    """One uint32 buffer of all rows, never empty."""
    rows = np.concatenate([*(p.reshape(-1, width) for p in parts), np.zeros((1, width))])
    return ctx.buffer(np.ascontiguousarray(rows, np.uint32))
