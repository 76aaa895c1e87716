"""The caustic maps of a scene laid out in one way: what splats are added to, and what is read of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from ..features.features import Features
from ..gpu import shader
from ..gpu.framebuffers import frame_of
from ..gpu.records import RECEIVER
from ..gpu.shader import Releasable
from ..gpu.splat_way import way_of
from ..gpu.tiles import Tile
from ..passes.border_maps import border_rows, border_texture, inside_share
from ..passes.caustic_maps import CausticMaps
from ..passes.contact_lines import read_words, seen_shares
from ..passes.map_atlas import MapAtlas
from ..passes.map_layout import MapLayout, Window
from ..passes.picture_window import PictureWindow
from ..passes.resolve import Resolve
from ..passes.splat import Splatter
from ..passes.splat_sums import copy_texture

_ROWS = 256
"""Rows of a map that are read at once."""


class LightMaps:
    """Owns atlas, splat pass and resolved textures of one layout; empty at first."""

    def __init__(
        self,
        ctx: moderngl.Context,
        layout: MapLayout,
        features: Features,
        contact_words: moderngl.Texture | None = None,
    ) -> None:
        """`contact_words` (`passes.contact_lines`) becomes the maps' own."""
        self._ctx = ctx
        self.layout = layout
        # Only the layout says which windows pay: without them no splat is drawn twice.
        self.features = replace(
            features,
            nested_windows=max([1, *map(len, layout.windows.values())]) - 1,
            contact_lines=contact_words is not None,
            border_images=features.border_images and bool(layout.borders),
        )
        self.splatter = self._new_splatter()
        # Tents only say how XYZ are shared out over the spectrum.
        scratched = 1 if features.map_tents else None
        self.atlas = MapAtlas(ctx, layout.size, layout.placements, features.targets, scratched)
        self.atlas.contact_words = contact_words
        if self.features.border_images:
            self.atlas.borders = border_texture(ctx, layout)
        self.receivers = ctx.buffer(
            np.ascontiguousarray(layout.receivers if len(layout.receivers) else RECEIVER.zeros(1)).tobytes()
        )
        self.photon_weight = 0.0
        """What was deposited is energy times this."""
        self._resolved: list[moderngl.Texture] = []
        self._is_settled = False
        self._in_bulk = way_of(ctx).in_bulk
        self._resolve = Resolve(
            ctx,
            features.targets,
            [tile for tiles in layout.tiles.values() for tile in tiles],
            layout.folds,
            [(layout.tiles[r][0], charts) for r, charts in layout.charts.items()],
            self.splatter.by_compute,
        )

    def follow(self, layout: MapLayout) -> bool:
        """Be laid out as `layout`, of the same tiles, from now on. False, and nothing done, where borders are others in
        number."""
        counts, before = ({r: len(b) for r, b in of.borders.items()} for of in (layout, self.layout))
        if counts != before:
            return False
        if layout is not self.layout:
            self.layout = layout
            self.atlas.placements.write(layout.placements)
            if self.atlas.borders is not None:
                self.atlas.borders.write(border_rows(layout))
        return True

    def take(self, features: Features) -> None:
        """Splat from now on with other features of the same layout (the brush came or went)."""
        self.splatter.release()
        known = {name: getattr(self.features, name) for name in ("nested_windows", "contact_lines", "border_images")}
        self.features = features.changed(**known)
        self.splatter = self._new_splatter()

    def _new_splatter(self) -> Splatter:
        by_compute = way_of(self._ctx).for_maps(self.layout.size, self.features.targets)
        return Splatter(self._ctx, self.features, by_compute)

    def clear(self) -> None:
        """Forget what was deposited and counted."""
        self.photon_weight = 0.0
        self.atlas.clear()
        self.splatter.footprints.reset_counts()

    def copied_sums(self, into: Sequence[moderngl.Texture] | None = None) -> list[moderngl.Texture]:
        """What was summed, in textures of the caller's; `into`: those of an earlier call."""
        self.atlas.flush()
        total = self.atlas.total_textures
        copies = list(into) if into is not None else [self._ctx.texture(self.atlas.size, 4, dtype="f4") for _ in total]
        for source, target in zip(total, copies, strict=True):
            copy_texture(self._ctx, source, target)
        return copies

    def bring_back(self, sums: Sequence[moderngl.Texture], photon_weight: float) -> None:
        """Hold again what `copied_sums` gave, with the weight of that time."""
        self.clear()
        self.atlas.ready_totals()
        for source, target in zip(sums, self.atlas.total_textures, strict=True):
            copy_texture(self._ctx, source, target)
        self.photon_weight = photon_weight

    @property
    def scale(self) -> float:
        """Factor from what the atlas has summed to energy per texel."""
        return 1.0 / self.photon_weight if self.photon_weight else 0.0

    @property
    def bytes(self) -> int:
        """Device memory of the textures."""
        width, height = self.atlas.size
        return self.atlas.bytes + 16 * width * height * len(self._resolved)

    def settle(self) -> None:
        """No photons follow: give back all that only they needed."""
        if self._is_settled:
            return
        self.atlas.settle()
        self.splatter.release()
        if self.layout.charts:
            self.resolved_textures()
            shader.release(*self.atlas.total_textures)
        else:
            shader.release(*self._resolved)
            self._resolved = self.atlas.total_textures
            self._resolve.run(self.atlas, self._resolved)
        self.atlas.total_textures = []
        self._is_settled = True

    def resolved_textures(self) -> list[moderngl.Texture]:
        """The summed maps for lookups: wide texels added to fine ones, charts' seams folded home."""
        if self._is_settled:
            return self._resolved
        if not self._in_bulk or (self.splatter.by_compute and self.atlas.is_drawn):
            self.atlas.flush()
        if not self._resolved:
            self._resolved = [self._ctx.texture(self.atlas.size, 4, dtype="f4") for _ in range(self.atlas.targets)]
            for texture in self._resolved:
                frame_of(self._ctx, texture).clear()
        self._resolve.run(self.atlas, self._resolved)
        return self._resolved

    def caustic_maps(self, textures: Sequence[moderngl.Texture] | None = None) -> CausticMaps:
        """As the camera reads them; `textures` where they are not `resolved_textures`."""
        return CausticMaps(textures or self.resolved_textures(), self.receivers, self.atlas.placements, self.scale)

    def portions(self, tile: Tile, target: int = 0) -> Iterator[tuple[int, np.ndarray]]:
        """A tile of one texture in rows that take little memory: (first of them, float32 (rows, width, 4))."""
        frame = self._ctx.framebuffer([self.resolved_textures()[target]])
        try:
            for first in range(0, tile.height, _ROWS):
                rows = np.empty((min(_ROWS, tile.height - first), tile.width, 4), np.float32)
                frame.read_into(rows, (tile.x, tile.y + first, tile.width, len(rows)), components=4, dtype="f4")
                yield first, rows
        finally:
            frame.release()

    def receiver(self, receiver: int) -> np.ndarray:
        """A receiver's finest map: float32 (height, width, channels), row 0 at texel y = 0."""
        tile, targets = self.layout.tiles[receiver][0], len(self.resolved_textures())
        texels = np.empty((tile.height, tile.width, 4 * targets), np.float32)
        for target in range(targets):
            for first, rows in self.portions(tile, target):
                texels[first : first + len(rows), :, 4 * target : 4 * target + 4] = rows
        return texels

    def flux(self) -> float:
        """What the maps hold where they are read: the sum of XYZ maps' last channel (W), or of all bins."""
        flux, is_xyz = 0.0, not self.features.bins
        words = None if self.atlas.contact_words is None else read_words(self.atlas.contact_words)
        targets = 1 if is_xyz else len(self.resolved_textures())
        bordered = self.layout.borders if self.features.border_images else {}
        for receiver, tiles in self.layout.tiles.items():
            charts = self.layout.charts.get(receiver)
            for level, tile in enumerate(tiles):
                finer = self._finer_share(receiver, level, tile) if level and charts is None else None
                within = inside_share(self.layout, receiver, level) if receiver in bordered else None
                for target in range(targets):
                    for first, rows in self.portions(tile, target):
                        energy = (rows[..., 3] if is_xyz else rows.sum(axis=-1)).astype(float)
                        if finer is not None:
                            energy *= 1.0 - finer(first, first + len(rows))
                        if within is not None:
                            energy *= within(first, first + len(rows))
                        if words is not None:
                            row = tile.y + first
                            energy *= seen_shares(words[row : row + len(rows), tile.x : tile.x + tile.width])
                        if charts is not None:
                            energy = energy[charts.owner[first : first + len(rows)] >= 0]
                        flux += energy.sum()
        return flux

    def _finer_share(self, receiver: int, level: int, tile: Tile) -> Callable[[int, int], np.ndarray]:
        """How much of each texel of a coarse window's rows finer windows are read for: rows `first` to `end`."""
        coarse = self.layout.windows[receiver][level]
        assert isinstance(coarse, Window)
        # Nearly all of a finer window is in the next one.
        shares = [self._share_in(fine, receiver, coarse, tile) for fine in self.layout.windows[receiver][:level]]
        return lambda first, end: np.maximum.reduce([share(first, end) for share in shares])

    def _share_in(
        self, fine: Window | PictureWindow, receiver: int, coarse: Window, tile: Tile
    ) -> Callable[[int, int], np.ndarray]:
        """How much of each texel of a coarse window's rows is in one of the finer windows."""
        x, y = (np.linspace(coarse.low[i], coarse.high[i], n + 1) for i, n in enumerate((tile.width, tile.height)))
        if isinstance(fine, Window):
            columns, rows = (
                np.clip(np.minimum(fine.high[i], at[1:]) - np.maximum(fine.low[i], at[:-1]), 0.0, None) / np.diff(at)
                for i, at in enumerate((x, y))
            )
            return lambda first, end: rows[first:end, None] * columns
        return lambda first, end: self._seen_share(fine, receiver, x, y[first : end + 1])

    def _seen_share(self, fine: PictureWindow, receiver: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Share of every texel between borders `x` and `y` of a receiver's plane that is in `fine`, in sixteenths."""
        frame = self.layout.frames[receiver]
        parts = (np.arange(4) + 0.5) / 4.0
        u, v = (np.add.outer(at[:-1], parts * (at[1] - at[0])).ravel() for at in (x, y))
        held = fine.holds_grid(frame, u, v).reshape(len(y) - 1, 4, len(x) - 1, 4)
        return held.mean(axis=(1, 3))

    def release(self) -> None:
        """Free everything."""
        owned: Iterable[Releasable] = (
            *(() if self._is_settled else (self.splatter,)),
            self.atlas,
            self.receivers,
            *self._resolved,
            self._resolve,
        )
        shader.release(*owned)
