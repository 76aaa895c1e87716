"""Blocks with a wavy top: height fields, and water rippled by a sum of plane waves with exact normals."""

from __future__ import annotations

import math

import numpy as np

from ...base.errors import UserError
from .mesh import Mesh, make_mesh, normalised
from .primitives_parts import MAX_TRIANGLES, band, count, in_range, positive

MAX_HEIGHT = 1e30
"""Beyond it slopes overflow."""


def height_field(
    heights: np.ndarray,
    size: tuple[float, float] = (1.0, 1.0),
    depth: float = 0.5,
    gradient: tuple[np.ndarray, np.ndarray] | None = None,
    name: str = "height field",
) -> Mesh:
    """A closed block whose top is z = `heights` (ny, nx), rows along +y, over a rectangle of `size` about 0.

    The flat bottom lies at z = -`depth`. The top is smooth, with normals from `gradient` =
    (dz/dx, dz/dy) where given and from second-order differences otherwise; sides and
    bottom are flat. Raises UserError when the grid is too small or dips below the bottom.
    """
    z = np.array(heights, dtype=np.float64)
    if z.ndim != 2 or min(z.shape, default=0) < 3 or not np.isfinite(z).all():
        raise UserError("height field: heights must be a grid of at least 3 × 3 finite numbers")
    if np.abs(z).max() > MAX_HEIGHT:
        raise UserError(f"height field: heights beyond {MAX_HEIGHT:g} units; give them in larger units")
    if 2 * z.size > MAX_TRIANGLES:
        raise UserError(f"height field: {z.size} heights are too many (limit {MAX_TRIANGLES // 2})")
    width, height = (positive("height field", f"size along {axis}", s) for axis, s in zip("xy", size, strict=True))
    bottom_z = -positive("height field", "depth", depth)
    if z.min() <= bottom_z:
        raise UserError(f"height field: the top dips to {z.min():g}, below the bottom at {bottom_z:g}; make it deeper")
    ny, nx = z.shape
    x, y = np.linspace(-0.5 * width, 0.5 * width, nx), np.linspace(-0.5 * height, 0.5 * height, ny)
    if gradient is None:
        dz_dy, dz_dx = np.gradient(z, y, x, edge_order=2)
    else:
        dz_dx, dz_dy = gradient
    top_normals = normalised(np.stack([-dz_dx, -dz_dy, np.ones_like(z)], axis=2)).reshape(-1, 3)

    number = np.arange(nx * ny).reshape(ny, nx)
    a, b, c, d = number[:-1, :-1].ravel(), number[:-1, 1:].ravel(), number[1:, 1:].ravel(), number[1:, :-1].ravel()
    # The diagonal alternates, so that the tessellation favours no direction.
    even = (np.add.outer(np.arange(ny - 1), np.arange(nx - 1)) % 2 == 0).ravel()
    top = np.concatenate(
        [
            np.stack([a, b, np.where(even, c, d)], axis=1),
            np.stack([np.where(even, a, b), c, d], axis=1),
        ]
    )
    # Boundary counter-clockwise from above, and its copy at the bottom.
    boundary = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    beneath = nx * ny + np.arange(len(boundary))
    sides = band(beneath, boundary)
    bottom_number = np.full(nx * ny, -1)
    bottom_number[boundary] = beneath
    bottom = _strips(bottom_number.reshape(ny, nx))

    grid = np.stack([*np.meshgrid(x, y), z], axis=2).reshape(-1, 3)
    lowered = grid[boundary].copy()
    lowered[:, 2] = bottom_z
    side_normals = _boundary_normals(nx, ny)
    normals = np.concatenate(
        [
            top_normals[top],
            np.repeat(np.concatenate([side_normals, side_normals])[:, None], 3, axis=1),
            np.broadcast_to([0.0, 0.0, -1.0], (len(bottom), 3, 3)),
        ]
    )
    return make_mesh(name, np.concatenate([grid, lowered]), np.concatenate([top, sides, bottom]), normals)


def rippled_water(
    size: tuple[float, float] = (2.0, 2.0),
    depth: float = 0.5,
    resolution: int = 200,
    amplitude: float = 0.01,
    wavelength: float = 0.35,
    waves: int = 7,
    seed: int = 1,
    name: str = "rippled water",
) -> Mesh:
    """A block of water whose top is the sum of `waves` sines, with the sum's exact normals.

    The mean level is z = 0 and the bottom z = -`depth`. `amplitude` is the root mean
    square height times √2 (that of the one wave when `waves` is 1); wavelengths spread by
    a factor 0.6 to 1.6 about `wavelength`, and directions go all round, by a golden-ratio
    sequence shifted by `seed`. `resolution` counts cells along the longer side.
    """
    shape = "rippled water"
    cells = count(shape, "resolution", resolution, 4, 2000)
    width, height = (positive(shape, f"size along {axis}", s) for axis, s in zip("xy", size, strict=True))
    amplitude = in_range(shape, "amplitude", amplitude, -1e-300, math.inf)
    mean_wavelength = positive(shape, "wavelength", wavelength)
    waves = count(shape, "waves", waves, 1, 64)
    cell = max(width, height) / cells
    nx, ny = max(3, round(width / cell) + 1), max(3, round(height / cell) + 1)
    x, y = np.meshgrid(np.linspace(-0.5 * width, 0.5 * width, nx), np.linspace(-0.5 * height, 0.5 * height, ny))
    z, dz_dx, dz_dy = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    order = np.arange(waves)
    spread = np.ones(1) if waves == 1 else 0.6 * (1.6 / 0.6) ** ((seed * 0.754877666 + (order + 1) * golden) % 1.0)
    angle = 2.0 * np.pi * (order + 0.31 * seed % 1.0) / waves
    phase = 2.0 * np.pi * ((seed * 0.569840291 + order**2 * golden) % 1.0)
    # Equal slopes: long waves are higher, as in real water.
    weight = amplitude * spread / np.linalg.norm(spread)
    number = 2.0 * np.pi / (mean_wavelength * spread)
    for w, kx, ky, start in zip(weight, number * np.cos(angle), number * np.sin(angle), phase, strict=True):
        z += w * np.sin(kx * x + ky * y + start)
        slope = w * np.cos(kx * x + ky * y + start)
        dz_dx += kx * slope
        dz_dy += ky * slope
    return height_field(z, (width, height), depth, (dz_dx, dz_dy), name)


def _boundary_normals(nx: int, ny: int) -> np.ndarray:
    """Outward normal of each step of the boundary in `height_field`'s order, float64 (2(nx + ny) - 4, 3)."""
    outward = np.array([(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])
    return np.repeat(outward, [nx - 1, ny - 1, nx - 1, ny - 1], axis=0)


def _strips(number: np.ndarray) -> np.ndarray:
    """Triangles, facing -z, of a flat rectangle whose boundary vertices alone are numbered in (ny, nx).

    One strip per row: their boxes do not overlap in a tree as those of a fan would.
    """
    ny, nx = number.shape
    left, right = number[:, 0], number[:, -1]
    triangles = []
    for j in range(1, ny - 2):
        triangles += [(left[j], right[j + 1], right[j]), (left[j], left[j + 1], right[j + 1])]
    for i in range(nx - 1):
        triangles.append((number[0, i], left[1], number[0, i + 1]))
        triangles.append((number[-1, i], number[-1, i + 1], right[-2]))
    triangles.append((left[1], right[1], right[0]))
    triangles.append((left[-2], left[-1], right[-2]))
    return np.array(triangles)
