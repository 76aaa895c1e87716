"""Plates that draw a known picture: light that is even in x and y is led to what is a product of two densities.

Each coordinate is mapped by its own cumulative distribution, u = x' − x, and the slope of the face is that which
refracts by u over the distance; both are gradients, since u depends on x alone.
"""

from __future__ import annotations

import numpy as np
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import height_field


def densities(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Over −0.5 … 0.5: of x two unequal humps, of y one off the middle; float64 (count,), of mean 1."""
    t = (np.arange(count) + 0.5) / count - 0.5
    along = 0.35 + np.exp(-(((t + 0.22) / 0.09) ** 2)) + 0.6 * np.exp(-(((t - 0.2) / 0.12) ** 2))
    up = 0.4 + np.exp(-(((t - 0.12) / 0.14) ** 2))
    return along / along.mean(), up / up.mean()


def picture(count: int = 96) -> np.ndarray:
    """The target, as seen from the plate with x to the left and y up: float64 (count, count, 3)."""
    along, up = densities(count)
    return np.repeat((up[::-1, None] * along[::-1])[..., None], 3, axis=2)


def plate(distance: float, n: float, side: float = 100.0, resolution: int = 161, depth: float = 6.0) -> Mesh:
    """A plate of `side` that draws the picture in its own size at `distance`, flat side to the light."""
    x = np.linspace(-0.5, 0.5, resolution)
    parts = []
    for density in densities(4096):
        edges = np.linspace(-0.5, 0.5, 4097)
        reached = np.concatenate([[0.0], np.cumsum(density)]) / density.sum()
        shift = (np.interp(x + 0.5, reached, edges) - x) * side
        slope = shift / np.hypot(shift, distance) / (n - distance / np.hypot(shift, distance))
        step = side / (resolution - 1)
        parts.append(np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * step)]))
    heights = parts[1][:, None] + parts[0]
    return height_field(heights - heights.max(), (side, side), depth=depth + float(np.ptp(heights)))
