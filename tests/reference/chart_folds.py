"""Gutter energy of charts carried home, and copied back for lookups, in float64."""

from __future__ import annotations

import numpy as np
from spectrasplat.model.geometry.charts import ChartAtlas


def fold(atlas: ChartAtlas, energy: np.ndarray) -> np.ndarray:
    """(height, width, …) energy per texel -> the same, gutters empty."""
    folded = np.array(energy, dtype=np.float64)
    gx, gy = atlas.gutter_texel_xy.T
    moved = folded[gy, gx]
    folded[gy, gx] = 0.0
    dx, dy = atlas.destination_xy.T
    kept = dx >= 0
    np.add.at(folded, (dy[kept], dx[kept]), moved[kept])
    return folded


def fill(atlas: ChartAtlas, folded: np.ndarray) -> np.ndarray:
    """Energies copied back into the gutters after `fold`, so that interpolated lookups see no seam."""
    filled = np.array(folded, dtype=np.float64)
    kept = atlas.destination_xy[:, 0] >= 0
    gx, gy = atlas.gutter_texel_xy[kept].T
    dx, dy = atlas.destination_xy[kept].T
    ratio = atlas.fill_ratio[kept].reshape(-1, *[1] * (filled.ndim - 2))
    filled[gy, gx] = filled[dy, dx] * ratio
    return filled
