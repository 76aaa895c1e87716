"""Uniaxial crystals of the references, compiled: Maxwell's boundary conditions as four equations for four waves.

At an interface all waves share what of the wave vector lies in the surface. Two go back into the medium they come from
and two go on, each of known form: an ordinary wave's electric field and an extraordinary wave's magnetic one are
perpendicular to its wave vector and the axis. That both tangential fields go through unbroken gives the four amplitudes
by elimination, whichever of the media is a crystal or none, and beyond total reflection too, where waves have complex
vectors. A path takes one of the waves by its share of the power, except that both of an isotropic medium go together.

Fields go as exp(i(k·r − ωt)); wave vectors are in units of ω/c, magnetic fields of 1/Z₀. In a crystal light goes along
Poynting's vector, across the electric field, and not along the wave vector, which is kept in row `WAVE` beside the
fields of `polarised`. What follows there is scratch: `SYSTEM` holds four equations (columns 0 to 3; 4 and 5 of the
incident fields), `WAVES` (wave vector, electric field) of the four.
"""

from __future__ import annotations

import cmath
import math

from .compiling import compiled, inlined
from .polarised import turn_fields
from .vectors import across, cross, dot, length, moved, over, scaled

WAVE, SYSTEM, WAVES = 2, 3, 7
FIELD_SHAPE = (11, 6)
_ALONG = 1e-9
"""Sine of the angle to the axis below which both waves are one and any two directions are theirs."""


@inlined
def _parts(vector, axis, along, beyond):
    """A vector times a tensor: `along` the axis, and what its eigenvalue across that is short of, `beyond`."""
    return moved(scaled(vector, along), beyond * dot(vector, axis), axis)


@inlined
def _norm(a):
    """Length of a complex vector."""
    return math.sqrt(abs(a[0]) ** 2 + abs(a[1]) ** 2 + abs(a[2]) ** 2)


@inlined
def permitted(vector, n_o, n_e, axis):
    """Displacement of a field in a crystal: ε times it."""
    return _parts(vector, axis, n_o * n_o, (n_e - n_o) * (n_e + n_o))


@compiled
def _wave(field, row, tangential, n, side, n_o, n_e, axis, is_extraordinary):
    """Put the wave with this wave vector along the surface, into the side of `n` (1) or away from it (−1), in `row`."""
    beyond = (n_e - n_o) * (n_e + n_o) if is_extraordinary else 0.0
    # k·εk = (n_o n_e)² or k·k = n_o² for k = tangential + z n; the root's sign is that of the power along n.
    c_t, c_n = dot(axis, tangential), dot(axis, n)
    a, b = n_o * n_o + beyond * c_n * c_n, beyond * c_t * c_n
    c = n_o * n_o * (dot(tangential, tangential) - (n_e * n_e if is_extraordinary else n_o * n_o)) + beyond * c_t * c_t
    root = cmath.sqrt(complex(b * b - a * c, 0.0))
    z = (side * root - b) / a
    k = moved(tangential, z, n)
    u = cross(k, axis)
    if _norm(u) < _ALONG * _norm(k):
        u = cross(k, across(axis))
    u = over(u, _norm(u))
    if is_extraordinary:
        e = cross(u, k)
        e = _parts(e, axis, 1.0 / (n_o * n_o), 1.0 / (n_e * n_e) - 1.0 / (n_o * n_o))
    else:
        e = u
    for i in range(3):
        field[row, i], field[row, 3 + i] = k[i], e[i]


@inlined
def _power(k, e, n):
    """Poynting's vector along `n` of the field e of the wave k, as it stands."""
    h = cross(k, e)
    flow = 0.0
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        flow += n[i] * (e[j] * h[m].conjugate() - e[m] * h[j].conjugate()).real
    return flow


@compiled
def _eliminate(field):
    """Solve the four equations for both right sides, which become the amplitudes."""
    for column in range(4):
        best = column
        for row in range(column + 1, 4):
            if abs(field[SYSTEM + row, column]) > abs(field[SYSTEM + best, column]):
                best = row
        for k in range(6):
            swap = field[SYSTEM + column, k]
            field[SYSTEM + column, k] = field[SYSTEM + best, k]
            field[SYSTEM + best, k] = swap
        pivot = field[SYSTEM + column, column]
        for k in range(6):
            field[SYSTEM + column, k] /= pivot
        for row in range(4):
            factor = field[SYSTEM + row, column]
            if row != column and factor != 0.0:
                for k in range(6):
                    field[SYSTEM + row, k] -= factor * field[SYSTEM + column, k]


@compiled
def wave_vector(field, d, n_o, is_crystal):
    """Of the incident light."""
    if not is_crystal:
        return scaled(d, n_o)
    return field[WAVE, 0].real, field[WAVE, 1].real, field[WAVE, 2].real


