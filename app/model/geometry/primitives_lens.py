"""Lenses by radii, thickness and diameter, with exact normals, a sharp rim and optional conic surfaces.

Sign convention of optics: light travels along +z, a radius is positive when its centre of
curvature lies towards +z (Born & Wolf, Principles of Optics, §4.4). Each surface is a disc
of hexagonal rings spaced evenly along its arc, so its tessellation depends on nothing but
the surface and the ring count: the cemented faces of a doublet coincide vertex by vertex.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.errors import UserError
from .mesh import Mesh, make_mesh, normalised
from .primitives_parts import count, positive


def lens(
    radius1: float = 1.0,
    radius2: float = -1.0,
    thickness: float = 0.3,
    diameter: float = 1.0,
    triangles: int = 20_000,
    conic1: float = 0.0,
    conic2: float = 0.0,
    front: float | None = None,
    name: str = "lens",
) -> Mesh:
    """A lens on the z axis, its first vertex at z = `front`, by default as far before the origin as the second behind.

    `radius1` and `radius2` are the signed radii of the first and second surface (infinite
    = plane), `conic1` and `conic2` their conic constants (0 sphere, -1 paraboloid). Lenses with a vertex, a
    diameter, a number of triangles and the radius between them in common are cemented: the surface has the same
    vertices in both, to the last bit. Raises UserError when a surface does not reach the rim or the two cross.
    """
    low, high = vertices_of(thickness, front)
    rings = max(1, round(math.sqrt(count("lens", "triangles", triangles, 24) / 12.0 + 0.25) - 0.5))
    return _lens_between(name, (low, radius1, conic1), (high, radius2, conic2), diameter, rings)


def vertices_of(thickness: float, front: float | None) -> tuple[float, float]:
    """Places of a lens's vertices on its axis."""
    low = -0.5 * positive("lens", "thickness", thickness) if front is None else front
    if not math.isfinite(low):
        raise UserError(f"lens: front must be a finite number, not {low:g}")
    return low, -low if front is None else low + positive("lens", "thickness", thickness)


def _lens_between(
    name: str, first: tuple[float, float, float], second: tuple[float, float, float], diameter: float, rings: int
) -> Mesh:
    """The solid between two surfaces, each (vertex z, signed radius, conic constant)."""
    aperture = 0.5 * positive(name, "diameter", diameter)
    for number, (_, radius, conic) in enumerate((first, second), start=1):
        _check_surface(name, number, radius, conic, aperture)
    radial, faces, direction = _hexagonal_disc(rings)
    caps = []
    for vertex_z, radius, conic in (first, second):
        r = _even_arc(radius, conic, aperture, rings)
        sag, slope = sag_and_slope(r, radius, conic)
        points = np.column_stack([r[radial][:, None] * direction, vertex_z + sag[radial]])
        normals = normalised(np.column_stack([-slope[radial][:, None] * direction, np.ones(len(radial))]))
        caps.append((points, normals))
    (front, front_normals), (back, back_normals) = caps
    _check_thickness(name, first, second, aperture)

    size = len(radial)
    rim = np.arange(size - 6 * rings, size)
    knife_edge = bool((back[rim, 2] - front[rim, 2] <= 1e-12 * aperture).all())
    upper = np.arange(size) + size
    if knife_edge:
        upper[rim] = rim
    triangles = [faces[:, ::-1], upper[faces]]
    corner_normals = [-front_normals[faces[:, ::-1]], back_normals[faces]]
    if not knife_edge:
        following = np.roll(rim, -1)
        radial_normal = np.column_stack([direction, np.zeros(size)])
        for a, b, c in ((rim, following, following + size), (rim, following + size, rim + size)):
            triangles.append(np.stack([a, b, c], axis=1))
            corner_normals.append(np.stack([radial_normal[k % size] for k in (a, b, c)], axis=1))
    vertices = np.concatenate([front, back[: size - 6 * rings] if knife_edge else back])
    return make_mesh(name, vertices, np.concatenate(triangles), np.concatenate(corner_normals))


