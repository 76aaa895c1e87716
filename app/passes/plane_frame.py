"""The frame of a flat receiver's plane, and from the plane to texels of its map: along the plane's own axes, or as a
camera sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_SIDE = np.array([0.1, -0.4, 0.9])
"""On which a plane's normal lies: not on one that the rounding of its points decides, which differs between frames."""
NEAREST = 0.5
"""Share of the least weight in a map's rectangle; points with less are near the camera's own plane, or behind it."""


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


@dataclass(frozen=True)
class TexelMap:
    """A homography: (U, V, W) = matrix (s, t, 1) for a point (s, t) of the plane (GPU units), texel (U, V) / W of the
    atlas. W is 1 everywhere for maps along the plane's axes."""

    matrix: np.ndarray
    """float64 (3, 3), of positive determinant."""
    rect: np.ndarray
    """float64 (4,): x0, y0, x1, y1, atlas texels."""

    @classmethod
    def of(cls, placement: np.void, frame: PlaneFrame) -> TexelMap:
        """The map of one PLACEMENT record."""
        rows = np.stack([placement[name] for name in ("row_u", "row_v", "row_w")]).astype(np.float64)
        return cls(frame.on_plane(rows), placement["rect"].astype(np.float64))

    @property
    def is_affine(self) -> bool:
        """Whether texels are of one size."""
        return not self.matrix[2, :2].any()

    @property
    def inverse(self) -> np.ndarray:
        """float64 (3, 3): (s, t, 1) / W of (u, v, 1)."""
        return np.linalg.inv(self.matrix)

    @property
    def least_weight(self) -> float:
        """W that a point must have to be drawn."""
        x0, y0, x1, y1 = self.rect
        corners = np.array([[x0, y0, 1.0], [x1, y0, 1.0], [x0, y1, 1.0], [x1, y1, 1.0]])
        return NEAREST / float((corners @ self.inverse[2]).max())

    def weights(self, points: np.ndarray) -> np.ndarray:
        """W (...) of points (..., 2) of the plane."""
        return points @ self.matrix[2, :2] + self.matrix[2, 2]

    def texels(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) points of the plane of positive weight, in atlas texels."""
        found = points @ self.matrix[:2, :2].T + self.matrix[:2, 2]
        return found if self.is_affine else found / self.weights(points)[..., None]

    def points(self, texels: np.ndarray) -> np.ndarray:
        """The points of the plane (..., 2) at atlas `texels` (..., 2); not finite beyond a horizon."""
        inverse = self.inverse
        weight = texels @ inverse[2, :2] + inverse[2, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (texels @ inverse[:2, :2].T + inverse[:2, 2]) / weight[..., None]
        return np.where(weight[..., None] > 0.0, found, np.nan)

    def density(self, points: np.ndarray) -> np.ndarray:
        """Texels per GPU unit² (...) at points of the plane; of what is too near to the camera, or behind it, as
        where that begins."""
        return np.linalg.det(self.matrix) / self.drawn_weights(points) ** 3

    def drawn_weights(self, points: np.ndarray) -> np.ndarray:
        """`weights`, at least that of what is drawn."""
        return np.maximum(self.weights(points), self.least_weight)

    def longest_step(self, points: np.ndarray) -> np.ndarray:
        """Texels that a GPU unit along the plane is long at most (...), at points of it."""
        weight = self.weights(points)[..., None, None]
        jacobian = (self.matrix[:2, :2] - self.texels(points)[..., None] * self.matrix[2, :2]) / weight
        return np.linalg.norm(jacobian, ord=2, axis=(-2, -1))
