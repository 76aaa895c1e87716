"""The compiled half of `piece_lattice`: a lattice over each piece of a beam, cell by cell."""

from __future__ import annotations

import math

import numpy as np

from .clipping import clip
from .compiling import jit, part
from .piece_cells import cell_body, ray_of
from .piece_measure import MOMENTS_OF_BAND, STEPS, TANGENTS, copy, keep_lit, moments_of, power_between, weight_at

GOLDEN = 0.6180339887498949


@part
def _frame(own, hull, moves, polygons, cut, scratch, out):
    """Principal axis (cosine, sine) of what is lit at some time; low and high of the hull, and of that, along it and
    across it; area of the convex hull of that."""
    times = MOMENTS_OF_BAND if moves else 1
    counts, moments, total = scratch.counts, scratch.moments, scratch.total
    total[:] = 0.0
    for k in range(times):
        t = k / (times - 1) if times > 1 else 0.0
        counts[k] = keep_lit(own, t, 0.0, 0.0, polygons[k], copy(hull, polygons[k]), cut)
        moments_of(polygons[k], counts[k], moments)
        for m in range(6):
            total[m] += moments[m]
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
    if not moves or not _moves(own):
        out[10] = total[0] / times
        return True
    # About the hull as many tangents, in proportion to its box.
    round_it, count = scratch.hull, 4
    for corner in range(4):
        round_it[corner, 0] = 1.0 if corner in (1, 2) else -1.0
        round_it[corner, 1] = 1.0 if corner >= 2 else -1.0
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
        count = clip(round_it, count, scratch.hull_cut, -a_u, -a_v, farthest)
    moments_of(round_it, count, moments)
    out[10] = 0.25 * moments[0] * length * width
    return out[10] > 0.0


@part
def _moves(edges):
    """Whether an edge moves over the band."""
    for e in range(len(edges)):
        for j in range(3):
            if edges[e, j] != edges[e, 3 + j]:
                return True
    return False


@part
def _widen(span, value):
    span[0], span[1] = min(span[0], value), max(span[1], value)


@part
def _mixed(state):
    """SplitMix64's output function ("Mix13" of Stafford 2011)."""
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))


@part
def _random(key, piece, dimension):
    """Uniform in [0, 1)."""
    state = _mixed(np.uint64(key) + np.uint64(0x9E3779B97F4A7C15))
    state = _mixed(state + np.uint64(piece) + np.uint64(0x9E3779B97F4A7C15))
    state = _mixed(state + np.uint64(dimension) + np.uint64(0x9E3779B97F4A7C15))
    return float(state >> np.uint64(11)) / 9007199254740992.0


@part
def _divide(frame, points):
    """Cells of a lattice of about `points` over what is lit, along and across it."""
    length, width = frame[7] - frame[6], frame[9] - frame[8]
    cells = points * length * width / frame[10]
    across = max(1.0, np.rint(math.sqrt(cells * width / length)))
    return max(1.0, np.rint(cells / across)), across


@jit
def rays(
    pieces,
    chosen,
    points,
    boost,
    edges,
    hulls,
    curve_x,
    curve_w,
    shift_u,
    shift_v,
    key,
    polygons,
    cut,
    scratches,
    bodies,
    found,
    done,
):
    """Rays of the pieces `chosen`, from the `done[0]`th on, into `found` (n, COLUMNS) from its row `done[1]` on; ends
    where that is full, or where `bodies` are fewer than the cells of a piece: `done[2]` is 1 then.

    Piece chosen[k] has about points[k] >= 1 lattice points and is to carry boost[k] times its `content`.
    """
    scratch = scratches[0]
    frame, cell, polygon = scratch.frame, scratch.cell, polygons[0]
    for k in range(done[0], len(chosen)):
        done[0], i = k, chosen[k]
        piece = pieces[i]
        own, hull = edges[piece.edges[0] : piece.edges[1]], hulls[piece.hull[0] : piece.hull[1]]
        x_lo, x_hi, weight = piece.x_lo, piece.x_hi, piece.weight
        if not _frame(own, hull, x_hi > x_lo, polygons, cut, scratch, frame):
            continue
        along_it, across_it = _divide(frame, points[k])
        length, width = (frame[7] - frame[6]) / along_it, (frame[9] - frame[8]) / across_it
        columns, rows = int(np.ceil((frame[3] - frame[2]) / length)) + 1, int(np.ceil((frame[5] - frame[4]) / width))
        u0 = frame[2] - length * ((_random(0, piece.key, 0) + shift_u) % 1.0)
        v0 = frame[4] - width * ((_random(0, piece.key, 1) + shift_v) % 1.0)
        cell[2], cell[3] = 0.5 * length * frame[0], 0.5 * length * frame[1]
        cell[4], cell[5] = -0.5 * width * frame[1], 0.5 * width * frame[0]
        band_content = 0.0
        steps = STEPS if x_hi > x_lo else 1
        for step in range(steps):
            lo = x_lo + (x_hi - x_lo) * step / steps
            hi = x_lo + (x_hi - x_lo) * (step + 1) / steps
            t = (step + 0.5) / steps if steps > 1 else 0.0
            band_content += power_between(curve_x, curve_w, lo, hi) * weight_at(weight, t)

        # Lit cells that hold less than `least` are chosen by chance, in order along the lattice.
        least = piece.content / points[k] / min(across_it, 4.0)
        lit, small = 0, 0.0
        for row in range(rows + 1):
            for column in range(columns + 1):
                if lit == len(bodies):
                    done[2] = 1
                    return
                # Rows go on by the golden ratio: as even a lattice along every line as that of emission.
                along, across = u0 + (column + 0.5 - (row * GOLDEN) % 1.0) * length, v0 + (row + 0.5) * width
                cell[0], cell[1] = frame[0] * along - frame[1] * across, frame[1] * along + frame[0] * across
                if cell_body(
                    own,
                    weight,
                    x_lo,
                    x_hi,
                    curve_x,
                    curve_w,
                    cell,
                    band_content,
                    polygon,
                    cut,
                    scratch,
                    bodies[lit],
                ):
                    bodies[lit, 10] = row * (columns + 1) + column
                    if bodies[lit, 0] < least:
                        small += bodies[lit, 0]
                    lit += 1
        count = done[1]
        if count + lit > len(found):
            return
        # All that the small ones hold, in equal parts.
        parts = max(1.0, np.rint(small / least))
        part = small / parts
        running, at = 0.0, _random(key, piece.key, 4)
        for body in range(lit):
            carried = bodies[body, 0]
            if carried < least:
                before = running
                running += carried / small * parts
                carried = part * (math.floor(running + at) - math.floor(before + at))
            if carried <= 0.0:
                continue
            if ray_of(
                piece.position,
                piece.direction,
                weight,
                x_lo,
                x_hi,
                curve_x,
                curve_w,
                bodies[body],
                carried * boost[k],
                scratch,
                found[count],
            ):
                found[count, 31], found[count, 32] = i, bodies[body, 10]
                count += 1
        done[1] = count
    done[0] = len(chosen)
