"""Convex glass with flat sides between parallel lines: what a ray sees through it, all reflections summed up in
float64.

A prism, a slab or a light guide whose rays stay in one plane is a polygon. Every way through it is followed
until it weighs nothing, so that the sum is exact; nothing of the shaders' is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .camera_probe import fresnel

NOTHING = 1e-5
"""Weight of a path that is not followed on."""
MAX_EVENTS = 600
"""Surfaces after which a path is not followed on, whatever it weighs."""


@dataclass(frozen=True)
class Way:
    """One way out of a polygon."""

    direction: tuple[float, float, float]
    weight: float
    events: int
    """Surfaces met."""


def ways(outline: np.ndarray, n: float, position: ArrayLike, direction: ArrayLike, inside: bool = False) -> list[Way]:
    """All ways of a ray from `position` (x, y) in `direction` that weigh something, out of the polygon `outline` (k, 2)
    of index `n`.

    The outline runs anticlockwise and is convex; round it there is air. Weights sum up to 1 less what was left off.
    """
    edge = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1)[:, None]
    offset = np.einsum("ij,ij->i", normal, outline)
    found = []
    waiting = [(np.array(position, float), np.array(direction, float), inside, 1.0, 0, -1)]
    while waiting:
        p, d, within, weight, events, side = waiting.pop()
        if weight < NOTHING or events > MAX_EVENTS:
            continue
        met = _side_met(normal, offset, p, d, within, side)
        if met is None:
            found.append(Way((float(d[0]), float(d[1]), 0.0), weight, events))
            continue
        number, distance = met
        p, m = p + distance * d, normal[number] * (1.0 if within else -1.0)
        cosine = float(d @ m)
        relative = 1.0 / n if within else n
        reflectance = float(fresnel(cosine, relative))
        waiting.append((p, d - 2.0 * cosine * m, within, weight * reflectance, events + 1, number))
        if reflectance < 1.0:
            along = (d - cosine * m) / relative
            refracted = along + np.sqrt(1.0 - along @ along) * m
            waiting.append((p, refracted, not within, weight * (1.0 - reflectance), events + 1, number))
    return found


def radiance_seen(
    outline: np.ndarray,
    n: float,
    position: ArrayLike,
    direction: ArrayLike,
    radiance: Callable[[np.ndarray], np.ndarray],
    inside: bool = False,
) -> float:
    """Radiance along a ray into a scene of the polygon alone, under the sky `radiance` of directions (…, 3)."""
    out = ways(outline, n, position, direction, inside)
    return float(radiance(np.array([way.direction for way in out])) @ np.array([way.weight for way in out]))


def trapezium(incidence_rad: float, height: float = 1.0) -> np.ndarray:
    """An outline that a ray along x enters straight on through x = 0 and whose next face it meets at `incidence_rad`,
    at (½, 0)."""
    reach = 0.5 * height * np.tan(incidence_rad)
    return np.array(
        [(0.0, -0.5 * height), (0.5 + reach, -0.5 * height), (0.5 - reach, 0.5 * height), (0.0, 0.5 * height)]
    )


def rectangle(width: float, height: float) -> np.ndarray:
    """Round the origin."""
    x, y = 0.5 * width, 0.5 * height
    return np.array([(-x, -y), (x, -y), (x, y), (-x, y)])


def _side_met(
    normal: np.ndarray, offset: np.ndarray, p: np.ndarray, d: np.ndarray, within: bool, last: int
) -> tuple[int, float] | None:
    """(side, distance) where the ray crosses the outline next; the side it starts on is not met again."""
    facing, gap = normal @ d, offset - normal @ p
    if within:
        way = np.where(facing > 0.0, gap / np.where(facing > 0.0, facing, 1.0), np.inf)
        way[last if last >= 0 else slice(0, 0)] = np.inf
        side = int(way.argmin())
        return side, float(max(way[side], 0.0))
    if last >= 0:
        return None  # what leaves a convex solid does not come back
    enters = facing < 0.0
    if not enters.any():
        return None
    first = np.where(enters, gap / np.where(enters, facing, 1.0), -np.inf)
    side = int(first.argmax())
    leaves = np.where(~enters & (facing > 0.0), gap / np.where(facing > 0.0, facing, 1.0), np.inf).min()
    misses = bool(((facing == 0.0) & (gap < 0.0)).any())
    return None if misses or first[side] < 0.0 or first[side] > leaves else (side, float(first[side]))
