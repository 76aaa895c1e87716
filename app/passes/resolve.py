"""From the sums of a map atlas to the maps that are read: wide texels added to fine ones, seams of charts folded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from ..features.program_switches import Defines, switched
from ..gpu import shader
from ..gpu.splat_way import way_of
from ..gpu.tiles import Tile
from ..model.geometry.charts import ChartAtlas
from .light_programs import sum_defines
from .map_atlas import MapAtlas
from .splat_sums import BIND_SUMS, copy_texture

_SIDE, _WORKGROUP = 16, 64
_ACROSS = 32768
"""Work groups of a row of a dispatch."""
_IMAGES = 8
"""Image units of a program."""


class Resolve:
    """Reads what an atlas holds, be it in totals or still in sums or scratch textures, and changes nothing there.

    Of curved receivers gutters then hold what is across their seam, for interpolated lookups; those beyond an open
    border keep what fell there, which is lost to the receiver. The order in which is added is fixed.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        targets: int,
        tiles: Sequence[Tile],
        folds: Sequence[tuple[Tile, Tile, int]],
        charts: Sequence[tuple[Tile, ChartAtlas]],
        by_compute: bool,
    ) -> None:
        """`tiles` that are read; `folds` as `MapLayout` has them; each `ChartAtlas` with its tile."""
        self._ctx = ctx
        way = way_of(ctx)
        self._reads_sums, self._reads_scratch = way.in_bulk and by_compute, way.in_bulk and not by_compute
        self._at_once = min(targets, _IMAGES // (3 if self._reads_scratch else 2)) if way.in_bulk else 1
        defines: Defines = {"AT_ONCE": self._at_once, "SCRATCH_AT": 2 * self._at_once}
        defines |= switched(FROM_SUMS=self._reads_sums, FROM_SCRATCH=self._reads_scratch) | sum_defines(way)
        extensions = way.extensions if self._reads_sums else ()
        words, self._groups = tile_words(tiles, {fine: (wide, parts) for wide, fine, parts in folds})
        self._tiles = ctx.buffer(words)
        self._folds: Sequence[tuple[Tile, Tile, int]] = ()
        if way.in_bulk:
            self._program = shader.compute(ctx, "light/resolve.comp", defines | {"SIDE": _SIDE}, extensions=extensions)
        else:
            # Invocations that wait for each other cost a software renderer ten times as much.
            self._folds, self._program = folds, shader.compute(ctx, "light/levels_fold.comp")
        seams, gutters = seam_words(charts)
        self._seam_count = len(seams)
        self._seam_program: moderngl.ComputeShader | None = None
        self._seams: tuple[moderngl.Buffer, ...] = ()
        if len(seams):
            defines |= switched(SEAMS=True) | {"WORKGROUP": _WORKGROUP}
            self._seam_program = shader.compute(ctx, "light/resolve.comp", defines, extensions=extensions)
            self._seams = ctx.buffer(seams), ctx.buffer(gutters)

    def run(self, atlas: MapAtlas, resolved: Sequence[moderngl.Texture]) -> None:
        """`resolved`: RGBA32F of the atlas's size, a target each; without charts they may be the totals themselves."""
        scratched = len(atlas.scratch_textures) if self._reads_scratch and atlas.is_drawn else 0
        is_summed = self._reads_sums and atlas.is_added
        parts = int(atlas.has_totals) + 2 * is_summed + 4 * scratched
        self._ctx.memory_barrier()
        for first in range(0, len(resolved), self._at_once):
            own = range(first, min(first + self._at_once, len(resolved)))
            for unit, target in enumerate(own):
                atlas.total_textures[target].bind_to_image(unit, read=True, write=False)
                resolved[target].bind_to_image(self._at_once + unit, read=False, write=True)
                if target < scratched:
                    atlas.scratch_textures[target].bind_to_image(2 * self._at_once + unit, read=True, write=False)
            if is_summed:
                atlas.sums.buffer.bind_to_storage_buffer(BIND_SUMS)
            if way_of(self._ctx).in_bulk:
                self._dispatch(self._program, (self._tiles,), first, parts, self._groups, len(own))
            elif resolved[first] is not atlas.total_textures[first]:
                copy_texture(self._ctx, atlas.total_textures[first], resolved[first])
            if self._seam_program is not None:
                self._ctx.memory_barrier()
                self._dispatch(self._seam_program, self._seams, first, parts, self._seam_count, len(own))
            for wide, fine, parts in self._folds:
                resolved[first].bind_to_image(0, read=True, write=True)
                self._program["wide"].value, self._program["fine"].value = wide.rect, fine.rect
                self._program["even_parts"].value = parts
                self._ctx.memory_barrier()
                self._program.run(-(-fine.width // 8), -(-fine.height // 8))
        self._ctx.memory_barrier()

    def _dispatch(
        self,
        program: moderngl.ComputeShader,
        buffers: Sequence[moderngl.Buffer],
        first: int,
        parts: int,
        count: int,
        targets: int,
    ) -> None:
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        for name, value in (("first_target", first), ("parts", parts), ("count", count)):
            if name in program:
                program[name].value = value
        groups = -(-count // (_WORKGROUP if program is self._seam_program else 1))
        program.run(min(groups, _ACROSS), -(-groups // _ACROSS), targets)

    def release(self) -> None:
        """Free programs and buffers."""
        shader.release(self._program, self._seam_program, self._tiles, *self._seams)


def tile_words(tiles: Sequence[Tile], wider: Mapping[Tile, tuple[Tile, int]]) -> tuple[np.ndarray, int]:
    """What the program reads of each tile (int32, rows of four), and the number of its work groups."""
    rows: list[tuple[int, int, int, int]] = []
    groups = 0
    for i, tile in enumerate(tiles):
        levels = [tile]
        while levels[-1] in wider:
            levels.append(wider[levels[-1]][0])
        across, down = -(-tile.width // _SIDE), -(-tile.height // _SIDE)
        following = len(rows) + 1 + len(levels) if i + 1 < len(tiles) else 0
        _, parts = wider.get(tile, (tile, 0))
        rows += [(groups, across, len(levels) - 1 | parts << 8, following), *(level.rect for level in levels)]
        groups += across * down
    return np.array(rows or [(0, 1, 0, 0)], np.int32), groups


_SEAM = np.dtype([("texel", "i4", 2), ("share", "f4"), ("first", "u4"), ("home", "i4", 2), ("count", "u4", 2)])


def seam_words(charts: Sequence[tuple[Tile, ChartAtlas]]) -> tuple[np.ndarray, np.ndarray]:
    """Texels that get what others hold, homes of gutters' energy before the gutters; and the gutters (n, 2)."""
    seams, gutters, first = [], [], 0
    for tile, chart in charts:
        corner = np.array([tile.x, tile.y], np.int64)
        homes, offsets, sources = chart.gather_lists()
        gather, fill = np.zeros(len(homes), _SEAM), np.zeros(np.count_nonzero(chart.destination_xy[:, 0] >= 0), _SEAM)
        gather["texel"] = gather["home"] = homes + corner
        gather["share"], gather["first"], gather["count"][:, 0] = 1.0, first + offsets[:-1], np.diff(offsets)
        kept = chart.destination_xy[:, 0] >= 0
        of_home = np.searchsorted(_flat(homes, chart), _flat(chart.destination_xy[kept], chart))
        for name in ("home", "first", "count"):
            fill[name] = gather[name][of_home]
        fill["texel"], fill["share"] = chart.gutter_texel_xy[kept] + corner, chart.fill_ratio[kept]
        seams += [gather, fill]
        gutters.append(sources + corner)
        first += len(sources)
    none = np.zeros(0, _SEAM), np.zeros((0, 2))
    return np.concatenate([none[0], *seams]), np.concatenate([none[1], *gutters]).astype(np.int32)


def _flat(xy: np.ndarray, chart: ChartAtlas) -> np.ndarray:
    return xy[:, 1].astype(np.int64) * chart.width + xy[:, 0]
