"""A convex solid from its planes: what faceting designs are made of.

Planes that meet in one point only as far as a file's decimals say get one vertex there, so that the mesh is watertight
by index.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .mesh import Mesh, make_mesh
from .mesh_health import connected_roots

_WIDEST = 1e4
"""A solid that reaches beyond this many times its planes' distances is open."""
_THINNEST = 1e-9
_WELD = 1e-8
"""Vertices closer than this share of the solid's size are one."""


def faces_of(planes: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Vertices, float64 (V, 3), and for each of `planes`, rows (n, d) of half-spaces n·x <= d with unit n, the numbers
    of its face's corners, counter-clockwise seen from outside; none where it only touches the solid.

    Raises ValueError with a reason where the half-spaces leave nothing, or something open.
    """
    from scipy.optimize import linprog
    from scipy.spatial import HalfspaceIntersection, QhullError

    planes = np.asarray(planes, dtype=np.float64)
    normals, scale = planes[:, :3], float(np.abs(planes[:, 3]).max(initial=0.0))
    if scale == 0.0:
        raise ValueError("all planes go through one point")
    distances = planes[:, 3] / scale
    # The largest ball that fits, of a radius up to 1.
    rows = np.column_stack([normals, np.ones(len(planes))])
    ball = linprog((0.0, 0.0, 0.0, -1.0), rows, distances, bounds=[(-_WIDEST, _WIDEST)] * 3 + [(0.0, 1.0)])
    if not ball.success or ball.x[3] < _THINNEST:
        raise ValueError("they leave nothing of the solid")
    try:
        hull = HalfspaceIntersection(np.column_stack([normals, -distances]), ball.x[:3])
    except QhullError:
        raise ValueError("they do not close: it has no end on one side") from None
    if hull.dual_equations[:, 3].max() > -1.0 / _WIDEST:
        raise ValueError("they do not close: it has no end on one side")
    vertices, on = _welded(hull.intersections, hull.dual_facets, normals, distances)
    return scale * vertices, [
        _corners(normal, vertices, np.flatnonzero(here)) for normal, here in zip(normals, on.T, strict=True)
    ]


def _welded(
    points: np.ndarray, met: list[list[int]], normals: np.ndarray, distances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, float64 (V, 3), and which planes go through each, bool (V, P), of `points` in which planes `met`; where
    they meet in several points that are nearly one, the point that is nearest to all of them."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(_WELD * float(np.ptp(points, axis=0).max()), output_type="ndarray")
    roots, number = np.unique(connected_roots(pairs[:, 0], pairs[:, 1], len(points)), return_inverse=True)
    on = np.zeros((len(roots), len(normals)), bool)
    for corner, planes in zip(number, met, strict=True):
        on[corner, planes] = True
    vertices = points[roots]
    for vertex, through in zip(vertices, on, strict=True):
        vertex += np.linalg.lstsq(normals[through], distances[through] - normals[through] @ vertex, rcond=1e-6)[0]
    return vertices, on


def _corners(normal: np.ndarray, vertices: np.ndarray, face: np.ndarray) -> np.ndarray:
    """The vertices `face` of a plane in their order round it."""
    if len(face) < 3:
        return face[:0]
    spread = vertices[face] - vertices[face].mean(axis=0)
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    return face[np.argsort(np.arctan2(spread @ np.cross(normal, u), spread @ u))]


def convex_solid(name: str, planes: np.ndarray, source: str | None = None) -> Mesh:
    """The solid within `planes`, as in `faces_of`, each face a fan of triangles. Raises ValueError as that."""
    vertices, faces = faces_of(planes)
    used, number = np.unique(np.concatenate(faces), return_inverse=True)
    triangles, first = [], 0
    for face in filter(len, faces):
        triangles += _fan(vertices, face, number[first : first + len(face)])
        first += len(face)
    mesh = make_mesh(name, vertices[used], np.array(triangles), source=source)
    if not mesh.is_closed or mesh.volume() <= 0.0:
        raise ValueError("they leave too thin a solid")
    return mesh


def _fan(vertices: np.ndarray, face: np.ndarray, number: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of a convex polygon from that of its corners which leaves none of them without area."""
    best: tuple[float, np.ndarray] = (-1.0, number)
    for turn in range(len(face)):
        spread = vertices[np.roll(face, -turn)]
        spread = spread[1:] - spread[0]
        least = float(np.linalg.norm(np.cross(spread[:-1], spread[1:]), axis=1).min(initial=np.inf))
        if least > best[0]:
            best = least, np.roll(number, -turn)
    apex, *others = best[1].tolist()
    return [(apex, a, b) for a, b in pairwise(others)]
