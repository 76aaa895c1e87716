"""Angle-weighted corner normals: smooth everywhere, or up to a crease angle.

Weights are the corner angles (Thürmer and Wüthrich, Computing Vertex Normals from Polygonal
Facets, 1998): independent of how a flat part is cut into triangles.
"""

from __future__ import annotations

import math

import numpy as np

from .mesh import Mesh, cross, normalised
from .mesh_health import weld_map

FINE_TRIANGLES, FINE_BEND_DEG, FLAT_DEG = 500, 12.0, 0.05
SMOOTH_CREASE_DEG = 30.0
"""What bends less is taken to be smooth in a finely cut mesh without normals."""


def angle_weighted_normals(mesh: Mesh, crease_deg: float = 180.0) -> np.ndarray:
    """Corner normals, float64 (T, 3, 3).

    Faces round a vertex are averaged as long as they hang together over edges that bend by
    at most `crease_deg`; other edges stay sharp. Vertices at one position count as one. A
    corner whose faces cancel keeps its face normal.
    """
    triangles = weld_map(mesh.vertices)[1][mesh.triangles]
    faces = mesh.face_normals()
    group = (
        triangles if crease_deg >= 180.0 else _smoothing_groups(triangles, faces, math.cos(math.radians(crease_deg)))
    )
    group = group.ravel()
    weighted = (_corner_angles(mesh.corners())[..., None] * faces[:, None]).reshape(-1, 3)
    sums = np.stack([np.bincount(group, weighted[:, axis]) for axis in range(3)], axis=1)
    scale = np.bincount(group, np.linalg.norm(weighted, axis=1))
    sums[np.linalg.norm(sums, axis=1) <= 1e-9 * scale] = 0.0
    normals = normalised(sums)[group].reshape(-1, 3, 3)
    cancelled = (normals == 0.0).all(axis=2, keepdims=True)
    return np.where(cancelled, faces[:, None], normals)


def is_finely_cut(mesh: Mesh) -> bool:
    """Whether flat triangles most likely stand for a smooth surface: many of them, that bend a little from one to the
    next. A cut stone has few, and bends more."""
    if len(mesh.triangles) < FINE_TRIANGLES:
        return False
    triangles, faces = weld_map(mesh.vertices)[1][mesh.triangles], mesh.face_normals()
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    key = np.minimum(start, end).astype(np.int64) * (int(triangles.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    one, two = order[:-1][same] // 3, order[1:][same] // 3
    bends = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", faces[one], faces[two]), -1.0, 1.0)))
    bends = bends[(bends > FLAT_DEG) & (bends < SMOOTH_CREASE_DEG)]
    return len(bends) > 0.2 * len(same.nonzero()[0]) and float(np.median(bends)) < FINE_BEND_DEG


def _corner_angles(corners: np.ndarray) -> np.ndarray:
    """Interior angles in radians, float64 (T, 3)."""
    after = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    before = (np.roll(corners, 1, axis=1) - corners).reshape(-1, 3)
    sine = np.linalg.norm(cross(after, before), axis=1)
    return np.arctan2(sine, np.einsum("ij,ij->i", after, before)).reshape(-1, 3)


def _smoothing_groups(triangles: np.ndarray, faces: np.ndarray, cos_crease: float) -> np.ndarray:
    """Number of the smooth fan each corner belongs to, int (T, 3)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    key = np.minimum(start, end).astype(np.int64) * (int(triangles.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    one, two = order[:-1][same], order[1:][same]
    soft = np.einsum("ij,ij->i", faces[one // 3], faces[two // 3]) >= cos_crease - 1e-12
    one, two = one[soft], two[soft]

    def following(corner: np.ndarray) -> np.ndarray:
        return corner - corner % 3 + (corner + 1) % 3

    # The corner at an edge's start meets the neighbour's corner at the same vertex.
    opposite = start[one] != start[two]
    at_start = np.where(opposite, following(two), two)
    at_end = np.where(opposite, two, following(two))
    rows = np.concatenate([one, following(one)])
    columns = np.concatenate([at_start, at_end])
    size = triangles.size
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(size, size)).tocsr()
    return connected_components(graph, directed=False)[1].reshape(-1, 3)
