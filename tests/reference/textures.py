"""Float64 reference of textures: single texels, levels by summing overlaps texel by texel, and means over areas by
brute force, which know nothing of levels or lookups."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray


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


def environment_place(direction: Array) -> Array:
    """Places (N, 2) on a latitude-longitude picture, v downwards, of directions (N, 3) of any length."""
    polar = np.arctan2(np.hypot(direction[:, 0], direction[:, 1]), direction[:, 2])
    return np.stack([0.5 - np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * np.pi), polar / np.pi], axis=1)


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
