"""Spheres, ellipsoids, tori and solids of revolution with exact or creased corner normals.

A sphere is a subdivided icosahedron, whose triangles are all nearly equilateral: shading
normals interpolated over slivers would make ray differentials needlessly rough.

Cones of a solid of revolution are cut into rows that taper little (`in_rows`). A facet of a cone has two corners on
one ring of the mesh and one on the next. The wider one ring is than the other, the more unevenly the interpolated
normal turns along the facet, and light that it refracts is striped by half the taper however narrow the facets are:
more segments make the stripes finer, not weaker. More rows make them weaker.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...base.errors import UserError
from .mesh import Mesh, make_mesh, normalised
from .primitives_parts import MAX_TRIANGLES, count, globe_uv, in_range, positive


def sphere(radius: float = 0.5, triangles: int = 20_480, name: str = "sphere") -> Mesh:
    """A sphere of about `triangles` faces (20 f² for a whole f); vertices and normals are exact.

    The solid is inscribed: its volume falls short by O(1/triangles). A picture goes round it as a map of the
    world does round a globe, its middle at +x and its upper edge at +z.
    """
    directions, faces = _icosphere(count("sphere", "triangles", triangles, 20))
    vertices = positive("sphere", "radius", radius) * directions
    return make_mesh(name, vertices, faces, directions[faces], globe_uv(directions, faces), uv_unwraps=False)


def ellipsoid(
    semi_axes: tuple[float, float, float] = (0.5, 0.5, 0.5), triangles: int = 20_480, name: str = "ellipsoid"
) -> Mesh:
    """An ellipsoid of `semi_axes` along x, y, z; as `sphere`, with the exact normals of the quadric."""
    axes = np.array([positive("ellipsoid", f"semi-axis along {a}", s) for a, s in zip("xyz", semi_axes, strict=True)])
    directions, faces = _icosphere(count("ellipsoid", "triangles", triangles, 20))
    normals = normalised(directions / axes)[faces]
    return make_mesh(name, directions * axes, faces, normals, globe_uv(directions, faces), uv_unwraps=False)


def torus(major_radius: float = 0.5, minor_radius: float = 0.15, triangles: int = 20_480, name: str = "torus") -> Mesh:
    """A ring about z: a circle of `minor_radius` whose centre runs round a circle of `major_radius`."""
    major, minor = positive("torus", "major_radius", major_radius), positive("torus", "minor_radius", minor_radius)
    if minor >= major:
        raise UserError(f"torus: minor_radius {minor:g} must be smaller than major_radius {major:g}")
    triangles = count("torus", "triangles", triangles, 18)
    # Quads about as long as wide: segments / sides = major / minor.
    sides = max(3, round(math.sqrt(0.5 * triangles * minor / major)))
    segments = max(3, round(0.5 * triangles / sides))
    angle = 2.0 * np.pi * np.arange(sides) / sides
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    profile = np.array([major, 0.0]) + minor * normals
    return revolve(name, profile, normals, np.roll(normals, -1, axis=0), segments, loop=True)


SEGMENTS = (128, 512)
"""Least and most segments of a solid of revolution whose file does not say: as many as `TRIANGLES` allow …"""
TRIANGLES = 80_000
"""… since light that grazes a few large facets is striped (`in_rows`)."""


def solid_of_revolution(
    profile: Sequence[tuple[float, float]] | np.ndarray,
    segments: int | None = None,
    crease_deg: float = 40.0,
    name: str = "solid of revolution",
) -> Mesh:
    """The solid swept by a profile of (radius, z) points about the z axis; `segments` None: by the profile's length.

    An open profile must begin and end on the axis (radius 0); a profile whose last point
    repeats its first is a loop and makes a ring. Where the profile bends by more than
    `crease_deg` the surface has a sharp edge, elsewhere it is smooth. The direction of the
    profile does not matter. Raises UserError for a negative radius, a profile that leaves
    the axis open, repeated points, or one that crosses itself.
    """
    points, start, end, loop = profile_with_normals(profile, crease_deg)
    points, start, end = in_rows(points, start, end, loop)
    if segments is None:
        segments = min(max(TRIANGLES // (2 * len(points)), SEGMENTS[0]), SEGMENTS[1])
    segments = count("solid of revolution", "segments", segments, 3, 1 << 16)
    return revolve(name, points, start, end, segments, loop)


def profile_with_normals(
    profile: Sequence[tuple[float, float]] | np.ndarray, crease_deg: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """(points (K, 2) with the solid on the left, outward normals at the start and at the end of each segment, whether
    the profile is a loop) of `solid_of_revolution`, which says what is refused."""
    crease = math.radians(in_range("solid of revolution", "crease_deg", crease_deg, -1e-9, 180.000001))
    points = np.array(profile, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.isfinite(points).all():
        raise UserError("solid of revolution: profile must be three or more finite [radius, z] points")
    loop = bool((points[0] == points[-1]).all())
    points = points[:-1] if loop else points
    if (points[:, 0] < 0.0).any():
        raise UserError(f"solid of revolution: point {int(np.argmin(points[:, 0]))} has a negative radius")
    if not loop and (points[[0, -1], 0] != 0.0).any():
        raise UserError(
            "solid of revolution: the profile must begin and end at radius 0, or end where it begins to make a ring"
        )
    inner = points if loop else points[1:-1]
    if (inner[:, 0] == 0.0).any():
        raise UserError("solid of revolution: only the first and last point of the profile may lie on the axis")
    steps = np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(steps, axis=1)
    if (lengths[: None if loop else -1] == 0.0).any():
        raise UserError(f"solid of revolution: profile points {int(np.argmin(lengths))} and next coincide; drop one")
    _refuse_crossing(points)
    # Counter-clockwise in (radius, z) has the solid on its left; an open profile closes along the axis.
    if np.sum(points[:, 0] * np.roll(points[:, 1], -1) - np.roll(points[:, 0], -1) * points[:, 1]) < 0.0:
        points = points[::-1]
    start, end = _creased_normals(points, loop, crease)
    return points, start, end, loop


def revolve(
    name: str, profile: np.ndarray, start_normals: np.ndarray, end_normals: np.ndarray, segments: int, loop: bool
) -> Mesh:
    """Sweep a counter-clockwise profile (K, 2) of (radius, z) about z.

    `start_normals`, `end_normals` (K or K - 1, 2) are the profile's outward unit normals at
    the two ends of each of its segments.
    """
    rows = len(profile)
    if 2 * rows * segments > MAX_TRIANGLES:
        raise UserError(f"{name}: {2 * rows * segments} triangles are too many (limit {MAX_TRIANGLES})")
    on_axis = profile[:, 0] == 0.0
    sizes = np.where(on_axis, 1, segments)
    first = np.concatenate([[0], np.cumsum(sizes)])
    angle = 2.0 * np.pi * np.arange(segments) / segments
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate(
        [
            np.array([[0.0, 0.0, z]]) if axis else np.column_stack([radius * turn, np.full(segments, z)])
            for (radius, z), axis in zip(profile, on_axis, strict=True)
        ]
    )
    low = np.arange(rows if loop else rows - 1)
    high = (low + 1) % rows
    around = np.arange(segments)
    # Corner (row, column) of every quad; a pole has the one vertex in all columns.
    columns = np.stack([around, (around + 1) % segments], axis=1)

    def index(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return first[row][:, None] + np.where(on_axis[row][:, None], 0, column[None, :])

    corner = [
        index(low, columns[:, 0]),
        index(low, columns[:, 1]),
        index(high, columns[:, 1]),
        index(high, columns[:, 0]),
    ]

    def normal(of_profile: np.ndarray, column: np.ndarray) -> np.ndarray:
        radial = of_profile[:, None, :1] * turn[column][None]
        return np.concatenate([radial, np.broadcast_to(of_profile[:, None, 1:], (*radial.shape[:2], 1))], axis=2)

    normals = [
        normal(start_normals, columns[:, 0]),
        normal(start_normals, columns[:, 1]),
        normal(end_normals, columns[:, 1]),
        normal(end_normals, columns[:, 0]),
    ]
    triangles, corner_normals = [], []
    for picks, degenerate in (((0, 1, 2), on_axis[low]), ((0, 2, 3), on_axis[high])):
        keep = ~degenerate
        triangles.append(np.stack([corner[p][keep].ravel() for p in picks], axis=1))
        corner_normals.append(np.stack([normals[p][keep].reshape(-1, 3) for p in picks], axis=1))
    return make_mesh(name, vertices, np.concatenate(triangles), np.concatenate(corner_normals))


def _creased_normals(points: np.ndarray, loop: bool, crease: float) -> tuple[np.ndarray, np.ndarray]:
    """Outward normals at both ends of each profile segment, smooth where it bends less than `crease`."""
    steps = (np.roll(points, -1, axis=0) - points)[: None if loop else -1]
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    flat = np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths
    start, end = flat.copy(), flat.copy()
    before = np.arange(len(flat)) if loop else np.arange(1, len(flat))
    previous = before - 1
    smooth = np.einsum("ij,ij->i", flat[previous], flat[before]) >= math.cos(crease)
    # Weights 1/length make the tangent exact for a parabola through three uneven points.
    mean = normalised(flat[previous] / lengths[previous] + flat[before] / lengths[before])
    start[before[smooth]] = mean[smooth]
    end[previous[smooth]] = mean[smooth]
    if not loop:
        # A profile that meets the axis nearly at a right angle is smooth through it.
        for at, array in ((0, start), (-1, end)):
            if abs(flat[at, 1]) >= math.cos(0.5 * crease):
                array[at] = (0.0, math.copysign(1.0, flat[at, 1]))
    return start, end


def _refuse_crossing(points: np.ndarray) -> None:
    """UserError when two segments of the closed polygon through `points` cross properly."""
    a, b = points, np.roll(points, -1, axis=0)

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    p, q, r, s = a[:, None], b[:, None], a[None], b[None]
    crossing = (side(p, q, r) * side(p, q, s) < 0.0) & (side(r, s, p) * side(r, s, q) < 0.0)
    if crossing.any():
        first, second = np.argwhere(crossing)[0]
        raise UserError(f"solid of revolution: the profile crosses itself at points {first} and {second}")


_ICOSAHEDRON = """
 0 11  5   0  5  1   0  1  7   0  7 10   0 10 11
 1  5  9   5 11  4  11 10  2  10  7  6   7  1  8
 3  9  4   3  4  2   3  2  6   3  6  8   3  8  9
 4  9  5   2  4 11   6  2 10   8  6  7   9  8  1
