"""The compiled half of `piece_lattice`: a lattice over each piece of a beam, cell by cell.

In a file of its own so that numba is imported (0.4 s) only when a beam has pieces.

A cell and the piece's edges, which move with t, cut a body out of (q_u, q_v, t). Its ray has the body's content (so
that the cells of a piece add up to the piece), its mean place and interval, its spread about them, and the slope of
place against t: what a moving edge or a moving sliver lights one after the other moves with the ray's wavelengths.
"""

from __future__ import annotations

import math

import numpy as np

from .compiling import allocating

STEPS = 16
"""Places of the band at which a whole piece is measured …"""
CELL_STEPS = 2
"""… and of each of three parts of the time that a cell is lit, where an edge crosses it."""
COLUMNS = 31
"""Of a ray: position, direction, their derivatives by the cell's two axes (dp dp dd dd) and by x (dp dd), x_lo,
x_anchor, x_hi, throughput there, flux."""
MOMENTS_OF_BAND, TANGENTS = 5, 16
"""Times at which what is lit is measured for its lattice, and sides of what is laid about it."""
GOLDEN = 0.6180339887498949
_BODY = 11
_LINE_X = 1e-9
"""An emission line is looked for so far on both sides of its x."""


@allocating
def _power_below(curve_x, curve_w, x):
    """Cumulative power at x, a line there included (`CumulativeSpectrum.at`)."""
    x = min(max(x, 0.0), 1.0)
    i = min(max(np.searchsorted(curve_x, x, side="right") - 1, 0), len(curve_x) - 2)
    span = curve_x[i + 1] - curve_x[i]
    share = (x - curve_x[i]) / span if span > 0.0 else 1.0
    return curve_w[i] + share * (curve_w[i + 1] - curve_w[i])


@allocating
def _power(curve_x, curve_w, x_lo, x_hi):
    """Power between two places of the spectrum; of the line, where they are one."""
    widen = _LINE_X if x_hi == x_lo else 0.0
    return _power_below(curve_x, curve_w, x_hi + widen) - _power_below(curve_x, curve_w, x_lo - widen)


@allocating
def _parabola(t):
    """Weights of the values at 0, 1/2, 1."""
    return 2.0 * (t - 0.5) * (t - 1.0), 4.0 * t * (1.0 - t), 2.0 * t * (t - 0.5)


@allocating
def _weight_at(weight, t):
    a, b, c = _parabola(t)
    return max(a * weight[0] + b * weight[1] + c * weight[2], 0.0)


@allocating
def _clip(polygon, count, scratch, a_u, a_v, c):
    """Keep a . p + c >= 0 of a convex polygon, in place; the number of corners left."""
    kept = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        h_i = a_u * polygon[i, 0] + a_v * polygon[i, 1] + c
        h_j = a_u * polygon[j, 0] + a_v * polygon[j, 1] + c
        if h_i >= 0.0:
            scratch[kept, 0], scratch[kept, 1] = polygon[i, 0], polygon[i, 1]
            kept += 1
        if (h_i >= 0.0) != (h_j >= 0.0):
            s = h_i / (h_i - h_j)
            scratch[kept, 0] = polygon[i, 0] + s * (polygon[j, 0] - polygon[i, 0])
            scratch[kept, 1] = polygon[i, 1] + s * (polygon[j, 1] - polygon[i, 1])
            kept += 1
    for i in range(kept):
        polygon[i, 0], polygon[i, 1] = scratch[i, 0], scratch[i, 1]
    return kept


@allocating
def _moments(polygon, count, out):
    """Area, first moments, second moments uu, uv, vv about the origin."""
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


@allocating
def _lit(edges, t, u, v, polygon, count, scratch):
    """Clip a polygon about (u, v) by all edges at t."""
    for e in range(len(edges)):
        if count == 0:
            break
        a_u = edges[e, 0] + t * (edges[e, 3] - edges[e, 0])
        a_v = edges[e, 1] + t * (edges[e, 4] - edges[e, 1])
        c = edges[e, 2] + t * (edges[e, 5] - edges[e, 2])
        count = _clip(polygon, count, scratch, a_u, a_v, c + a_u * u + a_v * v)
    return count