@compiled
def solve_interface(field, d, n, first, second):
    """Amplitudes of the four waves for both incident fields, in columns 4 and 5 of `SYSTEM`: (shares of the power of
    the two reflected ones and the two transmitted ones).

    `n`: unit normal against the incident ray; `first`, `second`: (n_o, n_e, axis, whether it is a crystal) before and
    behind. Of an isotropic medium the first wave is s and the second p.
    """
    k = wave_vector(field, d, first[0], first[3])
    tangential = moved(k, -dot(k, n), n)
    for wave in range(4):
        n_o, n_e, axis, is_crystal = first if wave < 2 else second
        side = 1.0 if wave < 2 else -1.0
        _wave(field, WAVES + wave, tangential, n, side, n_o, n_e, axis if is_crystal else n, wave % 2 == 1)
    x = across(n)
    y = cross(n, x)
    incoming = 0.0
    for i in range(2):
        e = field[i, 0], field[i, 1], field[i, 2]
        h = cross(k, e)
        incoming -= _power(k, e, n)
        field[SYSTEM, 4 + i], field[SYSTEM + 1, 4 + i] = dot(e, x), dot(e, y)
        field[SYSTEM + 2, 4 + i], field[SYSTEM + 3, 4 + i] = dot(h, x), dot(h, y)
    for wave in range(4):
        row = field[WAVES + wave]
        e = row[3], row[4], row[5]
        h = cross((row[0], row[1], row[2]), e)
        sign = -1.0 if wave < 2 else 1.0
        field[SYSTEM, wave], field[SYSTEM + 1, wave] = sign * dot(e, x), sign * dot(e, y)
        field[SYSTEM + 2, wave], field[SYSTEM + 3, wave] = sign * dot(h, x), sign * dot(h, y)
    _eliminate(field)
    return (
        _share(field, 0, n, incoming),
        _share(field, 1, n, incoming),
        -_share(field, 2, n, incoming),
        -_share(field, 3, n, incoming),
    )


@inlined
def _share(field, wave, n, incoming):
    row = field[WAVES + wave]
    flow = _power((row[0], row[1], row[2]), (row[3], row[4], row[5]), n)
    return flow * (abs(field[SYSTEM + wave, 4]) ** 2 + abs(field[SYSTEM + wave, 5]) ** 2) / incoming


@compiled
def take_wave(field, wave, medium):
    """Let light go on as one of the four waves, with its twin where the medium is isotropic: its unit direction. The
    fields are made 1 again, and the wave vector is kept."""
    n_o, n_e, axis, is_crystal = medium
    begin, end = (wave, wave + 1) if is_crystal else (wave - wave % 2, wave - wave % 2 + 2)
    power = 0.0
    for i in range(2):
        for k in range(3):
            e = complex(0.0)
            for each in range(begin, end):
                e += field[SYSTEM + each, 4 + i] * field[WAVES + each, 3 + k]
            field[i, k] = e
            power += e.real**2 + e.imag**2
    per_root = 1.0 / math.sqrt(power) if power > 0.0 else 0.0
    for i in range(2):
        for k in range(3):
            field[i, k] *= per_root
    for k in range(3):
        field[WAVE, k] = field[WAVES + begin, k]
    r = field[WAVE, 0].real, field[WAVE, 1].real, field[WAVE, 2].real
    if is_crystal and wave % 2 == 1:
        r = permitted(r, n_o, n_e, axis)
    return over(r, length(r))


@compiled
def begin_in_crystal(field, d, n_o, n_e, axis, is_extraordinary):
    """Light that begins inside a crystal along `d`, of one of its kinds."""
    u = cross(d, axis)
    u = over(u, length(u)) if length(u) > _ALONG else across(axis)
    k, e = scaled(d, n_o), u
    if is_extraordinary:
        k = _parts(d, axis, 1.0 / (n_o * n_o), 1.0 / (n_e * n_e) - 1.0 / (n_o * n_o))
        k = scaled(k, n_o * n_e / math.sqrt(dot(k, permitted(k, n_o, n_e, axis))))
        e = cross(d, u)
    for i in range(3):
        field[0, i], field[1, i], field[WAVE, i] = e[i], 0.0, k[i]


@compiled
def through_sheet(field, d, axis, along, across_it, retardance):
    """Share of the power that a polariser or wave plate leaves of fields, which it turns: amplitudes of light polarised
    along its axis and across it, which is `retardance` of a period late."""
    a = moved(axis, -dot(axis, d), d)
    a = over(a, length(a)) if length(a) > _ALONG else across(d)
    late = across_it * cmath.exp(complex(0.0, 2.0 * math.pi * retardance))
    return turn_fields(field, d, d, a, complex(along), late)
