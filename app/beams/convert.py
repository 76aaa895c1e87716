"""Finished beams as the plain arrays of `polygons`."""

from __future__ import annotations

import numpy as np

from .compiling import jit
from .facets import BeamScene
from .leaves import Leaves
from .polygons import BeamPieces, BeamPolygons
from .search import LEAF_PIECE, LEAF_RECEIVER


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
    """What lies on receivers. `unit`: GPU units a scene unit."""
    chosen = Chosen(leaves, (LEAF_RECEIVER,))
    head = chosen.head
    edges = np.zeros((len(chosen.edges), 8))
    edges[:, 0:3], edges[:, 4:7] = chosen.edges[:, 0], chosen.edges[:, 2]
    edges[:, 3] = edges[:, 7] = chosen.soft
    starts = np.concatenate([[0], np.cumsum(head[:, 6])]).astype(np.int32)
    softest = np.maximum.reduceat(np.append(chosen.soft, 0.0), starts[:-1]) if len(head) else np.zeros(0)
    hull_start, hulls = hulls_around(chosen, softest)
    return BeamPolygons(
        np.full(len(head), light, np.int32),
        scene.facets["receiver"][head[:, 1]].astype(np.int32),
        head[:, 3].astype(np.int32),
        head[:, 4].astype(np.int32),
        chosen.x[:, 0],
        chosen.x[:, 2],
        chosen.density * unit * unit,
        chosen.slope,
        chosen.centre,
        chosen.flux,
        starts,
        edges,
        hull_start,
        hulls,
    )


def pieces_of(leaves: list[Leaves], scene: BeamScene, light: int) -> BeamPieces:
    """What photons have to carry on."""
    chosen = Chosen(leaves, (LEAF_PIECE,))
    head = chosen.head
    edges = np.concatenate([chosen.edges[:, 0], chosen.edges[:, 2]], axis=1)
    counts = head[:, 6]
    of_edge = np.repeat(np.arange(len(head)), counts)
    for first in (0, 3):
        edges[:, first + 2] += np.einsum("ek,ek->e", edges[:, first : first + 2], chosen.centre[of_edge])
    hull_start, hulls = hulls_around(chosen, np.zeros(len(head)))
    hulls = hulls - chosen.centre[np.repeat(np.arange(len(head)), np.diff(hull_start))]
    last = np.maximum(head[:, 2], 0)
    towards = np.einsum("mk,mk->m", chosen.ray[:, 1, 1, 0], scene.facets["plane"][last, :3])
    return BeamPieces(
        np.full(len(head), light, np.int32),
        head[:, 3].astype(np.int32),
        head[:, 4].astype(np.int32),
        chosen.x[:, 0],
        chosen.x[:, 2],
        chosen.centre,
        chosen.ray[:, 0],
        chosen.ray[:, 1],
        chosen.density,
        scene.facets["triangle"][last].astype(np.int32),
        scene.facets["owner"][last].astype(np.int32),
        towards < 0.0,
        objects_of(head[:, 5], scene),
        chosen.flux,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        edges,
        hull_start,
        hulls,
    )


class Chosen:
    """Leaves of some kinds, packed."""

    def __init__(self, leaves: list[Leaves], kinds: tuple[int, ...]) -> None:
        head = _packed([part.head for part in leaves], (9,), np.int64)
        keep = np.isin(head[:, 0], kinds)
        edge_keep, corner_keep = np.repeat(keep, head[:, 6]), np.repeat(keep, head[:, 7])
        self.head = head[keep]
        self.x = _packed([part.x for part in leaves], (3,))[keep]
        self.density = _packed([part.density for part in leaves], (3,))[keep]
        self.centre = _packed([part.centre for part in leaves], (2,))[keep]
        self.slope = _packed([part.slope for part in leaves], (2,))[keep]
        self.flux = _packed([part.flux for part in leaves], ())[keep]
        self.ray = _packed([part.ray for part in leaves], (2, 3, 3, 3))[keep]
        self.edges = _packed([part.edge for part in leaves], (3, 3))[edge_keep]
        self.soft = _packed([part.soft for part in leaves], ())[edge_keep]
        self.corners = _packed([part.corner for part in leaves], (2,))[corner_keep]


def _packed(arrays: list[np.ndarray], shape: tuple[int, ...], dtype: type = float) -> np.ndarray:
    return np.concatenate(arrays) if arrays else np.zeros((0, *shape), dtype)


def hulls_around(chosen: Chosen, grow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and corners of the leaves' convex hulls, grown by `grow` of each."""
    starts = np.concatenate([[0], np.cumsum(chosen.head[:, 7])]).astype(np.int64)
    out = np.empty((4 * len(chosen.corners) + 8, 2))
    ends = np.zeros(len(starts), np.int64)
    points = np.empty((4 * int(chosen.head[:, 7].max(initial=0)), 2))
    hulls_of(chosen.corners, starts, grow.astype(float), points, np.empty((2 * len(points) + 2, 2)), ends, out)
    return ends.astype(np.int32), out[: ends[-1]].copy()


def objects_of(mask: np.ndarray, scene: BeamScene) -> np.ndarray:
    """Masks with a bit an object from masks with a bit a solid."""
    result = np.zeros(len(mask), np.uint64)
    for i, bit in enumerate(scene.solids["bit"]):
        if bit >= 0:
            result |= np.where((mask >> bit) & 1, np.uint64(1) << np.uint64(i), np.uint64(0))
    return result
