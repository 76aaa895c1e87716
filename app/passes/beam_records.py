"""Beam polygons in texels of one window, as the shaders read them: records, edges and the hulls to fill.

Everything lies about a whole texel near the polygon, so that float32 knows a polygon of a hundredth of a texel at the
far end of a wide map.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..beams.polygons import BeamPolygons
from ..gpu.beam_tables import CurveParts
from ..gpu.schema import Field, Struct
from .map_layout import PlaneFrame

BEAM = Struct(
    "BeamRecord",
    (
        Field("anchor", "vec2", "a texel corner near the polygon, atlas texels"),
        Field("slope", "vec2", "change of the density per texel, relative to that at the anchor"),
        Field("density", "vec3", "energy per texel and per unit of the curve: 1, t, t²; at the anchor"),
        Field("nodes", "float", "narrow: equal parts of the band in each of which it stands still; wide: -most parts"),
        Field("place", "vec2", "where the band begins on its curve, and its length there; samples"),
        Field("curve_row", "float", "the curve of target 0; the other targets' follow"),
        Field("edge_count", "float", ""),
    ),
    texels=True,
)

EDGE = Struct(
    "BeamEdge",
    (
        Field("start", "vec4", "x, y, c, reach at the band's start: inside is x, y · texel + c >= 0"),
        Field("change", "vec4", "from there to its end"),
    ),
)
"""`reach`: half of what a texel spans across the edge, in the edge's own measure."""

EDGES = 4, 6, 8
"""Edges that programs of their own hold as flat inputs; polygons of more are read from the texture."""
ROW_TEXELS = 4096
"""At most in a row of the texture."""
NODES_MAX = 4096
NODES_MIN = 4
NO_EDGE = 1.0, 0.0, 1e6, 0.5
"""Start of an edge that everything lies inside of."""
LEAST_LEVEL = 0.05
"""Of the density at the anchor over that at the polygon's centre."""
STILL = 0.02
"""Texels an edge may move over the band where it is drawn as if it stood in the middle."""
FINEST_STEP, WIDEST_STEP = 0.125, 0.25
"""Texels a narrow polygon moves from node to node: a quarter of its width, within these."""
PARTS = 3, 10
"""In which a texel's time is looked at that a wide polygon's edges cross, at least and at most."""
WIDE = 2.0
"""Texels; a wider polygon has texels that are all inside."""


@dataclass(frozen=True)
class TexelMap:
    """From a receiver's plane (GPU units) to the atlas (texels)."""

    matrix: np.ndarray
    """float64 (2, 2)."""
    offset: np.ndarray
    """float64 (2,)."""

    @classmethod
    def of(cls, placement: np.void, frame: PlaneFrame) -> TexelMap:
        """Of one PLACEMENT record."""
        rows = np.stack([placement["row_u"], placement["row_v"]]).astype(np.float64)
        return cls(rows[:, :3] @ frame.axes.T, rows[:, :3] @ frame.origin + rows[:, 3])

    def texels(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) points of the plane, in atlas texels."""
        return points @ self.matrix.T + self.offset


@dataclass(frozen=True)
class PackedBeams:
    """What is uploaded for one draw."""

    edges: int
    """One of `EDGES`, or 0: any number."""
    is_still: bool
    texels: np.ndarray
    """uint32 (rows, `per_row` polygons, texels a polygon, 4): BEAM, then EDGE by EDGE."""
    vertices: np.ndarray
    """`VERTEX` dtype."""
    indices: np.ndarray
    """uint32, triangles."""


VERTEX = np.dtype([("position", "f4", 2), ("polygon", "u4")])


def ragged(start: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows start[i] … start[i + 1] of the `chosen` items one after the other: (indices, counts)."""
    counts = (start[1:] - start[:-1])[chosen].astype(np.int64)
    first = np.cumsum(counts) - counts
    return np.repeat(start[:-1][chosen] - first, counts) + np.arange(counts.sum()), counts


def hull_boxes(polygons: BeamPolygons, corners: np.ndarray) -> np.ndarray:
    """(n, 4): x0, y0, x1, y1 of each hull, of all hulls' `corners` (H, 2); every hull has corners."""
    start = polygons.hull_start[:-1]
    return np.concatenate([np.minimum.reduceat(corners, start), np.maximum.reduceat(corners, start)], axis=1)


