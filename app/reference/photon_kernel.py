"""The reference's light tracer, compiled: one photon, one wavelength, one path, one pixel.

Reflection or refraction is drawn with Fresnel's probability, absorption is Beer's law on the
weight, and nothing is cut off but what exceeds the depth. At a diffuse surface the photon's flux
goes to the one pixel that sees the point. Numbers come from a scrambled Sobol sequence (place,
wavelength, place on the light, then one a Fresnel choice) and, when its dimensions are used up, from a hash.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .photon_emit import emit, search
from .photon_intersect import STACK_SIZE, blocked, compiled, nearest
from .photon_scene import BLACK, DIFFUSE, MIRROR

DIMENSIONS = 10
EMITTED, DEPOSITED, DIRECT, ABSORBED, ESCAPED, LOST_DEPTH, LOST_NUMERIC = range(7)
COUNTED = 7
"""Places in a tally (`photon_run.TALLY` and what follows)."""

_TABLE_SCALE = 20.0
_TABLE_LAST = 8000
_AIR = -1


class Sequence(NamedTuple):
    """One random scrambling of the Sobol sequence."""

    directions: np.ndarray
    """uint32 (DIMENSIONS, 32): direction numbers."""
    shift: np.ndarray
    """uint32 (DIMENSIONS,): digital shift."""
    key: np.uint64
    """Of the hash that follows."""


# Primitive polynomials (degree, coefficients) and initial numbers of dimensions 2 to 10: Joe and Kuo 2008.
_JOE_KUO = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
)


def sobol_directions() -> np.ndarray:
    """Direction numbers, uint32 (DIMENSIONS, 32), highest bit first."""
    rows = [[1 << (31 - i) for i in range(32)]]
    for degree, coefficients, initial in _JOE_KUO:
        v = [m << (31 - i) for i, m in enumerate(initial)]
        for i in range(degree, 32):
            value = v[i - degree] ^ (v[i - degree] >> degree)
            for k in range(1, degree):
                if (coefficients >> (degree - 1 - k)) & 1:
                    value ^= v[i - k]
            v.append(value)
        rows.append(v)
    return np.array(rows, np.uint32)


def scrambled(seed: int, *stream: int) -> Sequence:
    """A random linear scrambling with a digital shift (Matoušek 1998): every point uniform, the net kept."""
    rng = np.random.default_rng([seed, *stream])
    plain = sobol_directions()
    bits = ((plain[:, :, None] >> np.arange(31, -1, -1, dtype=np.uint32)) & 1).astype(np.int64)
    mixed = np.empty_like(bits)
    for dimension in range(DIMENSIONS):
        lower = np.tril(rng.integers(0, 2, (32, 32)), -1) + np.eye(32, dtype=np.int64)
        mixed[dimension] = bits[dimension] @ lower.T & 1
    weights = np.uint64(1) << np.arange(31, -1, -1, dtype=np.uint64)
    directions = (mixed.astype(np.uint64) * weights).sum(axis=2).astype(np.uint32)
    shift = rng.integers(0, 2**32, DIMENSIONS, dtype=np.uint32)
    return Sequence(directions, shift, np.uint64(rng.integers(0, 2**64, dtype=np.uint64)))


@compiled
def _mixed(value):
    """A 64-bit hash (splitmix64, Steele et al. 2014)."""
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@compiled
def _unit(word):
    return (float(word) + 0.5) * 2.0**-32


@compiled
def _table(rows, row, nm):
    at = (nm - 380.0) * _TABLE_SCALE
    cell = min(int(at), _TABLE_LAST - 1)
    share = at - cell
    return rows[row, cell] + share * (rows[row, cell + 1] - rows[row, cell])


@compiled
def _medium(scene, mask, alone):
    """The object whose substance fills a place: the highest rank in the mask, or the solid that stands alone."""
    for rank in range(scene.stack.shape[0] - 1, -1, -1):
        if (mask >> np.uint64(rank)) & np.uint64(1):
            return scene.stack[rank]
    return alone


@compiled
def _refractive_index(scene, thing, nm):
    return 1.0 if thing == _AIR else _table(scene.index, scene.medium[thing], nm)


@compiled
def fresnel(cosine_i, eta):
    """(unpolarised reflectance, cosine of the transmitted angle) with eta = n_i/n_t; (1, 0) is total reflection."""
    cosine2 = (1.0 - eta) * (1.0 + eta) + eta * eta * cosine_i * cosine_i
    if cosine2 <= 0.0:
        return 1.0, 0.0
    cosine_t = math.sqrt(cosine2)
    s = (eta * cosine_i - cosine_t) / (eta * cosine_i + cosine_t)
    p = (cosine_i - eta * cosine_t) / (cosine_i + eta * cosine_t)
    return 0.5 * (s * s + p * p), cosine_t


@compiled
def project(camera, px, py, pz):
    """(row, column, film area per area across the way to the camera, toward the camera (3), its distance); row −1: not
    seen.

    The factor is 1/(d² cos³) for a pinhole and 1 for an orthographic camera; on a film at distance one.
    """
    rx, ry, rz = px - camera.position[0], py - camera.position[1], pz - camera.position[2]
    depth = rx * camera.forward[0] + ry * camera.forward[1] + rz * camera.forward[2]
    if depth <= 0.0:
        return -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0
    x = rx * camera.right[0] + ry * camera.right[1] + rz * camera.right[2]
    y = rx * camera.up[0] + ry * camera.up[1] + rz * camera.up[2]
    if camera.orthographic:
        factor, distance = 1.0, depth
        tx, ty, tz = -camera.forward[0], -camera.forward[1], -camera.forward[2]
    else:
        x, y = x / depth, y / depth
        distance = math.sqrt(rx * rx + ry * ry + rz * rz)
        cosine = depth / distance
        factor = 1.0 / (distance * distance * cosine * cosine * cosine)
        tx, ty, tz = -rx / distance, -ry / distance, -rz / distance
    column = math.floor(0.5 * (1.0 + x / camera.half_width) * camera.width)
    row = math.floor(0.5 * (1.0 - y / camera.half_height) * camera.height)
    if column < 0 or column >= camera.width or row < 0 or row >= camera.height:
        return -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0
    return int(row), int(column), factor, tx, ty, tz, distance


@compiled
def _deposit(scene, camera, colour, atom, triangle, px, py, pz, from_front, watt, picture, stack):
    """Add a landed photon to its pixel; returns (row, column, luminance added), row −1 where the camera does not see
    it."""
    row, column, factor, tx, ty, tz, distance = project(camera, px, py, pz)
    if row < 0:
        return -1, -1, 0.0
    nx, ny, nz = scene.normals[triangle, 0], scene.normals[triangle, 1], scene.normals[triangle, 2]
    cosine = tx * nx + ty * ny + tz * nz
    # An opaque sheet: light on one side is not seen from the other.
    if (cosine > 0.0) != from_front or cosine == 0.0:
        return -1, -1, 0.0
    if blocked(scene, px, py, pz, tx, ty, tz, distance, triangle, stack):
        return -1, -1, 0.0
    pixel_area = 4.0 * camera.half_width * camera.half_height / (camera.width * camera.height)
    radiance = watt * abs(cosine) * factor / (math.pi * pixel_area)
    thing = scene.owner[triangle]
    rgb = colour.rgb[scene.reflectance_class[thing], atom]
    r = radiance * rgb[0] * scene.reflectance[thing, 0]
    g = radiance * rgb[1] * scene.reflectance[thing, 1]
    b = radiance * rgb[2] * scene.reflectance[thing, 2]
    picture[row, column, 0] += r
    picture[row, column, 1] += g
    picture[row, column, 2] += b
    return row, column, 0.2126 * r + 0.7152 * g + 0.0722 * b


@compiled
def trace(
    scene, camera, domain, colour, sequence, first, count, share, max_depth, picture, tally, pixel_weight, importance
):
    """Trace photons [first, first + count) of one domain.

    `share`: factor on every weight. `picture` (H, W, 3) and `tally` (9,) are added to. With a non-empty
    `importance` (GRID, GRID), squares of what each cell's photons add, times `pixel_weight` (H, W), are added to it.
    """
    stack = np.empty(STACK_SIZE, np.int64)
    stack_distance = np.empty(STACK_SIZE)
    state = sequence.shift.copy()
    start = first ^ (first >> 1)
    for d in range(DIMENSIONS):
        for k in range(32):
            if (start >> k) & 1:
                state[d] ^= sequence.directions[d, k]
    pilot = importance.shape[0] > 0
    for i in range(first, first + count):
        if i > first:  # Gray code: one bit of the number changes from point to point
            k = 0
            while not (i >> k) & 1:
                k += 1
            for d in range(DIMENSIONS):
                state[d] ^= sequence.directions[d, k]
        dimension = 3
        c, e = 0.5, 0.5
        if domain.extended:
            c, e = _unit(state[3]), _unit(state[4])
            dimension = 5
        px, py, pz, dx, dy, dz, watt, row, column = emit(domain, _unit(state[0]), _unit(state[1]), c, e)
        if watt <= 0.0:
            continue
        u = _unit(state[2])
        atom = search(colour.cdf, u)
        nm = colour.start_nm[atom] + colour.width_nm[atom] * (u - colour.cdf[atom]) / (
            colour.cdf[atom + 1] - colour.cdf[atom]
        )
        watt *= colour.watt[atom] * share
        tally[EMITTED] += watt
        tally[COUNTED] += 1.0
        noise = _mixed(sequence.key ^ _mixed(np.uint64(i)))

        last, last_object, within, mask, alone, depth = -1, -1, False, np.uint64(0), _AIR, 0
        while True:
            t, triangle, u, v = nearest(
                scene, px, py, pz, dx, dy, dz, last, last_object, within, mask, stack, stack_distance
            )
            if triangle < 0:
                tally[ESCAPED if mask == np.uint64(0) and alone == _AIR else LOST_NUMERIC] += watt
                break
            filling = _medium(scene, mask, alone)
            if filling != _AIR and scene.weight[filling] >= 0:
                kept = math.exp(-_table(scene.weights, scene.weight[filling], nm) * t)
                tally[ABSORBED] += watt * (1.0 - kept)
                watt *= kept
                if watt <= 0.0:
                    break
            px += t * dx
            py += t * dy
            pz += t * dz
            gx, gy, gz = scene.normals[triangle, 0], scene.normals[triangle, 1], scene.normals[triangle, 2]
            cosine_g = -(dx * gx + dy * gy + dz * gz)
            entering = cosine_g > 0.0
            thing = scene.owner[triangle]
            kind = scene.kind[thing]
            if kind == DIFFUSE:
                if depth == 0:  # no caustic
                    tally[DIRECT] += watt
                    break
                tally[DEPOSITED] += watt
                y, x, added = _deposit(
                    scene, camera, colour, atom, triangle, px, py, pz, entering, watt, picture, stack
                )
                if y >= 0:
                    tally[COUNTED + 1] += 1.0
                    if pilot:
                        importance[row, column] += added * added * pixel_weight[y, x]
                break
            if kind == BLACK:
                tally[ABSORBED] += watt
                break
            if depth >= max_depth:
                tally[LOST_DEPTH] += watt
                break

            before, after, mask_after, alone_after, changes = _AIR, _AIR, mask, alone, True
            if kind != MIRROR:
                bit = scene.bit[thing]
                if bit >= 0:
                    own = np.uint64(1) << np.uint64(bit)
                    mask_before = mask & ~own if entering else mask | own
                    mask_after = mask | own if entering else mask & ~own
                    before, after = _medium(scene, mask_before, _AIR), _medium(scene, mask_after, _AIR)
                    changes = before != after
                else:
                    before = _AIR if entering else thing
                    after = thing if entering else _AIR
                    alone_after = after
            last, last_object = triangle, thing
            if not changes:  # another solid's substance fills both sides
                mask, within = mask_after, entering
                continue

            if not entering:
                gx, gy, gz, cosine_g = -gx, -gy, -gz, -cosine_g
            nx, ny, nz, cosine = gx, gy, gz, cosine_g
            if scene.smooth[triangle] >= 0:
                m = scene.corner_normals[scene.smooth[triangle]]
                w = 1.0 - u - v
                nx = w * m[0] + u * m[3] + v * m[6]
                ny = w * m[1] + u * m[4] + v * m[7]
                nz = w * m[2] + u * m[5] + v * m[8]
                length = math.sqrt(nx * nx + ny * ny + nz * nz)
                length = length if entering else -length
                if length != 0.0:
                    nx, ny, nz = nx / length, ny / length, nz / length
                cosine = -(dx * nx + dy * ny + dz * nz)
                # An interpolated normal that sees the photon from behind gives way to the facet's.
                if not (cosine > 1e-6 and length != 0.0):
                    nx, ny, nz, cosine = gx, gy, gz, cosine_g
            depth += 1
            if kind == MIRROR:
                kept = _table(scene.weights, scene.weight[thing], nm)
                tally[ABSORBED] += watt * (1.0 - kept)
                watt *= kept
                if watt <= 0.0:
                    break
                reflects, cosine_t, eta = True, 0.0, 1.0
            else:
                eta = _refractive_index(scene, before, nm) / _refractive_index(scene, after, nm)
                reflectance, cosine_t = fresnel(cosine, eta)
                reflects = True
                if reflectance < 1.0:
                    if dimension < DIMENSIONS:
                        draw = _unit(state[dimension])
                        dimension += 1
                    else:
                        noise += np.uint64(0x9E3779B97F4A7C15)
                        draw = float(_mixed(noise) >> np.uint64(11)) * 2.0**-53
                    reflects = draw < reflectance
            if reflects:
                rx, ry, rz = dx + 2.0 * cosine * nx, dy + 2.0 * cosine * ny, dz + 2.0 * cosine * nz
                if rx * gx + ry * gy + rz * gz <= 0.0:  # into the facet
                    rx, ry, rz = dx + 2.0 * cosine_g * gx, dy + 2.0 * cosine_g * gy, dz + 2.0 * cosine_g * gz
                within = not entering
            else:
                k = eta * cosine - cosine_t
                rx, ry, rz = eta * dx + k * nx, eta * dy + k * ny, eta * dz + k * nz
                if rx * gx + ry * gy + rz * gz >= 0.0:  # back out of the facet
                    cosine2 = (1.0 - eta) * (1.0 + eta) + eta * eta * cosine_g * cosine_g
                    k = eta * cosine_g - math.sqrt(max(cosine2, 1e-12))
                    rx, ry, rz = eta * dx + k * gx, eta * dy + k * gy, eta * dz + k * gz
                within, mask, alone = entering, mask_after, alone_after
            length = math.sqrt(rx * rx + ry * ry + rz * rz)
            dx, dy, dz = rx / length, ry / length, rz / length
