"""Pictures and their smaller copies, as the filter of shaders/lib/textures.glsl reads them.

A texel of a level is the exact mean of the part of level 0 below it, also where a side is odd and its border cuts
texels. On an environment "mean" is over solid angle, so that what little there is at the poles does not count as if
it were much; and below level 0 every row is smoothed to texels that are about as wide as high on the sphere, so
that near a pole, where a round footprint covers many columns, one lookup still sees all of them.
"""

from __future__ import annotations

import weakref

import numpy as np

_Array = np.ndarray


def level_count(width: int, height: int) -> int:
    """Levels down to one texel, each half the one before, rounded down."""
    return max(width, height).bit_length()


def level_size(width: int, height: int, level: int) -> tuple[int, int]:
    """Width and height of a level."""
    return max(1, width >> level), max(1, height >> level)


def texture_levels(rgb: _Array) -> list[_Array]:
    """float32 (H_k, W_k, 3) of every level of a picture (H, W, 3); level 0 is the picture."""
    return _chain(rgb, on_sphere=False)


def environment_levels(rgb: _Array) -> list[_Array]:
    """`texture_levels` of a latitude-longitude picture, whose top row is one pole and whose bottom row is the other."""
    first, *smaller = _chain(rgb, on_sphere=True)
    return [first, *(_round_texels(level) for level in smaller)]


def _chain(rgb: _Array, *, on_sphere: bool) -> list[_Array]:
    height, width = rgb.shape[:2]
    levels = [rgb]
    for k in range(1, level_count(width, height)):
        to_width, to_height = level_size(width, height, k)
        # From the level before where its texels are wholly in this one's, else from the picture itself.
        nested = all(n == m or n == 2 * m for n, m in zip(levels[-1].shape[:2], (to_height, to_width), strict=True))
        source = levels[-1] if nested else rgb
        rows = _means(source, to_height, on_sphere)
        levels.append(_means(rows.swapaxes(0, 1), to_width, False).swapaxes(0, 1))
    return [np.ascontiguousarray(level, np.float32) for level in levels]


def _measure(share: _Array, on_sphere: bool) -> _Array:
    """Size of the part of an axis before `share` of it: length, or solid angle for an axis from pole to pole."""
    return 0.5 - 0.5 * np.cos(np.pi * share) if on_sphere else share


def _means(values: _Array, count: int, on_sphere: bool) -> _Array:
    """Means of `values` (N, …) over `count` equal parts of its first axis, float64 (count, …)."""
    size = len(values)
    if size == count:
        return values
    if size == 2 * count:
        borders = _measure(np.arange(size + 1) / size, on_sphere)
        weights = np.diff(borders).reshape(count, 2)
        weights = (weights / weights.sum(axis=1, keepdims=True)).reshape(count, 2, *(1,) * (values.ndim - 1))
        return weights[:, 0] * values[0::2] + weights[:, 1] * values[1::2]
    from scipy.sparse import coo_array

    # In units where both grids' borders are whole numbers; a piece between two borders is in one part and one cell.
    borders = np.union1d(np.arange(count + 1) * size, np.arange(size + 1) * count)
    part, cell = borders[:-1] // size, borders[:-1] // count
    share = np.diff(_measure(borders / (size * count), on_sphere))
    share /= np.bincount(part, share)[part]
    means = coo_array((share, (part, cell)), shape=(count, size)).tocsr()
    return (means @ np.ascontiguousarray(values).reshape(size, -1)).reshape(count, *values.shape[1:])


def _round_texels(level: _Array) -> _Array:
    """Every row averaged along itself, round the sphere, over as many columns as a texel's height is long there."""
    height, width = level.shape[:2]
    borders = np.pi * np.arange(height + 1) / height
    sine = -np.diff(np.cos(borders)) / (np.pi / height)
    columns = np.clip(0.5 * width / height / sine, 1.0, width)
    smoothed = level.copy()
    for row in np.flatnonzero(columns > 1.0):
        smoothed[row] = _running_mean(level[row].astype(np.float64), columns[row])
    return smoothed


def _running_mean(row: _Array, columns: float) -> _Array:
    """Means of a closed row (W, channels) over `columns` (1 to W, not whole) about each of its texels."""
    width = len(row)
    total = np.concatenate([np.zeros((1, *row.shape[1:])), np.cumsum(np.concatenate([row, row, row]), axis=0)])

    def up_to(place: _Array) -> _Array:
        whole = np.floor(place).astype(int)
        part = (place - whole)[:, None]
        return total[whole] * (1.0 - part) + total[np.minimum(whole + 1, 3 * width)] * part

    middle = width + 0.5 + np.arange(width)
    return (up_to(middle + 0.5 * columns) - up_to(middle - 0.5 * columns)) / columns


_kept: dict[tuple[int, bool], tuple[weakref.ref[_Array], list[_Array]]] = {}


def kept_levels(rgb: _Array, *, on_sphere: bool) -> list[_Array]:
    """The levels of `rgb`, worked out once in the life of the array: edits of a scene leave its pictures as they
    are."""
    key = id(rgb), on_sphere
    if key not in _kept:
        levels = environment_levels(rgb) if on_sphere else texture_levels(rgb)
        # Without level 0, which may be `rgb` itself and would then live for ever.
        _kept[key] = weakref.ref(rgb, lambda _: _kept.pop(key, None)), levels[1:]
    return [np.asarray(rgb, np.float32), *_kept[key][1]]
