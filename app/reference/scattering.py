"""What happens to a path at a surface and between surfaces, compiled: the one set of rules of all references.

The light tracer (`photon_kernel`), the camera tracer (`camera_kernel`) and the caustic's (`caustic_kernel`) call these
functions: Fresnel's exact reflectance decides by chance, nested solids follow their rank, an interpolated normal that
would send a ray through its own facet gives way to the facet's, Beer's law thins what passes. Rough glass has
microfacets drawn by their area (Walter et al. 2007, eq. 35, 36, 41), whether the ray sees them or not: another way
than the shaders', with the same mean; light that microfacets throw at each other goes both ways as the rest does
(Turquin 2019).
"""

from __future__ import annotations

import math

import numpy as np

from .compiling import compiled, inlined
from .curved_surfaces import turned_normal
from .photon_intersect import normal_at
from .photon_scene import GRATING, MIRROR, SHEET
from .polarised import across, amplitudes, senkrecht, share_of, turn_fields
from .rough_albedo import masking, sent_on
from .sampling import mixed

AIR = -1
_TABLE_SCALE = 20.0
_TABLE_LAST = 8000


@compiled
def table(rows, row, nm):
    """A row on `TABLE_NM` at a wavelength, linear between its values."""
    at = (nm - 380.0) * _TABLE_SCALE
    cell = min(int(at), _TABLE_LAST - 1)
    share = at - cell
    return rows[row, cell] + share * (rows[row, cell + 1] - rows[row, cell])


@compiled
def medium(scene, mask, alone):
    """The object whose substance fills a place: the highest rank in the mask, or the solid that stands alone."""
    for rank in range(scene.stack.shape[0] - 1, -1, -1):
        if (mask >> np.uint64(rank)) & np.uint64(1):
            return scene.stack[rank]
    return alone


@compiled
def _refractive_index(scene, thing, nm):
    return 1.0 if thing == AIR else table(scene.refractive_index, scene.medium[thing], nm)


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


@inlined
def transmitted(scene, mask, alone, nm, distance):
    """What Beer's law leaves after `distance` in the medium a ray is in."""
    filling = medium(scene, mask, alone)
    if filling == AIR or scene.weight[filling] < 0:
        return 1.0
    return math.exp(-table(scene.weights, scene.weight[filling], nm) * distance)


@inlined
def side_met(scene, triangle, place, dx, dy, dz):
    """0 where a ray comes to a surface's front (against its normal) at a place, else 1."""
    nx, ny, nz = normal_at(scene, triangle, place[0], place[1], place[2])
    return 1 if dx * nx + dy * ny + dz * nz > 0.0 else 0


@inlined
def _shading_normal(scene, triangle, place, u, v, dx, dy, dz, gx, gy, gz, entering):
    """Unit normal against the ray: interpolated where that faces the ray, else the surface's (gx, gy, gz)."""
    row = scene.smooth[triangle]
    curved = scene.curved[triangle]
    if curved >= 0:
        nx, ny, nz = turned_normal(scene.forms[curved], place[0], place[1], place[2])
    elif row < 0:
        return gx, gy, gz
    else:
        m = scene.corner_normals[row]
        w = 1.0 - u - v
        nx = w * m[0] + u * m[3] + v * m[6]
        ny = w * m[1] + u * m[4] + v * m[7]
        nz = w * m[2] + u * m[5] + v * m[8]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return gx, gy, gz
    length = length if entering else -length
    nx, ny, nz = nx / length, ny / length, nz / length
    if not -(dx * nx + dy * ny + dz * nz) > 1e-6:
        return gx, gy, gz
    return nx, ny, nz


@inlined
def _diffracted(dx, dy, dz, nx, ny, nz, lines, step, reflects):
    """(direction, whether it is real) of an order: `step` = m λ / (Λ n) across `lines`, along lines × n, is added
    to the direction's part in the surface; (nx, ny, nz) is the outward normal."""
    ax, ay, az = lines[1] * nz - lines[2] * ny, lines[2] * nx - lines[0] * nz, lines[0] * ny - lines[1] * nx
    length = math.sqrt(ax * ax + ay * ay + az * az)
    theta = dx * nx + dy * ny + dz * nz
    tx = dx - theta * nx + step * ax / length
    ty = dy - theta * ny + step * ay / length
    tz = dz - theta * nz + step * az / length
    cosine2 = 1.0 - (tx * tx + ty * ty + tz * tz)
    cosine = math.sqrt(max(cosine2, 0.0))
    if (theta < 0.0) != reflects:
        cosine = -cosine
    return tx + cosine * nx, ty + cosine * ny, tz + cosine * nz, cosine2 > 0.0


