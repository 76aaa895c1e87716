"""Polarised light of the references, compiled: electric fields in the world's axes, turned by complex amplitudes.

Unpolarised light is two perpendicular fields that do not interfere, so a path carries both, complex (2, 3), and no
frame: where it meets a surface each is split along s and p of that plane of incidence. Together their squares are
1; what an event lets pass becomes the probability of the choice, and the fields are made 1 again. The shaders know
Stokes parameters instead (`shaders/lib/polarisation.glsl`), so each way checks the other.
"""

from __future__ import annotations

import math

from .compiling import compiled
from .vectors import across, cross, dot, length, moved, over

_UPRIGHT = 1e-8
"""Sine of the angle of incidence below which s is any direction: both polarisations then fare alike."""


@compiled
def begin_unpolarised(field, d):
    """Two fields perpendicular to a direction and to each other, of half the power each."""
    first = across(d)
    second = cross(d, first)
    half = math.sqrt(0.5)
    for k in range(3):
        field[0, k], field[1, k] = half * first[k], half * second[k]


@compiled
def senkrecht(d, n):
    """Unit vector perpendicular to a direction and a normal (or another direction): s of their plane."""
    s = cross(d, n)
    size = length(s)
    return across(d) if size < _UPRIGHT else over(s, size)


@compiled
def amplitudes(cosine_i, eta):
    """(r_s, r_p, t_s, t_p), complex, with eta = n_i/n_t and a p that turns with the ray (r_p = -r_s upright). Those of
    transmission are of the root of the power; both are 0 at total reflection. [Born and Wolf, 1.5.2]"""
    cosine2 = (1.0 - eta) * (1.0 + eta) + eta * eta * cosine_i * cosine_i
    cosine_t = complex(math.sqrt(cosine2), 0.0) if cosine2 > 0.0 else complex(0.0, math.sqrt(-cosine2))
    for_s, for_p = eta * cosine_i + cosine_t, cosine_i + eta * cosine_t
    r_s, r_p = (eta * cosine_i - cosine_t) / for_s, (cosine_i - eta * cosine_t) / for_p
    root = math.sqrt(cosine_t.real / (eta * cosine_i)) if cosine2 > 0.0 else 0.0
    return r_s, r_p, 2.0 * eta * cosine_i * root / for_s, 2.0 * eta * cosine_i * root / for_p


@compiled
def share_of(field, d, s, a_s, a_p):
    """Share of the power that amplitudes for s and p leave."""
    p = cross(d, s)
    share = 0.0
    for i in range(2):
        e_s, e_p = a_s * dot(field[i], s), a_p * dot(field[i], p)
        share += e_s.real**2 + e_s.imag**2 + e_p.real**2 + e_p.imag**2
    return share


@compiled
def turn_fields(field, d, r, s, a_s, a_p):
    """Take fields from direction d to direction r (unit vectors) with amplitudes for s and p, and make them 1 again.
    Returns the share of the power that the amplitudes leave."""
    p = cross(d, s)
    # Where an interpolated normal gave way to the facet's, s is not perpendicular to the new direction yet.
    t = moved(s, -dot(s, r), r)
    t = over(t, length(t))
    q = cross(r, t)
    power = 0.0
    for i in range(2):
        e_s, e_p = a_s * dot(field[i], s), a_p * dot(field[i], p)
        power += e_s.real**2 + e_s.imag**2 + e_p.real**2 + e_p.imag**2
        for k in range(3):
            field[i, k] = e_s * t[k] + e_p * q[k]
    per_root = 1.0 / math.sqrt(power) if power > 0.0 else 0.0
    for i in range(2):
        for k in range(3):
            field[i, k] *= per_root
    return power