@allocating
def contents(
    x_lo, x_hi, weight, edge_start, edges, hull_start, hulls, light, curve_start, curve_x, curve_w, out, powers
):
    """What each piece holds, `out` (M,): weight · power · area, W per unit of the measure's scale; `powers` (M,) of the
    bands, W."""
    moments = np.empty(6)
    for i in range(len(out)):
        own = edges[edge_start[i] : edge_start[i + 1]]
        hull = hulls[hull_start[i] : hull_start[i + 1]]
        room = len(own) + len(hull) + 4
        polygon, scratch = np.empty((room, 2)), np.empty((2 * room, 2))
        first, end = curve_start[light[i]], curve_start[light[i] + 1]
        steps = STEPS if x_hi[i] > x_lo[i] else 1
        total = 0.0
        for k in range(steps):
            t = (k + 0.5) / steps if steps > 1 else 0.0
            lo = x_lo[i] + (x_hi[i] - x_lo[i]) * k / steps
            hi = x_lo[i] + (x_hi[i] - x_lo[i]) * (k + 1) / steps
            power = _power(curve_x[first:end], curve_w[first:end], lo, hi)
            polygon[: len(hull)] = hull
            _moments(polygon, _lit(own, t, 0.0, 0.0, polygon, len(hull), scratch), moments)
            total += moments[0] * power * _weight_at(weight[i], t)
            powers[i] += power
        out[i] = total


@allocating
def _frame(own, hull, moves, out):
    """Principal axis (cosine, sine) of what is lit at some time; low and high of the hull, and of that, along it and
    across it; area of the convex hull of that."""
    times = MOMENTS_OF_BAND if moves else 1
    room = len(own) + len(hull) + 4
    polygons, counts = np.empty((times, room, 2)), np.empty(times, np.int64)
    scratch, moments, total = np.empty((2 * room, 2)), np.empty(6), np.zeros(6)
    for k in range(times):
        polygons[k, : len(hull)] = hull
        t = k / (times - 1) if times > 1 else 0.0
        counts[k] = _lit(own, t, 0.0, 0.0, polygons[k], len(hull), scratch)
        _moments(polygons[k], counts[k], moments)
        total += moments
    if not total[0] > 0.0:
        return False
    u, v = total[1] / total[0], total[2] / total[0]
    uu, uv, vv = total[3] / total[0] - u * u, total[4] / total[0] - u * v, total[5] / total[0] - v * v
    angle = 0.5 * math.atan2(2.0 * uv, uu - vv)
    cosine, sine = math.cos(angle), math.sin(angle)
    out[0], out[1] = cosine, sine
    for at in range(2, 10, 2):
        out[at], out[at + 1] = np.inf, -np.inf
    for i in range(len(hull)):
        _widen(out[2:4], cosine * hull[i, 0] + sine * hull[i, 1])
        _widen(out[4:6], -sine * hull[i, 0] + cosine * hull[i, 1])
    for k in range(times):
        for i in range(counts[k]):
            _widen(out[6:8], cosine * polygons[k, i, 0] + sine * polygons[k, i, 1])
            _widen(out[8:10], -sine * polygons[k, i, 0] + cosine * polygons[k, i, 1])
    length, width = out[7] - out[6], out[9] - out[8]
    if not (length > 0.0 and width > 0.0):
        return False
    if not moves or not np.any(own[:, :3] != own[:, 3:]):
        out[10] = total[0] / times
        return True
    # About the hull as many tangents, in proportion to its box.
    round_it = np.empty((2 * TANGENTS + 8, 2))
    for corner in range(4):
        round_it[corner, 0] = 1.0 if corner in (1, 2) else -1.0
        round_it[corner, 1] = 1.0 if corner >= 2 else -1.0
    count, scratch = 4, np.empty((4 * TANGENTS + 16, 2))
    for tangent in range(TANGENTS):
        turn = 2.0 * math.pi * (tangent + 0.5) / TANGENTS
        a_u, a_v, farthest = math.cos(turn), math.sin(turn), -np.inf
        for k in range(times):
            for i in range(counts[k]):
                along = cosine * polygons[k, i, 0] + sine * polygons[k, i, 1]
                across = -sine * polygons[k, i, 0] + cosine * polygons[k, i, 1]
                along = 2.0 * (along - out[6]) / length - 1.0
                across = 2.0 * (across - out[8]) / width - 1.0
                farthest = max(farthest, a_u * along + a_v * across)
        count = _clip(round_it, count, scratch, -a_u, -a_v, farthest)
    _moments(round_it, count, moments)
    out[10] = 0.25 * moments[0] * length * width
    return out[10] > 0.0


@allocating
def _widen(span, value):
    span[0], span[1] = min(span[0], value), max(span[1], value)