@compiled
def _diffract(scene, triangle, place, u, v, dx, dy, dz, mask, alone, nm, draw, field):
    """`scatter` at a grating: `draw` chooses an order as they are strong; what they leave, and an order that is
    evanescent, is absorbed. Both polarisations fare alike."""
    thing = scene.owner[triangle]
    gx, gy, gz = normal_at(scene, triangle, place[0], place[1], place[2])
    entering = dx * gx + dy * gy + dz * gz < 0.0
    side = 1.0 if entering else -1.0
    nx, ny, nz = _shading_normal(scene, triangle, place, u, v, dx, dy, dz, side * gx, side * gy, side * gz, entering)
    first, end = scene.first_order[thing], scene.first_order[thing + 1]
    efficiency = 0.0
    for row in range(first, end):
        efficiency += scene.orders[row, 1]
    chosen, below = first, 0.0
    for row in range(first, end):
        if below <= draw * efficiency:
            chosen = row
        below += scene.orders[row, 1]
    reflects = scene.orders[chosen, 2] > 0.0
    step = scene.orders[chosen, 0] * nm * 1e-3 / _refractive_index(scene, medium(scene, mask, alone), nm)
    rx, ry, rz, real = _diffracted(dx, dy, dz, side * nx, side * ny, side * nz, scene.lines[thing], step, reflects)
    wrong = ((rx * gx + ry * gy + rz * gz) * side > 0.0) != reflects
    if wrong:
        rx, ry, rz, real = _diffracted(dx, dy, dz, gx, gy, gz, scene.lines[thing], step, reflects)
    inner = entering != reflects
    if scene.polarised and real:
        sx, sy, sz = senkrecht(dx, dy, dz, rx, ry, rz)
        turn_fields(field, dx, dy, dz, rx, ry, rz, sx, sy, sz, complex(-1.0 if reflects else 1.0), complex(1.0))
    return rx, ry, rz, mask, alone, inner, True, efficiency if real else 0.0, True


_TILT, _TURN = np.uint64(0xA24BAED4963EE407), np.uint64(0x9FB21C651E98DF25)
"""Set the numbers for a microfacet apart from those of Fresnel choices."""


@compiled
def microfacet(nx, ny, nz, width, a, b):
    """Normal of a microfacet of GGX about (nx, ny, nz), by two numbers in [0, 1); density D(m) |m · n|."""
    slope = width * math.sqrt(a / (1.0 - a))
    cosine = 1.0 / math.sqrt(1.0 + slope * slope)
    sine = slope * cosine
    sx, sy, sz = across(nx, ny, nz)
    tx, ty, tz = ny * sz - nz * sy, nz * sx - nx * sz, nx * sy - ny * sx
    c, s = sine * math.cos(2.0 * math.pi * b), sine * math.sin(2.0 * math.pi * b)
    return c * sx + s * tx + cosine * nx, c * sy + s * ty + cosine * ny, c * sz + s * tz + cosine * nz


@compiled
def _both_faces(a_s, a_p):
    """(r_s, r_p, t_s, t_p) of a thin sheet, of whose faces one alone reflects `a_s` and `a_p`: the powers of all that
    is reflected between both add up, and phases are those of the first."""
    s, p = abs(a_s) ** 2, abs(a_p) ** 2
    r_s, r_p = 2.0 * s / (1.0 + s), 2.0 * p / (1.0 + p)
    one_s, one_p = math.copysign(1.0, a_s.real), math.copysign(1.0, a_p.real)
    return (
        complex(one_s * math.sqrt(r_s)),
        complex(one_p * math.sqrt(r_p)),
        complex(math.sqrt(1.0 - r_s)),
        complex(math.sqrt(1.0 - r_p)),
    )