def packed(
    polygons: BeamPolygons,
    chosen: np.ndarray,
    to_texels: TexelMap,
    energy_scale: float,
    area_scale: float,
    curves: CurveParts,
) -> Iterator[PackedBeams]:
    """The `chosen` polygons (n,), all on one window, a draw for each kind of program that they need. `curves` of these;
    `energy_scale`: from flux per scene unit² to what a whole texel holds; `area_scale`: texels a scene unit²."""
    hull_rows, hull_counts = ragged(polygons.hull_start, chosen)
    hulls = to_texels.texels(polygons.hulls[hull_rows])
    hull_first = np.cumsum(hull_counts) - hull_counts
    low, high = np.minimum.reduceat(hulls, hull_first), np.maximum.reduceat(hulls, hull_first)
    anchor = np.floor(0.5 * (low + high))
    diagonal = np.linalg.norm(high - low, axis=1)

    edge_rows, counts = ragged(polygons.edge_start, chosen)
    first = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(chosen)), counts)
    is_line = (polygons.x_hi <= polygons.x_lo)[chosen]
    edges, moves = _edges(polygons.edges[edge_rows], to_texels, anchor[owner], is_line[owner], 0.5 * diagonal[owner])
    motion = np.maximum.reduceat(moves, first)

    records = BEAM.zeros(len(chosen))
    inverse = np.linalg.inv(to_texels.matrix)
    slope = polygons.slope[chosen] @ inverse
    level = 1.0 + np.sum(slope * (anchor - to_texels.texels(polygons.centre[chosen])), axis=1)
    level = np.maximum(level, LEAST_LEVEL)
    start, middle, end = polygons.density[chosen].T
    middle, end = np.where(is_line, start, middle), np.where(is_line, start, end)
    parabola = np.stack([start, -3.0 * start + 4.0 * middle - end, 2.0 * (start - 2.0 * middle + end)], axis=1)
    area = polygons.flux[chosen] / np.where(middle > 0.0, middle, 1.0) * area_scale
    records["anchor"], records["slope"] = anchor, slope / level[:, None]
    records["density"] = parabola * (energy_scale * level)[:, None]
    width = area / np.maximum(diagonal - motion, np.sqrt(area) + 1e-9)
    nodes = np.ceil(motion / np.clip(0.25 * width, FINEST_STEP, WIDEST_STEP))
    records["nodes"] = np.where(
        width > WIDE, -np.clip(np.ceil(2.0 + 6.0 * motion), *PARTS), np.clip(nodes, NODES_MIN, NODES_MAX)
    )
    records["place"] = np.stack([curves.place[:, 0], curves.place[:, 1] - curves.place[:, 0]], axis=1)
    records["curve_row"], records["edge_count"] = curves.row, counts

    is_still = motion < STILL
    held = np.append(EDGES, 0)[np.searchsorted(EDGES, counts)]
    column = np.arange(len(owner)) - first[owner]
    for kind in np.unique(2 * held + is_still):
        of_kind = np.flatnonzero(2 * held + is_still == kind)
        size = int(kind // 2) or int(counts[of_kind].max())
        texels = BEAM.stride // 16 + 2 * size
        per_row = ROW_TEXELS // texels
        data = np.zeros((-(-len(of_kind) // per_row) * per_row, texels, 4), np.uint32)
        data[: len(of_kind), : BEAM.stride // 16] = records[of_kind].view(np.uint32).reshape(len(of_kind), -1, 4)
        lines = data[: len(of_kind), BEAM.stride // 16 :].view(np.float32)
        lines[:, ::2] = NO_EDGE
        place = np.full(len(chosen), -1)
        place[of_kind] = np.arange(len(of_kind))
        mine = np.flatnonzero(place[owner] >= 0)
        for offset, name in enumerate(("start", "change")):
            lines[place[owner[mine]], 2 * column[mine] + offset] = edges[name][mine]
        yield PackedBeams(
            int(kind // 2),
            bool(kind % 2),
            data.reshape(-1, per_row, texels, 4),
            *_boxes(low[of_kind], high[of_kind]),
        )


def _edges(
    edges: np.ndarray, to_texels: TexelMap, anchor: np.ndarray, is_line: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """EDGE records in texels about `anchor`, and how far each edge moves over the band within `radius`, texels."""
    inverse = np.linalg.inv(to_texels.matrix)
    ends = []
    for columns in (slice(0, 4), slice(4, 8)):
        a, c = edges[:, columns][:, :2] @ inverse, edges[:, columns][:, 2]
        c = c + np.sum(a * (anchor - to_texels.offset), axis=1)
        ends.append(np.column_stack([a, c]))
    # One factor for both ends: the line in between is a mixture of the two as they are.
    scale = 2.0 / (np.linalg.norm(ends[0][:, :2], axis=1) + np.linalg.norm(ends[1][:, :2], axis=1))
    start, end = (end * scale[:, None] for end in ends)
    end = np.where(is_line[:, None], start, end)
    reach = [0.5 * np.abs(line[:, :2]).sum(axis=1) for line in (start, end)]
    records = EDGE.zeros(len(edges))
    records["start"] = np.column_stack([start, reach[0]])
    records["change"] = np.column_stack([end - start, reach[1] - reach[0]])
    change = end - start
    return records, np.abs(change[:, 2]) + np.linalg.norm(change[:, :2], axis=1) * radius


def _boxes(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles for every box that holds all texels a polygon touches."""
    low, high = np.floor(low), np.ceil(high)
    vertices = np.zeros((len(low), 4), VERTEX)
    vertices["position"] = np.stack(
        [low, np.stack([high[:, 0], low[:, 1]], axis=1), np.stack([low[:, 0], high[:, 1]], axis=1), high], axis=1
    )
    vertices["polygon"] = np.arange(len(low))[:, None]
    indices = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(len(low), dtype=np.uint32)[:, None]
    return vertices.reshape(-1), indices.reshape(-1)
