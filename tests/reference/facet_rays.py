# ruff: noqa: NPY002 (what numba compiles has the old generator only)
"""Light through flat facets by chance alone: float64 rays over triangles, Fresnel by a random number.

What beams (`spectrasplat.beams`) are held against. Nothing is shared with them: no facets, no half-planes, no affine
maps. Surfaces closer than `_CONTACT` are one interface between the media before and behind all of them.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numba
import numpy as np

GLASS, MIRROR, BLACK, RECEIVER = range(4)
_CONTACT = 1e-8
_CHUNK = 250_000


@dataclass(frozen=True)
class World:
    """Triangles with what lies behind them, at one wavelength."""

    corners: np.ndarray
    """(T, 3, 3), counter-clockwise from outside."""
    owner: np.ndarray
    """int64 (T,)."""
    kind: np.ndarray
    """int64 (objects,)."""
    rank: np.ndarray
    """int64 (objects,): which solid wins where several overlap; unique, 0 … 61, -1 for what is not glass."""
    index: np.ndarray
    """(objects,), refractive index."""
    absorption: np.ndarray
    """(objects,), per unit of length inside."""
    reflectance: np.ndarray
    """(objects,), of mirrors."""


@dataclass(frozen=True)
class Grid:
    """Cells on a receiver: places origin + u axes[0] + v axes[1], cells of `side` from `low` on."""

    receiver: int
    """Its object."""
    origin: np.ndarray
    axes: np.ndarray
    low: tuple[float, float]
    side: float
    shape: tuple[int, int]
    """Along u, along v."""


@dataclass(frozen=True)
class Lamp:
    """Where rays start: position on a rectangle or disc, direction about `forward`.

    Parallel: start = origin + a right half[0] + b up half[1], direction = forward + `tangent` (disc), flux 1 per unit².
    Point: start anywhere on the rectangle or disc `half`, direction forward + (x, y) in the window of the gnomonic
    plane, flux 1 per sr (with `lambert`: times the cosine to `axis` and per unit² of the rectangle)."""

    origin: np.ndarray
    forward: np.ndarray
    right: np.ndarray
    up: np.ndarray
    half: tuple[float, float]
    is_disc: bool = False
    tangent: float = 0.0
    is_point: bool = False
    window: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Gnomonic plane sampled: x from, to, y from, to; all zero: the whole sphere."""
    axis: np.ndarray = field(default_factory=lambda: np.zeros(3))
    cone: tuple[float, float] = (4.0, 4.0)
    lambert: bool = False
    corners: int = 0
    """Of the regular polygon of the disc's area, with the middle of a side on the way to `right`, on which rays start
    instead of the disc; 0: on the disc."""


@dataclass(frozen=True)
class Landed:
    """What landed, per unit of spectral power: mean and variance by cell, and of all of it."""

    flux: np.ndarray
    variance: np.ndarray
    hits: np.ndarray
    total: float
    """On the receiver, inside the grid or not."""
    total_variance: float
    weight: float
    """Of a ray that landed, by mean square over mean."""


@numba.njit(cache=True, nogil=True)
def _nearest(o, d, edges, normal, owner, ball, nearest, found):
    """The nearest crossing beyond contact [Moeller, Trumbore 1997] and all crossings in contact with it; returns their
    number."""
    count, best = 0, 1e300
    t0 = 0
    while t0 < len(owner):
        o0 = owner[t0]
        end = int(ball[o0, 5])
        cx, cy, cz = ball[o0, 0] - o[0], ball[o0, 1] - o[1], ball[o0, 2] - o[2]
        along = cx * d[0] + cy * d[1] + cz * d[2]
        if cx * cx + cy * cy + cz * cz - along * along > ball[o0, 3]:
            t0 = end
            continue
        for t in range(t0, end):
            a, b, c = edges[t, 0], edges[t, 1], edges[t, 2]
            hx, hy, hz = d[1] * c[2] - d[2] * c[1], d[2] * c[0] - d[0] * c[2], d[0] * c[1] - d[1] * c[0]
            det = b[0] * hx + b[1] * hy + b[2] * hz
            if det == 0.0:
                continue
            sx, sy, sz = o[0] - a[0], o[1] - a[1], o[2] - a[2]
            u = (sx * hx + sy * hy + sz * hz) / det
            if u < 0.0 or u > 1.0:
                continue
            qx, qy, qz = sy * b[2] - sz * b[1], sz * b[0] - sx * b[2], sx * b[1] - sy * b[0]
            v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
            if v < 0.0 or u + v > 1.0:
                continue
            way = (c[0] * qx + c[1] * qy + c[2] * qz) / det
            if way <= _CONTACT or way > best + _CONTACT:
                continue
            if way < best - _CONTACT:
                count = 0
            best = min(best, way)
            if count < 16:
                found[count] = t
                count += 1
        t0 = end
    nearest[0] = best
    return count


