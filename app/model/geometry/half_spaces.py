"""A convex solid from its planes: what faceting designs are made of.

The face on a plane is the part of it that all other half-spaces leave, cut in the plane's own two coordinates. Planes
that meet in one point only as far as a file's decimals say get one vertex there, so that the mesh is watertight by
index.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .mesh import Mesh, make_mesh
from .mesh_health import connected_roots

_WIDEST = 1e4
"""A solid that reaches beyond this many times its planes' distances is open."""
_SAME = 1e-9
_WELD = 1e-8
"""Vertices closer than this share of the solid's size are one."""
_AT_ONCE = 256

Line = tuple[float, float, float]
"""a x + b y <= c, (a, b) a unit vector."""


def faces_of(planes: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Vertices, float64 (V, 3), and for each of `planes`, rows (n, d) of half-spaces n·x <= d with unit n, the numbers
    of its face's corners, counter-clockwise seen from outside; none where it only touches the solid.

    Raises ValueError with a reason where the half-spaces leave nothing, or something open.
    """
    planes = np.asarray(planes, dtype=np.float64)
    scale = float(np.abs(planes[:, 3]).max(initial=0.0))
    if scale == 0.0:
        raise ValueError("all planes go through one point")
    corners = [_face(planes, number, scale) for number in range(len(planes))]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    if sum(len(face) > 0 for face in corners) < 4:
        raise ValueError("they leave nothing of the solid")
    of_face = np.repeat(np.arange(len(planes)), [len(face) for face in corners])
    vertices, number = _welded(points, of_face, planes)
    faces = []
    for part in np.split(number, np.cumsum([len(face) for face in corners])[:-1]):
        face = part[part != np.roll(part, 1)]
        faces.append(face if len(face) > 2 else face[:0])
    return vertices, faces


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


def _face(planes: np.ndarray, number: int, scale: float) -> np.ndarray:
    """Corners of the face on one plane, float64 (n, 3). Raises ValueError where it is open."""
    normal, distance = planes[number, :3], planes[number, 3]
    lines = _lines_on(planes, number, scale)
    if lines is None:
        return np.zeros((0, 3))
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    across = lines[:, :3] @ np.column_stack([u, v])
    length = np.linalg.norm(across, axis=1)
    rows = np.column_stack([across, lines[:, 3]]) / length[:, None]
    corners = _polygon([(a, b, c) for a, b, c in rows[np.argsort(rows[:, 2], kind="stable")].tolist()], scale)
    return distance * normal + np.array(corners).reshape(-1, 2) @ np.stack([u, v])


def _lines_on(planes: np.ndarray, number: int, scale: float) -> np.ndarray | None:
    """Where the other planes cut the plane `number`: rows (n, c) of n·p <= c for p from its point nearest the origin;
    None where one covers it."""
    normal, distance = planes[number, :3], planes[number, 3]
    others = np.delete(planes, number, axis=0)
    cosine = others[:, :3] @ normal
    left = others[:, 3] - cosine * distance
    across = others[:, :3] - cosine[:, None] * normal
    parallel = np.linalg.norm(across, axis=1) < _SAME
    behind = left < _SAME * scale * np.where(
        np.arange(len(others)) < number, 1.0, -1.0
    )  # the first of equal ones stays
    if (parallel & behind & (cosine > 0.0)).any() or (parallel & (left < 0.0) & (cosine < 0.0)).any():
        return None
    return np.column_stack([across, left])[~parallel]


def _polygon(lines: Sequence[Line], scale: float) -> list[tuple[float, float]]:
    """Corners of the polygon within `lines`, which are in the order of c; none where it has no area."""
    reach = _WIDEST * scale
    sides: list[Line | None] = [None] * 4
    corners = [(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)]
    for line in lines:
        a, b, c = line
        if c > 0.0 and c * c > max(x * x + y * y for x, y in corners):
            break
        beyond = [a * x + b * y - c for x, y in corners]
        if max(beyond) <= 1e-13 * scale:
            continue
        if min(beyond) >= -1e-13 * scale:
            return []
        corners, sides = _cut(corners, sides, line, beyond)
    if None in sides:
        raise ValueError("they do not close: it has no end on one side")
    return corners


def _cut(
    corners: list[tuple[float, float]], sides: list[Line | None], line: Line, beyond: list[float]
) -> tuple[list[tuple[float, float]], list[Line | None]]:
    """The polygon without what lies `beyond` a line; `sides[i]` runs from corner i to the next."""
    kept: list[tuple[float, float]] = []
    kept_sides: list[Line | None] = []
    for i, corner in enumerate(corners):
        after = (i + 1) % len(corners)
        if beyond[i] <= 0.0:
            kept.append(corner)
            kept_sides.append(sides[i])
        if (beyond[i] <= 0.0) != (beyond[after] <= 0.0):
            kept.append(_meeting(sides[i], line, corner, corners[after], beyond[i] / (beyond[i] - beyond[after])))
            kept_sides.append(line if beyond[i] <= 0.0 else sides[i])
    return kept, kept_sides


def _meeting(
    side: Line | None, line: Line, start: tuple[float, float], end: tuple[float, float], share: float
) -> tuple[float, float]:
    """Where two lines meet; by `share` of the way from `start` to `end` where they are nearly one."""
    if side is not None:
        (a, b, c), (d, e, f) = side, line
        determinant = a * e - b * d
        if abs(determinant) > 1e-9:
            return (c * e - b * f) / determinant, (a * f - c * d) / determinant
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def _welded(points: np.ndarray, of_face: np.ndarray, planes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, float64 (V, 3), and the number of each of `points`, corners of the faces `of_face`, among them; where
    planes meet in several points that are nearly one, the point that is nearest to all of them."""
    size = float(np.ptp(points, axis=0).max())
    found = [np.zeros((0, 2), int)]
    for first in range(0, len(points), _AT_ONCE):
        apart = np.abs(points[first : first + _AT_ONCE, None] - points).max(axis=2)
        found.append(np.argwhere(apart <= _WELD * size) + (first, 0))
    pairs = np.concatenate(found)
    roots, number = np.unique(connected_roots(pairs[:, 0], pairs[:, 1], len(points)), return_inverse=True)
    vertices = points[roots]
    for i, vertex in enumerate(vertices):
        met = planes[np.unique(of_face[number == i])]
        vertices[i] += np.linalg.lstsq(met[:, :3], met[:, 3] - met[:, :3] @ vertex, rcond=1e-6)[0]
    return vertices, number
