"""A receiver with the light that was baked onto it, as other programs take it: a mesh that glows by a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.mesh_health import weld_map
from ..staging import UpAxis


@dataclass(frozen=True)
class LitMesh:
    """Corners are those of triangles, one by one; `welded` joins them."""

    name: str
    corners: np.ndarray
    """float64 (t, 3, 3), the scene's coordinates."""
    normals: np.ndarray | None
    """float64 (t, 3, 3), or None for flat facets."""
    uv: np.ndarray
    """float64 (t, 3, 2), (0, 0) the picture's upper left corner; beyond 0 to 1 its border goes on."""
    emission: np.ndarray
    """float32 (h, w, 3), linear Rec.709 radiance, cd/unit²; within the gamut."""
    base_rgb: tuple[float, float, float]
    """Its own reflectance, linear Rec.709, for all other light."""
    up: UpAxis
    """Which axis of its coordinates is up."""

    @property
    def strength(self) -> float:
        """Radiance that the full value of an 8-bit texture stands for, cd/unit²."""
        return float(self.emission.max()) or 1.0

    def welded(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray]:
        """Positions (n, 3), texture coordinates (n, 2), normals (n, 3) or None, all float32, and triangles uint32
        (t, 3)."""
        columns = [self.corners.reshape(-1, 3), self.uv.reshape(-1, 2)]
        if self.normals is not None:
            columns.append(self.normals.reshape(-1, 3))
        rows = np.hstack(columns).astype(np.float32)
        kept, number = weld_map(rows.astype(np.float64))
        rows = rows[kept]
        normals = None if self.normals is None else rows[:, 5:8]
        return rows[:, :3], rows[:, 3:5], normals, number.astype(np.uint32).reshape(-1, 3)
