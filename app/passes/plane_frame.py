"""The frame of a flat receiver's plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_SIDE = np.array([0.1, -0.4, 0.9])
"""On which a plane's normal lies: not on one that the rounding of its points decides, which differs between frames."""


@dataclass(frozen=True)
class PlaneFrame:
    """A flat receiver's plane: p = origin + u axes[0] + v axes[1]."""

    origin: np.ndarray
    axes: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """Plane coordinates (..., 2) of GPU-space points."""
        return (points - self.origin) @ self.axes.T

    def at(self, places: np.ndarray) -> np.ndarray:
        """GPU-space points (..., 3) of plane coordinates (..., 2)."""
        return self.origin + places @ self.axes

    def on_plane(self, rows: np.ndarray) -> np.ndarray:
        """Rows (n, 4) that act on GPU-space points, for plane coordinates (s, t, 1): (n, 3)."""
        return np.concatenate([rows[:, :3] @ self.axes.T, (rows[:, :3] @ self.origin + rows[:, 3])[:, None]], axis=1)


def plane_frame(points: np.ndarray) -> PlaneFrame:
    """The frame of coplanar `points`; its axes follow the coordinate axes where they can."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    normal = np.copysign(1.0, normal @ _SIDE) * normal
    guide = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    first = guide - normal * (guide @ normal)
    first /= np.linalg.norm(first)
    return PlaneFrame(centre, np.stack([first, np.cross(normal, first)]))
