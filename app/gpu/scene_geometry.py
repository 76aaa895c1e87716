"""Shapes of a scene packed for the GPU: triangles with their tree, and solids that are intersections of half-spaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..features.facts import half_spaces
from ..features.features import Features
from ..model.curved_solids import Face, curved_solids
from ..model.geometry.bvh import Bvh, build_bvh
from ..model.geometry.mesh import Mesh
from ..model.scene import Scene, SceneObject
from .gpu_space import GpuSpace
from .records import NONE
from .scene_records import PIECE, SOLID, TRIANGLE
from .scene_texels import tree_texels

_PLANE_BIT = 0x80000000
"""Bit of a primitive's number: a plane of a half-space solid, not a triangle (shaders/lib/intersect.glsl)."""
_CURVED_BIT = 0x40000000
"""Likewise, a face of a curved solid."""
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Solids:
    """Objects that are intersections of half-spaces."""

    records: np.ndarray
    """SOLID (S,)."""
    planes: np.ndarray
    """float32 (P, 4): n·x <= d, GPU space."""

    @staticmethod
    def of(scene: Scene, meshes: Sequence[Mesh], space: GpuSpace) -> Solids:
        """`meshes`: in the world."""
        found: list[tuple[int, np.ndarray]] = []
        known_meshes = set()
        for index, untransformed in half_spaces(scene).items():
            item, mesh = scene.objects[index], meshes[index]
            # Of a mesh with many places, they are found once.
            own = mesh.convex_planes if id(item.mesh) not in known_meshes else None
            known_meshes.add(id(item.mesh))
            if own is None:  # a transform may push a borderline solid over the tolerance
                own = _transformed_planes(untransformed, item.object_to_world)
            offset = own[:, 3] - own[:, :3] @ space.centre
            found.append((index, np.column_stack([own[:, :3], offset * space.scale])))
        records = SOLID.zeros(len(found))
        counts = [len(planes) for _, planes in found]
        records["object"] = [index for index, _ in found]
        records["plane_count"], records["first_plane"] = counts, np.cumsum([0, *counts])[:-1]
        planes = np.concatenate([planes for _, planes in found]) if found else np.zeros((0, 4))
        return Solids(records, np.ascontiguousarray(planes, "f4"))

    def moved(self, index: int, matrix: np.ndarray) -> tuple[int, np.ndarray] | None:
        """Number of the first plane of object `index`, and all of them, float32 (n, 4), under `matrix` (3, 4); None
        where it is no such solid."""
        mine = np.flatnonzero(self.records["object"] == index)
        if not len(mine):
            return None
        first, count = (int(self.records[name][mine[0]]) for name in ("first_plane", "plane_count"))
        planes = _transformed_planes(self.planes[first : first + count].astype(float), np.vstack([matrix, _LAST_ROW]))
        return first, np.ascontiguousarray(planes, "f4")


@dataclass(frozen=True)
class Curved:
    """Objects that are intersections of quadrics' insides and half-spaces (`curved_solids`)."""

    own: dict[int, tuple[Face, ...]]
    """By object, in their own frames."""
    faces: tuple[Face, ...]
    """Faces of all objects, GPU space."""
    objects: tuple[int, ...]
    """Each face's object."""

    @staticmethod
    def of(scene: Scene, space: GpuSpace, own: dict[int, tuple[Face, ...]]) -> tuple[Curved, dict[str, np.ndarray]]:
        """With the sections of `SceneTexels`."""
        faces: list[Face] = []
        for index, found in own.items():
            matrix = scene.objects[index].object_to_world
            offset = (matrix[:3, 3] - space.centre) * space.scale
            faces += [face.moved(space.scale * matrix[:3, :3], offset) for face in found]
        objects = [index for index, found in own.items() for _ in found]
        records = _pieces(faces, objects)
        return Curved(own, tuple(faces), tuple(objects)), {"PIECES": records} if faces else {}

    def moved(self, index: int, matrix: np.ndarray) -> tuple[int, np.ndarray] | None:
        """Number of the first face of object `index`, and records of all of them, under `matrix` (3, 4); None where it
        is no such solid."""
        if index not in self.own:
            return None
        first = self.objects.index(index)
        faces = self.faces[first : first + len(self.own[index])]
        return first, _pieces([face.moved(matrix[:, :3], matrix[:, 3]) for face in faces], [index] * len(faces))

    def primitives(self, index: int, corners: np.ndarray) -> np.ndarray:
        """uint32 (T,): the face that each triangle of an object's mesh is part of. `corners` (T, 3, 3): GPU space."""
        first = self.objects.index(index)
        off = [np.abs(face.distance(corners)).max(axis=1) for face in self.faces[first : first + len(self.own[index])]]
        return (_CURVED_BIT | (first + np.argmin(off, axis=0))).astype(np.uint32)


