"""What a camera path and a photon of the camera's reference have in common, compiled: numbers, surfaces, absorption.

One event at glass or a mirror is one call of `scatter`, by the same rules as the light's reference
(`photon_kernel`): Fresnel's exact reflectance decides by chance, nested solids follow their rank, an interpolated
normal that would send a ray through its own facet gives way to the facet's. `photon_kernel.trace` holds the
rules a second time, written out in its loop, and a test compares what the two send where.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit

from .photon_intersect import STACK_SIZE
from .photon_kernel import (
    _AIR,
    DIMENSIONS,
    _medium,
    _mixed,
    _refractive_index,
    _table,
    _unit,
    fresnel,
)
from .photon_scene import MIRROR

AIR = _AIR


_LEAN = {"nogil": True, "error_model": "numpy", "_nrt": False}


def stripped(function: Callable) -> Callable:
    """`compiled` without counting references: a scene is some sixty arrays, and counting them took 60 % of a path's
    time.

    Nothing may be allocated inside: scratch comes from the caller.
    """
    try:
        return njit(cache=True, **_LEAN)(function)
    except RuntimeError:  # numba: no folder for the cache
        return njit(**_LEAN)(function)


def inlined(function: Callable) -> Callable:
    """`lean`, and put into its callers: arrays are not handed over at every call."""
    try:
        return njit(cache=True, forceinline=True, **_LEAN)(function)
    except RuntimeError:
        return njit(forceinline=True, **_LEAN)(function)


class Scratch(NamedTuple):
    """Working memory of one thread."""

    stack: np.ndarray
    """int64 (STACK_SIZE,)."""
    stack_distance: np.ndarray
    """float64 (STACK_SIZE,)."""
    beginning: np.ndarray
    state: np.ndarray
    shift: np.ndarray
    """uint32 (DIMENSIONS,): a first point of the sequence, the present one, and what is added to it (all zero at
    first)."""
    xyz: np.ndarray
    """float64 (3,)."""


def scratch() -> Scratch:
    """Fresh working memory."""
    words = [np.zeros(DIMENSIONS, np.uint32) for _ in range(3)]
    return Scratch(np.zeros(STACK_SIZE, np.int64), np.zeros(STACK_SIZE), *words, np.zeros(3))


FIRST_CHOICE = 5
"""Dimension of the sequence that the first Fresnel choice takes; below it are place, wavelength and place on a
light."""


@inlined
def sobol_start(sequence, index, state):
    """Set `state` (DIMENSIONS,) to point `index` of the scrambled sequence."""
    code = index ^ (index >> 1)
    for d in range(DIMENSIONS):
        state[d] = sequence.shift[d]
        for k in range(32):
            if (code >> k) & 1:
                state[d] ^= sequence.directions[d, k]


@inlined
def sobol_next(sequence, index, state):
    """From point index − 1 to point `index` (> 0): the Gray code changes one bit."""
    k = 0
    while not (index >> k) & 1:
        k += 1
    for d in range(DIMENSIONS):
        state[d] ^= sequence.directions[d, k]


@inlined
def choice(state, shift, event, noise):
    """Uniform number of a path's Fresnel choice `event` (0, 1, …): of the sequence while it has dimensions, then a
    hash."""
    dimension = FIRST_CHOICE + event
    if dimension < DIMENSIONS:
        return _unit(state[dimension] ^ shift[dimension])
    word = _mixed(noise + np.uint64(event) * np.uint64(0x9E3779B97F4A7C15))
    return float(word >> np.uint64(11)) * 2.0**-53


@inlined
def camera_ray(camera, column, row):
    """(origin (3), unit direction (3)) through the picture's point, pixels from its upper left corner."""
    x = camera.half_width * (2.0 * column / camera.width - 1.0)
    y = camera.half_height * (1.0 - 2.0 * row / camera.height)
    ax = x * camera.right[0] + y * camera.up[0]
    ay = x * camera.right[1] + y * camera.up[1]
    az = x * camera.right[2] + y * camera.up[2]
    ox, oy, oz = camera.position[0], camera.position[1], camera.position[2]
    dx, dy, dz = camera.forward[0], camera.forward[1], camera.forward[2]
    if camera.orthographic:
        return ox + ax, oy + ay, oz + az, dx, dy, dz
    dx, dy, dz = dx + ax, dy + ay, dz + az
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return ox, oy, oz, dx / length, dy / length, dz / length


