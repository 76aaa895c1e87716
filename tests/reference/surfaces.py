"""Smooth and faceted surfaces for the reference tracer: where a ray meets them and how they bend there.

Each surface answers `distances(origin, direction)` — signed, ascending — and `normals(point)` — the geometric normal
and the shading normal. Normals point outward, or to the side a plane's normal names.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from spectrasplat.reference.optics import Array, cross, normalised_derivative, unit


class Surface(Protocol):
    """What the tracer asks of a surface."""

    def distances(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray: ...

    def normals(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class Plane:
    """The unbounded plane through `point`."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def distances(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        normal = unit(np.array(self.normal, float))
        return np.array([(np.array(self.point) - origin) @ normal / (direction @ normal)])

    def normals(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = unit(np.array(self.normal, float))
        return normal, normal


@dataclass(frozen=True)
class Quadric:
    """The ellipsoid Σ ((p - centre)/semi_axes)² = 1; three equal semi-axes make a sphere."""

    centre: tuple[float, float, float]
    semi_axes: tuple[float, float, float]

    def distances(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        # In the space where it is the unit sphere; |o + t d|² = 1 by its two roots.
        o = (origin - np.array(self.centre)) / self.semi_axes
        d = direction / np.array(self.semi_axes)
        a, b = d @ d, o @ d
        closest = o - b / a * d
        discriminant = 1.0 - closest @ closest
        if discriminant < 0.0:
            return np.empty(0)
        half = np.sqrt(discriminant / a)
        return np.array([-b / a - half, -b / a + half])

    def normals(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = unit((point - np.array(self.centre)) / np.array(self.semi_axes) ** 2)
        return normal, normal


def sphere(centre: tuple[float, float, float], radius: float) -> Quadric:
    """A sphere."""
    return Quadric(centre, (radius, radius, radius))


@dataclass(frozen=True, eq=False)
class Facet:
    """The plane of one triangle, with normals interpolated from its corners (flat without them)."""

    corners: np.ndarray
    corner_normals: np.ndarray | None = None

    def distances(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        normal = self.area_vector()
        return np.array([(self.corners[0] - origin) @ normal / (direction @ normal)])

    def normals(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        geometric = unit(self.area_vector())
        if self.corner_normals is None:
            return geometric, geometric
        return geometric, unit(barycentric_weights(self.corners, point) @ self.corner_normals)

    def area_vector(self) -> np.ndarray:
        a, b, c = self.corners
        return cross(b - a, c - a)


def barycentric_weights(triangle: Array, point: Array) -> Array:
    """Weights (3,) of the corners for a point in the plane of `triangle` (3, 3), by signed areas."""
    a, b, c = triangle
    normal = cross(b - a, c - a)
    areas = np.array([cross(c - b, point - b), cross(a - c, point - c), cross(b - a, point - a)]) @ normal
    return areas / (normal @ normal)


def shading_normal_column(
    triangle: Array, corner_normals: Array, point: Array, dposition: Array
) -> tuple[Array, Array]:
    """(n̂, ∂n̂) of normals interpolated over a triangle; ∂n̂ for dposition (..., 3) in its plane.

    The weights are linear in the point, so their change is found by weighing a moved point:
    no gradient formula is shared with the shaders.
    """
    weights = barycentric_weights(triangle, point)
    summed = weights @ corner_normals
    columns = np.reshape(dposition, (-1, 3))
    dweights = np.array([barycentric_weights(triangle, point + column) - weights for column in columns]).reshape(-1, 3)
    dnormal = normalised_derivative(summed, dweights @ corner_normals)
    return unit(summed), dnormal.reshape(np.shape(dposition))
