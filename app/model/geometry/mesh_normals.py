"""Angle-weighted corner normals: smooth everywhere, or up to a crease angle.

Weights are the corner angles (Thürmer and Wüthrich, Computing Vertex Normals from Polygonal
Facets, 1998): independent of how a flat part is cut into triangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .mesh import Mesh, cross, normalised
from .mesh_health import connected_roots, half_edges, weld_map

FINE_TRIANGLES, FINE_BEND_DEG, FLAT_DEG = 500, 12.0, 0.05
SMOOTH_CREASE_DEG = 30.0
"""What bends less is taken to be smooth in a finely cut mesh without normals."""
ROUND_DEG = 60.0
"""The crease angle of `--smooth`."""

OFF_DEG, OFF_SHARE = 20.0, 0.01
"""Normals further off their facets than this, over that share of the area, are worth a second look."""
SHARP_DEG, SHARP_BY_FACET_DEG, SHARP_ANYWHERE_DEG = 45.5, 35.0, 65.0
"""Bends that no curve has which is cut into eight or more facets a turn: on a convex solid, on one with a flat facet
whose normals fan out, and on any (coarse tori bend more)."""
SHARP_SHARE, CUT_SHARE, FACET_SHARE = 0.1, 0.6, 0.05
"""Shares of the area: next to sharp edges, for a convex solid to have any; for it to be cut; of a facet showing it."""
FAN_DEG, SAME_NORMAL = 5.0, math.cos(math.radians(1.2))


def angle_weighted_normals(mesh: Mesh, crease_deg: float = 180.0) -> np.ndarray:
    """Corner normals, float64 (T, 3, 3).

    Faces round a vertex are averaged as long as they hang together over edges that bend by
    at most `crease_deg`; other edges stay sharp. Vertices at one position count as one. A
    corner whose faces cancel keeps its face normal.
    """
    faces = mesh.face_normals()
    group = weld_map(mesh.vertices)[1][mesh.triangles] if crease_deg >= 180.0 else _smoothing_groups(mesh, crease_deg)
    group = group.ravel()
    weighted = (_corner_angles(mesh.corners())[..., None] * faces[:, None]).reshape(-1, 3)
    sums = np.stack([np.bincount(group, weighted[:, axis]) for axis in range(3)], axis=1)
    scale = np.bincount(group, np.linalg.norm(weighted, axis=1))
    sums[np.linalg.norm(sums, axis=1) <= 1e-9 * scale] = 0.0
    normals = normalised(sums)[group].reshape(-1, 3, 3)
    cancelled = (normals == 0.0).all(axis=2, keepdims=True)
    return np.where(cancelled, faces[:, None], normals)


def with_smooth(mesh: Mesh, smooth: bool | float | None) -> Mesh:
    """`mesh` with normals as a scene file's `smooth` says: None its own; False flat; True averaged over every edge; a
    number over edges that bend by at most so many degrees."""
    if smooth is None:
        return mesh
    normals = None if smooth is False else angle_weighted_normals(mesh, 180.0 if smooth is True else float(smooth))
    return replace(mesh, corner_normals=normals)


def is_finely_cut(mesh: Mesh) -> bool:
    """Whether flat triangles most likely stand for a smooth surface: many of them, that bend a little from one to the
    next. A cut stone has few, and bends more."""
    return len(mesh.triangles) >= FINE_TRIANGLES and _bends_little(Edges.of(mesh).bend_deg, 50.0)


def with_plausible_normals(mesh: Mesh, notes: list[str], file: str, is_bare: bool = False) -> Mesh:
    """`mesh` without the normals of a cut stone that were averaged over its edges, as many programs write them.

    A solid is taken to be cut where the normals run smoothly over edges too sharp for a tessellated curve. It becomes
    flat, or smooth between those edges where it is finely cut, as a mesh of a file that `is_bare` becomes without any
    normals; a note in `notes` says so once. Coarse balls, tori and cylinders keep their normals: they bend by at most
    45° at eight facets a turn.
    """
    if mesh.corner_normals is None:
        why, crease = "no normals are given", SMOOTH_CREASE_DEG if is_bare and is_finely_cut(mesh) else None
    else:
        why, crease = (
            "normals far off their facets, as if averaged over edges, are passed over",
            _plausible_crease(mesh),
        )
    if crease is None:
        return mesh
    done = f"is smooth where it bends by less than {crease:g}°; --flat shows facets"
    note = f"{file}: {why}; the mesh {done if crease else 'has flat facets; --smooth rounds it'}."
    if note not in notes:
        notes.append(note)
    return with_smooth(mesh, crease or False)


def _plausible_crease(mesh: Mesh) -> float | None:
    """0 for a mesh whose normals should be those of its facets, a crease angle in degrees for one with sharp edges
    between smooth parts, None for one that may keep its normals."""
    assert mesh.corner_normals is not None
    areas = mesh.areas() / max(float(mesh.areas().sum()), 1e-300)
    cosine = np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals())
    if float(areas @ (cosine < math.cos(math.radians(OFF_DEG))).mean(axis=1)) < OFF_SHARE:
        return None
    edges = Edges.of(mesh)
    if not len(edges.one):
        return None
    is_convex = float(edges.is_convex(mesh).mean()) > 0.98
    fans = (cosine < math.cos(math.radians(FAN_DEG))).any(axis=1)
    has_facet = edges.largest_facet(areas, fans) > FACET_SHARE
    sharp_deg = SHARP_ANYWHERE_DEG if not is_convex else SHARP_BY_FACET_DEG if has_facet else SHARP_DEG
    averaged = edges.is_averaged(mesh) & (edges.bend_deg > sharp_deg)
    at_vertex = np.zeros(int(edges.vertex.max()) + 1, bool)
    at_vertex[edges.vertex.ravel()[edges.ends()[:, averaged]]] = True
    share = float(areas @ at_vertex[edges.vertex].any(axis=1))
    if share < (SHARP_SHARE if is_convex else 0.9):
        return None
    if is_finely_cut(mesh) or _bends_little(edges.bend_deg, 90.0):
        return SMOOTH_CREASE_DEG
    return 0.0 if share > CUT_SHARE or has_facet else None


def _bends_little(bend_deg: np.ndarray, percentile: float) -> bool:
    """Whether many edges bend, a turn's at least, and up to this percentile of them by less than `FINE_BEND_DEG`."""
    bent = bend_deg[bend_deg > FLAT_DEG]
    soft = bent[bent < SMOOTH_CREASE_DEG]
    return len(soft) > max(0.2 * len(bent), 360.0 / 15.0) and float(np.percentile(soft, percentile)) < FINE_BEND_DEG


