"""One photon of a domain (`photon_emission`), compiled: four numbers become a ray and its weight."""

from __future__ import annotations

import math

from .compiling import compiled, inlined
from .sampling import unit
from .vectors import angle_between, combined, cross, dot, length, minus, mixed_of, moved, over, scaled

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
def shone(table, start, axis, u, v, d):
    """Share of its peak that a lamp's table at `start` (`ies_file.Profile.packed`) has towards a unit direction; `u`,
    `v`: where the horizontal angle is 0 and 90°.

    Bilinear: the weighted sum of the four values round the angles."""
    verticals, horizontals = int(table[start]), int(table[start + 1])
    horizontal = math.atan2(dot(d, v), dot(d, u))
    turn = horizontal - 2.0 * math.pi * math.floor(horizontal / (2.0 * math.pi))
    j, t = _between(table, start + 2, verticals, angle_between(d, axis))
    i, s = _between(table, start + 2 + verticals, horizontals, turn)
    at = start + 2 + verticals + horizontals + i * verticals + j
    below = (1.0 - s) * table[at] + s * table[at + verticals]
    above = (1.0 - s) * table[at + 1] + s * table[at + verticals + 1]
    return (1.0 - t) * below + t * above


@compiled
def emit(domain, a, b, c, d):
    """A photon from four numbers of [0, 1): (place, direction, weight, row, column).

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
    place = domain.origin[0], domain.origin[1], domain.origin[2]
    if domain.kind == AREA:
        place, way, factor = _from_area(domain, a, b, c, d)
        return place, way, weight * factor, row, column
    x = domain.rect[0] + a * domain.rect[2]
    y = domain.rect[1] + b * domain.rect[3]
    if domain.kind == PLANE:
        if domain.has_aperture and domain.is_disc:
            u, v = (x - domain.aperture[0]) / domain.aperture[2], (y - domain.aperture[1]) / domain.aperture[3]
            if u * u + v * v > 1.0:
                weight = 0.0
        tx, ty = concentric_disc(c, d)
        tx, ty = tx * domain.tilt, ty * domain.tilt
        scale = 1.0 / math.sqrt(1.0 + tx * tx + ty * ty)
        way = scaled(combined(tx, f[0], ty, f[1], 1.0, f[2]), scale)
        start = combined(x, f[0], y, f[1], -domain.back, way)
        return moved(place, 1.0, start), way, weight, row, column
    scale = 1.0 / math.sqrt(1.0 + x * x + y * y)
    way = scaled(combined(x, f[0], y, f[1], 1.0, f[2]), scale)
    weight *= scale * scale * scale  # solid angle of the plane's area
    if domain.cone[1] < math.pi:
        weight *= spot_falloff(domain.cone, angle_between(way, domain.axis))
    if domain.profile.shape[0] > 0:
        weight *= shone(domain.profile, 0, domain.axis, domain.half_u, domain.half_v, way)
    return place, way, weight, row, column


@compiled
def _from_area(domain, a, b, c, d):
    """(place, direction, factor on the weight) of a photon of an area light: from a point of it that `c` and `d` choose
    into the cone round the target, uniformly by `a` and `b`."""
    tx, ty = 2.0 * c - 1.0, 2.0 * d - 1.0
    if domain.is_disc:
        tx, ty = concentric_disc(c, d)
    place = moved(domain.origin, 1.0, mixed_of(tx, domain.half_u, ty, domain.half_v))
    w = minus(domain.target, place)
    distance = length(w)
    sine = domain.radius / distance if distance > domain.radius else 1.0
    # 1 − cos of the cone's half angle; the whole sphere from within.
    lack = sine * sine / (1.0 + math.sqrt(1.0 - sine * sine)) if distance > domain.radius else 2.0
    w = over(w, max(distance, 1e-300))
    f = domain.frame
    guide = f[0] if abs(dot(f[0], w)) < 0.9 else f[1]
    u = moved(guide, -dot(guide, w), w)
    u = over(u, length(u))
    v = cross(w, u)
    fall = a * lack
    aside = math.sqrt(fall * (2.0 - fall))
    turn = 2.0 * math.pi * b
    way = combined(aside * math.cos(turn), u, aside * math.sin(turn), v, 1.0 - fall, w)
    return place, way, 2.0 * math.pi * lack * max(dot(way, domain.axis), 0.0)


@inlined
def emit_coloured(domain, colour, share, state):
    """A photon of one wavelength from a point of the sequence: (as `emit`, weight in W times `share`, …, atom, nm)."""
    c, d = (unit(state[3]), unit(state[4])) if domain.extended else (0.5, 0.5)
    place, way, watt, row, column = emit(domain, unit(state[0]), unit(state[1]), c, d)
    chance = unit(state[2])
    atom = search(colour.cdf, chance)
    nm = colour.start_nm[atom] + colour.width_nm[atom] * (chance - colour.cdf[atom]) / (
        colour.cdf[atom + 1] - colour.cdf[atom]
    )
    return place, way, watt * (colour.watt[atom] * share), row, column, atom, nm
