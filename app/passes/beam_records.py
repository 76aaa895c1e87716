"""Beam polygons in texels of one window, as the shaders read them: records, edges and the hulls to fill.

Everything is relative to a whole texel near the polygon, so that float32 resolves a polygon of a hundredth of a texel
at the far end of a wide map; smaller ones are drawn larger, with the same light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..beams.polygons import WIDE, BeamPolygons
from ..gpu.beam_tables import CurveParts
from ..gpu.schema import Field, Struct
from .plane_frame import TexelMap

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
        Field("perspective", "vec2", "change of the texel map's 1 / W per texel, relative to that at the anchor"),
        Field("reserved", "vec2", ""),
    ),
    texels=True,
)

EDGE = Struct(
    "BeamEdge",
    (
        Field("start", "vec4", "x, y, c, window at the band's start: inside is x, y · texel + c >= 0"),
        Field("change", "vec4", "from there to its end"),
    ),
)
"""`window`: side of the square over which the covered part is taken there, texels."""

EDGES = 4, 6, 8
"""Edges that programs of their own hold as flat inputs; polygons of more are read from the texture."""
ROW_TEXELS = 4096
"""At most in a row of the texture."""
NODES_MAX = 4096
NODES_MIN = 4
NO_EDGE = 1.0, 0.0, 1e6, 1.0
"""Start of an edge that has everything inside."""
LEAST_LEVEL = 0.05
"""Least ratio of the density at the anchor to that at the polygon's centre."""
STILL = 0.02
"""Texels an edge may move over the band where it is drawn as if it stood in the middle."""
FINEST_STEP, WIDEST_STEP = 0.125, 0.25
"""Windows (texels, unless a penumbra is wider) that a narrow polygon moves from node to node: a quarter of its width,
within these."""
PARTS = 3, 10
"""Parts in which the time of a texel is taken that a wide polygon's edges cross, at least and at most."""
BORDER = 2.0
"""Texels that a triangle costs besides its own, per texel of its sides: they are filled in blocks of 4 x 4."""
MOSTLY_INSIDE = 4.0
"""Windows; of a wider polygon few texels are crossed by its edges, whose times are taken in few parts."""
PLACES = 5
"""Places across a narrow polygon at which the share of light that a mask keeps is taken."""
LEAST_KEPT = 0.25
"""Least share of a narrow polygon's light that one mask keeps: about half of what is at a mask is inside."""
BROAD = 4.0
"""Texels that a penumbra keeps at least where it is drawn in a map of wider ones."""
MASKED = 8.0
"""How many times sharper than its penumbrae a narrow polygon's mask is drawn at least."""
LEAST_SIZE = 1.0 / 8.0
"""Windows from a polygon's middle to its edges that it is drawn with at least: of much smaller ones float32 cannot tell
the area."""


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


