"""Float64 reference of shaders/lib/textures.glsl and of the levels it reads, and what both stand for: means over areas.

The CPU reference finds the axes of a patch by a singular value decomposition and levels by summing overlaps texel by
texel; the means by brute force know nothing of levels or lookups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Array = np.ndarray
MAX_TAPS, ROUND_RATIO, LEVEL_BIAS, SKY_WIDER = 8, 1.25, -0.8, 1.366


def level_by_overlaps(rgb: Array, level: int, on_sphere: bool = False) -> Array:
    """Level of a picture (H, W, channels) as the mean of what each texel covers, by area or by solid angle from pole to
    pole."""
    height, width = rgb.shape[:2]
    rows, columns = max(1, height >> level), max(1, width >> level)
    out = np.zeros((rows, columns, rgb.shape[2]))
    for row in range(rows):
        for column in range(columns):
            total, weight = np.zeros(rgb.shape[2]), 0.0
            top, bottom = row * height / rows, (row + 1) * height / rows
            left, right = column * width / columns, (column + 1) * width / columns
            for y in range(int(top), int(np.ceil(bottom - 1e-9))):
                low, high = max(y, top) / height, min(y + 1, bottom) / height
                tall = np.cos(np.pi * low) - np.cos(np.pi * high) if on_sphere else high - low
                for x in range(int(left), int(np.ceil(right - 1e-9))):
                    share = tall * (min(x + 1, right) - max(x, left))
                    total, weight = total + share * rgb[y, x], weight + share
            out[row, column] = total / weight
    return out


def bilinear(rgb: Array, place: Array, repeats: tuple[bool, bool]) -> Array:
    """(N, channels) between the texels of (H, W, channels) at (N, 2) places; (0, 0) is the upper left corner."""
    rows, columns = rgb.shape[:2]

    def texels(axis: int, count: int) -> tuple[Array, Array, Array]:
        share = place[:, axis] % 1.0 if repeats[axis] else np.clip(place[:, axis], 0.0, 1.0)
        at = share * count - 0.5
        low = np.floor(at).astype(int)
        both = np.stack([low, low + 1])
        both = both % count if repeats[axis] else np.clip(both, 0, count - 1)
        return both[0], both[1], (at - low)[:, None]

    left, right, x = texels(0, columns)
    top, bottom, y = texels(1, rows)
    values = rgb.astype(np.float64)
    above = values[top, left] * (1.0 - x) + values[top, right] * x
    below = values[bottom, left] * (1.0 - x) + values[bottom, right] * x
    return above * (1.0 - y) + below * y


def patch_axes(side_s: Array, side_t: Array) -> tuple[Array, Array, Array]:
    """Longer and shorter axis (N,) of parallelograms with sides (N, d), and the longer one as a vector (N, d)."""
    left, lengths, _ = np.linalg.svd(np.stack([side_s, side_t], axis=-1), full_matrices=False)
    return lengths[:, 0], lengths[:, 1], left[:, :, 0] * lengths[:, :1]


def filter_plan(longer: Array, shorter: Array) -> tuple[Array, Array]:
    """Level and number of lookups for a patch with these axes in texels."""
    width = np.maximum(np.maximum(shorter, longer / (MAX_TAPS * ROUND_RATIO)), 1.0)
    taps = np.clip(np.ceil(longer / (ROUND_RATIO * width)), 1, MAX_TAPS)
    return np.maximum(np.log2(width) + LEVEL_BIAS, 0.0), taps


def _looked_up(
    levels: Sequence[Array],
    level: Array,
    taps: Array,
    place_of_tap: Callable[[Array], Array],
    repeats: tuple[bool, bool],
) -> Array:
    """Mean over `taps` places, in (-½, ½) of the longer axis, of what lies between two levels there."""
    total = np.zeros((len(level), levels[0].shape[2]))
    level = np.minimum(level, len(levels) - 1)
    for tap in range(MAX_TAPS):
        place = place_of_tap((tap + 0.5) / taps - 0.5)
        for k, texels in enumerate(levels):
            weight = np.maximum(1.0 - np.abs(level - k), 0.0) * (tap < taps)
            total += weight[:, None] * bilinear(texels, place, repeats)
    return total / taps[:, None]


def texture_filtered(levels: Sequence[Array], uv: Array, duv_ds: Array, duv_dt: Array, repeats: bool) -> Array:
    """(N, channels) of a texture's levels about `uv` (N, 2), v upwards, over patches with sides (N, 2)."""
    size = np.array(levels[0].shape[1::-1], np.float64)
    longer, shorter, axis = patch_axes(duv_ds * size, duv_dt * size)
    level, taps = filter_plan(longer, shorter)
    flip = np.array([0.0, 1.0])

    def place(share: Array) -> Array:
        at = uv + share[:, None] * axis / size
        return flip + at * (1.0 - 2.0 * flip)

    return _looked_up(levels, level, taps, place, (repeats, repeats))


def environment_place(direction: Array) -> Array:
    """Places (N, 2) on a latitude-longitude picture, v downwards, of directions (N, 3) of any length."""
    polar = np.arctan2(np.hypot(direction[:, 0], direction[:, 1]), direction[:, 2])
    return np.stack([0.5 - np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * np.pi), polar / np.pi], axis=1)


def environment_radiance(
    levels: Sequence[Array], direction: Array, ddirection_ds: Array, ddirection_dt: Array
) -> Array:
    """(N, channels) of an environment's levels about unit directions (N, 3) over patches with sides (N, 3)."""
    longer, shorter, axis = patch_axes(ddirection_ds, ddirection_dt)
    per_rad = levels[0].shape[0] / np.pi
    level, taps = filter_plan(SKY_WIDER * longer * per_rad, SKY_WIDER * shorter * per_rad)
    return _looked_up(
        levels, level, taps, lambda share: environment_place(direction + share[:, None] * axis), (True, False)
    )


def mean_by_force(
    value: Callable[[Array], Array], centre: Array, side_s: Array, side_t: Array, steps: int = 48
) -> Array:
    """Mean (N, channels) of `value` (points (N, d) → (N, channels)) over parallelograms about `centre` (N, d), from
    steps² points each."""
    shares = (np.arange(steps) + 0.5) / steps - 0.5
    total: Array | float = 0.0
    for s in shares:
        for t in shares:
            total = total + value(centre + s * side_s + t * side_t)
    return np.asarray(total) / steps**2


def hit_uv(uv: Array, bary: Array) -> Array:
    """(N, 2) at barycentric weights (N, 2) of the second and third corner of triangles with (N, 3, 2) texture
    coordinates."""
    weights = np.column_stack([1.0 - bary.sum(axis=1), bary])
    return np.einsum("nc,ncj->nj", weights, uv)


def uv_gradients(corners: Array, uv: Array) -> tuple[Array, Array]:
    """Gradients (N, 3) of u and v in the planes of triangles (N, 3, 3): the least-norm solution of their edges'
    equations."""
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    steps = np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1)
    gradients = np.linalg.pinv(edges) @ steps
    return gradients[:, :, 0], gradients[:, :, 1]
