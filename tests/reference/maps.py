"""Float64 reference of shaders/lib/lookup.glsl: from a place on a receiver to irradiance.

Written from what the functions promise: a lookup is the exact mean of the piecewise constant map over a
box of texels, worked out texel by texel from overlaps. Records are of `spectrasplat.gpu.records`.
"""

from __future__ import annotations

import numpy as np
from spectrasplat.gpu.records import NONE

Array = np.ndarray


def find_texel(
    receivers: Array, placements: Array, receiver: int, source: int, position: Array
) -> tuple[bool, int, Array]:
    """(found, placement, texel (2,)): the finest window that holds the position (3,), float64; a window on a picture's
    pixels holds nothing behind the camera."""
    owner = receivers[receiver]
    at = int(owner["placement"])
    if at == NONE:
        return False, at, np.zeros(2)
    if owner["kind"] == 1:
        at += source - int(owner["first_triangle"])
    texel = np.zeros(2)
    while at != NONE:
        place = placements[at]
        texel = texel_of(place, position)
        slack = 1.0 if place["kind"] == 1 else 0.0
        low, high = place["rect"][:2].astype(np.float64), place["rect"][2:].astype(np.float64)
        if weight_of(place, position) > 0.0 and np.all(texel >= low - slack) and np.all(texel < high + slack):
            return True, at, texel
        at = int(place["next"])
    return False, at, texel


def texel_of(placement: np.void, position: Array) -> Array:
    """Texel coordinates (2,) of a position (3,) under a placement's rows."""
    rows = np.stack([placement["row_u"], placement["row_v"]]).astype(np.float64)
    return (rows[:, :3] @ position + rows[:, 3]) / weight_of(placement, position)


def weight_of(placement: np.void, position: Array) -> float:
    """What a placement divides by at a position (3,)."""
    row = placement["row_w"].astype(np.float64)
    return float(row[:3] @ position + row[3])


def texel_area_of(placement: np.void, position: Array) -> float:
    """Scene unit² of the texel at a position (3,)."""
    return float(placement["texel_area"]) * weight_of(placement, position) ** 3


def texels_along(placement: np.void, position: Array, direction: Array) -> Array:
    """Derivative (2,) of the texel along a direction (3,), by central differences."""
    step = 1e-6 * direction
    return (texel_of(placement, position + step) - texel_of(placement, position - step)) / 2e-6


def caustic_energy(texels: Array, placement: np.void, texel: Array, box: Array) -> Array:
    """Mean over a box (sides (2,), at most one texel) about `texel` (2,) of a map (H, W, channels). Beyond the
    placement's rectangle the map repeats its border."""
    low = np.floor(placement["rect"][:2].astype(np.float64)).astype(int)
    high = np.ceil(placement["rect"][2:].astype(np.float64)).astype(int) - 1
    side = np.clip(box, 1e-4, 1.0)
    total = np.zeros(texels.shape[-1])
    for row in range(int(np.floor(texel[1] - 1)), int(np.floor(texel[1] + 1)) + 1):
        for column in range(int(np.floor(texel[0] - 1)), int(np.floor(texel[0] + 1)) + 1):
            corner = np.array([column, row])
            overlap = np.minimum(texel + 0.5 * side, corner + 1) - np.maximum(texel - 0.5 * side, corner)
            share = np.prod(np.maximum(overlap, 0.0) / side)
            x, y = np.clip(corner, low, high)
            total = total + share * texels[y, x]
    return total