def _rows_of(rows: np.ndarray, first: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the `chosen` items, one after the other, and where each begins."""
    picked, sizes = ragged(np.append(first, len(rows)), chosen)
    return rows[picked], np.concatenate([[0], np.cumsum(sizes)])


def texel_hulls(
    polygons: BeamPolygons, chosen: np.ndarray, to_texels: TexelMap
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which of the `chosen` (n,) are in front of the camera whose pixels are texels (all of them in maps along a
    plane's own axes), their hulls' corners (H, 2) in texels and where each hull begins."""
    rows, counts = ragged(polygons.hull_start, chosen)
    hulls = polygons.hulls[rows]
    if not to_texels.is_affine:
        hulls, counts = _in_front(hulls, counts, to_texels)
        chosen, counts = chosen[counts > 0], counts[counts > 0]
    return chosen, to_texels.texels(hulls), np.cumsum(counts) - counts


def _in_front(hulls: np.ndarray, counts: np.ndarray, to_texels: TexelMap) -> tuple[np.ndarray, np.ndarray]:
    """Convex polygons of `counts` corners each, cut where the weight becomes too little."""
    depth = to_texels.weights(hulls) - to_texels.least_weight
    is_in = depth >= 0.0
    if is_in.all():
        return hulls, counts
    first = np.repeat(np.cumsum(counts) - counts, counts)
    nth = np.arange(len(hulls)) - first
    following = first + (nth + 1) % np.repeat(counts, counts)
    crosses = is_in != is_in[following]
    kept = is_in.astype(int) + crosses
    rows = np.repeat(np.arange(len(hulls)), kept)
    is_border = crosses[rows] & (np.append(rows[1:], -1) != rows)
    share = np.where(is_border, depth[rows] / np.where(is_border, depth[rows] - depth[following[rows]], 1.0), 0.0)
    cut = hulls[rows] + share[:, None] * (hulls[following[rows]] - hulls[rows])
    owner = np.repeat(np.arange(len(counts)), counts)
    return cut, np.bincount(owner, kept, len(counts)).astype(np.int64)


def hull_boxes(hulls: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (n, 2) of hulls that begin at `first`."""
    return np.minimum.reduceat(hulls, first), np.maximum.reduceat(hulls, first)


def hull_areas(hulls: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Area (n,) of hulls that begin at `first`."""
    following = np.arange(1, len(hulls) + 1)
    following[np.append(first[1:], len(hulls)) - 1] = first
    # About a corner of each: places far beyond the window must not cost digits.
    about = hulls[first].repeat(np.diff(np.append(first, len(hulls))), axis=0)
    (x, y), (u, v) = (hulls - about).T, (hulls[following] - about).T
    return 0.5 * np.abs(np.add.reduceat(x * v - u * y, first))


def levels(polygons: BeamPolygons, chosen: np.ndarray, to_texels: TexelMap) -> np.ndarray:
    """int64 (n,): how many times the texels may double for each of the `chosen`, since its penumbrae are broad.

    A polygon far narrower than its penumbrae shows their mean only, and a mask that cuts it is drawn `MASKED` times
    sharper than that at least; of another the sharpest edge counts."""
    rows, counts = ragged(polygons.edge_start, chosen)
    first = np.cumsum(counts) - counts
    density = to_texels.density(polygons.centre[chosen])
    softness = polygons.edges[rows][:, [3, 7]] * np.repeat(np.sqrt(density), counts)[:, None]
    windows, is_mask, mean, widest = _windows_as_they_are(softness, first)
    area = polygons.area[chosen] * density
    sharpest = np.minimum.reduceat(windows.min(axis=1), first)
    is_masked = np.logical_or.reduceat(is_mask, first)
    shown = np.where(is_masked, np.maximum(mean / MASKED, sharpest), mean)
    window = np.where(np.sqrt(area) < WIDE * widest, shown, sharpest)
    return np.maximum(np.floor(np.log2(window / BROAD)), 0.0).astype(np.int64)


def packed(
    polygons: BeamPolygons,
    chosen: np.ndarray,
    to_texels: TexelMap,
    energy_scale: float,
    curves: CurveParts,
) -> Iterator[PackedBeams]:
    """The `chosen` polygons (n,), all on one window, a draw for each kind of program that they need. `curves` of these;
    `energy_scale`: from flux per scene unit² to what a whole texel holds where its weight is 1. All must be in front
    (`texel_hulls`)."""
    _, hulls, hull_first = texel_hulls(polygons, chosen, to_texels)
    low, high = hull_boxes(hulls, hull_first)
    inverse = to_texels.inverse
    anchor = np.floor(0.5 * (low + high))
    if not to_texels.is_affine:
        # A corner of the box may be beyond the horizon, no corner of the polygon is.
        corners = np.floor(hulls[hull_first])
        beyond = _homogeneous(anchor) @ inverse[2] < 0.1 * (_homogeneous(corners) @ inverse[2])
        anchor = np.where(beyond[:, None], corners, anchor)
    diagonal = np.linalg.norm(high - low, axis=1)

    edge_rows, counts = ragged(polygons.edge_start, chosen)
    first = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(chosen)), counts)
    is_line = (polygons.x_hi <= polygons.x_lo)[chosen]
    start, middle, end = polygons.density[chosen].T
    middle, end = np.where(is_line, start, middle), np.where(is_line, start, end)
    weight = to_texels.drawn_weights(polygons.centre[chosen])
    ends = polygons.edges[edge_rows]
    lines, moves = _lines(ends, inverse, anchor[owner], weight[owner], is_line[owner], 0.5 * diagonal[owner])
    motion = np.maximum.reduceat(moves, first)
    area = polygons.area[chosen] * to_texels.density(polygons.centre[chosen])
    growth = _grow_tiny(lines, first, owner, area)
    area *= growth**2
    width = area / np.maximum(diagonal - motion, np.sqrt(area) + 1e-9)
    windows, widest = _windows(lines, first, owner, width)
    kept = _kept_by_masks(lines, ends, first, owner, widest, hulls, hull_first, anchor)
    is_wide = width > MOSTLY_INSIDE * widest
    edges = _edges(lines[..., :3], windows)

    records = BEAM.zeros(len(chosen))
    # With q = (u, v, 1): 1 / W = r . q, the density's level = l . q / r . q, a texel's area is proportional to (r .
    # q)^-3.
    r = inverse[2]
    slope = polygons.slope[chosen]
    level_rows = slope @ inverse[:2] + (1.0 - np.sum(slope * polygons.centre[chosen], axis=1))[:, None] * r
    at_anchor = _homogeneous(anchor) @ r
    level = np.sum(level_rows * _homogeneous(anchor), axis=1) / at_anchor
    level = np.maximum(level, LEAST_LEVEL)
    parabola = np.stack([start, -3.0 * start + 4.0 * middle - end, 2.0 * (start - 2.0 * middle + end)], axis=1)
    records["anchor"], records["slope"] = anchor, level_rows[:, :2] / (level * at_anchor)[:, None]
    records["perspective"] = r[:2] / at_anchor[:, None]
    records["density"] = parabola * (energy_scale * level / (kept * growth**2 * at_anchor**3))[:, None]
    motion = motion / widest
    nodes = np.ceil(motion / np.clip(0.25 * width / widest, FINEST_STEP, WIDEST_STEP))
    records["nodes"] = np.where(
        is_wide, -np.clip(np.ceil(2.0 + 6.0 * motion), *PARTS), np.clip(nodes, NODES_MIN, NODES_MAX)
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
            *_filled(
                *_rows_of(hulls, hull_first, of_kind), (widest * (1.0 + 4.0 * LEAST_SIZE * (growth > 1.0)))[of_kind]
            ),
        )