def _check_surface(name: str, number: int, radius: float, conic: float, aperture: float) -> None:
    if math.isnan(radius) or radius == 0.0:
        raise UserError(f"{name}: radius{number} must not be {radius:g}; use inf for a plane")
    if not math.isfinite(conic):
        raise UserError(f"{name}: conic{number} must be a finite number, not {conic:g}")
    if math.isfinite(radius) and (1.0 + conic) * (aperture / radius) ** 2 > 1.0 + 1e-12:
        reach = 2.0 * abs(radius) / math.sqrt(1.0 + conic)
        raise UserError(
            f"{name}: surface {number} (radius{number} = {radius:g}) reaches a diameter of {reach:g} only; "
            f"make the diameter smaller or the radius larger"
        )


def _check_thickness(
    name: str, first: tuple[float, float, float], second: tuple[float, float, float], aperture: float
) -> None:
    r = aperture * np.linspace(0.0, 1.0, 257)
    gap = (second[0] + sag_and_slope(r, *second[1:])[0]) - (first[0] + sag_and_slope(r, *first[1:])[0])
    thinnest = int(np.argmin(gap))
    if gap[thinnest] < -1e-12 * aperture or (gap[thinnest] <= 1e-12 * aperture and thinnest != len(r) - 1):
        raise UserError(
            f"{name}: the surfaces cross at {2.0 * r[thinnest]:g} of the diameter {2.0 * aperture:g} "
            f"(thickness there {gap[thinnest]:.4g}); make it thicker, smaller or less curved"
        )


def sag_and_slope(r: np.ndarray, radius: float, conic: float) -> tuple[np.ndarray, np.ndarray]:
    """Height of a conic surface above its vertex and its slope dz/dr at distances `r` from the axis."""
    curvature = 0.0 if math.isinf(radius) else 1.0 / radius
    root = np.sqrt(np.maximum(0.0, 1.0 - (1.0 + conic) * (curvature * r) ** 2))
    # A hemisphere's rim is vertical: its slope is bounded so that normals stay finite.
    return curvature * r * r / (1.0 + root), curvature * r / np.maximum(root, 1e-12)


def _even_arc(radius: float, conic: float, aperture: float, rings: int) -> np.ndarray:
    """Radii of the rings 0 … `rings`, evenly spaced along the meridian, float64 (rings + 1,)."""
    # Sampled in sin t, so that the steep end of a hemisphere is resolved.
    r = aperture * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 16 * rings + 257))
    sag, _ = sag_and_slope(r, radius, conic)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(sag)))])
    even = np.interp(np.linspace(0.0, arc[-1], rings + 1), arc, r)
    even[-1] = aperture
    return even


def _hexagonal_disc(rings: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ring number (V,), triangles (6 rings², 3) counter-clockwise from +z, and directions (V, 2).

    Ring k has 6 k vertices after the central one.
    """
    ring = np.concatenate([[0], np.repeat(np.arange(1, rings + 1), 6 * np.arange(1, rings + 1))])
    first = np.concatenate([[0], 1 + 3 * np.arange(rings) * np.arange(1, rings + 1)])
    place = np.arange(len(ring)) - first[ring]
    angle = 2.0 * np.pi * place / np.maximum(6 * ring, 1)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    direction[0] = 0.0
    triangles = []
    for k in range(1, rings + 1):
        sector, i = (g.ravel() for g in np.meshgrid(np.arange(6), np.arange(k), indexing="ij"))
        outer = first[k] + (sector * k + i) % (6 * k)
        outer_next = first[k] + (sector * k + i + 1) % (6 * k)
        inner_size = max(6 * (k - 1), 1)
        inner = first[k - 1] + (sector * (k - 1) + i) % inner_size
        triangles.append(np.stack([outer, outer_next, inner], axis=1))
        between = i < k - 1
        inner_next = first[k - 1] + (sector * (k - 1) + i + 1) % inner_size
        triangles.append(np.stack([outer_next, inner_next, inner], axis=1)[between])
    return ring, np.concatenate(triangles), direction