@allocating
def _cell_body(edges, weight, x_lo, x_hi, curve_x, curve_w, cell, band_content, polygon, scratch, body):
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
    moments, sums = np.empty(6), np.zeros(12)
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
        _moments(polygon, _lit(edges, t, u, v, polygon, 4, scratch), moments)
        if moments[0] > 0.0:
            power = _power(curve_x, curve_w, x_lo + (x_hi - x_lo) * lo, x_lo + (x_hi - x_lo) * (lo + step))
            sums[0] += moments[0] * power * _weight_at(weight, t)
            moments *= step if step > 0.0 else 1.0
            for m in range(6):
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
    if _power(curve_x, curve_w, x_lo + (x_hi - x_lo) * body[3], x_lo + (x_hi - x_lo) * body[4]) <= 0.0:
        body[3], body[4] = first, last  # a line of the spectrum lies in the rest
    middle = 0.5 * (body[3] + body[4])
    body[0] = sums[0]
    body[1] = u + mean_u + slope_u * (middle - mean_t)
    body[2] = v + mean_v + slope_v * (middle - mean_t)
    body[5], body[6] = slope_u, slope_v
    body[7] = sums[4] / lit - mean_u * mean_u - slope_u * slope_u * between
    body[8] = sums[5] / lit - mean_u * mean_v - slope_u * slope_v * between
    body[9] = sums[6] / lit - mean_v * mean_v - slope_v * slope_v * between
    return True


@allocating
def _at(affine, t, u, v, out):
    """X + X_u u + X_v v at t, `affine` (3, 3, 3)."""
    a, b, c = _parabola(t)
    for j in range(3):
        out[j] = (
            a * (affine[0, 0, j] + affine[0, 1, j] * u + affine[0, 2, j] * v)
            + b * (affine[1, 0, j] + affine[1, 1, j] * u + affine[1, 2, j] * v)
            + c * (affine[2, 0, j] + affine[2, 1, j] * u + affine[2, 2, j] * v)
        )


@allocating
def _normalise(direction):
    length = math.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
    direction /= length
    return length


@allocating
def _ray(position, direction, weight, x_lo, x_hi, curve_x, curve_w, body, content, ray):
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
    a, b, c = _parabola(t)
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
        low, high = np.empty(6), np.empty(6)
        for place, out in ((first, low), (last, high)):
            _at(position, place, u + body[5] * (place - t), v + body[6] * (place - t), out[:3])
            _at(direction, place, u + body[5] * (place - t), v + body[6] * (place - t), out[3:])
            _normalise(out[3:])
        ray[18:24] = (high - low) / (end - start)
    ray[24], ray[25], ray[26] = start, middle, end
    w_lo, w_mid, w_hi = _weight_at(weight, first), _weight_at(weight, t), _weight_at(weight, last)
    if end > start:
        held = 0.5 * (w_lo + w_mid) * _power(curve_x, curve_w, start, middle) + 0.5 * (w_mid + w_hi) * _power(
            curve_x, curve_w, middle, end
        )
    else:
        held = w_mid * _power(curve_x, curve_w, start, end)
    if not held > 0.0:
        return False
    ray[27], ray[28], ray[29] = w_lo * content / held, w_mid * content / held, w_hi * content / held
    ray[30] = content
    return True


@allocating
def _mixed(state):
    """SplitMix64's output function ("Mix13" of Stafford 2011)."""
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))


@allocating
def _random(key, piece, dimension):
    """Uniform in [0, 1)."""
    state = _mixed(np.uint64(key) + np.uint64(0x9E3779B97F4A7C15))
    state = _mixed(state + np.uint64(piece) + np.uint64(0x9E3779B97F4A7C15))
    state = _mixed(state + np.uint64(dimension) + np.uint64(0x9E3779B97F4A7C15))
    return float(state >> np.uint64(11)) / 9007199254740992.0


@allocating
def _divide(frame, points):
    """Cells of a lattice of about `points` over what is lit, along and across it."""
    length, width = frame[7] - frame[6], frame[9] - frame[8]
    cells = points * length * width / frame[10]
    across = max(1.0, np.rint(math.sqrt(cells * width / length)))
    return max(1.0, np.rint(cells / across)), across