@inlined
def transmitted(scene, mask, alone, nm, distance):
    """What Beer's law leaves after `distance` in the medium a ray is in."""
    filling = _medium(scene, mask, alone)
    if filling == AIR or scene.weight[filling] < 0:
        return 1.0
    return math.exp(-_table(scene.weights, scene.weight[filling], nm) * distance)


@inlined
def _shading_normal(scene, triangle, u, v, dx, dy, dz, gx, gy, gz, entering):
    """Unit normal against the ray: interpolated where that faces the ray, else the facet's (gx, gy, gz)."""
    row = scene.smooth[triangle]
    if row < 0:
        return gx, gy, gz
    m = scene.corner_normals[row]
    w = 1.0 - u - v
    nx = w * m[0] + u * m[3] + v * m[6]
    ny = w * m[1] + u * m[4] + v * m[7]
    nz = w * m[2] + u * m[5] + v * m[8]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return gx, gy, gz
    length = length if entering else -length
    nx, ny, nz = nx / length, ny / length, nz / length
    if not -(dx * nx + dy * ny + dz * nz) > 1e-6:
        return gx, gy, gz
    return nx, ny, nz


@inlined
def scatter(scene, triangle, u, v, dx, dy, dz, mask, alone, nm, draw):
    """One event at glass or a mirror: (direction (3), mask, alone, on the object's inner side, is an event, share
    kept).

    `draw` in [0, 1) decides by Fresnel's reflectance. "Is an event" is false where the same substance
    lies on both sides; a mirror keeps its reflectance, glass everything.
    """
    gx, gy, gz = scene.normals[triangle, 0], scene.normals[triangle, 1], scene.normals[triangle, 2]
    cosine_g = -(dx * gx + dy * gy + dz * gz)
    entering = cosine_g > 0.0
    thing = scene.owner[triangle]
    mirror = scene.kind[thing] == MIRROR
    before, after, mask_after, alone_after = AIR, AIR, mask, alone
    if not mirror:
        bit = scene.bit[thing]
        if bit >= 0:
            own = np.uint64(1) << np.uint64(bit)
            mask_before = mask & ~own if entering else mask | own
            mask_after = mask | own if entering else mask & ~own
            before, after = _medium(scene, mask_before, AIR), _medium(scene, mask_after, AIR)
            if before == after:
                return dx, dy, dz, mask_after, alone, entering, False, 1.0
        else:
            before = AIR if entering else thing
            after = thing if entering else AIR
            alone_after = after
    if not entering:
        gx, gy, gz, cosine_g = -gx, -gy, -gz, -cosine_g
    nx, ny, nz = _shading_normal(scene, triangle, u, v, dx, dy, dz, gx, gy, gz, entering)
    cosine = -(dx * nx + dy * ny + dz * nz)
    kept, reflects, cosine_t, eta_it = 1.0, True, 0.0, 1.0
    if mirror:
        kept = _table(scene.weights, scene.weight[thing], nm)
    else:
        eta_it = _refractive_index(scene, before, nm) / _refractive_index(scene, after, nm)
        reflectance, cosine_t = fresnel(cosine, eta_it)
        reflects = draw < reflectance
    if reflects:
        rx, ry, rz = dx + 2.0 * cosine * nx, dy + 2.0 * cosine * ny, dz + 2.0 * cosine * nz
        if rx * gx + ry * gy + rz * gz <= 0.0:  # into the facet
            rx, ry, rz = dx + 2.0 * cosine_g * gx, dy + 2.0 * cosine_g * gy, dz + 2.0 * cosine_g * gz
        mask_after, alone_after, inner = mask, alone, not entering
    else:
        k = eta_it * cosine - cosine_t
        rx, ry, rz = eta_it * dx + k * nx, eta_it * dy + k * ny, eta_it * dz + k * nz
        if rx * gx + ry * gy + rz * gz >= 0.0:  # back out of the facet
            cosine2 = (1.0 - eta_it) * (1.0 + eta_it) + eta_it * eta_it * cosine_g * cosine_g
            k = eta_it * cosine_g - math.sqrt(max(cosine2, 1e-12))
            rx, ry, rz = eta_it * dx + k * gx, eta_it * dy + k * gy, eta_it * dz + k * gz
        inner = entering
    length = math.sqrt(rx * rx + ry * ry + rz * rz)
    return rx / length, ry / length, rz / length, mask_after, alone_after, inner, True, kept
