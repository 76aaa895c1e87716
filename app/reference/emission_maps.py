"""Float64 references of the functions of shaders/lib/emission.glsl and spot.glsl: lattice, equal-area plane, disc, spot
edge.

Written from the definitions (the azimuthal equal-area map by its chord, the angle by chords) and
not from the shaders. Points of the plane or the square have shape (..., 2), directions (..., 3).
"""

from __future__ import annotations

import numpy as np

from .random_numbers import kronecker, unit_float

Array = np.ndarray
GOLDEN = 2654435769
PLASTIC = (3242174889, 2447445414)


def lattice_point(i: Array, count: int, shift: tuple[Array | int, Array | int]) -> Array:
    """Point i of the golden-ratio Kronecker lattice of `count` points in the unit square, shifted modulo 2³²."""
    along = (np.asarray(i, np.float64) + unit_float(shift[0])) / count
    return np.stack(np.broadcast_arrays(along, kronecker(i, GOLDEN, shift[1])), axis=-1)


def mirrored_lattice_point(i: Array, count: int, shift: tuple[Array | int, Array | int]) -> Array:
    """Point i of `count`: even ones are a lattice in the left half of the unit square, each odd one is the mirror image
    in the square's middle of the one before it."""
    i = np.asarray(i)
    unit = lattice_point(i // 2, (count + 1) // 2, shift) * (0.5, 1.0)
    return np.where(i[..., None] % 2 == 0, unit, 1.0 - unit)


def azimuthal_direction(q: Array) -> Array:
    """Lambert's azimuthal equal-area map: |q| <= 2 is the chord 2 sin(angle/2) from the z axis."""
    radius = np.linalg.norm(q, axis=-1)
    angle = 2.0 * np.arcsin(0.5 * radius)
    sine_over_radius = np.sqrt(np.maximum(1.0 - 0.25 * radius**2, 0.0))
    return np.concatenate([q * sine_over_radius[..., None], np.cos(angle)[..., None]], axis=-1)


def concentric_disc(unit: Array) -> Array:
    """The square's concentric rings become circles, a side a quarter turn (Shirley and Chiu 1997)."""
    p = 2.0 * np.asarray(unit, np.float64) - 1.0
    x, y = p[..., 0], p[..., 1]
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    safe = np.where(radius == 0.0, 1.0, radius)
    turn = np.where(wide, 0.25 * np.pi * y / safe, 0.5 * np.pi - 0.25 * np.pi * x / safe)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """Angle between unit vectors, rad, by the chord and the chord of the supplement."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def spot_falloff(direction: Array, axis: Array, inner: Array | float, outer: Array | float) -> Array:
    """1 within `inner`, 0 beyond `outer` (rad), a smoothstep of the angle between; hard where they are equal."""
    angle = angle_between(direction, axis)
    soft = outer - inner > 1e-7
    t = np.clip((outer - angle) / np.where(soft, outer - inner, 1.0), 0.0, 1.0)
    return np.where(soft, t * t * (3.0 - 2.0 * t), (angle <= outer).astype(np.float64))
