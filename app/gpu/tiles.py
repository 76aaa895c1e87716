"""Rectangles laid side by side in one texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..base.errors import UserError

MAX_SIDE = 4096
GUARD = 1
"""Empty texels between tiles, so that a bilinear lookup never meets a neighbour."""


@dataclass(frozen=True)
class Tile:
    """A rectangle of the atlas, in texels."""

    x: int
    y: int
    width: int
    height: int

    @property
    def rect(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1."""
        return self.x, self.y, self.x + self.width, self.y + self.height


def pack(sizes: Sequence[tuple[int, int]], max_side: int = MAX_SIDE) -> tuple[list[Tile], tuple[int, int]]:
    """Shelves, tallest tiles first: a tile per (width, height), in their order, and the atlas size.

    The narrowest of a few atlas widths that wastes least. Raises `UserError` when nothing up to
    max_side² holds them.
    """
    if not sizes:
        return [], (GUARD, GUARD)
    widest = max(width for width, _ in sizes) + 2 * GUARD
    area = sum((width + GUARD) * (height + GUARD) for width, height in sizes)
    best: tuple[int, list[Tile], tuple[int, int]] | None = None
    for factor in (0.0, 1.0, 1.2, 1.5, 2.0, 1e9):
        limit = min(max(widest, int(factor * area**0.5)), max_side)
        tiles, size = _shelves(sizes, limit)
        if size[0] <= max_side and size[1] <= max_side and (best is None or size[0] * size[1] < best[0]):
            best = (size[0] * size[1], tiles, size)
    if best is None:
        raise UserError(
            f"the caustic maps need {area / 1e6:.1f} M texels and do not fit a texture of {max_side}²; choose a "
            "smaller picture or map"
        )
    return best[1], best[2]


def _shelves(sizes: Sequence[tuple[int, int]], limit: int) -> tuple[list[Tile], tuple[int, int]]:
    tiles: list[Tile] = [Tile(0, 0, 0, 0)] * len(sizes)
    x = y = GUARD
    shelf = widest = 0
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][1], -sizes[i][0], i)):
        width, height = sizes[index]
        if x > GUARD and x + width + GUARD > limit:
            x, y, shelf = GUARD, y + shelf + GUARD, 0
        tiles[index] = Tile(x, y, width, height)
        x += width + GUARD
        shelf = max(shelf, height)
        widest = max(widest, x)
    return tiles, (widest, y + shelf + GUARD)
