"""A fan of rays in numbers: deviations, the least deviation of a prism, focal points.

Everything is measured on the traced paths themselves; `least_deviation_deg` alone is a formula. Angles are in degrees,
lengths in scene units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..model.scene import Vec3
from ..passes.ray_line import RayLine

_SAME_FACE = 1e-4
"""Distance of unit normals up to which two rays met one flat face."""
_PARALLEL_RAD = 1e-5


@dataclass(frozen=True)
class RayReading:
    """One wavelength of the fan."""

    wavelength_nm: float
    index: float | None
    """Refractive index of the glass, where it is one."""
    deviation_deg: float
    """Between the middle ray's first and last segment; with inner reflections the whole turn of the ray that turns
    least, where rays crowd."""
    path: np.ndarray
    """float64 (n, 3), that ray."""
    apex_deg: float | None = None
    """Angle between the two flat faces that the rays went through; None where they are not flat, or more or fewer."""
    least_deg: float | None = None
    """Minimum deviation of that prism, for rays in its principal section."""
    focus: Vec3 | None = None
    """Where a thin bundle about the middle ray crosses; None where it leaves parallel."""
    focal_length: float | None = None
    """Focal length of parallel light, h / sin u' of that bundle; negative where the focus is virtual."""
    focus_distance: float | None = None
    """From the last surface to the focus, along the ray; negative where it is virtual."""


def readings(
    rays: Sequence[RayLine],
    bundle: Sequence[RayLine],
    indices: dict[float, float],
    is_parallel: bool,
    reflections: int = 0,
) -> tuple[RayReading, ...]:
    """One reading a wavelength. `bundle`: three rays a wavelength close together, of which the middle one is the fan's,
    or with inner `reflections` many over the whole object; `indices`: wavelength to index of the glass, empty where it
    is none; `is_parallel`: the light is."""
    found = []
    for nm in sorted({ray.wavelength_nm for ray in bundle}):
        thin = [ray.points for ray in bundle if ray.wavelength_nm == nm]
        middle = thin[len(thin) // 2]
        if len(middle) < 3:
            continue  # it passed by
        index = indices.get(nm)
        if reflections:
            turning = [path for path in thin if len(path) == reflections + 4]
            if turning:
                least_turned = min(turning, key=turn_deg)
                found.append(RayReading(nm, index, turn_deg(least_turned), least_turned))
            continue
        apex = (
            None if index is None else _apex_deg([ray.points for ray in rays if ray.wavelength_nm == nm], thin, index)
        )
        least = None if apex is None or index is None else least_deviation_deg(index, apex)
        focus, length, distance = _focus(thin, is_parallel)
        found.append(
            RayReading(nm, index, angle_deg(*_ends(middle)), middle, apex, least, focus, length, distance),
        )
    return tuple(found)


def least_deviation_deg(index: float, apex_deg: float) -> float | None:
    """Minimum deviation 2 asin(n sin(A/2)) − A of a prism in air [Born and Wolf 1999, 4.7.2]; None where every ray is
    totally reflected."""
    sine = index * np.sin(np.radians(0.5 * apex_deg))
    return None if sine > 1.0 else float(np.degrees(2.0 * np.arcsin(sine)) - apex_deg)


def angle_deg(first: np.ndarray, second: np.ndarray) -> float:
    """Between two directions (3,), exact for small angles too."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


def turn_deg(points: np.ndarray) -> float:
    """How far a path of points (n, 3) turns in all, with what it turns at every surface added up."""
    return sum(angle_deg(before, behind) for before, behind in pairwise(np.diff(points, axis=0)))


def _ends(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions of the first and the last segment."""
    ways = points[1] - points[0], points[-1] - points[-2]
    return ways[0] / np.linalg.norm(ways[0]), ways[1] / np.linalg.norm(ways[1])


def _apex_deg(fan: list[np.ndarray], thin: list[np.ndarray], index: float) -> float | None:
    """Angle between the two faces that all rays of the thin bundle, and at least one other, went straight through."""
    normals = [_normals(points, index) for points in (*thin, *fan)]
    own = normals[len(thin) // 2]
    if own is None or any(n is None for n in normals[: len(thin)]):
        return None
    alike = [
        n is not None and all(np.linalg.norm(a - b) < _SAME_FACE for a, b in zip(n, own, strict=True)) for n in normals
    ]
    if not all(alike[: len(thin)]) or sum(alike[len(thin) :]) < min(2, len(fan)):
        return None
    apex = angle_deg(*own)
    return apex if apex > 0.01 else None


def _normals(points: np.ndarray, index: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Normals along the light of the faces that a path entered and left by, from Snell's law in vectors: the change of
    n times the direction is along the normal. None for paths of other than two refractions."""
    if len(points) != 4:
        return None
    ways = np.diff(points, axis=0)
    before, inside, behind = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    entered, left = index * inside - before, index * inside - behind
    lengths = np.linalg.norm(entered), np.linalg.norm(left)
    return (entered / lengths[0], left / lengths[1]) if min(lengths) > 1e-6 else None


def _focus(thin: list[np.ndarray], is_parallel: bool) -> tuple[Vec3 | None, float | None, float | None]:
    """Crossing of the bundle's outer rays behind the glass, its focal length, and how far behind the last surface."""
    first, middle, last = thin[0], thin[len(thin) // 2], thin[-1]
    if len({len(points) for points in thin}) != 1 or len(thin) < 3:
        return None, None, None
    a, b = (points[-2] for points in (first, last))
    u, v = (_ends(points)[1] for points in (first, last))
    opening = np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v)
    if opening < _PARALLEL_RAD:
        return None, None, None
    # Nearest points of the two lines a + s u, b + t v, and the middle between them.
    across, cosine = b - a, u @ v
    s = (across @ u - cosine * (across @ v)) / (1.0 - cosine**2)
    t = (cosine * (across @ u) - across @ v) / (1.0 - cosine**2)
    at = 0.5 * (a + s * u + b + t * v)
    distance = float((at - middle[-2]) @ _ends(middle)[1])
    length = None
    if is_parallel:
        way = _ends(middle)[0]
        apart = last[0] - first[0]
        height = 0.5 * np.linalg.norm(apart - (apart @ way) * way)
        length = float(np.copysign(height / np.sin(0.5 * opening), distance))
    return (float(at[0]), float(at[1]), float(at[2])), length, distance
