"""Where a camera sees things through glass, in closed form or by an exact trace in one plane: float64, for tests of
pictures.

The plane has x away from the camera and y upwards. `n` may be an array (of wavelengths, say); results broadcast. The
closed forms are Born and Wolf's, Principles of Optics, 7th edition; sections are named where they stand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray


# ---- prisms (§ 4.7.2) ------------------------------------------------------------------------


def thin_prism_deviation(n: Array | float, apex_rad: float) -> Array:
    """Deviation toward the base of a thin prism near normal incidence, rad: (n − 1) A."""
    return (np.asarray(n, float) - 1.0) * apex_rad


def thin_prism_fringe(n_short: float, n_long: float, apex_rad: float, distance: float) -> float:
    """Width of the coloured fringe of an edge `distance` behind a thin prism, measured at the edge: (n_F − n_C) A L.

    The edge is displaced toward the apex by `thin_prism_deviation` × distance, for short waves most.
    """
    return float((n_short - n_long) * apex_rad * distance)


# ---- plane-parallel slabs --------------------------------------------------------------------


def slab_offset(n: Array | float, thickness: float, incidence_rad: float) -> Array:
    """How far a ray advances along the slab inside it: t s/√(n² − s²), s = sin i."""
    sine = math.sin(incidence_rad)
    return thickness * sine / np.sqrt(np.asarray(n, float) ** 2 - sine**2)


def slab_displacement(n: Array | float, thickness: float, incidence_rad: float) -> Array:
    """How far, along the slab, a point behind it lies nearer to the foot of the ray than it would without: t tan i −
    `slab_offset`."""
    return thickness * math.tan(incidence_rad) - slab_offset(n, thickness, incidence_rad)


def slab_lateral_shift(n: Array | float, thickness: float, incidence_rad: float) -> Array:
    """Distance between the ray before and after, across it: `slab_displacement` · cos i."""
    return slab_displacement(n, thickness, incidence_rad) * math.cos(incidence_rad)


# ---- plano-convex lenses (§ 4.4) -------------------------------------------------------------


def thick_seen_tangent(
    n: float, radius: float, thickness: float, camera_distance: float, object_distance: float, height: float
) -> float:
    """The same through a lens of finite thickness, its curved side toward the camera: paraxial matrices (§ 4.4.3 in
    matrix form)."""
    refract = np.array([[1.0, 0.0], [-(n - 1.0) / (n * radius), 1.0 / n]])
    leave = np.array([[1.0, 0.0], [0.0, n]])
    system = _gap(object_distance) @ leave @ _gap(thickness) @ refract @ _gap(camera_distance)
    return height / float(system[0, 1])  # a ray from the camera's point: y = B · slope


def _gap(length: float) -> Array:
    return np.array([[1.0, length], [0.0, 1.0]])


# ---- the exact trace in one plane ------------------------------------------------------------


@dataclass(frozen=True)
class Face:
    """A straight surface."""

    point: tuple[float, float]
    normal: tuple[float, float]
    """Any length and side."""


@dataclass(frozen=True)
class Arc:
    """A circular surface: the half round the circle's point nearest to the camera (x < centre), or farthest."""

    centre: tuple[float, float]
    radius: float
    toward_camera: bool = True


def prism_faces(apex_rad: float, x: float, thickness: float) -> tuple[Face, Face]:
    """An isosceles prism with its apex up, cut by the axis y = 0 from `x` to `x + thickness`."""
    c, s = math.cos(0.5 * apex_rad), math.sin(0.5 * apex_rad)
    return Face((x, 0.0), (-c, s)), Face((x + thickness, 0.0), (c, s))


def plano_convex_faces(radius: float, x: float, thickness: float) -> tuple[Arc, Face]:
    """A plano-convex lens on the axis, its vertex at `x` toward the camera."""
    return Arc((x + radius, 0.0), radius), Face((x + thickness, 0.0), (1.0, 0.0))


def trace(
    surfaces: Sequence[Face | Arc], indices: Sequence[float], position: Sequence[float], angle_rad: float
) -> tuple[Array, Array]:
    """Point on the last surface and unit direction after it, (2,) each, of a ray from `position` upwards by `angle_rad`
    from x.

    `indices`: behind each surface; before the first there is air. Raises ValueError where a surface is missed or
    reflects totally.
    """
    p, d = np.array(position, float), np.array([math.cos(angle_rad), math.sin(angle_rad)])
    before = 1.0
    for surface, after in zip(surfaces, indices, strict=True):
        if isinstance(surface, Face):
            normal = np.array(surface.normal, float) / math.hypot(*surface.normal)
            way = float((np.array(surface.point) - p) @ normal / (d @ normal))
        else:
            relative = p - np.array(surface.centre)
            b = float(relative @ d)
            discriminant = b * b - float(relative @ relative) + surface.radius**2
            if discriminant < 0.0:
                raise ValueError("the ray misses an arc")
            way = -b - math.sqrt(discriminant) if surface.toward_camera else -b + math.sqrt(discriminant)
            normal = (relative + way * d) / surface.radius
        if way < 0.0:
            raise ValueError("a surface lies behind the ray")
        p = p + way * d
        # Snell's law: n times the tangential part of the direction is kept.
        tangent = np.array([-normal[1], normal[0]])
        sine = before / after * float(d @ tangent)
        if abs(sine) >= 1.0:
            raise ValueError("total reflection")
        d = sine * tangent + math.copysign(math.sqrt(1.0 - sine * sine), float(d @ normal)) * normal
        before = after
    return p, d


def height_on_screen(
    surfaces: Sequence[Face | Arc], indices: Sequence[float], angle_rad: float, screen_x: float
) -> float:
    """Where a ray from a camera at the origin, through the surfaces, meets the screen x = `screen_x`."""
    p, d = trace(surfaces, indices, (0.0, 0.0), angle_rad)
    return float(p[1] + d[1] / d[0] * (screen_x - p[0]))


def viewing_angle(
    surfaces: Sequence[Face | Arc], indices: Sequence[float], screen_x: float, height: float, low: float, high: float
) -> float:
    """Angle at which a camera at the origin sees the screen's point at `height`, by bisection between two angles, rad.

    Raises ValueError where both ends see the point on the same side.
    """
    sign = math.copysign(1.0, height_on_screen(surfaces, indices, low, screen_x) - height)
    if sign == math.copysign(1.0, height_on_screen(surfaces, indices, high, screen_x) - height):
        raise ValueError("the point is not seen between the two angles")
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if math.copysign(1.0, height_on_screen(surfaces, indices, middle, screen_x) - height) == sign:
            low = middle
        else:
            high = middle
