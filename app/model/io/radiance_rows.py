"""The compiled half of `radiance_hdr`: bytes of a Radiance picture to its pixels, row by row.

In a file of its own so that numba is imported (0.4 s) only when such a picture is opened.
"""

from __future__ import annotations

import numpy as np

from ...base.compiling import compiled

ENDED, DAMAGED = -1, -2
"""Returned in the place of a position: the bytes end too early, or a run leaves its row."""


@compiled
def decode(data: np.ndarray, pixels: np.ndarray) -> tuple[int, int]:
    """Fill `pixels` uint8 (H, W, 4) from `data` uint8 (N,); rows filled, and bytes used, ENDED or DAMAGED."""
    at = 0
    for row in range(pixels.shape[0]):
        at = _decode_row(data, at, pixels[row])
        if at < 0:
            return row, at
    return pixels.shape[0], at


@compiled
def _decode_row(data, at, row):
    """One row from position `at`; the position behind it, ENDED or DAMAGED."""
    width = row.shape[0]
    # A new-style row opens with 2, 2 and its width: no mantissas are that small beside one another.
    if 8 <= width < 32768 and at + 4 <= len(data) and data[at] == 2 and data[at + 1] == 2 and data[at + 2] < 128:
        if int(data[at + 2]) * 256 + int(data[at + 3]) != width:
            return DAMAGED
        return _new_row(data, at + 4, row)
    return _old_row(data, at, row)


@compiled
def _new_row(data, at, row):
    """Four planes, each of runs: a count above 128 repeats one byte, any other is followed by as many."""
    width = row.shape[0]
    for channel in range(4):
        x = 0
        while x < width:
            if at >= len(data):
                return ENDED
            count = int(data[at])
            at += 1
            repeated = count > 128
            if repeated:
                count -= 128
            if count == 0 or x + count > width:
                return DAMAGED
            if at + (1 if repeated else count) > len(data):
                return ENDED
            for i in range(count):
                row[x + i, channel] = data[at if repeated else at + i]
            at += 1 if repeated else count
            x += count
    return at


@compiled
def _old_row(data, at, row):
    """Whole pixels; one of mantissas 1, 1, 1 repeats the pixel before it, and in a row of such each counts 256 times
    the last."""
    width = row.shape[0]
    x = 0
    weight = 1
    while x < width:
        if at + 4 > len(data):
            return ENDED
        if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
            count = int(data[at + 3]) * weight
            if x == 0 or x + count > width:
                return DAMAGED
            for i in range(count):
                row[x + i] = row[x - 1]
            x += count
            weight = min(weight * 256, 1 << 32)
        else:
            row[x] = data[at : at + 4]
            x += 1
            weight = 1
        at += 4
    return at
