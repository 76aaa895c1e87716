"""Polarised light of the references, compiled: electric fields in the world's axes, turned by complex amplitudes.

Unpolarised light is two fields across each other that do not interfere, so a path carries both, complex (2, 3), and no
frame: where it meets a surface each is taken apart along s and p of that plane of incidence. Together their squares are
1; what an event lets go on becomes the probability of the choice, and the fields are made 1 again. The shaders know
Stokes parameters instead (`shaders/lib/polarisation.glsl`), so both ways witness for each other.
"""

from __future__ import annotations

import math

from .compiling import compiled

_UPRIGHT = 1e-8
"""Sine of the angle of incidence below which s is any direction: both polarisations then fare alike."""


@compiled
def across(dx, dy, dz):
    """A unit vector across a direction."""
    if abs(dx) < 0.5:
        x, y, z = 0.0, -dz, dy
    else:
        x, y, z = dz, 0.0, -dx
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@compiled
def begin_unpolarised(field, dx, dy, dz):
    """Two fields across a direction and each other, of half the power each."""
    x, y, z = across(dx, dy, dz)
    half = math.sqrt(0.5)
    field[0, 0], field[0, 1], field[0, 2] = half * x, half * y, half * z
    field[1, 0], field[1, 1], field[1, 2] = (
        half * (dy * z - dz * y),
        half * (dz * x - dx * z),
        half * (dx * y - dy * x),
    )


@compiled
def senkrecht(dx, dy, dz, nx, ny, nz):
    """Unit vector across direction and normal (or another direction)."""
    x, y, z = dy * nz - dz * ny, dz * nx - dx * nz, dx * ny - dy * nx
    length = math.sqrt(x * x + y * y + z * z)
    if length < _UPRIGHT:
        return across(dx, dy, dz)
    return x / length, y / length, z / length


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
def share_of(field, dx, dy, dz, sx, sy, sz, a_s, a_p):
    """Share of the power that amplitudes for s and p leave."""
    px, py, pz = dy * sz - dz * sy, dz * sx - dx * sz, dx * sy - dy * sx
    share = 0.0
    for i in range(2):
        e_s = a_s * (field[i, 0] * sx + field[i, 1] * sy + field[i, 2] * sz)
        e_p = a_p * (field[i, 0] * px + field[i, 1] * py + field[i, 2] * pz)
        share += e_s.real**2 + e_s.imag**2 + e_p.real**2 + e_p.imag**2
    return share


@compiled
def turn_fields(field, dx, dy, dz, rx, ry, rz, sx, sy, sz, a_s, a_p):
    """Take fields from direction d to direction r (unit vectors) with amplitudes for s and p, and make them 1 again."""
    px, py, pz = dy * sz - dz * sy, dz * sx - dx * sz, dx * sy - dy * sx
    # Where an interpolated normal gave way to the facet's, s is not across the new direction yet.
    along = sx * rx + sy * ry + sz * rz
    tx, ty, tz = sx - along * rx, sy - along * ry, sz - along * rz
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / length, ty / length, tz / length
    qx, qy, qz = ry * tz - rz * ty, rz * tx - rx * tz, rx * ty - ry * tx
    power = 0.0
    for i in range(2):
        e_s = a_s * (field[i, 0] * sx + field[i, 1] * sy + field[i, 2] * sz)
        e_p = a_p * (field[i, 0] * px + field[i, 1] * py + field[i, 2] * pz)
        power += e_s.real**2 + e_s.imag**2 + e_p.real**2 + e_p.imag**2
        field[i, 0], field[i, 1], field[i, 2] = (
            e_s * tx + e_p * qx,
            e_s * ty + e_p * qy,
            e_s * tz + e_p * qz,
        )
    per_root = 1.0 / math.sqrt(power) if power > 0.0 else 0.0
    for i in range(2):
        for k in range(3):
            field[i, k] *= per_root