"""
"""Its faces."""


def _icosphere(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions (V, 3) and faces (20 f², 3) of an icosahedron whose edges are cut into f parts."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    # Corners of three rectangles, each across the next axis.
    across = [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)]
    corners = normalised(np.array([np.roll((a, b, 0.0), k) for k in (0, 1, 2) for a, b in across]))
    base = np.array(_ICOSAHEDRON.split(), int).reshape(20, 3)
    parts = max(1, round(math.sqrt(triangles / 20.0)))
    row, column = np.array([(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]).T
    weights = np.stack([parts - row - column, row, column], axis=1)
    number = np.full((parts + 1, parts + 1), -1)
    number[row, column] = np.arange(len(row))
    up = row + column < parts
    down = row + column < parts - 1
    local = np.concatenate(
        [
            np.stack(
                [number[row[up], column[up]], number[row[up] + 1, column[up]], number[row[up], column[up] + 1]], 1
            ),
            np.stack(
                [
                    number[row[down] + 1, column[down]],
                    number[row[down] + 1, column[down] + 1],
                    number[row[down], column[down] + 1],
                ],
                1,
            ),
        ]
    )
    # Whole-number keys (corner, weight) weld points that neighbouring faces share, without tolerances.
    pairs = np.where(weights[None] > 0, base[:, None, :] * (parts + 1) + weights[None], -1) + 1
    ordered = np.sort(pairs, axis=2).astype(np.int64)
    span = 12 * (parts + 1) + 1
    key = (ordered[..., 0] * span + ordered[..., 1]) * span + ordered[..., 2]
    _, representative, welded = np.unique(key.ravel(), return_index=True, return_inverse=True)
    points = np.einsum("pk,fkj->fpj", weights / parts, corners[base]).reshape(-1, 3)[representative]
    faces = welded.reshape(20, -1)[:, local].reshape(-1, 3)
    return normalised(points), faces


TAPER = 0.05
"""By how much the radii of a row's two rings may differ, as a share of the smaller one."""
MOST_ROWS = 16
"""Most rows of one cone; towards its tip rows taper more, and hardly any light passes there."""
_TIP = 0.1
_SHORTEST = 0.05
"""Least length of a row, as a share of the largest radius: a fine profile is left as it is."""