@dataclass(frozen=True)
class Edges:
    """Edges (E,) between two triangles: at which corners (three times the triangle's number, and the place there) they
    begin in `one` and in `two`, and the angle between both normals. `vertex` (T, 3) is one number for one position."""

    vertex: np.ndarray
    one: np.ndarray
    two: np.ndarray
    bend_deg: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh) -> Edges:
        """All of `mesh`."""
        order, same, vertex = half_edges(mesh)
        faces = mesh.face_normals()
        one, two = order[:-1][same], order[1:][same]
        cosine = np.einsum("ij,ij->i", faces[one // 3], faces[two // 3])
        return cls(vertex, one, two, np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))

    def ends(self) -> np.ndarray:
        """Corners at both ends of each edge, int (4, E): of the first triangle, and at the same two vertices of the
        other one."""
        opposite = self.vertex.ravel()[self.one] != self.vertex.ravel()[self.two]
        at_start = np.where(opposite, _following(self.two), self.two)
        at_end = np.where(opposite, self.two, _following(self.two))
        return np.stack([self.one, _following(self.one), at_start, at_end])

    def is_averaged(self, mesh: Mesh) -> np.ndarray:
        """Whether both triangles have one normal at either end, bool (E,)."""
        assert mesh.corner_normals is not None
        normals = mesh.corner_normals.reshape(-1, 3)[self.ends()]
        return (np.einsum("eij,eij->ei", normals[:2], normals[2:]) > SAME_NORMAL).all(axis=0)

    def is_convex(self, mesh: Mesh) -> np.ndarray:
        """Whether the other triangle does not rise over the first one's plane, bool (E,)."""
        corners = mesh.corners().reshape(-1, 3)
        beyond = corners[_following(_following(self.two))] - corners[self.one]
        rise = np.einsum("ij,ij->i", mesh.face_normals()[self.one // 3], beyond)
        return (rise <= 0.0) | (self.bend_deg < 1.0)

    def largest_facet(self, areas: np.ndarray, counts: np.ndarray) -> float:
        """Area of the largest flat facet of which three triangles or more count; 0 without one."""
        flat = self.bend_deg < 0.5
        facet = connected_roots(self.one[flat] // 3, self.two[flat] // 3, len(areas))
        return float(np.where(np.bincount(facet, counts) > 2, np.bincount(facet, areas), 0.0).max())


def _following(corner: np.ndarray) -> np.ndarray:
    return corner - corner % 3 + (corner + 1) % 3


def _corner_angles(corners: np.ndarray) -> np.ndarray:
    """Interior angles in radians, float64 (T, 3)."""
    after = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    before = (np.roll(corners, 1, axis=1) - corners).reshape(-1, 3)
    sine = np.linalg.norm(cross(after, before), axis=1)
    return np.arctan2(sine, np.einsum("ij,ij->i", after, before)).reshape(-1, 3)


def _smoothing_groups(mesh: Mesh, crease_deg: float) -> np.ndarray:
    """Number of the smooth fan each corner belongs to, int (T, 3)."""
    edges = Edges.of(mesh)
    at_one, at_other = np.split(edges.ends()[:, edges.bend_deg <= crease_deg + 1e-4], 2)
    return connected_roots(at_one.ravel(), at_other.ravel(), edges.vertex.size).reshape(-1, 3)
