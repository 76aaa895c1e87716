"""Which pixels each polygon of a picture touches: the list of what has to be looked at."""

from __future__ import annotations

import numpy as np

from .compiling import jit
from .screen_polygons import PIXEL_BITS, ScreenPolygons

_NOTHING = np.empty((0, 2), np.uint32)


def pixel_parts(
    polygons: ScreenPolygons,
    size: tuple[int, int],
    reach: float,
    parts: np.ndarray,
    which: tuple[int, int] | None = None,
) -> np.ndarray:
    """uint32 (n, 2): polygon; pixel (row by row) and, from bit `PIXEL_BITS` on, part of it; polygon after polygon.

    `reach`: pixels from a pixel's middle to its outermost points; `parts` (N,): of every pixel, by polygon; `which`:
    the first polygon and the one after the last."""
    args = _arguments(polygons, size, reach, parts, which)
    found = np.empty((_listed(*args, _NOTHING), 2), np.uint32)
    _listed(*args, found)
    return found


def count_pixel_parts(polygons: ScreenPolygons, size: tuple[int, int], reach: float, parts: np.ndarray) -> int:
    """How many `pixel_parts` lists."""
    return int(_listed(*_arguments(polygons, size, reach, parts, None), _NOTHING))


def portions(polygons: ScreenPolygons, size: tuple[int, int], parts: np.ndarray, most: int) -> list[tuple[int, int]]:
    """Polygons in turn, as few portions as possible of at most about `most` parts of pixels each (a polygon of more is
    a portion of its own)."""
    corners = np.clip(polygons.hulls, 0.0, np.array(size, float))
    starts = polygons.hull_start[:-1]
    some = np.diff(polygons.hull_start) > 0
    pixels = np.zeros(len(polygons))
    if some.any():
        span = np.maximum.reduceat(corners, starts[some]) - np.minimum.reduceat(corners, starts[some])
        pixels[some] = np.prod(span + 2.0, axis=1)
    result, first, held = [], 0, 0.0
    for i, count in enumerate(pixels * parts):
        if held > 0.0 and held + count > most:
            result.append((first, i))
            first, held = i, 0.0
        held += count
    return [*result, (first, len(polygons))] if len(polygons) else []


def _arguments(polygons, size, reach, parts, which):
    shapes = polygons.edge_start, polygons.edges, polygons.hull_start, polygons.hulls
    return *shapes, size[0], size[1], reach, parts, *(which or (0, len(polygons)))


@jit
def _listed(edge_start, edges, hull_start, hulls, width, height, reach, parts, start, end, out):
    """Number of entries; written to `out` where it has room."""
    count = 0
    for i in range(start, end):
        if hull_start[i] == hull_start[i + 1]:
            continue
        x0 = y0 = 1e300
        x1 = y1 = -1e300
        for k in range(hull_start[i], hull_start[i + 1]):
            x0, y0 = min(x0, hulls[k, 0]), min(y0, hulls[k, 1])
            x1, y1 = max(x1, hulls[k, 0]), max(y1, hulls[k, 1])
        grown = reach - 0.5
        first_x, last_x = max(int(np.floor(x0 - grown)), 0), min(int(np.floor(x1 + grown)), width - 1)
        first_y, last_y = max(int(np.floor(y0 - grown)), 0), min(int(np.floor(y1 + grown)), height - 1)
        for y in range(first_y, last_y + 1):
            for x in range(first_x, last_x + 1):
                touched = True
                for e in range(edge_start[i], edge_start[i + 1]):
                    at_lo = edges[e, 0] * (x + 0.5) + edges[e, 1] * (y + 0.5) + edges[e, 2]
                    at_hi = edges[e, 3] * (x + 0.5) + edges[e, 4] * (y + 0.5) + edges[e, 5]
                    if at_lo < -reach * (abs(edges[e, 0]) + abs(edges[e, 1])) and at_hi < -reach * (
                        abs(edges[e, 3]) + abs(edges[e, 4])
                    ):
                        touched = False
                        break
                if touched:
                    if len(out) > 0:
                        for part in range(parts[i]):
                            out[count + part, 0] = i
                            out[count + part, 1] = (y * width + x) | (part << PIXEL_BITS)
                    count += parts[i]
    return count