def _homogeneous(texels: np.ndarray) -> np.ndarray:
    """(n, 2) -> (n, 3), a 1 after each."""
    return np.concatenate([texels, np.ones((len(texels), 1))], axis=1)


def _lines(
    edges: np.ndarray,
    inverse: np.ndarray,
    anchor: np.ndarray,
    weight: np.ndarray,
    is_line: np.ndarray,
    radius: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Edges about `anchor` (E, 2 ends, 4): x, y, c and softness in texels; and how far each moves over the band within
    `radius`, texels. A line seen by a camera is a line, and of two lines' mixture the same mixture: `inverse` as in
    `TexelMap`, with the penumbra as wide as it is where the polygon's `weight` is."""
    ends = edges.reshape(-1, 2, 4)
    rows = ends[..., :3] @ inverse
    a = rows[..., :2]
    c = np.sum(a * anchor[:, None], axis=-1) + rows[..., 2]
    softness = ends[..., 3] / weight[:, None]
    lines = np.concatenate([a, c[..., None], softness[..., None]], axis=-1)
    # One factor for both ends: the line in between is a mixture of the two as they are.
    lines *= (2.0 / np.linalg.norm(a, axis=-1).sum(axis=1))[:, None, None]
    lines[is_line, 1] = lines[is_line, 0]
    change = lines[:, 1] - lines[:, 0]
    return lines, np.abs(change[:, 2]) + np.linalg.norm(change[:, :2], axis=1) * radius


def _grow_tiny(lines: np.ndarray, first: np.ndarray, owner: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Move the `lines` (E, 2 ends, 4) of polygons that are tiny in every direction apart; how many times (n,) those are
    longer and wider then. Each grows about the point that is nearest to all its lines, at either end."""
    a, c = lines[..., :2], lines[..., 2]
    normal = np.add.reduceat(a[..., :, None] * a[..., None, :], first) + 1e-9 * np.eye(2)
    middle = np.linalg.solve(normal, -np.add.reduceat(a * c[..., None], first)[..., None])[..., 0]
    inside = np.sum(a * middle[owner], axis=-1) + c
    reach = np.maximum(np.maximum.reduceat(inside.max(axis=1), first), 1e-30)
    # A sliver's lines are all near to its middle, not its corners.
    _, _, window, _ = _windows_as_they_are(lines[..., 3], first)
    growth = np.maximum(LEAST_SIZE * window / np.maximum(reach, area / (np.pi * reach)), 1.0)
    lines[..., 2] += (growth[owner, None] - 1.0) * inside
    return growth


def _windows_as_they_are(
    softness: np.ndarray, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The window of each edge (E, 2 ends), texels, and whether it is a mask; the mean and the widest of each polygon's
    without masks'."""
    windows, is_mask = np.sqrt(1.0 + 4.0 * softness**2), softness[:, 0] < 0.0
    counted = np.where(is_mask[:, None], 0.0, windows)
    mean = np.add.reduceat(counted.mean(axis=1), first) / np.add.reduceat(~is_mask, first)
    return windows, is_mask, mean, np.maximum.reduceat(counted.max(axis=1), first)


def _half_plane_share(normal: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Part of a square of side 1 that is within a line (n,) `inside` of its middle, `normal` (n, 2) across."""
    n = np.abs(normal) / np.linalg.norm(normal, axis=1)[:, None]
    total, difference, h = 0.5 * n.sum(axis=1), 0.5 * np.abs(n[:, 0] - n[:, 1]), np.abs(inside)
    missing = np.maximum(total - h, 0.0)
    share = np.where(
        h <= difference, 0.5 + h / n.max(axis=1), 1.0 - missing**2 / np.maximum(2.0 * n.prod(axis=1), 1e-12)
    )
    return np.where(inside >= 0.0, share, 1.0 - share)


def _windows(
    lines: np.ndarray, first: np.ndarray, owner: np.ndarray, width: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sides of the squares over which the covered part is taken at each edge (E, 2 ends), texels: a texel blurred by
    the edge's penumbra (of the same variance); and the largest of each polygon. Masks of wide polygons, and of sharp
    ones, are moved out of the way.

    At the edges of a narrow polygon they are all the same and whole texels, or it would lose or gain light."""
    windows, is_mask, mean, widest = _windows_as_they_are(lines[..., 3], first)
    is_narrow = width <= WIDE * widest
    widest = np.where(is_narrow, np.round(mean), widest)
    # Little of a wide polygon is beyond, and how much is not known.
    lines[is_mask & ((widest < BROAD) | ~is_narrow)[owner], :, 2] = NO_EDGE[2]
    return np.where((is_narrow[owner] & ~is_mask)[:, None], widest[owner, None], windows), widest


def _kept_by_masks(
    lines: np.ndarray,
    ends: np.ndarray,
    first: np.ndarray,
    owner: np.ndarray,
    widest: np.ndarray,
    hulls: np.ndarray,
    hull_first: np.ndarray,
    anchor: np.ndarray,
) -> np.ndarray:
    """Share (n,) of a narrow polygon's light that its masks keep, about: what they hold back is spread over what is
    inside of them. The polygon is as wide across a mask as its hull, less what the widest penumbra grew that by along
    both axes of the plane (`ends` (E, 8): of `BeamPolygons`)."""
    masks = np.flatnonzero((lines[:, 0, 3] < 0.0) & (lines[:, 0, 2] < NO_EDGE[2]))
    kept = np.ones(len(first))
    if not len(masks):
        return kept
    of, line = owner[masks], lines[masks].mean(axis=1)
    rows, sizes = ragged(np.append(hull_first, len(hulls)), of)
    begins = np.cumsum(sizes) - sizes
    beside = hulls[rows] - np.repeat(anchor[of], sizes, axis=0)
    inside = np.sum(np.repeat(line[:, :2], sizes, axis=0) * beside, axis=1) + np.repeat(line[:, 2], sizes)
    low, high = np.minimum.reduceat(inside, begins), np.maximum.reduceat(inside, begins)
    penumbra = np.maximum.reduceat(lines[..., 3].max(axis=1), first)[of]
    half = np.maximum(0.5 * (high - low) - np.abs(ends[masks, :2]).sum(axis=1) * penumbra, 0.0)
    low, high = np.maximum(0.5 * (low + high)[None] + half * [[-1.0], [1.0]], 0.0)
    along = (np.arange(PLACES) + 0.5)[:, None] / PLACES
    shares = [_half_plane_share(line[:, :2], place / widest[of]) for place in low + along * (high - low)]
    np.multiply.at(kept, of, np.maximum(np.mean(shares, axis=0), LEAST_KEPT))
    return kept


def _edges(lines: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """EDGE records of lines (E, 2 ends, 3)."""
    ends = np.concatenate([lines, windows[..., None]], axis=-1)
    records = EDGE.zeros(len(lines))
    records["start"], records["change"] = ends[:, 0], ends[:, 1] - ends[:, 0]
    return records


def _grown(hulls: np.ndarray, start: np.ndarray, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convex polygons start[i] … start[i + 1] of `hulls` (H, 2), each grown to every texel it touches: the same for
    their Minkowski sums with a square of side `windows`.

    A corner becomes the texel's corners that are farthest out along the normals between its two sides."""
    counts = np.diff(start)
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(hulls)) - start[owner]
    following = start[owner] + (place + 1) % counts[owner]
    before = start[owner] + (place - 1) % counts[owner]
    along = hulls[following] - hulls
    quarter = _quarter(along)
    steps = (quarter - quarter[before]) % 4
    rows = np.repeat(np.arange(len(hulls)), steps + 1)
    nth = np.arange(len(rows)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)
    corner = TEXEL_CORNERS[(quarter[before][rows] + nth) % 4]
    sizes = np.add.reduceat(steps + 1, start[:-1])
    return hulls[rows] + corner * windows[owner[rows], None], np.concatenate([[0], np.cumsum(sizes)])


TEXEL_CORNERS = (0.5 + 1e-3) * np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""Farthest out for a side of a counter-clockwise polygon directed up and right, up and left, …"""


def _quarter(along: np.ndarray) -> np.ndarray:
    """0-3: a direction from right (included) to up, from up to left, …"""
    x, y = along.T
    return np.where(
        (x > 0.0) & (y >= 0.0), 0, np.where((x <= 0.0) & (y > 0.0), 1, np.where((x < 0.0) & (y <= 0.0), 2, 3))
    )


def _filled(hulls: np.ndarray, start: np.ndarray, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that hold each polygon start[i] … start[i + 1] of `hulls`, grown by half of `windows`.

    `VERTEX` and indices: a fan of its corners, a rectangle along its longest side, or a triangle round one along the
    axes, what costs least."""
    grown, grown_start = _grown(hulls, start, windows)
    first, counts = grown_start[:-1], np.diff(grown_start)
    owner = np.repeat(np.arange(len(counts)), counts)
    following = np.arange(len(grown)) + 1
    following[grown_start[1:] - 1] = first
    along, about = grown[following] - grown, grown - grown[first][owner]
    length, diagonal = np.linalg.norm(along, axis=1), np.linalg.norm(about, axis=1)
    twice = about[:, 0] * along[:, 1] - about[:, 1] * along[:, 0]
    fan_cost = 0.5 * np.add.reduceat(twice, first) + BORDER * np.add.reduceat(length + 2.0 * diagonal, first)

    longest = np.maximum.reduceat(length, first)
    is_longest = np.flatnonzero(length == longest[owner])
    chosen = is_longest[np.searchsorted(owner[is_longest], np.arange(len(counts)))]
    axis = along[chosen] / np.maximum(longest, 1e-12)[:, None]
    across = np.stack([-axis[:, 1], axis[:, 0]], axis=1)
    x, y = np.sum(grown * axis[owner], axis=1), np.sum(grown * across[owner], axis=1)
    low = np.stack([np.minimum.reduceat(x, first), np.minimum.reduceat(y, first)], axis=1)
    size = np.stack([np.maximum.reduceat(x, first), np.maximum.reduceat(y, first)], axis=1) - low
    at = low[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size[:, None]
    rectangle = at[..., :1] * axis[:, None] + at[..., 1:] * across[:, None]
    rectangle_cost = np.prod(size, axis=1) + 2.0 * BORDER * (size.sum(axis=1) + np.hypot(*size.T))
    # Where corners coincide, the turns of the sides do not add up to one round.
    is_round = counts == np.diff(start) + 4
    low = np.minimum.reduceat(hulls, start[:-1]) - 0.5 * windows[:, None]
    size = np.maximum.reduceat(hulls, start[:-1]) + 0.5 * windows[:, None] - low
    triangle = low[:, None] + np.array([[0, 0], [2, 0], [0, 2]]) * size[:, None]
    triangle_cost = 2.0 * np.prod(size, axis=1) + 2.0 * BORDER * (size.sum(axis=1) + np.hypot(*size.T))
    costs = [np.where(is_round, fan_cost, np.inf), np.where(is_round, rectangle_cost, np.inf), triangle_cost]
    kind = np.argmin(costs, axis=0)

    sizes = np.choose(kind, [counts, 4, 3])
    begin = np.cumsum(sizes) - sizes
    vertices = np.zeros(sizes.sum(), VERTEX)
    vertices["polygon"] = np.repeat(np.arange(len(sizes)), sizes)
    is_fan = np.repeat(kind == 0, sizes)
    vertices["position"][is_fan] = grown[(kind == 0)[owner]]
    for which, points in ((1, rectangle), (2, triangle)):
        rows = begin[kind == which, None] + np.arange(points.shape[1])
        vertices["position"][rows.ravel()] = points[kind == which].reshape(-1, 2)
    triangles = sizes - 2
    base = np.repeat(begin, triangles)
    nth = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return vertices, np.stack([base, base + nth + 1, base + nth + 2], axis=1).astype(np.uint32).reshape(-1)
