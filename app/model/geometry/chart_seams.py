"""Which texels a chart's triangles cover, and where energy in the others belongs.

A texel outside every triangle is unfolded: through the nearest border edge of its chart into
the plane of the triangle on the edge's other side, at the same distance from the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .chart_segments import half_edge_twins
from .mesh import Mesh, normalised

_PAIRS_AT_ONCE = 1 << 21
_SAMPLE_SPACING = 0.4
"""Texels between the points of a border edge that stand for it in the search for the nearest one."""


@dataclass(frozen=True)
class Seams:
    """The seam fold; see `ChartAtlas`."""

    gutter_texel_xy: np.ndarray
    destination_xy: np.ndarray
    edge_triangle: np.ndarray
    """int64 (G,): triangle of the texel's own chart at the edge it was unfolded through."""

    @staticmethod
    def none() -> Seams:
        """No gutters."""
        return Seams(np.zeros((0, 2), np.int32), np.zeros((0, 2), np.int32), np.zeros(0, np.int64))


def rasterise(corners: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Triangle at each texel's centre, int32 (height, width), -1 for none; and triangles that overlap others.

    `corners`: float64 (T, 3, 2) in texels. A centre on a common edge counts as covered once.
    """
    width, height = size
    owner = np.full(width * height, -1, dtype=np.int32)
    inside_count = np.zeros(width * height, dtype=np.uint8)
    low = np.ceil(corners.min(axis=1) - 0.5).astype(np.int64)
    high = np.floor(corners.max(axis=1) - 0.5).astype(np.int64)
    spans = np.maximum(high - low + 1, 0)
    pairs = spans.prod(axis=1)
    signed = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    pairs[signed == 0.0] = 0
    doubled: list[np.ndarray] = []
    cumulative = np.cumsum(pairs)
    start = 0
    while start < len(corners):
        done = cumulative[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(cumulative, done + _PAIRS_AT_ONCE, side="right")))
        chunk = np.arange(start, stop)
        t = np.repeat(chunk, pairs[chunk])
        local = np.arange(len(t)) - np.repeat(np.cumsum(pairs[chunk]) - pairs[chunk], pairs[chunk])
        x, y = low[t, 0] + local % spans[t, 0], low[t, 1] + local // spans[t, 0]
        centre = np.stack([x, y], axis=1) + 0.5
        least = np.full(len(t), np.inf)
        for i in range(3):
            a, b = corners[t, i], corners[t, (i + 1) % 3]
            np.minimum(least, _cross(b - a, centre - a) / signed[t], out=least)
        covered = least >= -1e-9
        at, t, least = (y * width + x)[covered], t[covered], least[covered]
        owner[at] = t
        # Strictly inside two triangles: the chart overlaps itself.
        strict = least > 1e-6
        np.add.at(inside_count, at[strict], 1)
        doubled.append(t[strict][inside_count[at[strict]] > 1])
        start = stop
    return owner.reshape(height, width), np.unique(np.concatenate(doubled))


def find_seams(
    mesh: Mesh, corners: np.ndarray, chart_of: np.ndarray, rects: np.ndarray, owner: np.ndarray, rows: np.ndarray
) -> Seams:
    """Unfold every uncovered texel of every chart's rectangle."""
    from scipy.ndimage import distance_transform_edt
    from scipy.spatial import cKDTree

    height, width = owner.shape
    chart_at = np.full((height, width), -1, dtype=np.int64)
    for chart, (x0, y0, x1, y1) in enumerate(rects):
        chart_at[y0:y1, x0:x1] = chart
    gutter_y, gutter_x = np.nonzero((chart_at >= 0) & (owner < 0))
    if not len(gutter_x) or (owner < 0).all():
        return Seams.none()
    gutter_chart = chart_at[gutter_y, gutter_x]
    centre = np.stack([gutter_x, gutter_y], axis=1) + 0.5

    twins = half_edge_twins(mesh)
    half_edges = np.arange(len(twins))
    border = half_edges[(twins < 0) | (chart_of[half_edges // 3] != chart_of[twins // 3])]
    if not len(border):  # one chart with no border at all cannot lie flat; guarded for safety of indices
        return Seams.none()
    edge, samples = _sampled(corners, border)
    # The chart's number as a third coordinate keeps every search within its own chart.
    apart = 4.0 * (width + height)
    tree = cKDTree(np.column_stack([samples, apart * chart_of[edge // 3]]))
    _, nearest = tree.query(np.column_stack([centre, apart * gutter_chart]))
    through = edge[nearest]
    known = (twins[through] >= 0) & (chart_of[through // 3] == gutter_chart)

    destination = np.full((len(centre), 2), -1, dtype=np.int64)
    target = _unfolded(mesh, corners, rows, centre[known], through[known], twins[through[known]])
    texel = np.clip(np.floor(target).astype(np.int64), 0, (width - 1, height - 1))
    # At a corner of charts the place may miss every triangle: take the nearest covered texel.
    nearest_y, nearest_x = distance_transform_edt(owner < 0, return_distances=False, return_indices=True)
    destination[known, 0] = nearest_x[texel[:, 1], texel[:, 0]]
    destination[known, 1] = nearest_y[texel[:, 1], texel[:, 0]]
    gutter = np.stack([gutter_x, gutter_y], axis=1).astype(np.int32)
    return Seams(gutter, destination.astype(np.int32), through // 3)


def _sampled(corners: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points along border half-edges in texels: their half-edge (S,) and position (S, 2)."""
    a = corners[border // 3, border % 3]
    b = corners[border // 3, (border % 3 + 1) % 3]
    counts = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / _SAMPLE_SPACING).astype(np.int64), 1)
    which = np.repeat(np.arange(len(border)), counts)
    step = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    t = (step + 0.5) / counts[which]
    return border[which], a[which] + t[:, None] * (b - a)[which]


def _unfolded(
    mesh: Mesh, corners: np.ndarray, rows: np.ndarray, centre: np.ndarray, here: np.ndarray, there: np.ndarray
) -> np.ndarray:
    """Texel positions (N, 2) of `centre` (N, 2) carried over the half-edges `here` to their twins `there`."""
    p = mesh.corners()
    t, i = here // 3, here % 3
    start, end = p[t, i], p[t, (i + 1) % 3]
    along = normalised(end - start)
    # The point in the plane of its own triangle: barycentric coordinates from the flat one.
    a, b, c = (corners[t, k] for k in range(3))
    total = _cross(b - a, c - a)
    total = np.where(total == 0.0, 1.0, total)
    v, w = _cross(centre - a, c - a) / total, _cross(b - a, centre - a) / total
    point = p[t, 0] + v[:, None] * (p[t, 1] - p[t, 0]) + w[:, None] * (p[t, 2] - p[t, 0])
    offset = point - start
    forward = np.einsum("ij,ij->i", offset, along)
    outward = np.linalg.norm(offset - forward[:, None] * along, axis=1)
    # On the other side, across the edge and into the neighbour.
    s, j = there // 3, there % 3
    inward = p[s, (j + 2) % 3] - start
    inward = normalised(inward - np.einsum("ij,ij->i", inward, along)[:, None] * along)
    landing = start + forward[:, None] * along + outward[:, None] * inward
    return np.einsum("nij,nj->ni", rows[s, :, :3], landing) + rows[s, :, 3]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