def in_rows(
    points: np.ndarray, start: np.ndarray, end: np.ndarray, loop: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The profile (K, 2) of (radius, z) and the normals (K or K - 1, 2) at both ends of its segments, with segments
    that sweep cones cut into rows of at most `TAPER`, or into `MOST_ROWS` of them."""
    begins, ends = points[: len(start)], np.roll(points, -1, axis=0)[: len(start)]
    shortest = _SHORTEST * float(points[:, 0].max())
    cut = [np.concatenate([[0.0], _cuts(a, b, shortest)]) for a, b in zip(begins, ends, strict=True)]
    rows = [len(shares) for shares in cut]
    share = np.concatenate(cut)[:, None]
    following = np.concatenate([np.append(shares[1:], 1.0) for shares in cut])[:, None]
    a, b, low, high = (np.repeat(array, rows, axis=0) for array in (begins, ends, start, end))
    found = (1.0 - share) * a + share * b
    return (
        found if loop else np.vstack([found, points[-1:]]),
        normalised((1.0 - share) * low + share * high),
        normalised((1.0 - following) * low + following * high),
    )


def _cuts(a: np.ndarray, b: np.ndarray, shortest: float) -> np.ndarray:
    """Shares of the way from a to b at which a segment is cut."""
    narrow, wide = sorted((float(a[0]), float(b[0])))
    if narrow == wide or a[1] == b[1]:
        return np.zeros(0)
    ratio = wide / max(narrow, _TIP * wide)
    rows = min(int(np.ceil(np.log(ratio) / np.log1p(TAPER) - 1e-9)), MOST_ROWS, int(np.hypot(*(b - a)) / shortest))
    radii = wide / ratio ** (np.arange(1, rows) / max(rows, 1))
    shares = np.sort((radii - a[0]) / (b[0] - a[0]))
    return shares[(shares > 0.0) & (shares < 1.0)]