@inlined
def scatter(scene, triangle, place, u, v, dx, dy, dz, mask, alone, nm, draw, noise, event, field):
    """One event at a place (3) of glass or a mirror: (direction (3), mask, alone, on the object's inner side, is an
    event, share kept, whether `draw` mattered).

    `draw` in [0, 1) decides by Fresnel's reflectance, unless all is reflected. "Is an event" is false where the same
    substance lies on both sides; a mirror keeps its reflectance, glass what its surface lets through, and rough glass
    also the weight of a microfacet that words `event` of the hash `noise` draw (its mean is 1). In a polarised scene
    `field` complex (2, 3), the two of `polarised`, turns with the ray.
    """
    if scene.kind[scene.owner[triangle]] == GRATING:
        return _diffract(scene, triangle, place, u, v, dx, dy, dz, mask, alone, nm, draw, field)
    gx, gy, gz = normal_at(scene, triangle, place[0], place[1], place[2])
    cosine_g = -(dx * gx + dy * gy + dz * gz)
    entering = cosine_g > 0.0
    thing = scene.owner[triangle]
    mirror, sheet = scene.kind[thing] == MIRROR, scene.kind[thing] == SHEET
    before, after, mask_after, alone_after = AIR, AIR, mask, alone
    if sheet:
        before, after = medium(scene, mask, alone), thing
    elif not mirror:
        bit = scene.bit[thing]
        if bit >= 0:
            own = np.uint64(1) << np.uint64(bit)
            mask_before = mask & ~own if entering else mask | own
            mask_after = mask | own if entering else mask & ~own
            before, after = medium(scene, mask_before, AIR), medium(scene, mask_after, AIR)
            if before == after:
                return dx, dy, dz, mask_after, alone, entering, False, 1.0, False
        else:
            before = AIR if entering else thing
            after = thing if entering else AIR
            alone_after = after
    if not entering:
        gx, gy, gz, cosine_g = -gx, -gy, -gz, -cosine_g
    nx, ny, nz = _shading_normal(scene, triangle, place, u, v, dx, dy, dz, gx, gy, gz, entering)
    cosine = -(dx * nx + dy * ny + dz * nz)
    width, wx, wy, wz, facing = scene.microfacet_width[thing], nx, ny, nz, cosine
    if width > 0.0:
        word = noise + np.uint64(event + 1) * np.uint64(0x9E3779B97F4A7C15)
        tilt = float(mixed(word ^ _TILT) >> np.uint64(11)) * 2.0**-53
        turn = float(mixed(word ^ _TURN) >> np.uint64(11)) * 2.0**-53
        nx, ny, nz = microfacet(nx, ny, nz, width, tilt, turn)
        cosine = -(dx * nx + dy * ny + dz * nz)
        if cosine <= 0.0:  # seen from behind
            return dx, dy, dz, mask, alone, not entering, True, 0.0, False
    kept, reflects, drawn, cosine_t, eta_it = 1.0, True, False, 0.0, 1.0
    sx, sy, sz, a_s, a_p = 0.0, 0.0, 0.0, complex(-1.0), complex(1.0)
    if scene.polarised:
        sx, sy, sz = senkrecht(dx, dy, dz, nx, ny, nz)
    if mirror:
        kept = table(scene.weights, scene.weight[thing], nm)
    else:
        eta_it = _refractive_index(scene, before, nm) / _refractive_index(scene, after, nm)
        reflectance, cosine_t = fresnel(cosine, eta_it)
        if scene.polarised:
            a_s, a_p, t_s, t_p = amplitudes(cosine, eta_it)
            if reflectance < 1.0:
                reflectance = share_of(field, dx, dy, dz, sx, sy, sz, a_s, a_p)
            if sheet:
                a_s, a_p, t_s, t_p = _both_faces(a_s, a_p)
                reflectance = share_of(field, dx, dy, dz, sx, sy, sz, a_s, a_p)
            if draw >= reflectance:
                a_s, a_p = t_s, t_p
        elif sheet:
            reflectance = 2.0 * reflectance / (1.0 + reflectance)
        reflects, drawn = draw < reflectance, reflectance < 1.0
        if sheet:
            eta_it, cosine_t = 1.0, cosine
        if not reflects and scene.filter[thing] >= 0:
            kept = table(scene.weights, scene.filter[thing], nm)
    if reflects:
        rx, ry, rz = dx + 2.0 * cosine * nx, dy + 2.0 * cosine * ny, dz + 2.0 * cosine * nz
        if width <= 0.0 and rx * gx + ry * gy + rz * gz <= 0.0:  # into the facet
            rx, ry, rz = dx + 2.0 * cosine_g * gx, dy + 2.0 * cosine_g * gy, dz + 2.0 * cosine_g * gz
        mask_after, alone_after, inner = mask, alone, not entering
    else:
        k = eta_it * cosine - cosine_t
        rx, ry, rz = eta_it * dx + k * nx, eta_it * dy + k * ny, eta_it * dz + k * nz
        if width <= 0.0 and rx * gx + ry * gy + rz * gz >= 0.0:  # back out of the facet
            cosine2 = (1.0 - eta_it) * (1.0 + eta_it) + eta_it * eta_it * cosine_g * cosine_g
            k = eta_it * cosine_g - math.sqrt(max(cosine2, 1e-12))
            rx, ry, rz = eta_it * dx + k * gx, eta_it * dy + k * gy, eta_it * dz + k * gz
        inner = entering
    length = math.sqrt(rx * rx + ry * ry + rz * rz)
    rx, ry, rz = rx / length, ry / length, rz / length
    if width > 0.0:
        side = 1.0 if reflects else -1.0
        leaving = side * (rx * wx + ry * wy + rz * wz)
        upright = nx * wx + ny * wy + nz * wz
        kept *= cosine * masking(facing, width) * masking(leaving, width) / (facing * upright)
        kept /= sent_on(scene.albedo, thing, facing, eta_it)
        if side * (rx * gx + ry * gy + rz * gz) <= 0.0:
            kept = 0.0
    if scene.polarised and kept > 0.0:
        turn_fields(field, dx, dy, dz, rx, ry, rz, sx, sy, sz, a_s, a_p)
    return rx, ry, rz, mask_after, alone_after, inner, True, kept, drawn
