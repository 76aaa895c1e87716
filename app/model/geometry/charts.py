"""Texture charts for curved diffuse receivers, whose caustic map cannot be one flat rectangle.

A mesh is cut into charts that are nearly flat, each laid into the plane and packed into one
rectangle of texels. A splat is drawn in the chart its photon hit and spills over the
chart's border into a gutter; the *seam fold* says for every texel outside the triangles
where on the neighbouring chart its energy belongs, so that none is lost and nothing shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.errors import UserError
from .chart_seams import Seams, find_seams, rasterise
from .chart_segments import Layout, lay_out
from .mesh import Mesh

DEFAULT_GUTTER = 6
MAX_TEXELS = 1 << 26


@dataclass(frozen=True)
class ChartAtlas:
    """Where every triangle of a mesh lies in a rectangle of texels, and how its seams connect.

    Texel (x, y) covers [x, x + 1) × [y, y + 1); images are indexed [y, x].
    """

    width: int
    height: int
    rows: np.ndarray
    """float64 (T, 2, 4): texel coordinates = rows[t] @ (p, 1) for a point p on triangle t; they do
    not change along the triangle's normal."""
    chart_of: np.ndarray
    """int32 (T,): chart of each triangle."""
    rects: np.ndarray
    """int32 (C, 4): x0, y0, x1, y1 of each chart with its gutter, upper ends exclusive; disjoint."""
    texel_area: np.ndarray
    """float64 (T,): area on the mesh of one texel, square units."""
    owner: np.ndarray
    """int32 (height, width): triangle that holds the texel's centre, -1 in gutters and between charts."""
    gutter_texel_xy: np.ndarray
    """int32 (G, 2): every texel of a chart's rectangle whose centre no triangle holds."""
    destination_xy: np.ndarray
    """int32 (G, 2): covered texel where its energy belongs; (-1, -1) beyond an open border: lost."""
    fill_ratio: np.ndarray
    """float64 (G,): texel area at the gutter's edge over that at the destination."""
    from_own_uv: bool
    """The charts are the mesh's own texture coordinates."""

    @property
    def triangle_rects(self) -> np.ndarray:
        """int32 (T, 4): the rectangle that splats on each triangle may draw to."""
        return self.rects[self.chart_of]

    def gather_lists(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the energy of gutters goes, for a shader without float atomics: one invocation for each destination.

        Returns destinations int32 (D, 2), offsets int32 (D + 1,) and sources int32 (S, 2):
        destination k also gets the energy of sources[offsets[k]:offsets[k + 1]].
        """
        kept = self.destination_xy[:, 0] >= 0
        flat = self.destination_xy[kept, 1].astype(np.int64) * self.width + self.destination_xy[kept, 0]
        order = np.argsort(flat, kind="stable")
        places, counts = np.unique(flat, return_counts=True)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        destinations = np.stack([places % self.width, places // self.width], axis=1).astype(np.int32)
        return destinations, offsets, self.gutter_texel_xy[kept][order]


def build_charts(mesh: Mesh, total_texels: int, gutter: int = DEFAULT_GUTTER) -> ChartAtlas:
    """Charts of `mesh` (in world space), with about `total_texels` in all.

    The mesh's own texture coordinates are used when they neither overlap nor degenerate, and were
    not made for pictures (`Mesh.uv_unwraps`); otherwise triangles are grouped by direction and projected, which shrinks
    areas by at most about a half (recorded in `texel_area`). Raises UserError for a number that is not positive or
    leads to more than MAX_TEXELS.
    """
    if total_texels <= 0:
        raise UserError(f"mesh '{mesh.name}': the texels of its map must be more than 0, not {total_texels}")
    for own_uv in (True, False) if mesh.uv is not None and mesh.uv_unwraps else (False,):
        layout = lay_out(mesh, own_uv)
        # Charts by projection that still overlap are halved until none does.
        while layout is not None:
            atlas, overlapping = _at_resolution(mesh, layout, total_texels, gutter)
            if not len(overlapping):
                return atlas
            layout = None if own_uv else layout.split(mesh, overlapping)
    raise AssertionError("a chart of one triangle cannot overlap itself")


def _at_resolution(mesh: Mesh, layout: Layout, total_texels: int, gutter: int) -> tuple[ChartAtlas, np.ndarray]:
    """The packed atlas, and the numbers of charts that overlap themselves (the atlas then is not to be used)."""
    area = float(layout.extents.prod(axis=1).sum())
    scale = math.sqrt(0.8 * total_texels / area)
    places, size = _pack(layout.extents * scale, gutter)
    for _ in range(4):  # gutters do not scale, so the size is approached in a few steps
        used = size[0] * size[1]
        if 0.85 * total_texels <= used <= total_texels:
            break
        scale *= min(2.0, max(0.25, math.sqrt(0.93 * total_texels / used)))
        places, size = _pack(layout.extents * scale, gutter)
    if size[0] * size[1] > MAX_TEXELS:
        raise UserError(f"mesh '{mesh.name}': its map would need {size[0]} × {size[1]} texels; ask for fewer")
    # Corners in texels: each chart's lowest corner lies `gutter` texels inside its rectangle.
    corners = layout.corners * scale + (places + gutter)[layout.chart_of][:, None]
    rows, texel_area = _placement_rows(mesh, corners)
    rects = np.hstack([places, places + _rectangle(layout.extents * scale, gutter)]).astype(np.int32)
    owner, doubled = rasterise(corners, size)
    overlapping = np.unique(layout.chart_of[doubled])
    seams = Seams.none() if len(overlapping) else find_seams(mesh, corners, layout.chart_of, rects, owner, rows)
    ratio = np.ones(len(seams.gutter_texel_xy))
    known = seams.destination_xy[:, 0] >= 0
    dx, dy = seams.destination_xy[known].T
    ratio[known] = texel_area[seams.edge_triangle[known]] / texel_area[owner[dy, dx]]
    atlas = ChartAtlas(
        width=size[0],
        height=size[1],
        rows=rows,
        chart_of=layout.chart_of,
        rects=rects,
        texel_area=texel_area,
        owner=owner,
        gutter_texel_xy=seams.gutter_texel_xy,
        destination_xy=seams.destination_xy,
        fill_ratio=ratio,
        from_own_uv=layout.own_uv,
    )
    return atlas, overlapping


def _rectangle(extents: np.ndarray, gutter: int) -> np.ndarray:
    """Whole texels each chart needs, gutter on all sides, int (C, 2)."""
    return np.maximum(np.ceil(extents - 1e-9), 1.0).astype(np.int64) + 2 * gutter


def _pack(extents: np.ndarray, gutter: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Lower corners (C, 2) of the charts' rectangles, and the whole size: the least of a few widths' area."""
    sizes = _rectangle(extents, gutter)
    side = math.sqrt(float(sizes.prod(axis=1).sum()))
    widest = int(sizes[:, 0].max())
    tries = 24 if len(sizes) <= 256 else 4
    widths = {max(widest, int(side * factor)) for factor in np.linspace(1.0, 2.2, tries)}
    packed = [shelves(sizes, width) for width in sorted(widths)]
    return min(packed, key=lambda result: result[1][0] * result[1][1])


def shelves(sizes: np.ndarray, width: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Rectangles of `sizes`, int (C, 2), on shelves of at most `width` texels, tallest first: lower corners (C, 2), and
    the size of all."""
    places = np.zeros_like(sizes)
    x = y = shelf = widest = 0
    for chart in np.lexsort((-sizes[:, 0], -sizes[:, 1])):
        w, h = sizes[chart]
        if x + w > width:
            x, y = 0, y + shelf
            shelf = 0
        places[chart] = x, y
        x += int(w)
        shelf = max(shelf, int(h))
        widest = max(widest, x)
    return places, (widest, y + shelf)


def _placement_rows(mesh: Mesh, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Affine rows (T, 2, 4) taking triangles to their texel `corners` (T, 3, 2), and texel areas (T,)."""
    p = mesh.corners()
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    g11, g12, g22 = (np.einsum("ij,ij->i", a, b) for a, b in ((e1, e1), (e1, e2), (e2, e2)))
    determinant = g11 * g22 - g12**2
    solid = determinant > 1e-24 * (g11 * g22 + np.finfo(float).tiny)
    safe = np.where(solid, determinant, 1.0)
    # Reciprocal basis of the triangle's plane: e_i · r_j = δ_ij, and no part along the normal.
    r1 = (g22[:, None] * e1 - g12[:, None] * e2) / safe[:, None]
    r2 = (g11[:, None] * e2 - g12[:, None] * e1) / safe[:, None]
    d1, d2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    rows = np.zeros((len(p), 2, 4))
    # A triangle without area maps to its first corner.
    rows[:, :, :3] = (d1[:, :, None] * r1[:, None] + d2[:, :, None] * r2[:, None]) * solid[:, None, None]
    rows[:, :, 3] = corners[:, 0] - np.einsum("tij,tj->ti", rows[:, :, :3], p[:, 0])
    in_texels = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0])
    measurable = solid & (in_texels > 0.0)
    area = np.divide(np.sqrt(np.abs(determinant)), in_texels, out=np.ones(len(p)), where=measurable)
    area[~measurable] = np.median(area[measurable]) if measurable.any() else 1.0
    return rows, area
