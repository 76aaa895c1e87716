"""What a point of a surface gets of a uniform polygon, in closed form (Lambert 1760)."""

from __future__ import annotations

import numpy as np


def rectangle(corner, side, other) -> np.ndarray:
    """Corners (4, 3) in order."""
    corner, side, other = (np.asarray(v, float) for v in (corner, side, other))
    return np.array([corner, corner + side, corner + side + other, corner + other])


def form_factor(at: np.ndarray, normal: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Irradiance (n,) at places (n, 3) with unit normals (n, 3) by a polygon (k, 3) of radiosity 1 that lies wholly in
    front of them: Σ Θ_i (Γ_i · n) / 2π over its edges, Θ the angle an edge subtends, Γ the unit normal of its plane
    with the place."""
    way = polygon[None] - at[:, None]
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    following = np.roll(way, -1, axis=1)
    across = np.cross(way, following)
    length = np.linalg.norm(across, axis=2)
    angle = np.arctan2(length, (way * following).sum(axis=2))
    share = np.einsum("nki,ni->nk", across / np.maximum(length, 1e-300)[..., None], normal)
    return np.abs((angle * share).sum(axis=1)) / (2.0 * np.pi)
