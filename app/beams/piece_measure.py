"""Compiled: the lit polygon of a piece of a beam (`BeamPieces`) at any wavelength of its band, and the light in it.

For `piece_lattice`, whose photons carry the pieces on. t in [0, 1] is a wavelength's place in a piece's band.
"""

from __future__ import annotations

import numpy as np

from .clipping import clip
from .compiling import jit, part

STEPS = 16
"""Equal parts of the band over which the light of a piece is summed."""
MOMENTS_OF_BAND, TANGENTS = 5, 16
"""Values of t at which the lit polygon is measured to lay its lattice; tangents laid about all of these polygons."""
SCRATCH = np.dtype(
    [
        ("moments", "f8", 6),
        ("total", "f8", 6),
        ("sums", "f8", 12),
        ("low", "f8", 6),
        ("high", "f8", 6),
        ("frame", "f8", 11),
        ("cell", "f8", 6),
        ("counts", "i8", MOMENTS_OF_BAND),
        ("hull", "f8", (2 * TANGENTS + 8, 2)),
        ("hull_cut", "f8", (4 * TANGENTS + 16, 2)),
    ]
)
"""Scratch of the compiled functions, besides the `polygons` and `cut` of `room_for`."""
PIECE = np.dtype(
    [
        ("light", "i8"),
        ("x_lo", "f8"),
        ("x_hi", "f8"),
        ("position", "f8", (3, 3, 3)),
        ("direction", "f8", (3, 3, 3)),
        ("weight", "f8", 3),
        # Rows of the edges and of the hull's corners, first and one behind the last.
        ("edges", "i8", 2),
        ("hull", "i8", 2),
        # Hash of its path.
        ("key", "i8"),
        # Its light and its band's spectral power, see `contents`.
        ("content", "f8"),
        ("power", "f8"),
    ]
)
"""A piece (`BeamPieces`) as compiled functions read it."""
_LINE_X = 1e-9
"""An emission line's power is the change of the cumulative power from this far below its x to this far above."""


def room_for(pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scratch arrays (`polygons`, `cut`, `scratch`) that suffice for PIECE records."""
    room = sum(int((pieces[name][:, 1] - pieces[name][:, 0]).max(initial=0)) for name in ("edges", "hull")) + 8
    return np.empty((MOMENTS_OF_BAND, room, 2)), np.empty((2 * room, 2)), np.empty(1, SCRATCH)


@part
def _power_below(curve_x, curve_w, x):
    """Cumulative power up to x, an emission line at x included (`CumulativeSpectrum.at`)."""
    x = min(max(x, 0.0), 1.0)
    i = min(max(np.searchsorted(curve_x, x, side="right") - 1, 0), len(curve_x) - 2)
    span = curve_x[i + 1] - curve_x[i]
    share = (x - curve_x[i]) / span if span > 0.0 else 1.0
    return curve_w[i] + share * (curve_w[i + 1] - curve_w[i])


@part
def power_between(curve_x, curve_w, x_lo, x_hi):
    """Power between two x; where they are equal, the power of the emission line there."""
    widen = _LINE_X if x_hi == x_lo else 0.0
    return _power_below(curve_x, curve_w, x_hi + widen) - _power_below(curve_x, curve_w, x_lo - widen)


@part
def parabola(t):
    """Weights at t of the values given at 0, 1/2 and 1 (quadratic interpolation)."""
    return 2.0 * (t - 0.5) * (t - 1.0), 4.0 * t * (1.0 - t), 2.0 * t * (t - 0.5)


@part
def weight_at(weight, t):
    a, b, c = parabola(t)
    return max(a * weight[0] + b * weight[1] + c * weight[2], 0.0)


@part
def moments_of(polygon, count, out):
    """Area, first moments u, v and second moments uu, uv, vv of a polygon about the origin, into `out`."""
    out[:] = 0.0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        x, y, z, w = polygon[i, 0], polygon[i, 1], polygon[j, 0], polygon[j, 1]
        cross = x * w - z * y
        out[0] += cross / 2.0
        out[1] += cross * (x + z) / 6.0
        out[2] += cross * (y + w) / 6.0
        out[3] += cross * (x * x + x * z + z * z) / 12.0
        out[4] += cross * (x * w + 2.0 * x * y + 2.0 * z * w + z * y) / 24.0
        out[5] += cross * (y * y + y * w + w * w) / 12.0


@part
def copy(hull, polygon):
    """Copy the polygon `hull` into the larger array `polygon`; returns its number of corners."""
    for c in range(len(hull)):
        polygon[c, 0], polygon[c, 1] = hull[c, 0], hull[c, 1]
    return len(hull)


@part
def keep_lit(edges, t, u, v, polygon, count, scratch):
    """Clip a polygon, relative to (u, v), to the lit side of all edges at t; returns its number of corners."""
    for e in range(len(edges)):
        if count == 0:
            break
        a_u = edges[e, 0] + t * (edges[e, 3] - edges[e, 0])
        a_v = edges[e, 1] + t * (edges[e, 4] - edges[e, 1])
        c = edges[e, 2] + t * (edges[e, 5] - edges[e, 2])
        count = clip(polygon, count, scratch, a_u, a_v, c + a_u * u + a_v * v)
    return count


@jit
def contents(pieces, edges, hulls, curve_start, curve_x, curve_w, polygons, cut, scratch):
    """Set the `content` of each piece: weight · spectral power · lit area summed over its band, W per unit of what q
    measures (scene unit² or sr); and `power`: spectral power of its band, W."""
    moments, polygon = scratch[0].moments, polygons[0]
    for i in range(len(pieces)):
        piece = pieces[i]
        own = edges[piece.edges[0] : piece.edges[1]]
        hull = hulls[piece.hull[0] : piece.hull[1]]
        first, end = curve_start[piece.light], curve_start[piece.light + 1]
        x_lo, x_hi = piece.x_lo, piece.x_hi
        steps = STEPS if x_hi > x_lo else 1
        total = band = 0.0
        for k in range(steps):
            t = (k + 0.5) / steps if steps > 1 else 0.0
            lo = x_lo + (x_hi - x_lo) * k / steps
            hi = x_lo + (x_hi - x_lo) * (k + 1) / steps
            power = power_between(curve_x[first:end], curve_w[first:end], lo, hi)
            moments_of(polygon, keep_lit(own, t, 0.0, 0.0, polygon, copy(hull, polygon), cut), moments)
            total += moments[0] * power * weight_at(piece.weight, t)
            band += power
        piece.content, piece.power = total, band
