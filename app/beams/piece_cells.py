"""A cell of the lattice over a piece of a beam, and the ray that represents it: compiled.

A cell and the piece's edges, which move with t, cut a body out of (q_u, q_v, t). Its ray has the body's content (so
that the cells of a piece add up to the piece), its mean place and interval, its spread about them, and the slope of
place against t: what a moving edge or a moving sliver lights one after the other moves with the ray's wavelengths.
"""

from __future__ import annotations

import math

from .compiling import part
from .piece_measure import keep_lit, moments_of, parabola, power_between, weight_at

CELL_STEPS = 2
"""Places of each of three parts of the time that a cell is lit at which it is measured, where an edge crosses it."""
_LEAST_HELD = 1e-12
"""Share of a light's power below which there is no ray."""
COLUMNS = 33
"""Numbers of a ray: position, direction, their derivatives by the cell's two axes (dp dp dd dd) and by x (dp dd), x_lo,
x_anchor, x_hi, throughput there, flux; its piece, and its number on the piece's lattice."""
BODY = 11
"""Numbers that `cell_body` gives, and which cell of the lattice it is."""


@part
def cell_body(edges, weight, x_lo, x_hi, curve_x, curve_w, cell, band_content, polygon, cut, scratch, body):
    """The part of a cell that is lit: `body` is content, mean u, v, first and last t, slope of u, v by t, spread uu,
    uv, vv. `cell`: u, v of its middle, its half axes' u, v, u, v."""
    u, v = cell[0], cell[1]
    area = 4.0 * abs(cell[2] * cell[5] - cell[3] * cell[4])
    first, last, whole = 0.0, 1.0, True
    risen, falls = 0.0, 1.0  # when edges that come in have crossed the cell, and those that go out begin to
    for e in range(len(edges)):
        near = edges[e, 0] * u + edges[e, 1] * v + edges[e, 2]
        far = edges[e, 3] * u + edges[e, 4] * v + edges[e, 5]
        reach0 = abs(edges[e, 0] * cell[2] + edges[e, 1] * cell[3]) + abs(edges[e, 0] * cell[4] + edges[e, 1] * cell[5])
        reach1 = abs(edges[e, 3] * cell[2] + edges[e, 4] * cell[3]) + abs(edges[e, 3] * cell[4] + edges[e, 4] * cell[5])
        if x_hi == x_lo:
            far, reach1 = near, reach0
        whole = whole and near >= reach0 and far >= reach1
        if near < reach0 and far > reach1:
            risen = max(risen, (reach0 - near) / (reach0 - near + far - reach1))
        elif near > reach0 and far < reach1:
            falls = min(falls, (near - reach0) / (near - reach0 + reach1 - far))
        near, far = near + reach0, far + reach1
        if near < 0.0 and far < 0.0:
            return False
        if near < 0.0:
            first = max(first, near / (near - far))
        elif far < 0.0:
            last = min(last, near / (near - far))
    if first > last:
        return False
    body[5] = body[6] = 0.0
    if whole:
        body[0], body[1], body[2], body[3], body[4] = area * band_content, u, v, 0.0, 1.0
        body[7] = (cell[2] * cell[2] + cell[4] * cell[4]) / 3.0
        body[8] = (cell[2] * cell[3] + cell[4] * cell[5]) / 3.0
        body[9] = (cell[3] * cell[3] + cell[5] * cell[5]) / 3.0
        return body[0] > 0.0

    # Straight in between: it grows, stays and shrinks again.
    risen, falls = min(max(risen, first), last), min(max(falls, first), last)
    bounds = (first, min(risen, falls), max(risen, falls), last)
    moments, sums = scratch.moments, scratch.sums
    sums[:] = 0.0
    for k in range(3 * CELL_STEPS if x_hi > x_lo else 1):
        start, end = bounds[k // CELL_STEPS], bounds[k // CELL_STEPS + 1]
        step = (end - start) / CELL_STEPS
        lo = start + step * (k % CELL_STEPS)
        if x_hi == x_lo:
            lo, step = 0.0, 0.0
        elif step <= 0.0:
            continue
        t = lo + 0.5 * step
        for corner in range(4):
            s, r = (1.0 if corner in (1, 2) else -1.0), (1.0 if corner >= 2 else -1.0)
            polygon[corner, 0] = s * cell[2] + r * cell[4]
            polygon[corner, 1] = s * cell[3] + r * cell[5]
        moments_of(polygon, keep_lit(edges, t, u, v, polygon, 4, cut), moments)
        if moments[0] > 0.0:
            power = power_between(curve_x, curve_w, x_lo + (x_hi - x_lo) * lo, x_lo + (x_hi - x_lo) * (lo + step))
            sums[0] += moments[0] * power * weight_at(weight, t)
            for m in range(6):
                moments[m] *= step if step > 0.0 else 1.0
                sums[1 + m] += moments[m]
            sums[7] += moments[0] * t
            sums[8] += moments[0] * t * t
            sums[9] += moments[1] * t
            sums[10] += moments[2] * t
            sums[11] += moments[0] * step * step / 12.0
    if not sums[0] > 0.0:
        return False
    lit = sums[1]
    mean_u, mean_v, mean_t = sums[2] / lit, sums[3] / lit, sums[7] / lit
    between, within = max(sums[8] / lit - mean_t * mean_t, 0.0), sums[11] / lit
    slope_u = slope_v = 0.0
    if between > 1e-6 * within:
        slope_u = (sums[9] / lit - mean_u * mean_t) / between
        slope_v = (sums[10] / lit - mean_v * mean_t) / between
    half = math.sqrt(3.0 * (between + within))
    body[3], body[4] = max(mean_t - half, first), min(mean_t + half, last)
    if power_between(curve_x, curve_w, x_lo + (x_hi - x_lo) * body[3], x_lo + (x_hi - x_lo) * body[4]) <= 0.0:
        body[3], body[4] = first, last  # a line of the spectrum is in the rest
    middle = 0.5 * (body[3] + body[4])
    body[0] = sums[0]
    body[1] = u + mean_u + slope_u * (middle - mean_t)
    body[2] = v + mean_v + slope_v * (middle - mean_t)
    body[5], body[6] = slope_u, slope_v
    body[7] = sums[4] / lit - mean_u * mean_u - slope_u * slope_u * between
    body[8] = sums[5] / lit - mean_u * mean_v - slope_u * slope_v * between
    body[9] = sums[6] / lit - mean_v * mean_v - slope_v * slope_v * between
    return True


@part
def _at(affine, t, u, v, out):
    """X + X_u u + X_v v at t, `affine` (3, 3, 3)."""
    a, b, c = parabola(t)
    for j in range(3):
        out[j] = (
            a * (affine[0, 0, j] + affine[0, 1, j] * u + affine[0, 2, j] * v)
            + b * (affine[1, 0, j] + affine[1, 1, j] * u + affine[1, 2, j] * v)
            + c * (affine[2, 0, j] + affine[2, 1, j] * u + affine[2, 2, j] * v)
        )


@part
def _normalise(direction):
    length = math.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
    for j in range(3):
        direction[j] /= length
    return length


@part
def ray_of(position, direction, weight, x_lo, x_hi, curve_x, curve_w, body, content, scratch, ray):
    """The ray of a lit cell that carries `content`."""
    first, last = body[3], body[4]
    if x_hi == x_lo:
        first = last = 0.0
    t = 0.5 * (first + last)
    u, v = body[1], body[2]
    # Principal axes of what is lit: a lattice's spacing is √12 standard deviations of its cell.
    mean, difference = 0.5 * (body[7] + body[9]), 0.5 * (body[7] - body[9])
    radius = math.sqrt(difference * difference + body[8] * body[8])
    angle = 0.5 * math.atan2(body[8], difference) if radius > 1e-9 * mean else 0.0
    long_axis, short_axis = math.sqrt(12.0 * max(mean + radius, 0.0)), math.sqrt(12.0 * max(mean - radius, 0.0))
    axes = (
        (long_axis * math.cos(angle), long_axis * math.sin(angle)),
        (-short_axis * math.sin(angle), short_axis * math.cos(angle)),
    )
    _at(position, t, u, v, ray[0:3])
    _at(direction, t, u, v, ray[3:6])
    length = _normalise(ray[3:6])
    a, b, c = parabola(t)
    for s in range(2):
        along = 0.0
        for j in range(3):
            dp = dd = 0.0
            for w in range(2):
                dp += axes[s][w] * (a * position[0, 1 + w, j] + b * position[1, 1 + w, j] + c * position[2, 1 + w, j])
                dd += axes[s][w] * (
                    a * direction[0, 1 + w, j] + b * direction[1, 1 + w, j] + c * direction[2, 1 + w, j]
                )
            ray[6 + 3 * s + j] = dp
            ray[12 + 3 * s + j] = dd / length
            along += dd / length * ray[3 + j]
        for j in range(3):
            ray[12 + 3 * s + j] -= along * ray[3 + j]
    start, middle, end = x_lo + (x_hi - x_lo) * first, x_lo + (x_hi - x_lo) * t, x_lo + (x_hi - x_lo) * last
    ray[18:24] = 0.0
    if end - start > 1e-12:
        low, high = scratch.low, scratch.high
        for place, out in ((first, low), (last, high)):
            _at(position, place, u + body[5] * (place - t), v + body[6] * (place - t), out[:3])
            _at(direction, place, u + body[5] * (place - t), v + body[6] * (place - t), out[3:])
            _normalise(out[3:])
        for j in range(6):
            ray[18 + j] = (high[j] - low[j]) / (end - start)
    ray[24], ray[25], ray[26] = start, middle, end
    w_lo, w_mid, w_hi = weight_at(weight, first), weight_at(weight, t), weight_at(weight, last)
    if end > start:
        below, above = power_between(curve_x, curve_w, start, middle), power_between(curve_x, curve_w, middle, end)
        held = 0.5 * (w_lo + w_mid) * below + 0.5 * (w_mid + w_hi) * above
    else:
        held = w_mid * power_between(curve_x, curve_w, start, end)
    if not held > _LEAST_HELD * curve_w[-1]:
        return False
    ray[27], ray[28], ray[29] = w_lo * content / held, w_mid * content / held, w_hi * content / held
    ray[30] = content
    return True
