"""Rectangles laid side by side in one texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from ..model.geometry.charts import shelves

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
    padded = np.array(sizes) + GUARD
    widest, area = int(padded[:, 0].max()), int(padded.prod(axis=1).sum())
    most = max_side - GUARD
    widths = {min(max(widest, int(factor * area**0.5) - GUARD), most) for factor in (0.0, 1.0, 1.2, 1.5, 2.0, 1e9)}
    tried = [shelves(padded, width) for width in sorted(widths)]
    held = [(corners, size) for corners, size in tried if max(size) <= most]
    if not held:
        raise UserError(
            f"the caustic maps need {area / 1e6:.1f} M texels and do not fit a texture of {max_side}²; choose a "
            "smaller picture or map"
        )
    corners, (width, height) = min(held, key=lambda each: (each[1][0] + GUARD) * (each[1][1] + GUARD))
    tiles = [Tile(x + GUARD, y + GUARD, *size) for (x, y), size in zip(corners.tolist(), sizes, strict=True)]
    return tiles, (width + GUARD, height + GUARD)