@numba.njit(cache=True, nogil=True)
def _circumradius(corners):
    """Of the regular polygon of the unit disc's area, or of the disc."""
    if corners == 0:
        return 1.0
    step = 2.0 * np.pi / corners
    return np.sqrt(step / np.sin(step))


@numba.njit(cache=True, nogil=True)
def _is_off(a, b, corners):
    """Whether a place is outside of the unit disc, or of the regular polygon of its area."""
    if corners == 0:
        return a * a + b * b > 1.0
    step = 2.0 * np.pi / corners
    from_middle = (np.arctan2(b, a) + 0.5 * step) % step - 0.5 * step
    return np.hypot(a, b) * np.cos(from_middle) > _circumradius(corners) * np.cos(0.5 * step)


@numba.njit(cache=True, nogil=True)
def _medium(mask, of_rank):
    best = -1
    for bit in range(62):
        if (mask >> bit) & 1:
            best = of_rank[bit]
    return best


@numba.njit(cache=True, nogil=True)
def _trace(
    seed,
    rays,
    lamp_kind,
    frame,
    half,
    tangent,
    window,
    axis,
    cone,
    lambert,
    corners,
    edges,
    normal,
    owner,
    ball,
    kind,
    rank,
    of_rank,
    index,
    absorption,
    rho,
    receiver,
    origin,
    axes,
    low,
    side,
    start_mask,
    depth,
    sums,
    squares,
    hits,
    total,
):
    np.random.seed(seed)
    o, d, n = np.empty(3), np.empty(3), np.empty(3)
    nearest, found = np.empty(1), np.empty(16, np.int64)
    reach = _circumradius(corners)
    for _ in range(rays):
        a, b = 2.0 * np.random.random() - 1.0, 2.0 * np.random.random() - 1.0
        if lamp_kind & 1:
            a, b = reach * a, reach * b
            while _is_off(a, b, corners):
                a = reach * (2.0 * np.random.random() - 1.0)
                b = reach * (2.0 * np.random.random() - 1.0)
        weight = 1.0
        if lamp_kind < 2:
            x = y = 0.0
            if tangent > 0.0:
                x, y = 2.0 * np.random.random() - 1.0, 2.0 * np.random.random() - 1.0
                while x * x + y * y > 1.0:
                    x, y = 2.0 * np.random.random() - 1.0, 2.0 * np.random.random() - 1.0
            x, y = x * tangent, y * tangent
        elif window[1] > window[0]:
            x = window[0] + (window[1] - window[0]) * np.random.random()
            y = window[2] + (window[3] - window[2]) * np.random.random()
            weight = (1.0 + x * x + y * y) ** -1.5
        else:
            x, y = 2.0 * np.random.random() - 1.0, 2.0 * np.pi * np.random.random()
        length = 0.0
        for k in range(3):
            o[k] = frame[0, k] + a * half[0] * frame[2, k] + b * half[1] * frame[3, k]
            if lamp_kind < 2 or window[1] > window[0]:
                d[k] = frame[1, k] + x * frame[2, k] + y * frame[3, k]
            else:
                d[k] = x * frame[1, k] + np.sqrt(1.0 - x * x) * (np.cos(y) * frame[2, k] + np.sin(y) * frame[3, k])
            length += d[k] * d[k]
        cosine = 0.0
        for k in range(3):
            d[k] /= np.sqrt(length)
            cosine += d[k] * axis[k]
        if lambert:
            weight *= max(cosine, 0.0)
        if cone[1] < 3.2:
            angle = np.arccos(min(max(cosine, -1.0), 1.0))
            if angle > cone[1]:
                continue
            if angle > cone[0]:
                s = (cone[1] - angle) / (cone[1] - cone[0])
                weight *= s * s * (3.0 - 2.0 * s)
        if weight <= 0.0:
            continue
        mask, events = start_mask, 0
        for _step in range(4 * depth + 64):
            count = _nearest(o, d, edges, normal, owner, ball, nearest, found)
            if count == 0:
                break
            before = _medium(mask, of_rank)
            if before >= 0 and absorption[before] > 0.0:
                weight *= np.exp(-absorption[before] * nearest[0])
            for k in range(3):
                o[k] += nearest[0] * d[k]
            behind, opaque, glass = mask, -1, -1
            for i in range(count):
                t = found[i]
                of = owner[t]
                if kind[of] != 0:
                    opaque = t
                    continue
                glass = t
                if d[0] * normal[t, 0] + d[1] * normal[t, 1] + d[2] * normal[t, 2] < 0.0:
                    behind |= np.int64(1) << rank[of]
                else:
                    behind &= ~(np.int64(1) << rank[of])
            after = _medium(behind, of_rank)
            if opaque >= 0:
                of = owner[opaque]
                if kind[of] == 3:
                    if of == receiver and events > 0:
                        total[0] += weight
                        total[1] += weight * weight
                        u = v = 0.0
                        for k in range(3):
                            u += (o[k] - origin[k]) * axes[0, k]
                            v += (o[k] - origin[k]) * axes[1, k]
                        i, j = int(np.floor((u - low[0]) / side)), int(np.floor((v - low[1]) / side))
                        if i >= 0 and j >= 0 and i < sums.shape[0] and j < sums.shape[1]:
                            sums[i, j] += weight
                            squares[i, j] += weight * weight
                            hits[i, j] += 1
                    break
                if kind[of] == 2:
                    break
                weight *= rho[of]
                glass = opaque
            for k in range(3):
                n[k] = normal[glass, k]
            facing = d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
            turn = opaque >= 0
            if not turn:
                if before == after:
                    mask = behind
                    continue
                n1 = index[before] if before >= 0 else 1.0
                n2 = index[after] if after >= 0 else 1.0
                c1 = abs(facing)
                sine2 = (n1 / n2) ** 2 * (1.0 - c1 * c1)
                share = 1.0
                if sine2 < 1.0:
                    c2 = np.sqrt(1.0 - sine2)
                    s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2)
                    p = (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)
                    share = 0.5 * (s * s + p * p)
                turn = np.random.random() < share
                if not turn:
                    sign = 1.0 if facing > 0.0 else -1.0
                    c2 = np.sqrt(1.0 - sine2)
                    for k in range(3):
                        d[k] = n1 / n2 * (d[k] - facing * n[k]) + sign * c2 * n[k]
                    mask = behind
            if turn:
                for k in range(3):
                    d[k] -= 2.0 * facing * n[k]
            events += 1
            if events > depth:
                break


