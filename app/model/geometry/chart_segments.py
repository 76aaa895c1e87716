"""Cutting a mesh into charts and laying them flat: its own texture coordinates, or projections.

Projection: every triangle goes to the nearest of fourteen directions (faces and corners of
a cube), connected triangles of one direction make a chart, and the chart is projected
along it. No normal is further than 55° from its chart's direction, most are within 35°.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh import Mesh
from .mesh_health import connected_roots, half_edges

_SMOOTHING_ROUNDS = 8
_MIN_COSINE = 0.57
"""A triangle joins its neighbours' chart only while it is tilted against it by less than 55°."""


@dataclass(frozen=True)
class Layout:
    """Charts laid flat, each from (0, 0) upward, in scene units."""

    chart_of: np.ndarray
    """int32 (T,), charts numbered from 0."""
    corners: np.ndarray
    """float64 (T, 3, 2), corner positions within the chart."""
    extents: np.ndarray
    """float64 (C, 2), size of each chart."""
    own_uv: bool

    def split(self, mesh: Mesh, charts: np.ndarray) -> Layout:
        """Cut each of `charts` in two across its longest direction in space, so that folds separate."""
        chart_of = self.chart_of.astype(np.int64)
        middles = mesh.corners().mean(axis=1)
        for chart in charts:
            members = np.flatnonzero(chart_of == chart)
            if len(members) < 2:
                continue
            centred = middles[members] - middles[members].mean(axis=0)
            along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
            order = np.argsort(along, kind="stable")
            chart_of[members[order[len(order) // 2 :]]] = chart_of.max() + 1
        return _placed(_numbered(mesh, chart_of), self.corners, own_uv=False)


def half_edge_twins(mesh: Mesh) -> np.ndarray:
    """Opposite half-edge of each half-edge 3 t + i (corner i to i + 1), int64 (3 T,); -1 at a border.

    Vertices at one position count as one. Edges of more than two triangles pair up as they come.
    """
    order, same, _ = half_edges(mesh)
    # In a run of equal keys, pair 0-1, 2-3, …
    position = np.arange(len(order))
    begins = np.concatenate([[True], ~same])
    within = position - np.maximum.accumulate(np.where(begins, position, 0))
    first = np.flatnonzero(same & (within[:-1] % 2 == 0))
    twins = np.full(len(order), -1, dtype=np.int64)
    twins[order[first]], twins[order[first + 1]] = order[first + 1], order[first]
    return twins


def lay_out(mesh: Mesh, own_uv: bool) -> Layout | None:
    """Charts from the mesh's texture coordinates (None when they degenerate) or by projection."""
    return _from_uv(mesh) if own_uv else _by_projection(mesh)


def _by_projection(mesh: Mesh) -> Layout:
    directions = _directions()
    cosines = mesh.face_normals() @ directions.T
    # A hair in favour of the axes, so that ties do not fray.
    label = np.argmax(cosines + 1e-6 * (np.abs(directions).max(axis=1) > 0.9), axis=1)
    twins = half_edge_twins(mesh).reshape(-1, 3)
    triangle = np.arange(len(label))
    for _ in range(_SMOOTHING_ROUNDS):
        around = np.where(twins >= 0, label[twins // 3], -1)
        agreed = np.where(
            (around[:, 0] == around[:, 1]) | (around[:, 0] == around[:, 2]),
            around[:, 0],
            np.where(around[:, 1] == around[:, 2], around[:, 1], -1),
        )
        change = (agreed >= 0) & (agreed != label) & (cosines[triangle, agreed] > _MIN_COSINE)
        if not change.any():
            break
        label = np.where(change, agreed, label)
    first, second = _tangents(directions)
    corners = mesh.corners()
    flat = np.stack(
        [np.einsum("tcj,tj->tc", corners, first[label]), np.einsum("tcj,tj->tc", corners, second[label])], axis=2
    )
    return _placed(_numbered(mesh, label), flat, own_uv=False)


def _directions() -> np.ndarray:
    """Fourteen unit directions, float64 (14, 3): the six axes and the eight diagonals."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    diagonals = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / np.sqrt(3.0)
    return np.concatenate([axes, diagonals])


def _tangents(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each direction, right-handed with it."""
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    first = np.cross(helper, directions)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(directions, first)


def _numbered(mesh: Mesh, label: np.ndarray) -> np.ndarray:
    """Connected parts of equal `label`, numbered from 0, int32 (T,)."""
    twins = half_edge_twins(mesh)
    here = np.flatnonzero(twins >= 0)
    a, b = here // 3, twins[here] // 3
    same = label[a] == label[b]
    root = connected_roots(a[same], b[same], len(label))
    return np.unique(root, return_inverse=True)[1].reshape(-1).astype(np.int32)


def _placed(chart_of: np.ndarray, corners: np.ndarray, own_uv: bool) -> Layout:
    """Move every chart's lowest corner to (0, 0)."""
    charts = int(chart_of.max()) + 1
    low, high = np.full((charts, 2), np.inf), np.full((charts, 2), -np.inf)
    np.minimum.at(low, chart_of, corners.min(axis=1))
    np.maximum.at(high, chart_of, corners.max(axis=1))
    return Layout(chart_of.astype(np.int32), corners - low[chart_of][:, None], high - low, own_uv)


def _from_uv(mesh: Mesh) -> Layout | None:
    """The islands of the mesh's texture coordinates, each scaled to its true area."""
    uv = mesh.uv
    if uv is None or not np.isfinite(uv).all():
        return None
    twins = half_edge_twins(mesh)
    here = np.flatnonzero(twins >= 0)
    opposite = twins[here]

    def at(half_edge: np.ndarray, step: int) -> np.ndarray:
        return uv[half_edge // 3, (half_edge % 3 + step) % 3]

    joined = (at(here, 0) == at(opposite, 1)).all(axis=1) & (at(here, 1) == at(opposite, 0)).all(axis=1)
    root = connected_roots(here[joined] // 3, opposite[joined] // 3, len(uv))
    chart_of = np.unique(root, return_inverse=True)[1].reshape(-1)
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    signed = 0.5 * (d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0])
    areas = mesh.areas()
    in_uv, in_world = np.bincount(chart_of, signed), np.bincount(chart_of, areas)
    if (in_uv == 0.0).any():
        return None
    stretch = signed / in_uv[chart_of] * in_world[chart_of]
    # Each triangle must be as its chart is: same side up, area within a factor of eight.
    solid = areas > 1e-12 * areas.max()
    if (stretch[solid] < areas[solid] / 8.0).any() or (stretch[solid] > 8.0 * areas[solid]).any():
        return None
    scale = np.sqrt(in_world / np.abs(in_uv))
    corners = uv * scale[chart_of][:, None, None]
    corners[..., 0] *= np.where(in_uv[chart_of] < 0.0, -1.0, 1.0)[:, None]
    layout = _placed(chart_of, corners, own_uv=True)
    return layout if not _sheared(mesh, corners) else None


def _sheared(mesh: Mesh, corners: np.ndarray) -> bool:
    """Whether some sizeable triangle is stretched more than tenfold along one direction against the other."""
    p = mesh.corners()
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    x1 = np.linalg.norm(e1, axis=1)
    solid = mesh.areas() > 1e-9 * mesh.areas().max()
    x1 = np.where(x1 > 0.0, x1, 1.0)
    x2 = np.einsum("ij,ij->i", e1, e2) / x1
    y2 = 2.0 * mesh.areas() / x1
    y2 = np.where(solid, y2, 1.0)
    du = (corners[:, 1] - corners[:, 0]) / x1[:, None]
    dv = ((corners[:, 2] - corners[:, 0]) - du * x2[:, None]) / y2[:, None]
    jacobian = np.stack([du, dv], axis=2)[solid]
    singular = np.linalg.svd(jacobian, compute_uv=False)
    return bool((singular[:, 0] > 10.0 * np.maximum(singular[:, 1], 1e-300)).any())
