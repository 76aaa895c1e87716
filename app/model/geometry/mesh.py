"""Triangle meshes as plain float64 values, shared by every loader, primitive and tree.

Vertices stay welded, so that a closed solid is watertight by index, and shading normals
live at triangle *corners*: a lens is smooth over its faces and sharp at its rim without
splitting a vertex. A closed convex flat mesh also knows its half-spaces, since a ray meets
an intersection of half-spaces without any tree.

A *recipe* is the description that a mesh was made from, so that a scene can be saved by it instead of by triangles.
A mesh that was edited is another value, has no recipe (`replace` leaves it out), and is saved as triangles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..vectors import frozen

MAX_CONVEX_PLANES = 96
"""Enough for a brilliant with a faceted girdle (73)."""
MAX_FLAT_FACES = 12
"""Flat faces of an object, at most: each has maps of its own, however few pixels see it."""
# Files hold float32 coordinates (1.2e-7 relative); a plane through them is known to a few times that.
_COPLANAR_TOLERANCE = 2e-6
_COPLANAR_COSINE = 0.9999


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in object space; made by `make_mesh`, compared by identity."""

    name: str
    vertices: np.ndarray
    """float64 (V, 3), scene units, finite."""
    triangles: np.ndarray
    """int32 (T, 3), counter-clockwise seen from outside."""
    corner_normals: np.ndarray | None = None
    """float64 (T, 3, 3), unit outward normal at each corner (zero where unknown); None = flat shading."""
    uv: np.ndarray | None = None
    """float64 (T, 3, 2), texture coordinates at each corner: u to the right, v up, (0, 0) a picture's lower left."""
    source: str | None = None
    """Path of the file it came from, None for a primitive."""
    uv_unwraps: bool = True
    """Whether `uv` may lay out the charts of a caustic map; not where it was made for pictures and stretches or
    repeats."""
    whole: Mesh | None = field(default=None, repr=False)
    """The mesh that this is a flat face of."""
    recipe: Mapping[str, Any] | None = field(default=None, init=False, repr=False)
    """The scene-file keys that make exactly this mesh: `shape` with its sizes, or `mesh` (absolute path) with
    `smooth`; None where no words do."""

    def corners(self) -> np.ndarray:
        """Corner positions, float64 (T, 3, 3)."""
        return self.vertices[self.triangles]

    def area_vectors(self) -> np.ndarray:
        """Half cross products, float64 (T, 3): the face normal times the area."""
        a, b, c = np.moveaxis(self.corners(), 1, 0)
        return 0.5 * cross(b - a, c - a)

    def areas(self) -> np.ndarray:
        """Triangle areas, float64 (T,), square units."""
        return np.linalg.norm(self.area_vectors(), axis=1)

    def face_normals(self) -> np.ndarray:
        """Unit geometric normals, float64 (T, 3); zero for a triangle without area."""
        return normalised(self.area_vectors())

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of the box round every vertex a triangle uses, float64 (3,) each."""
        return self._bounds

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        used = self.corners().reshape(-1, 3)
        return frozen(used.min(axis=0)), frozen(used.max(axis=0))

    @cached_property
    def flat_faces(self) -> tuple[Mesh, ...]:
        """Its flat faces, the largest first; none where it is one, has more than `MAX_FLAT_FACES`, or is shaded as
        curved ones are."""
        planes = [] if self.is_flat or not self.is_faceted else list(islice(_coplanar(self), MAX_FLAT_FACES + 1))
        if not 1 < len(planes) <= MAX_FLAT_FACES:
            return ()
        return tuple(replace(self.part(np.sort(rows)), corner_normals=None, whole=self) for rows in planes)

    def part(self, rows: np.ndarray) -> Mesh:
        """The triangles `rows` (n,) alone, with the vertices that they use."""
        used, corners = np.unique(self.triangles[rows], return_inverse=True)
        return replace(
            self,
            vertices=self.vertices[used],
            triangles=corners.reshape(-1, 3).astype(np.int32),
            corner_normals=None if self.corner_normals is None else self.corner_normals[rows],
            uv=None if self.uv is None else self.uv[rows],
        )

    def volume(self) -> float:
        """Signed volume, cubic units; positive when a closed mesh faces outward (divergence theorem)."""
        corners = self.corners()
        # About the middle, so that a mesh far from the origin does not cancel.
        corners = corners - 0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))
        return float(np.einsum("ij,ij->", corners[:, 0], cross(corners[:, 1], corners[:, 2])) / 6.0)

    def flipped(self) -> Mesh:
        """The same surface facing the other way."""
        return replace(
            self,
            triangles=frozen(self.triangles[:, ::-1]),
            corner_normals=None if self.corner_normals is None else frozen(-self.corner_normals[:, ::-1]),
            uv=None if self.uv is None else frozen(self.uv[:, ::-1]),
        )

    def transformed(self, matrix: np.ndarray) -> Mesh:
        """The mesh under the affine `matrix` (4, 4) acting on column vectors.

        Normals go by the inverse transpose; a mirroring matrix also turns the winding, so
        that outside stays outside. A singular matrix raises UserError.
        """
        matrix = np.asarray(matrix, dtype=np.float64)
        linear, determinant = matrix[:3, :3], self.determinant(matrix)
        vertices = self.vertices @ linear.T + matrix[:3, 3]
        normals = self.corner_normals
        if normals is not None:
            normals = normalised(normals @ np.linalg.inv(linear))
        triangles, uv = self.triangles, self.uv
        if determinant < 0:
            triangles = triangles[:, ::-1]
            normals = None if normals is None else normals[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        return replace(
            self,
            vertices=frozen(vertices),
            triangles=frozen(triangles),
            corner_normals=None if normals is None else frozen(normals),
            uv=None if uv is None else frozen(uv),
        )

    def determinant(self, matrix: np.ndarray) -> float:
        """Determinant of a transform of the mesh; negative where it mirrors. Raises UserError where it is singular."""
        linear = matrix[:3, :3]
        determinant = float(np.linalg.det(linear))
        if not np.isfinite(matrix).all() or abs(determinant) <= 1e-30 * np.linalg.norm(linear) ** 3:
            raise UserError(f"mesh '{self.name}': its transform flattens it; use a scale other than zero on every axis")
        return determinant

    @cached_property
    def is_closed(self) -> bool:
        """Every edge is shared by exactly two triangles that run along it in opposite directions."""
        a = self.triangles.ravel().astype(np.int64)
        b = np.roll(self.triangles, -1, axis=1).ravel().astype(np.int64)
        count = len(self.vertices)
        forward = np.sort(a * count + b)
        if len(forward) > 1 and (forward[1:] == forward[:-1]).any():
            return False
        return bool(np.array_equal(forward, np.sort(b * count + a)))

    @cached_property
    def is_flat(self) -> bool:
        """Whether all vertices are in one plane (relative tolerance 1e-5)."""
        singular = np.linalg.svd(self.vertices - self.vertices.mean(axis=0), compute_uv=False)
        return bool(singular[-1] <= 1e-5 * max(singular[0], np.finfo(float).tiny))

    @cached_property
    def is_faceted(self) -> bool:
        """Whether all facets are flat: no interpolated normals."""
        if self.corner_normals is None:
            return True
        known = np.abs(self.corner_normals).sum(axis=2) > 0.0
        cosine = np.einsum("tcj,tj->tc", self.corner_normals, self.face_normals())
        return bool((~known | (cosine >= 1.0 - 1e-9)).all())

    @cached_property
    def convex_planes(self) -> np.ndarray | None:
        """Outward half-spaces of a closed convex flat solid, float64 (P, 4): n·x <= d as rows (n, d).

        None when the mesh is open, concave, smooth, or has more than MAX_CONVEX_PLANES
        distinct planes. Coplanar triangles share a plane.
        """
        return convex_planes_of(self)


def make_mesh(
    name: str,
    vertices: np.ndarray,
    triangles: np.ndarray,
    corner_normals: np.ndarray | None = None,
    uv: np.ndarray | None = None,
    source: str | None = None,
    uv_unwraps: bool = True,
) -> Mesh:
    """A checked `Mesh` from array-likes; every array is copied, normals are normalised.

    Corner normals that are zero or not finite become zero (`mesh_health.repair` replaces
    them). Raises UserError for an empty mesh, non-finite vertices, wrong shapes or vertex
    numbers out of range; the sentence names the file (or mesh) and the face.
    """
    where = source or f"mesh '{name}'"
    vertices = np.array(vertices, dtype=np.float64)
    faces = np.array(triangles)
    if faces.size == 0 or vertices.size == 0:
        raise UserError(f"{where}: the mesh is empty; it needs at least one triangle")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise UserError(f"{where}: vertices must be rows of three numbers and faces triangles; triangulate the mesh")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        raise UserError(f"{where}: vertex {int(np.argmin(finite))} is not finite; export the mesh again")
    outside = (faces < 0) | (faces >= len(vertices))
    if outside.any():
        face, corner = np.argwhere(outside)[0]
        raise UserError(
            f"{where}: face {face} names vertex {int(faces[face, corner])}, "
            f"but there are only {len(vertices)} vertices (0 to {len(vertices) - 1}); export the mesh again"
        )
    normals = None
    if corner_normals is not None:
        normals = np.array(corner_normals, dtype=np.float64)
        _expect_shape(where, "corner normals", normals, (len(faces), 3, 3))
        normals = normalised(np.where(np.isfinite(normals).all(axis=2, keepdims=True), normals, 0.0))
    coordinates = None
    if uv is not None:
        coordinates = np.array(uv, dtype=np.float64)
        _expect_shape(where, "texture coordinates", coordinates, (len(faces), 3, 2))
    return Mesh(
        name=name,
        vertices=frozen(vertices),
        triangles=frozen(faces.astype(np.int32)),
        corner_normals=None if normals is None else frozen(normals),
        uv=None if coordinates is None else frozen(coordinates),
        source=source,
        uv_unwraps=uv_unwraps,
    )


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows, (N, 3); several times faster than `np.cross` on large arrays."""
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return out