def landed(
    world: World, lamp: Lamp, grid: Grid, rays: int, seed: int = 1, depth: int = 64, inside: int = 0, threads: int = 2
) -> Landed:
    """`rays` rays of `lamp` that met glass or a mirror and then the grid's receiver. `inside`: mask (by rank) of the
    solids that the lamp stands in. Deterministic for a seed, whatever the threads."""
    a, b, c = np.swapaxes(world.corners, 0, 1)
    edges = np.stack([a, b - a, c - a], axis=1)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    keep = size > 1e-300
    order = np.argsort(world.owner[keep], kind="stable")
    edges, owner = edges[keep][order], world.owner[keep][order]
    normal = (normal[keep] / size[keep][:, None])[order]
    ball = np.zeros((len(world.kind), 6))
    for i in range(len(world.kind)):
        points = world.corners[world.owner == i].reshape(-1, 3)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        ball[i, :3], ball[i, 3] = middle, np.max(np.sum((points - middle) ** 2, axis=1)) * (1.0 + 1e-9) + 1e-12
        ball[i, 4], ball[i, 5] = np.searchsorted(owner, [i, i + 1])
    of_rank = np.full(64, -1, np.int64)
    for i, rank in enumerate(world.rank):
        if rank >= 0:
            of_rank[rank] = i
    kind = (2 if lamp.is_point else 0) + lamp.is_disc
    frame = np.stack([lamp.origin, lamp.forward, lamp.right, lamp.up]).astype(float)
    area = (np.pi if lamp.is_disc else 4.0) * lamp.half[0] * lamp.half[1]
    domain = area
    if lamp.is_point:
        window = lamp.window
        domain = (window[1] - window[0]) * (window[3] - window[2]) or 4.0 * np.pi
        domain *= area if lamp.lambert else 1.0

    def chunk(number: int):
        count = min(_CHUNK, rays - number * _CHUNK)
        sums, squares = np.zeros(grid.shape), np.zeros(grid.shape)
        hits, total = np.zeros(grid.shape, np.int64), np.zeros(2)
        _trace(
            seed * 1_000_003 + number,
            count,
            kind,
            frame,
            np.array(lamp.half, float),
            float(lamp.tangent),
            np.array(lamp.window, float),
            np.asarray(lamp.axis, float),
            np.array(lamp.cone, float),
            lamp.lambert,
            lamp.corners,
            edges,
            normal,
            owner,
            ball,
            world.kind,
            world.rank,
            of_rank,
            world.index,
            world.absorption,
            world.reflectance,
            grid.receiver,
            grid.origin,
            grid.axes,
            np.array(grid.low, float),
            float(grid.side),
            np.int64(inside),
            depth,
            sums,
            squares,
            hits,
            total,
        )
        return sums, squares, hits, total

    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(chunk, range(-(-rays // _CHUNK))))
    sums, squares, hits, total = (np.sum([part[k] for part in parts], axis=0) for k in range(4))
    scale = domain / rays
    return Landed(
        sums * scale,
        (squares - sums**2 / rays) * scale**2,
        hits,
        float(total[0] * scale),
        float((total[1] - total[0] ** 2 / rays) * scale**2),
        float(total[1] / max(total[0], 1e-300) * scale),
    )
