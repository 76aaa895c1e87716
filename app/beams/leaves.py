"""Leaves of the search for beams: outline, density and rays of a beam where it ends, in its target's coordinates."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .compiling import part
from .nodes import area_of, first_place, last_place
from .polarised import STATE
from .rays import PARALLEL, advance, at_x, follow
from .search import medium

LEAF = np.dtype(
    [
        # `search.LEAF_…`; facet it ends on (-1: none), facet left last, object first met, specular events, mask of the
        # solids it is inside of.
        ("kind", "i8"),
        ("facet", "i8"),
        ("last", "i8"),
        ("source", "i8"),
        ("depth", "i8"),
        ("inside", "i8"),
        # Numbers of its edges, and of corners of its polygons at its three places, one after the other.
        ("edges", "i8"),
        ("corners", "i8"),
        # Hash of its path.
        ("key", "i8"),
        # Spectral coordinate of the three places: start, middle and end of the band.
        ("x", "f8", 3),
        # Flux per unit of the target's area and of the light's spectral power, roulette's gain included, there.
        ("density", "f8", 3),
        # Point of the target for which `density` holds; relative change of that per unit of the target's coordinates.
        ("centre", "f8", 2),
        ("slope", "f8", 2),
        # Over the whole band, per unit of the light's power.
        ("flux", "f8"),
        # Used for pieces: [position, direction][place][value at `centre`, d/dq_u, d/dq_v][xyz].
        ("ray", "f8", (2, 3, 3, 3)),
        # Polarisation at the three places (`polarised`).
        ("state", "f8", (3, STATE)),
    ]
)
"""A finished beam. Its target's coordinates are (u, v) on a receiver, q of the light for a piece that photons carry
on."""
EDGE = np.dtype(
    [
        # a_u, a_v, c at the three places; |a| = 1; a . p + c >= 0 inside.
        ("line", "f8", (3, 3)),
        # Half width of the penumbra in the target's lengths; negative: a mask (`BeamPolygons.edges`).
        ("soft", "f8"),
    ]
)

_DARK = 1e-200
"""Density whose relative changes may overflow."""


@dataclass(frozen=True)
class Leaves:
    """L finished beams, with their edges and corners one after the other."""

    leaf: np.ndarray
    """LEAF (L,)."""
    edge: np.ndarray
    """EDGE (E,)."""
    corner: np.ndarray
    """(H, 2)."""

    def where(self, keep: np.ndarray) -> Leaves:
        """The leaves for which `keep`, bool (L,), is true, with their edges and corners."""
        of_edge, of_corner = np.repeat(keep, self.leaf["edges"]), np.repeat(keep, self.leaf["corners"])
        return Leaves(self.leaf[keep], self.edge[of_edge], self.corner[of_corner])

    @classmethod
    def joined(cls, parts: list[Leaves]) -> Leaves:
        """All leaves of `parts`, which may be empty."""
        parts = parts or [Store(0).leaves(np.zeros(3, np.int64))]
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))


class Store:
    """Storage that the search writes leaves into, with unused rows at the end."""

    def __init__(self, leaves: int = 256) -> None:
        self.leaf = np.empty(leaves, LEAF)
        self.edge = np.empty(8 * leaves + 256, EDGE)
        self.corner = np.empty((24 * leaves + 512, 2))

    def grow(self) -> None:
        """Double the storage; what was written stays."""
        for name in ("leaf", "edge", "corner"):
            old = getattr(self, name)
            new = np.empty((2 * len(old), *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)

    def leaves(self, count: np.ndarray) -> Leaves:
        """A copy of what was written; `count`: numbers of leaves, edges and corners."""
        leaves, edges, corners = count
        return Leaves(self.leaf[:leaves].copy(), self.edge[:edges].copy(), self.corner[:corners].copy())


@part
def has_room(leaf, edge, corner, work):
    """Whether one more leaf fits, however many edges and corners it has."""
    n = work.count
    return n[0] + 1 < len(leaf) and n[1] + 128 < len(edge) and n[2] + 256 < len(corner)


@part
def plane_map(facet, position, direction, out, work):
    """Where a bundle meets a receiver, in the coordinates of its map: out = [[r_u, r_v], [d/dq_u], [d/dq_v]]; returns
    the distance and the determinant."""
    at, towards, frame = work.rays[2], work.rays[3], facet.frame
    for c in range(3):
        for k in range(3):
            at[c, k], towards[c, k] = position[c, k], direction[c, k]
    distance = advance(at, towards, facet.plane)
    for k in range(3):
        at[0, k] -= frame[0, k]
    for w in range(2):
        for c in range(3):
            out[c, w] = at[c, 0] * frame[1 + w, 0] + at[c, 1] * frame[1 + w, 1] + at[c, 2] * frame[1 + w, 2]
    return distance, out[1, 0] * out[2, 1] - out[1, 1] * out[2, 0]


@part
def lay_leaf(beam, facets, kind, leaf, edge, corner, work):
    """Write a beam as the next leaf without counting it yet. Returns how far its edges are from moving linearly with x
    (in the target's lengths; negative: no light arrives), and the density's relative deviation from linear."""
    row, first, corners = work.count[0], work.count[1], work.count[2]
    new, maps, det = leaf[row], work.map, work.det
    lo, hi = first_place(beam), last_place(beam)
    for a in range(lo, hi):
        density = beam.weight[a] * beam.boost * work.density
        if kind == 0:
            distance, det[a] = plane_map(facets[beam.facet], beam.position[a], beam.direction[a], maps[a], work)
            density /= max(abs(det[a]), 1e-30)
            if distance < 0.0 or abs(det[a]) < 1e-30:
                density = 0.0
        else:
            maps[a, 0, 0], maps[a, 0, 1] = beam.centre[0], beam.centre[1]
            maps[a, 1, 0] = maps[a, 2, 1] = det[a] = 1.0
            maps[a, 1, 1] = maps[a, 2, 0] = 0.0
        new.density[a] = density
    n = beam.lines
    for ln in range(n):
        edge[first + ln].soft = 0.0
        for a in range(lo, hi):
            line, m, out = beam.line[ln, a], maps[a], edge[first + ln].line
            value = line[0] + line[1] * beam.centre[0] + line[2] * beam.centre[1]
            d = det[a] if abs(det[a]) > 1e-30 else 1e-30
            au = (line[1] * m[2, 1] - line[2] * m[1, 1]) / d
            av = (line[2] * m[1, 0] - line[1] * m[2, 0]) / d
            c = value - au * m[0, 0] - av * m[0, 1]
            size = max(np.sqrt(au * au + av * av), 1e-300)
            out[a, 0], out[a, 1], out[a, 2] = au / size, av / size, c / size
            if lo == 1:
                for b in (0, 2):
                    out[b, 0], out[b, 1], out[b, 2] = out[1, 0], out[1, 1], out[1, 2]
    bent = 0.0
    for a in range(lo, hi):
        for c in range(beam.corners[a]):
            u, v = beam.corner[a, c, 0] - beam.centre[0], beam.corner[a, c, 1] - beam.centre[1]
            pu = maps[a, 0, 0] + u * maps[a, 1, 0] + v * maps[a, 2, 0]
            pv = maps[a, 0, 1] + u * maps[a, 1, 1] + v * maps[a, 2, 1]
            corner[corners, 0], corner[corners, 1] = pu, pv
            corners += 1
            if a == 1 and lo == 0:
                before = c - 1 if c > 0 else beam.corners[a] - 1
                for b in (before, c):
                    e = edge[first + beam.side[a, b]].line
                    off = 0.5 * ((e[0, 0] + e[2, 0]) * pu + (e[0, 1] + e[2, 1]) * pv + e[0, 2] + e[2, 2])
                    bent = max(bent, abs(off))
    for w in range(2):
        new.centre[w] = maps[1, 0, w]
        new.slope[w] = 0.0
    d = new.density
    if lo == 1:
        d[0] = d[2] = d[1]
    most = max(d[0], max(d[1], d[2]))
    if most <= 0.0 or corners == work.count[2]:
        return -1.0, 0.0
    if beam.corners[1] == 0:
        bent = 1e300
    flight = beam.flight
    new.kind, new.facet = kind, beam.facet if kind == 0 else -1
    new.edges, new.corners = n, corners - work.count[2]
    new.last = beam.path[flight - 1, 0] if flight > 0 else -1
    new.source = facets[beam.path[0, 0]].owner if flight > 0 else -1
    new.depth, new.inside = beam.depth, beam.mask
    new.key = np.int64(beam.key >> np.uint64(33))
    for a in range(3):
        b = a if lo == 0 else 1
        new.x[a] = beam.x[a]
        for c in range(STATE):
            new.state[a, c] = beam.state[b, c]
        for c in range(3):
            for k in range(3):
                new.ray[0, a, c, k] = beam.position[b, c, k]
                new.ray[1, a, c, k] = beam.direction[b, c, k]
    return bent, abs(d[1] - 0.5 * (d[0] + d[2])) / most


@part
def passes(solids, tables, inside, x, distance):
    """Transmittance over `distance` of the medium of solid `inside` (-1: air)."""
    if inside < 0 or solids[inside].tint < 0:
        return 1.0
    return np.exp(-at_x(tables, solids[inside].tint, x) * max(distance, 0.0))


@part
def density_slope(beam, facets, solids, tables, source, kind, new, work):
    """Set the slope of the leaf just written, where a light diverges or a medium absorbs, by central differences.
    Returns what the density's second order adds at the outline's farthest corner, and on average, as shares of it."""
    if source.kind == PARALLEL and not work.absorbing:
        return 0.0, 0.0
    size = 0.0
    for c in range(beam.corners[1]):
        u, v = beam.corner[1, c, 0] - beam.centre[0], beam.corner[1, c, 1] - beam.centre[1]
        size = max(size, np.sqrt(u * u + v * v))
    if size <= 0.0 or beam.weight[1] <= 0.0 or new.density[1] < _DARK:
        return 0.0, 0.0
    step = 0.5 * size
    middle = new.density[1] / (beam.boost * work.density)
    bulge = most = 0.0
    change, at, m = work.other, work.point, work.map[0]
    position, direction = work.rays[0], work.rays[1]
    for w in range(2):
        low = high = 0.0
        for sign in range(2):
            at[0], at[1] = beam.centre[0], beam.centre[1]
            at[w] += step * (2 * sign - 1)
            value = follow(
                source,
                facets,
                solids,
                tables,
                beam.path,
                beam.flight,
                beam.x[1],
                at[0],
                at[1],
                position,
                direction,
                work.state,
            )
            if kind == 0:
                distance, det = plane_map(facets[beam.facet], position, direction, m, work)
                value /= max(abs(det), 1e-30)
                if work.absorbing:
                    value *= passes(solids, tables, medium(solids, beam.mask), beam.x[1], distance)
            if sign == 0:
                low = value
            else:
                high = value
        # Two divisions, since the product (low + high) * step may underflow where little light is left.
        change[w] = (high - low) / (low + high) / step if low + high > 0.0 else 0.0
        second = 4.0 * (0.5 * (low + high) / middle - 1.0)
        bulge += second
        most = max(most, abs(second))
    mean = bulge * area_of(beam.corner[1], beam.corners[1]) / (12.0 * size * size)
    if kind == 0:
        _, det = plane_map(facets[beam.facet], beam.position[1], beam.direction[1], m, work)
        if abs(det) < 1e-30:
            return 0.0, 0.0
        new.slope[0] = (change[0] * m[2, 1] - change[1] * m[1, 1]) / det
        new.slope[1] = (change[1] * m[1, 0] - change[0] * m[2, 0]) / det
        plane_map(facets[beam.facet], beam.position[0], beam.direction[0], m, work)
    else:
        new.slope[0], new.slope[1] = change[0], change[1]
    return most, min(max(mean, -0.5), 0.5)


@part
def anchor_density(beam, new, work):
    """Convert the densities at both ends of the band of the leaf just written from the end's centre to the middle's.

    The slope is added about the middle's centre later, and must not count the change between the centres twice."""
    if first_place(beam) > 0:
        return
    for a in (0, 2):
        rise = 0.0
        for w in range(2):
            rise += new.slope[w] * (work.map[a, 0, w] - new.centre[w])
        new.density[a] /= max(1.0 + rise, 0.5)
