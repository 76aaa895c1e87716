"""Solids that rays meet as the curved surfaces they are, and not as the triangles that stand for them.

A ball, an ellipsoid, a lens of two convex or plane faces and a cylinder are where a few convex faces overlap, each the
inside of a quadric or of a plane. A ray then enters at the last face and leaves at the first, as with half-spaces: no
tree, no tessellation, and exact normals. `curved_solids` says which solids are met so; everything else is met as
triangles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from .contacts import contacts, nested_pairs
from .geometry.primitives_lens import sag_and_slope, vertices_of
from .scene import Scene, SceneObject

MOST_FACES = 24
"""Bound for all curved solids of a scene together: every ray tests all of them, and a tree of triangles few."""
_ROUNDING = 1e-9


class Face(NamedTuple):
    """The convex set |rows (p - origin)|² - 2 linear · (p - origin) - constant <= 0."""

    rows: np.ndarray
    """float64 (3, 3); zero of a plane."""
    origin: np.ndarray
    """float64 (3,): a place on it, or its middle."""
    linear: np.ndarray
    """float64 (3,): inward from `origin` where that lies on it."""
    constant: float

    @property
    def is_plane(self) -> bool:
        """Whether it is the inside of a plane."""
        return not self.rows.any()

    def moved(self, linear_map: np.ndarray, offset: np.ndarray) -> Face:
        """The face where p is mapped to `linear_map` (3, 3) p + `offset` (3,); its gradient keeps its length, so that
        single precision holds it whatever a scene's unit is."""
        inverse, size = np.linalg.inv(linear_map), abs(np.linalg.det(linear_map)) ** (1.0 / 3.0)
        rows, linear = math.sqrt(size) * self.rows @ inverse, size * inverse.T @ self.linear
        return Face(rows, linear_map @ self.origin + offset, linear, size * self.constant)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """To first order how far `points` (..., 3) lie outside it (...,)."""
        q = points - self.origin
        stretched = q @ self.rows.T
        value = (stretched**2).sum(axis=-1) - 2.0 * q @ self.linear - self.constant
        gradient = 2.0 * (stretched @ self.rows - self.linear)
        return value / np.maximum(np.linalg.norm(gradient, axis=-1), 1e-300)


def curved_solids(scene: Scene) -> dict[int, tuple[Face, ...]]:
    """Faces, in their own frames, of the objects that are met as curved solids, by index.

    They are of glass or mirrors made by a recipe (`geometry.mesh`) without a picture. What they lie in or against
    is flat, or glass that is met exactly too, else a surface that both share would be in two places.
    None is where they have more than `MOST_FACES` together.
    """
    found: dict[int, tuple[Face, ...]] = {}
    for index, item in enumerate(scene.objects):
        faces = faces_of(item)
        if faces:
            found[index] = faces
    if not found:
        return {}
    for pair in contacts(scene):
        for index, other in (pair, pair[::-1]):
            if index in found and not scene.objects[other].mesh.is_flat:
                del found[index]
    pairs = nested_pairs(scene)
    refused = True
    while refused:
        refused = False
        for a, b in (*pairs, *((b, a) for a, b in pairs)):
            if a in found and b not in found and scene.objects[b].mesh.convex_planes is None:
                del found[a]
                refused = True
    return found if sum(map(len, found.values())) <= MOST_FACES else {}


def faces_of(item: SceneObject) -> tuple[Face, ...]:
    """Faces of an object that can be met as a curved solid, in its own frame; empty: it cannot."""
    material = item.material
    if material.is_grating or not (material.is_solid or material.is_mirror) or material.texture is not None:
        return ()
    recipe = item.mesh.recipe
    make = None if recipe is None else _FACES.get(recipe.get("shape", ""))
    return () if make is None or recipe is None else tuple(make(recipe))


def _ball(recipe: Mapping[str, Any]) -> Iterator[Face]:
    axes = recipe.get("semi_axes", [recipe.get("radius", 0.5)] * 3)
    # Of length 2 its gradient, of a ball.
    mean = float(np.mean(axes))
    yield Face(np.diag(math.sqrt(mean) / np.array(axes, float)), np.zeros(3), np.zeros(3), mean)


def _lens(recipe: Mapping[str, Any]) -> Iterator[Face]:
    if recipe.get("conic1", 0.0) or recipe.get("conic2", 0.0):
        return
    start, end = vertices_of(recipe.get("thickness", 0.3), recipe.get("front"))
    aperture = 0.5 * float(recipe.get("diameter", 1.0))
    # Radii, positive where a face bulges.
    signed = float(recipe.get("radius1", 1.0)), -float(recipe.get("radius2", -1.0))
    first, second = (math.inf if math.isinf(radius) else radius for radius in signed)
    if min(first, second) < 0.0:
        return
    r = aperture * np.linspace(0.0, 1.0, 65)
    bulges = [sag_and_slope(r, radius, 0.0)[0] for radius in (first, second)]
    low, high = start + bulges[0], end - bulges[1]
    # Each face's sphere has a second half, which must not cut the lens.
    slack = _ROUNDING * aperture
    if (high > start + 2.0 * first - bulges[0] + slack).any() or (low < end - 2.0 * second + bulges[1] - slack).any():
        return
    up = np.array([0.0, 0.0, 1.0])
    for radius, vertex, inward in ((first, start, up), (second, end, -up)):
        yield Face(math.sqrt(1.0 / radius) * np.eye(3), vertex * up, inward, 0.0)
    if high[-1] - low[-1] > slack:
        yield _tube(aperture)


def _cylinder(recipe: Mapping[str, Any]) -> Iterator[Face]:
    profile = np.array(recipe["profile"], float)
    if profile.shape != (4, 2) or not 0.0 <= float(recipe.get("crease_deg", 40.0)) < 89.0:
        return
    (r0, z0), (r1, z1), (r2, z2), (r3, z3) = profile.tolist()
    if r0 or r3 or r1 != r2 or z0 != z1 or z2 != z3 or r1 <= 0.0 or z1 == z2:
        return
    up = np.array([0.0, 0.0, 1.0])
    yield _tube(r1)
    yield Face(np.zeros((3, 3)), min(z1, z2) * up, up, 0.0)
    yield Face(np.zeros((3, 3)), max(z1, z2) * up, -up, 0.0)


def _tube(radius: float) -> Face:
    """All round the z axis."""
    return Face(np.diag([1.0, 1.0, 0.0]) / math.sqrt(radius), np.zeros(3), np.zeros(3), radius)


_FACES: dict[str, Callable[[Mapping[str, Any]], Iterator[Face]]] = {
    "sphere": _ball,
    "ellipsoid": _ball,
    "lens": _lens,
    "revolution": _cylinder,
}
