"""One photon of a domain (`photon_emission`), compiled: four numbers become a ray and its weight."""

from __future__ import annotations

import math

from .compiling import compiled, inlined
from .sampling import unit

GRID = 64
"""Cells a side of a domain's density."""
PLANE, DIRECTIONS, AREA = range(3)
"""Kinds of domain."""


@compiled
def search(cdf, value):
    """The cell of an ascending distribution that holds `value` of [0, 1)."""
    low, high = 0, cdf.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if cdf[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@compiled
def concentric_disc(a, b):
    """Uniform point of the unit disc, neighbours kept together (Shirley and Chiu 1997)."""
    x, y = 2.0 * a - 1.0, 2.0 * b - 1.0
    if x == 0.0 and y == 0.0:
        return 0.0, 0.0
    if abs(x) > abs(y):
        angle = 0.25 * math.pi * y / x
        return x * math.cos(angle), x * math.sin(angle)
    angle = 0.5 * math.pi - 0.25 * math.pi * x / y
    return y * math.cos(angle), y * math.sin(angle)


@compiled
def spot_falloff(cone, angle):
    """A spot's edge: 1 inside, 0 outside, a smoothstep of the angle between (a hard edge where there is none)."""
    if angle > cone[1]:
        return 0.0
    if angle <= cone[0]:
        return 1.0
    t = (cone[1] - angle) / (cone[1] - cone[0])
    return t * t * (3.0 - 2.0 * t)


@compiled
def _between(table, first, count, angle):
    """Stretch of an ascending list of `count` angles at `first` that holds `angle`, and how far along it (0 to 1)."""
    k = 0
    while k < count - 2 and table[first + k + 1] <= angle:
        k += 1
    along = (angle - table[first + k]) / (table[first + k + 1] - table[first + k])
    return k, min(max(along, 0.0), 1.0)


@compiled
def _shine(table, start, vertical, horizontal):
    """Share of its peak that a lamp's table at `start` (`ies_file.Profile.packed`) has at these angles, rad (any turn).

    Bilinear: the weighted sum of the four values round the angles."""
    verticals, horizontals = int(table[start]), int(table[start + 1])
    turn = horizontal - 2.0 * math.pi * math.floor(horizontal / (2.0 * math.pi))
    j, t = _between(table, start + 2, verticals, vertical)
    i, s = _between(table, start + 2 + verticals, horizontals, turn)
    at = start + 2 + verticals + horizontals + i * verticals + j
    below = (1.0 - s) * table[at] + s * table[at + verticals]
    above = (1.0 - s) * table[at + 1] + s * table[at + verticals + 1]
    return (1.0 - t) * below + t * above


@compiled
def shone(table, start, axis, u, v, dx, dy, dz):
    """The same towards a unit direction; `u`, `v`: where the horizontal angle is 0 and 90°."""
    ax, ay, az = axis[0], axis[1], axis[2]
    kx, ky, kz = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
    vertical = math.atan2(math.sqrt(kx * kx + ky * ky + kz * kz), dx * ax + dy * ay + dz * az)
    across_u, across_v = dx * u[0] + dy * u[1] + dz * u[2], dx * v[0] + dy * v[1] + dz * v[2]
    return _shine(table, start, vertical, math.atan2(across_v, across_u))


@compiled
def emit(domain, a, b, c, d):
    """A photon from four numbers of [0, 1): (px, py, pz, dx, dy, dz, weight, row, column).

    `weight` turns the light's own quantity (W/sr, W/unit², W/(sr unit²), each per nm) into W; 0: no photon.
    """
    f = domain.frame
    row = search(domain.rows, b)
    height = domain.rows[row + 1] - domain.rows[row]
    column = search(domain.columns[row], a)
    width = domain.columns[row, column + 1] - domain.columns[row, column]
    a = (column + (a - domain.columns[row, column]) / width) / GRID
    b = (row + (b - domain.rows[row]) / height) / GRID
    weight = domain.measure / (height * width * GRID * GRID)
    px, py, pz = domain.origin[0], domain.origin[1], domain.origin[2]
    if domain.kind == PLANE:
        x = domain.rect[0] + a * domain.rect[2]
        y = domain.rect[1] + b * domain.rect[3]
        if domain.has_aperture and domain.is_disc:
            u, v = (x - domain.aperture[0]) / domain.aperture[2], (y - domain.aperture[1]) / domain.aperture[3]
            if u * u + v * v > 1.0:
                weight = 0.0
        tx, ty = concentric_disc(c, d)
        tx, ty = tx * domain.tilt, ty * domain.tilt
        scale = 1.0 / math.sqrt(1.0 + tx * tx + ty * ty)
        dx = (tx * f[0, 0] + ty * f[1, 0] + f[2, 0]) * scale
        dy = (tx * f[0, 1] + ty * f[1, 1] + f[2, 1]) * scale
        dz = (tx * f[0, 2] + ty * f[1, 2] + f[2, 2]) * scale
        px += x * f[0, 0] + y * f[1, 0] - domain.back * dx
        py += x * f[0, 1] + y * f[1, 1] - domain.back * dy
        pz += x * f[0, 2] + y * f[1, 2] - domain.back * dz
        return px, py, pz, dx, dy, dz, weight, row, column
    if domain.kind == DIRECTIONS:
        x = domain.rect[0] + a * domain.rect[2]
        y = domain.rect[1] + b * domain.rect[3]
        scale = 1.0 / math.sqrt(1.0 + x * x + y * y)
        dx = (x * f[0, 0] + y * f[1, 0] + f[2, 0]) * scale
        dy = (x * f[0, 1] + y * f[1, 1] + f[2, 1]) * scale
        dz = (x * f[0, 2] + y * f[1, 2] + f[2, 2]) * scale
        weight *= scale * scale * scale  # solid angle of the plane's area
        if domain.cone[1] < math.pi:
            ax, ay, az = domain.axis[0], domain.axis[1], domain.axis[2]
            kx, ky, kz = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
            angle = math.atan2(math.sqrt(kx * kx + ky * ky + kz * kz), dx * ax + dy * ay + dz * az)
            weight *= spot_falloff(domain.cone, angle)
        if domain.profile.shape[0] > 0:
            weight *= shone(domain.profile, 0, domain.axis, domain.half_u, domain.half_v, dx, dy, dz)
        return px, py, pz, dx, dy, dz, weight, row, column
    tx, ty = 2.0 * c - 1.0, 2.0 * d - 1.0
    if domain.is_disc:
        tx, ty = concentric_disc(c, d)
    px += tx * domain.half_u[0] + ty * domain.half_v[0]
    py += tx * domain.half_u[1] + ty * domain.half_v[1]
    pz += tx * domain.half_u[2] + ty * domain.half_v[2]
    wx, wy, wz = domain.target[0] - px, domain.target[1] - py, domain.target[2] - pz
    distance = math.sqrt(wx * wx + wy * wy + wz * wz)
    sine = domain.radius / distance if distance > domain.radius else 1.0
    # 1 − cos of the cone's half angle; the whole sphere from within.
    lack = sine * sine / (1.0 + math.sqrt(1.0 - sine * sine)) if distance > domain.radius else 2.0
    distance = max(distance, 1e-300)
    wx, wy, wz = wx / distance, wy / distance, wz / distance
    along = f[0, 0] * wx + f[0, 1] * wy + f[0, 2] * wz
    k = 0 if abs(along) < 0.9 else 1
    along = f[k, 0] * wx + f[k, 1] * wy + f[k, 2] * wz
    ux, uy, uz = f[k, 0] - along * wx, f[k, 1] - along * wy, f[k, 2] - along * wz
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    fall = a * lack
    across = math.sqrt(fall * (2.0 - fall))
    turn = 2.0 * math.pi * b
    cx, cy, cz = across * math.cos(turn), across * math.sin(turn), 1.0 - fall
    dx, dy, dz = cx * ux + cy * vx + cz * wx, cx * uy + cy * vy + cz * wy, cx * uz + cy * vz + cz * wz
    facing = dx * domain.axis[0] + dy * domain.axis[1] + dz * domain.axis[2]
    weight *= 2.0 * math.pi * lack * max(facing, 0.0)
    return px, py, pz, dx, dy, dz, weight, row, column


@inlined
def emit_coloured(domain, colour, share, state):
    """A photon of one wavelength from a point of the sequence: (as `emit`, weight in W times `share`, …, atom, nm)."""
    c, d = (unit(state[3]), unit(state[4])) if domain.extended else (0.5, 0.5)
    px, py, pz, dx, dy, dz, watt, row, column = emit(domain, unit(state[0]), unit(state[1]), c, d)
    chance = unit(state[2])
    atom = search(colour.cdf, chance)
    nm = colour.start_nm[atom] + colour.width_nm[atom] * (chance - colour.cdf[atom]) / (
        colour.cdf[atom + 1] - colour.cdf[atom]
    )
    return px, py, pz, dx, dy, dz, watt * (colour.watt[atom] * share), row, column, atom, nm