@dataclass(frozen=True)
class Triangles:
    """All other objects, as the tree orders their triangles."""

    order: np.ndarray
    """int (N,): each one's number among the triangles of all objects, in their order."""
    corner_turn: np.ndarray
    """`SceneBuffers.corner_turn`."""
    tree: Bvh | None

    @staticmethod
    def of(
        scene: Scene,
        meshes: Sequence[Mesh],
        space: GpuSpace,
        first: np.ndarray,
        loose: Sequence[int],
        has_tree: bool,
    ) -> tuple[Triangles, dict[str, np.ndarray]]:
        """With the sections of `SceneTexels`, which are not needed once they are uploaded. `first`:
        `SceneGeometry.first_triangle`; `loose`: objects that are neither `Solids` nor `Curved`."""
        corner_turn = np.tile(np.arange(3), (first[-1], 1))
        if not loose:
            return Triangles(np.zeros(0, int), corner_turn, None), {}
        source = np.concatenate([np.arange(first[i], first[i + 1]) for i in loose])
        corners = np.concatenate([space.to_gpu(meshes[i].corners()) for i in loose]).astype("f4")
        corner_turn[source] = _best_corner_first(corners)[..., 0]
        turned = corner_turn[source][..., None]
        corners = np.take_along_axis(corners, turned, axis=1)
        order, tree = np.arange(len(corners)), None
        if has_tree:
            tree = build_bvh(corners)
            order = tree.order
        found = Triangles(source[order], corner_turn, tree)
        sections = {} if tree is None else {"TREE": tree_texels(tree.nodes)}
        corners = corners[order]
        records = TRIANGLE.zeros(len(order))
        records["vertex"] = corners[:, 0]
        records["edge1"] = corners[:, 1] - corners[:, 0]
        records["edge2"] = corners[:, 2] - corners[:, 0]
        records["object"] = np.repeat(loose, [len(meshes[i].triangles) for i in loose])[order]
        records["source"] = found.order
        normals = np.concatenate([_corner_normals(scene.objects[i], meshes[i]) for i in loose])
        normals = np.take_along_axis(normals, turned, axis=1)[order]
        smooth = np.isfinite(normals).all(axis=(1, 2)) & (np.abs(normals).sum(axis=2) > 0).all(axis=1)
        # A facet whose three corner normals agree is flat: its normal has no derivative to compute.
        records["normals"] = NONE
        records["normals"][smooth] = 3 * np.arange(np.count_nonzero(smooth))
        packed = np.zeros((3 * np.count_nonzero(smooth), 4), "f4")
        packed[:, :3] = normals[smooth].reshape(-1, 3)
        return found, sections | {"TRIANGLES": records, "NORMALS": packed}