@allocating
def rays(
    chosen,
    points,
    boost,
    x_lo,
    x_hi,
    position,
    direction,
    weight,
    edge_start,
    edges,
    hull_start,
    hulls,
    content,
    curve_x,
    curve_w,
    shift_u,
    shift_v,
    key,
    first,
    stride,
):
    """Rays (n, COLUMNS) of the pieces `chosen`, their pieces and their numbers on all lattices.

    Piece chosen[k] has about points[k] >= 1 lattice points and is to carry boost[k] times its `content`. Of the cells
    those of sub-lattice `first` of `stride`.
    """
    room = 1024
    found, owner, number = np.empty((room, COLUMNS)), np.empty(room, np.int64), np.empty(room, np.int64)
    count, base = 0, 0
    frame, cell = np.empty(11), np.empty(6)
    # Rows of cells are shifted against each other, so that every sub-lattice is spread over the whole.
    row_step = max(1, int(np.rint(GOLDEN * stride)))
    while stride > 1 and math.gcd(row_step, stride) != 1:
        row_step += 1
    for k in range(len(chosen)):
        i = chosen[k]
        own = edges[edge_start[i] : edge_start[i + 1]]
        if not _frame(own, hulls[hull_start[i] : hull_start[i + 1]], x_hi[i] > x_lo[i], frame):
            continue
        along_it, across_it = _divide(frame, points[k])
        length, width = (frame[7] - frame[6]) / along_it, (frame[9] - frame[8]) / across_it
        columns, rows = int(np.ceil((frame[3] - frame[2]) / length)) + 1, int(np.ceil((frame[5] - frame[4]) / width))
        u0 = frame[2] - length * ((_random(0, i, 0) + shift_u) % 1.0)
        v0 = frame[4] - width * ((_random(0, i, 1) + shift_v) % 1.0)
        cell[2], cell[3] = 0.5 * length * frame[0], 0.5 * length * frame[1]
        cell[4], cell[5] = -0.5 * width * frame[1], 0.5 * width * frame[0]
        band_content = 0.0
        steps = STEPS if x_hi[i] > x_lo[i] else 1
        for step in range(steps):
            lo = x_lo[i] + (x_hi[i] - x_lo[i]) * step / steps
            hi = x_lo[i] + (x_hi[i] - x_lo[i]) * (step + 1) / steps
            t = (step + 0.5) / steps if steps > 1 else 0.0
            band_content += _power(curve_x, curve_w, lo, hi) * _weight_at(weight[i], t)

        room = int(2.0 * (along_it + 1.0) * (across_it + 1.0) / stride) + 16
        bodies = np.empty((room, _BODY))
        polygon, scratch = np.empty((len(own) + 8, 2)), np.empty((2 * len(own) + 16, 2))
        # Lit cells that hold less than `least` are chosen by chance, in order along the lattice.
        least = content[i] / points[k] / min(across_it, 4.0)
        lit, small = 0, 0.0
        offset = int(_random(key, i, 2) * stride)
        for row in range(rows + 1):
            column = (first + offset + row * row_step) % stride
            while column <= columns:
                # Rows go on by the golden ratio: as even a lattice along every line as that of emission.
                along, across = u0 + (column + 0.5 - (row * GOLDEN) % 1.0) * length, v0 + (row + 0.5) * width
                cell[0], cell[1] = frame[0] * along - frame[1] * across, frame[1] * along + frame[0] * across
                if _cell_body(
                    own,
                    weight[i],
                    x_lo[i],
                    x_hi[i],
                    curve_x,
                    curve_w,
                    cell,
                    band_content,
                    polygon,
                    scratch,
                    bodies[lit],
                ):
                    bodies[lit, 10] = base + row * (columns + 1) + column
                    if bodies[lit, 0] < least:
                        small += bodies[lit, 0]
                    lit += 1
                    if lit == len(bodies):
                        bodies = np.concatenate((bodies, np.empty_like(bodies)))
                column += stride
        base += (rows + 1) * (columns + 1)

        # All that the small ones hold, in equal parts; where it is less than one part, a sub-lattice has it by chance.
        parts = max(1.0, np.rint(small / least))
        part = small / parts
        if stride > 1 and small < least:
            parts, part = (1.0 if _random(key, i, 3 + first) * least < small else 0.0), least
        running, at = 0.0, _random(key, i, 3 + stride + first)
        for body in range(lit):
            carried = bodies[body, 0]
            if carried < least:
                before = running
                running += carried / small * parts
                carried = part * (math.floor(running + at) - math.floor(before + at)) if parts > 0.0 else 0.0
            if carried <= 0.0:
                continue
            if count == len(found):
                more = np.empty((2 * count, COLUMNS))
                more[:count] = found
                found = more
                owner = np.concatenate((owner, np.empty(count, np.int64)))
                number = np.concatenate((number, np.empty(count, np.int64)))
            if _ray(
                position[i],
                direction[i],
                weight[i],
                x_lo[i],
                x_hi[i],
                curve_x,
                curve_w,
                bodies[body],
                carried * boost[k],
                found[count],
            ):
                owner[count], number[count] = i, int(bodies[body, 10])
                count += 1
    return found[:count], owner[:count], number[:count]
