"""Receivers' borders (`borders`) as the splat pass reads them, and which part of a map's texels is inside of them."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from .map_layout import MapLayout


def border_rows(layout: MapLayout) -> np.ndarray:
    """float32 (receivers, n, 4): each receiver's borders from the left, zeros behind them."""
    rows = np.zeros((len(layout.receivers), 1 + max(map(len, layout.borders.values()))), (np.float32, 4))
    for receiver, borders in layout.borders.items():
        rows[receiver, : len(borders)] = borders
    return rows


def border_texture(ctx: moderngl.Context, layout: MapLayout) -> moderngl.Texture:
    """RGBA32F, `border_rows`."""
    rows = border_rows(layout)
    return ctx.texture(rows.shape[1::-1], 4, rows, dtype="f4")


def inside_share(layout: MapLayout, receiver: int, level: int) -> Callable[[int, int], np.ndarray]:
    """How much of each texel of a window is inside of the receiver's borders: of rows `first` to `end`, (rows,
    width). Of a texel that a border crosses aslant about as much."""
    tile, frame = layout.tiles[receiver][level], layout.frames[receiver]
    index = int(layout.receivers["placement"][receiver])
    for _ in range(level):
        index = int(layout.placements["next"][index])
    place = layout.placements[index]
    rows = np.stack([place["row_u"], place["row_v"], place["row_w"]]).astype(float)
    rows -= np.outer([tile.x, tile.y, 0.0], rows[2])
    lines = frame.on_plane(layout.borders[receiver]) @ np.linalg.inv(frame.on_plane(rows))
    lines /= np.abs(lines[:, :2]).sum(axis=1)[:, None]
    x = np.arange(tile.width) + 0.5

    def share(first: int, end: int) -> np.ndarray:
        y = np.arange(first, end) + 0.5
        inside = np.ones((end - first, tile.width))
        for a, b, c in lines:
            inside *= np.clip(0.5 + np.add.outer(b * y + c, a * x), 0.0, 1.0)
        return inside

    return share