def normalised(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along the last axis; zero stays zero."""
    # Scaled first: squares of very small or large numbers would leave the range.
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=largest > 0)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.divide(scaled, length, out=scaled, where=length > 0)


def _expect_shape(where: str, what: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise UserError(f"{where}: {what} have shape {array.shape} where {shape} is needed; give one for each corner")


def convex_planes_of(mesh: Mesh, most: int = MAX_CONVEX_PLANES) -> np.ndarray | None:
    """As `Mesh.convex_planes`, up to `most` of them."""
    area_vectors, areas, slivers = mesh.area_vectors(), mesh.areas(), _slivers(mesh)
    if mesh.corner_normals is not None:
        cosines = np.einsum("tcj,tj->tc", mesh.corner_normals, normalised(area_vectors))
        if (cosines[~slivers] < 1.0 - 1e-9).any():
            return None
    if not mesh.is_closed or mesh.volume() <= 0.0:
        return None
    middle = 0.5 * np.add(*mesh.bounds())
    corners = mesh.corners() - middle
    centroids = corners.mean(axis=1)
    planes: list[np.ndarray] = []
    for members in _coplanar(mesh):
        known = members[~slivers[members]]
        normal = normalised(area_vectors[known].sum(axis=0))
        offset = np.average(centroids[known] @ normal, weights=areas[known])
        if len(planes) == most or (corners @ normal).max() > offset + _coplanar_tolerance(mesh):
            return None
        planes.append(np.append(normal, offset + normal @ middle))
    # A surface covering the hull twice (two coincident shells) would pass all of the above.
    used = mesh.vertices[np.unique(mesh.triangles)]
    if len(np.unique(used, axis=0)) != len(used):
        return None
    return frozen(np.array(planes))


def _coplanar_tolerance(mesh: Mesh) -> float:
    return _COPLANAR_TOLERANCE * float(np.linalg.norm(np.subtract(*mesh.bounds())))


def _slivers(mesh: Mesh) -> np.ndarray:
    """bool (T,): triangles that know no plane; their neighbours' planes bound them."""
    corners = mesh.corners()
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return mesh.areas() <= 0.5 * _coplanar_tolerance(mesh) * longest


def _coplanar(mesh: Mesh) -> Iterator[np.ndarray]:
    """Triangles by the plane that they lie in and face, that of the largest first, for it knows its plane best. Slivers
    go with the first plane that holds them, and are left out where none does."""
    normals, slivers = mesh.face_normals(), _slivers(mesh)
    corners = mesh.corners() - 0.5 * np.add(*mesh.bounds())
    left = np.argsort(-mesh.areas(), kind="stable")
    while len(known := left[~slivers[left]]):
        first = known[0]
        beyond = np.abs((corners[left] - corners[first].mean(axis=0)) @ normals[first]).max(axis=1)
        together = (beyond <= _coplanar_tolerance(mesh)) & (
            slivers[left] | (normals[left] @ normals[first] >= _COPLANAR_COSINE)
        )
        together |= left == first
        yield left[together]
        left = left[~together]


def note_recipe(mesh: Mesh, recipe: Mapping[str, Any]) -> None:
    """Remember the scene-file keys that make `mesh`."""
    object.__setattr__(mesh, "recipe", dict(recipe))
