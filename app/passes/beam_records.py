"""Beam polygons in texels of one window, as the shaders read them: records, edges and the hulls to fill.

Everything lies about a whole texel near the polygon, so that float32 knows a polygon of a hundredth of a texel at the
far end of a wide map.
"""

from __future__ import annotations

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
        Field("slope", "vec2", "relative change of the density per texel"),
        Field("density", "vec3", "energy per texel and per unit of the curve: 1, t, t²"),
        Field("nodes", "float", "equal parts of the band in which the polygon stands still"),
        Field("place", "vec2", "where the band begins on its curve, and its length there; samples"),
        Field("first_edge", "uint", ""),
        Field("edge_count", "uint", ""),
        Field("curve", "uint", "first value of the curve of target 0"),
        Field("curve_stride", "uint", "values from one target's curve to the next"),
        Field("level", "float", "the density at the anchor over that at the polygon's centre"),
        Field("unused", "float", ""),
    ),
)

EDGE = Struct(
    "BeamEdge",
    (
        Field("start", "vec4", "x, y, c, reach at the band's start: inside is x, y · texel + c >= 0"),
        Field("change", "vec4", "from there to its end"),
    ),
)
"""`reach`: half of what a texel spans across the edge, in the edge's own measure."""

NODES_MAX = 4096


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

    records: np.ndarray
    edges: np.ndarray
    vertices: np.ndarray
    """VERTEX dtype."""
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
    curves: CurveParts,
) -> PackedBeams:
    """The `chosen` polygons (n,), all on one window. `curves` of these; `energy_scale`: from flux per scene unit² to
    what a whole texel holds."""
    hull_rows, hull_counts = ragged(polygons.hull_start, chosen)
    hulls = to_texels.texels(polygons.hulls[hull_rows])
    hull_first = np.cumsum(hull_counts) - hull_counts
    low, high = np.minimum.reduceat(hulls, hull_first), np.maximum.reduceat(hulls, hull_first)
    anchor = np.floor(0.5 * (low + high))
    radius = 0.5 * np.linalg.norm(high - low, axis=1)

    records = BEAM.zeros(len(chosen))
    edge_rows, edge_counts = ragged(polygons.edge_start, chosen)
    owner = np.repeat(np.arange(len(chosen)), edge_counts)
    is_line = (polygons.x_hi <= polygons.x_lo)[chosen]
    edges, speed = _edges(polygons.edges[edge_rows], to_texels, anchor[owner], is_line[owner], radius[owner])

    inverse = np.linalg.inv(to_texels.matrix)
    slope = polygons.slope[chosen] @ inverse
    start, middle, end = polygons.density[chosen].T
    middle, end = np.where(is_line, start, middle), np.where(is_line, start, end)
    level = 1.0 + np.sum(slope * (anchor - to_texels.texels(polygons.centre[chosen])), axis=1)
    records["anchor"], records["slope"] = anchor, slope
    parabola = np.stack([start, -3.0 * start + 4.0 * middle - end, 2.0 * (start - 2.0 * middle + end)], axis=1)
    records["density"] = parabola * energy_scale
    records["nodes"] = np.clip(
        np.ceil(2.0 * np.maximum.reduceat(speed, np.cumsum(edge_counts) - edge_counts)), 1, NODES_MAX
    )
    records["place"] = np.stack([curves.place[:, 0], curves.place[:, 1] - curves.place[:, 0]], axis=1)
    records["first_edge"], records["edge_count"] = np.cumsum(edge_counts) - edge_counts, edge_counts
    records["curve"], records["curve_stride"] = curves.first, curves.stride
    records["level"] = level
    return PackedBeams(records, edges, *_boxes(low, high))


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
