"""Finished beams as the plain arrays of `polygons`."""

from __future__ import annotations

import numpy as np

from .compiling import jit
from .facets import BeamScene
from .leaves import Leaves
from .lifetimes import lifetimes_of
from .polygons import BeamPieces, BeamPolygons, parabola_at
from .search import LEAF_PIECE, LEAF_RECEIVER, LEAF_TAIL

_ON_BORDER = 1e-7
"""Share of a receiver's radius."""


@jit
def hulls_of(corners, starts, grow, points, chain, ends, out):
    """Convex hulls, counter-clockwise, of groups of points [Andrew 1979], each point grown by `grow` of its group to
    both sides along both axes. `ends` gets those of the groups in `out`; `points`, and `chain` of more than twice
    the length, are scratch."""
    count = 0
    for group in range(len(starts) - 1):
        n = 0
        for c in range(starts[group], starts[group + 1]):
            for k in range(4 if grow[group] > 0.0 else 1):
                points[n, 0] = corners[c, 0] + (grow[group] if k & 1 else -grow[group])
                points[n, 1] = corners[c, 1] + (grow[group] if k & 2 else -grow[group])
                n += 1
        # Shell sort by u, then v: groups are small.
        gap = n // 2
        while gap > 0:
            for i in range(gap, n):
                u, v = points[i, 0], points[i, 1]
                j = i
                while j >= gap and (points[j - gap, 0] > u or (points[j - gap, 0] == u and points[j - gap, 1] > v)):
                    points[j, 0], points[j, 1] = points[j - gap, 0], points[j - gap, 1]
                    j -= gap
                points[j, 0], points[j, 1] = u, v
            gap //= 2
        m = 0
        for turn in range(2):
            base = m
            for s in range(n):
                p = points[s if turn == 0 else n - 1 - s]
                if turn == 1 and s == 0:
                    base = m - 1
                    continue
                while m - base >= 2:
                    a, b = chain[m - 2], chain[m - 1]
                    if (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0.0:
                        break
                    m -= 1
                chain[m, 0], chain[m, 1] = p[0], p[1]
                m += 1
        m = max(m - 1, 1)
        for k in range(m):
            out[count, 0], out[count, 1] = chain[k, 0], chain[k, 1]
            count += 1
        ends[group + 1] = count


def polygons_of(leaves: list[Leaves], scene: BeamScene, light: int, unit: float) -> BeamPolygons:
    """What lies on receivers, each in the part of its band in which it exists. `unit`: GPU units a scene unit."""
    chosen = of_kind(leaves, LEAF_RECEIVER)
    leaf, line = chosen.leaf, chosen.edge["line"]
    starts = np.append(0, np.cumsum(leaf["edges"]))
    corner_starts = np.append(0, np.cumsum(leaf["corners"]))
    edges = np.zeros((len(line), 8))
    edges[:, 0:3], edges[:, 4:7] = line[:, 0], line[:, 2]
    edges[:, 3] = edges[:, 7] = chosen.edge["soft"]
    lives = lifetimes_of(edges, starts, chosen.corner, corner_starts)
    exists = lives.bands[:, 1] > lives.bands[:, 0]
    t = lives.bands[exists]
    own = np.repeat(np.cumsum(exists) - 1, np.diff(starts))
    bounds = (lives.bounds | (chosen.edge["soft"] < 0.0)) & np.repeat(exists, np.diff(starts))
    inside = bounds & ~_are_borders(edges, np.repeat(leaf["facet"], np.diff(starts)), scene)
    bounds = inside | (bounds & (np.bincount(own[inside], minlength=len(t))[own] == 0))
    kept, own = edges[bounds], own[bounds]
    counts = np.bincount(own, minlength=len(t))
    change = kept[:, 4:] - kept[:, :4]
    hull_counts = np.diff(lives.starts)[exists]
    softest = np.maximum.reduceat(kept[:, 3], np.cumsum(counts) - counts) if len(kept) else np.zeros(0)
    hull_start, hulls = hulls_around(lives.corners, hull_counts, softest)
    leaf = leaf[exists]
    x = leaf["x"]
    places = t[:, 0], 0.5 * t.sum(axis=1), t[:, 1]
    from_behind = np.einsum("nk,nk->n", leaf["ray"][:, 1, 1, 0], scene.facets["plane"][leaf["facet"], :3]) > 0.0
    density = np.stack([parabola_at(leaf["density"], place) for place in places], axis=1)
    return BeamPolygons(
        np.full(len(t), light, np.int32),
        (scene.facets["receiver"][leaf["facet"]] + from_behind).astype(np.int32),
        leaf["source"].astype(np.int32),
        leaf["depth"].astype(np.int32),
        x[:, 0] + t[:, 0] * (x[:, 2] - x[:, 0]),
        x[:, 0] + t[:, 1] * (x[:, 2] - x[:, 0]),
        np.maximum(density, 0.0) * unit * unit,
        leaf["slope"],
        leaf["centre"],
        leaf["flux"],
        np.append(0, np.cumsum(counts)).astype(np.int32),
        np.concatenate([kept[:, :4] + t[own, k, None] * change for k in range(2)], axis=1),
        hull_start,
        hulls,
        lives.areas[exists],
    )


def _are_borders(edges: np.ndarray, facet: np.ndarray, scene: BeamScene) -> np.ndarray:
    """bool (E,): which edges of polygons on the facets `facet` (E,) run along the borders of receivers of one facet.
    Texels that a border crosses must hold what whole ones would: nothing is looked up beyond."""
    owners = scene.facets["owner"]
    used, own = np.unique(facet, return_inverse=True)
    corners, frame = scene.facets["corner"][used], scene.facets["frame"][used]
    count = np.where(np.bincount(owners)[owners[used]] == 1, scene.facets["corners"][used], 0)[:, None]
    number = np.arange(corners.shape[1])
    following = np.where(number + 1 < count, number + 1, 0)
    places = np.einsum("fkx,fwx->fkw", corners - frame[:, None, 0], frame[:, 1:])[own]
    off = np.zeros(places.shape[:2])
    for line in (edges[:, None, :3], edges[:, None, 4:7]):
        off = np.maximum(off, np.abs(np.sum(line[..., :2] * places, axis=2) + line[..., 2]))
    lies_on = (number < count)[own] & (off < _ON_BORDER * scene.facets["radius"][used][own, None])
    return np.any(lies_on & np.take_along_axis(lies_on, following[own], axis=1), axis=1)


def pieces_of(leaves: list[Leaves], scene: BeamScene, light: int, measure: float) -> BeamPieces:
    """What photons have to carry on. `measure`: as many units of `Emission.density` make one of `BeamPieces.weight`."""
    chosen = of_kind(leaves, LEAF_PIECE, LEAF_TAIL)
    leaf, line = chosen.leaf, chosen.edge["line"]
    edges = np.concatenate([line[:, 0], line[:, 2]], axis=1)
    of_edge = np.repeat(np.arange(len(leaf)), leaf["edges"])
    for first in (0, 3):
        edges[:, first + 2] += np.einsum("ek,ek->e", edges[:, first : first + 2], leaf["centre"][of_edge])
    hull_start, hulls = hulls_around(chosen.corner, leaf["corners"], np.zeros(len(leaf)))
    hulls = hulls - leaf["centre"][np.repeat(np.arange(len(leaf)), np.diff(hull_start))]
    last = np.maximum(leaf["last"], 0)
    chief = leaf["ray"][:, 1, 1, 0]
    return BeamPieces(
        np.full(len(leaf), light, np.int32),
        leaf["source"].astype(np.int32),
        leaf["depth"].astype(np.int32),
        leaf["x"][:, 0],
        leaf["x"][:, 2],
        leaf["centre"],
        leaf["ray"][:, 0],
        leaf["ray"][:, 1],
        leaf["density"] * measure,
        scene.facets["triangle"][last].astype(np.int32),
        scene.facets["owner"][last].astype(np.int32),
        np.einsum("mk,mk->m", chief, scene.facets["plane"][last, :3]) < 0.0,
        objects_of(leaf["inside"], scene),
        leaf["key"],
        leaf["kind"] == LEAF_TAIL,
        leaf["flux"],
        from_one_axis(leaf["state"], chief),
        np.append(0, np.cumsum(leaf["edges"])).astype(np.int32),
        edges,
        hull_start,
        hulls,
    )


def of_kind(leaves: list[Leaves], *kinds: int) -> Leaves:
    """Leaves of some kinds (`search.LEAF_…`)."""
    chosen = ((part, np.logical_or.reduce([part.leaf["kind"] == kind for kind in kinds])) for part in leaves)
    return Leaves.joined([part.where(keep) for part, keep in chosen if keep.any()])


def hulls_around(corners: np.ndarray, counts: np.ndarray, grow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and corners of the convex hulls of groups of so many `corners`, one after the other, grown by `grow` of
    each."""
    starts = np.append(0, np.cumsum(counts)).astype(np.int64)
    out = np.empty((4 * len(corners) + 8, 2))
    ends = np.zeros(len(starts), np.int64)
    points = np.empty((4 * int(counts.max(initial=0)), 2))
    hulls_of(corners, starts, grow.astype(float), points, np.empty((2 * len(points) + 2, 2)), ends, out)
    return ends.astype(np.int32), out[: ends[-1]].copy()


def objects_of(mask: np.ndarray, scene: BeamScene) -> np.ndarray:
    """Masks with a bit an object from masks with a bit a solid."""
    result = np.zeros(len(mask), np.uint64)
    for i, bit in enumerate(scene.solids["bit"]):
        if bit >= 0:
            result |= np.where((mask >> bit) & 1, np.uint64(1) << np.uint64(i), np.uint64(0))
    return result


def from_one_axis(state: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """States (M, 3, 6) counted from the axis at the middle of the band, whose rays run along `direction` (M, 3): so
    that they may be interpolated."""
    axis = state[:, 1, None, 3:]
    along = np.einsum("mak,mbk->ma", state[..., 3:], axis)
    across_axis = np.einsum("mak,mbk->ma", np.cross(direction[:, None], state[..., 3:]), axis)
    size = np.maximum(along**2 + across_axis**2, 1e-30)
    cosine, sine = (along**2 - across_axis**2) / size, 2.0 * along * across_axis / size
    q, u = cosine * state[..., 0] + sine * state[..., 1], cosine * state[..., 1] - sine * state[..., 0]
    return np.concatenate([q[..., None], u[..., None], state[..., 2:3], np.broadcast_to(axis, (*q.shape, 3))], axis=-1)
