"""Cut stones, convex and closed: the round brilliant, 57 facets of Tolkowsky's proportions and a thin faceted girdle;
the step cut, rows of long facets like an emerald's.

All facet planes meet in a few kinds of points, so the vertices are written down directly;
no half-space intersection is needed.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.errors import UserError
from .mesh import Mesh, make_mesh
from .primitives_parts import in_range, positive


def brilliant(
    diameter: float = 1.0,
    table: float = 0.53,
    crown_angle_deg: float = 34.5,
    pavilion_angle_deg: float = 40.75,
    girdle: float = 0.015,
    star_length: float = 0.5,
    lower_half_length: float = 0.77,
    name: str = "brilliant",
) -> Mesh:
    """A round brilliant, its table facing +z and the middle of its girdle in z = 0.

    Defaults are those of M. Tolkowsky, Diamond Design (1919). `table` (corner to corner)
    and `girdle` (thickness) are fractions of the diameter; `star_length` and
    `lower_half_length` say how far star facets reach from table to girdle and lower halves
    from girdle to culet, in plan. Facets: table, 8 stars, 8 bezels, 16 upper halves, 16
    girdle facets, 16 lower halves, 8 pavilion mains; a girdle of 0 has no facets of its
    own. Raises UserError when the proportions do not make a convex stone.
    """
    shape = "brilliant"
    radius = 0.5 * positive(shape, "diameter", diameter)
    table_radius = radius * in_range(shape, "table", table, 0.0, 1.0)
    crown = math.tan(math.radians(in_range(shape, "crown_angle_deg", crown_angle_deg, 0.0, 90.0)))
    pavilion = math.tan(math.radians(in_range(shape, "pavilion_angle_deg", pavilion_angle_deg, 0.0, 90.0)))
    half_girdle = radius * in_range(shape, "girdle", girdle, -1e-12, 0.5)
    step = math.pi / 8.0

    # Bezel k is the plane z = half_girdle + (radius - x') crown, x' along azimuth 2 k step; mains likewise.
    table_edge = table_radius * math.cos(step)
    star_radius = table_edge + in_range(shape, "star_length", star_length, 0.0, 1.0) * (radius - table_edge)
    star_z = half_girdle + (radius - star_radius * math.cos(step)) * crown
    table_z = half_girdle + (radius - table_radius) * crown
    lower_radius = radius * (1.0 - in_range(shape, "lower_half_length", lower_half_length, 0.0, 1.0))
    lower_z = -half_girdle - (radius - lower_radius * math.cos(step)) * pavilion

    def ring(size: int, at: float, z: float, turn: float) -> np.ndarray:
        angle = turn + 2.0 * np.pi * np.arange(size) / size
        return np.column_stack([at * np.cos(angle), at * np.sin(angle), np.full(size, z)])

    sharp = half_girdle <= 0.0
    rings = [
        ring(8, table_radius, table_z, 0.0),
        ring(8, star_radius, star_z, step),
        ring(16, radius, half_girdle, 0.0),
        *([] if sharp else [ring(16, radius, -half_girdle, 0.0)]),
        ring(8, lower_radius, lower_z, step),
        np.array([(0.0, 0.0, -half_girdle - radius * pavilion)]),
    ]
    above, below = 16, 16 if sharp else 32
    lower = below + 16
    culet = lower + 8
    facets: list[tuple[int, ...]] = [tuple(range(8))]
    for k in range(8):
        after, before = (k + 1) % 8, (k - 1) % 8
        tip, middle, next_tip = 2 * k, 2 * k + 1, (2 * k + 2) % 16
        facets.append((k, 8 + k, after))
        facets.append((k, 8 + before, above + tip, 8 + k))
        facets.append((above + tip, above + middle, 8 + k))
        facets.append((above + middle, above + next_tip, 8 + k))
        facets.append((below + middle, below + tip, lower + k))
        facets.append((below + next_tip, below + middle, lower + k))
        facets.append((below + tip, lower + before, culet, lower + k))
        if not sharp:
            facets.append((below + tip, below + middle, above + middle, above + tip))
            facets.append((below + middle, below + next_tip, above + next_tip, above + middle))
    return _stone(shape, name, rings, facets)


def step_cut(
    width: float = 1.0,
    length: float = 1.4,
    corner: float = 0.18,
    table: float = 0.6,
    crown_height: float = 0.16,
    pavilion_depth: float = 0.45,
    girdle: float = 0.03,
    name: str = "step_cut",
) -> Mesh:
    """An emerald cut, its table facing +z and the middle of its girdle in z = 0; 3 rows of facets above and 3 below.

    The outline is a rectangle of `width` by `length` whose corners are cut off by `corner` times the width. `table`:
    its size as a share of the outline; `crown_height`, `pavilion_depth`, `girdle`: fractions of the width. Rows grow
    steeper towards the girdle. Raises UserError when the proportions do not make a convex stone.
    """
    shape = "step_cut"
    half = 0.5 * positive(shape, "width", width)
    long_half = 0.5 * positive(shape, "length", length)
    cut = 2.0 * half * in_range(shape, "corner", corner, 0.0, 0.5)
    crown = 2.0 * half * in_range(shape, "crown_height", crown_height, 0.0, 2.0)
    pavilion = 2.0 * half * in_range(shape, "pavilion_depth", pavilion_depth, 0.0, 2.0)
    thin = half * in_range(shape, "girdle", girdle, 0.0, 0.5)
    size = in_range(shape, "table", table, 0.0, 1.0)
    a, b, c = half, long_half, min(cut, 0.9 * min(half, long_half))
    outline = np.array(
        [(a, -b + c), (a, b - c), (a - c, b), (-a + c, b), (-a, b - c), (-a, -b + c), (-a + c, -b), (a - c, -b)]
    )
    # Rows by the share of the way from girdle to table (or culet) and of the height; steeper at the girdle.
    above = [
        (1.0 - (1.0 - size) * at, thin + crown * up) for at, up in ((0.0, 0.0), (0.26, 0.42), (0.6, 0.75), (1.0, 1.0))
    ]
    below = [
        (1.0 - 0.97 * at, -thin - pavilion * down) for at, down in ((0.0, 0.0), (0.25, 0.4), (0.58, 0.75), (1.0, 1.0))
    ]
    rings = [np.column_stack([scale * outline, np.full(8, z)]) for scale, z in (*above[::-1], *below)]
    facets: list[tuple[int, ...]] = [tuple(range(8)), tuple(8 * (len(rings) - 1) + k for k in reversed(range(8)))]
    for row in range(len(rings) - 1):
        for k in range(8):
            upper, lower, after = 8 * row, 8 * row + 8, (k + 1) % 8
            facets.append((lower + k, lower + after, upper + after, upper + k))
    return _stone(shape, name, rings, facets)


def _stone(shape: str, name: str, rings: list[np.ndarray], facets: list[tuple[int, ...]]) -> Mesh:
    """Facets through corners of `rings`, numbered on from one to the next; refused unless they make a convex stone."""
    triangles = [(facet[0], facet[i], facet[i + 1]) for facet in facets for i in range(1, len(facet) - 1)]
    mesh = make_mesh(name, np.concatenate(rings), np.array(triangles))
    if mesh.convex_planes is None or len(mesh.convex_planes) != len(facets):
        raise UserError(f"{shape}: these proportions do not make a convex stone; move them towards the defaults")
    return mesh