@dataclass(frozen=True)
class SceneGeometry:
    """Every object's shape, as one of three."""

    solids: Solids
    curved: Curved
    triangles: Triangles
    first_triangle: np.ndarray
    """int (objects + 1,): each object's first one among the triangles of all."""

    @staticmethod
    def of(
        scene: Scene, meshes: Sequence[Mesh], space: GpuSpace, features: Features
    ) -> tuple[SceneGeometry, dict[str, np.ndarray]]:
        """With sections of `SceneTexels`. `meshes`: in the world."""
        solids = Solids.of(scene, meshes, space)
        curved, pieces = Curved.of(scene, space, curved_solids(scene) if features.curved_solids else {})
        packed = set(solids.records["object"].tolist()) | set(curved.own)
        loose = [i for i in range(len(meshes)) if i not in packed]
        first = np.cumsum([0] + [len(mesh.triangles) for mesh in meshes])
        triangles, sections = Triangles.of(scene, meshes, space, first, loose, features.tree)
        return SceneGeometry(solids, curved, triangles, first), sections | pieces

    def primitives(self, meshes: Sequence[Mesh], space: GpuSpace) -> np.ndarray:
        """uint32 (T,): what a ray that left each triangle has as `last_primitive`; T counts all objects' triangles."""
        numbers = np.full(self.first_triangle[-1], NONE, np.uint32)
        numbers[self.triangles.order] = np.arange(len(self.triangles.order))
        for solid in self.solids.records:
            first, count, index = (int(solid[name]) for name in ("first_plane", "plane_count", "object"))
            planes = self.solids.planes[first : first + count].astype(float)
            corners = space.to_gpu(meshes[index].corners())
            off = np.abs(corners @ planes[:, :3].T - planes[:, 3]).max(axis=1)
            start = self.first_triangle[index]
            numbers[start : start + len(corners)] = _PLANE_BIT | (first + off.argmin(axis=1))
        for index in self.curved.own:
            start, end = self.first_triangle[index], self.first_triangle[index + 1]
            numbers[start:end] = self.curved.primitives(index, space.to_gpu(meshes[index].corners()))
        return numbers


def _corner_normals(item: SceneObject, mesh: Mesh) -> np.ndarray:
    """float (T, 3, 3); not a number where the surface is as its facets are."""
    known = mesh.corner_normals if item.material.is_specular or item.material.has_coat else None
    return np.full((len(mesh.triangles), 3, 3), np.nan) if known is None else known


def _best_corner_first(corners: np.ndarray) -> np.ndarray:
    """Order (T, 3, 1) of each triangle's corners, turned so that the edges at the first are nearest to a right angle.

    A needle then has its short edge there. Between its two long ones the normal and the place on the facet would
    lose as many digits as the needle is thin.
    """
    to_next = (np.roll(corners, -1, axis=1) - corners).astype(np.float64)
    from_last = np.roll(to_next, 1, axis=1)
    along = np.einsum("tcj,tcj->tc", to_next, from_last)
    size = np.linalg.norm(to_next, axis=2) * np.linalg.norm(from_last, axis=2)
    cosine = np.abs(np.divide(along, size, out=np.ones_like(along), where=size > 0.0))
    return ((cosine.argmin(axis=1)[:, None] + np.arange(3)) % 3)[..., None]


def _pieces(faces: Sequence[Face], objects: Sequence[int]) -> np.ndarray:
    """PIECE records."""
    records = PIECE.zeros(len(faces))
    for record, face in zip(records, faces, strict=True):
        record["row_x"], record["row_y"], record["row_z"] = face.rows
        record["origin"], record["linear"], record["constant"] = face.origin, face.linear, face.constant
        record["is_plane"] = face.is_plane
    records["object"] = objects
    records["is_last"] = np.diff([*objects, -1]) != 0
    return records


def _transformed_planes(planes: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Half-spaces n·x <= d under an affine map."""
    covectors = np.linalg.inv(matrix).T @ np.column_stack([planes[:, :3], -planes[:, 3]]).T
    covectors = covectors.T / np.linalg.norm(covectors[:3], axis=0)[:, None]
    return np.column_stack([covectors[:, :3], -covectors[:, 3]])
