"""Polarised light of beams: Stokes parameters of a beam's chief ray at one place of its band, float64, compiled.

A state is six numbers: q, u, v of light of intensity 1, and a unit axis across the ray from which they count, as in
`shaders/lib/polarisation.glsl`. An axis of no length says that polarisation is not followed.
"""

from __future__ import annotations

import numpy as np

from .compiling import part

STATE = 6
"""Numbers of a state."""
_UPRIGHT = 1e-16
"""Squared sine of the angle of incidence below which s is any direction."""


@part
def begin(source, direction, state):
    """The state of what a source sends out: unpolarised."""
    for k in range(6):
        state[k] = 0.0
    if source.polarised:
        least = 0
        for k in range(1, 3):
            least = k if abs(direction[0, k]) < abs(direction[0, least]) else least
        i, j = (least + 1) % 3, (least + 2) % 3
        length = np.sqrt(direction[0, i] ** 2 + direction[0, j] ** 2)
        state[3 + i], state[3 + j] = -direction[0, j] / length, direction[0, i] / length


@part
def is_followed(state):
    """Whether it is a state at all."""
    return state[3] != 0.0 or state[4] != 0.0 or state[5] != 0.0


@part
def count_from_s(state, direction, plane):
    """Count a state from s of the plane of incidence at a facet."""
    s0 = direction[0, 1] * plane[2] - direction[0, 2] * plane[1]
    s1 = direction[0, 2] * plane[0] - direction[0, 0] * plane[2]
    s2 = direction[0, 0] * plane[1] - direction[0, 1] * plane[0]
    length2 = s0 * s0 + s1 * s1 + s2 * s2
    if length2 < _UPRIGHT:
        return
    length = np.sqrt(length2)
    s0, s1, s2 = s0 / length, s1 / length, s2 / length
    a0, a1, a2 = state[3], state[4], state[5]
    along = a0 * s0 + a1 * s1 + a2 * s2
    across = (
        (direction[0, 1] * a2 - direction[0, 2] * a1) * s0
        + (direction[0, 2] * a0 - direction[0, 0] * a2) * s1
        + (direction[0, 0] * a1 - direction[0, 1] * a0) * s2
    )
    cosine, sine = along * along - across * across, 2.0 * along * across
    q = state[0]
    state[0] = cosine * q + sine * state[1]
    state[1] = cosine * state[1] - sine * q
    state[3], state[4], state[5] = s0, s1, s2


@part
def _behind(state, s, p, real, imaginary):
    """Put a state, counted from s, behind an interface with these shares of s and p and this product of amplitudes;
    returns the share of all."""
    share = 0.5 * (s + p + (s - p) * state[0])
    per = 1.0 / share if share > 1e-30 else 0.0
    u, v = state[1], state[2]
    state[0] = 0.5 * (s - p + (s + p) * state[0]) * per
    state[1] = (real * u - imaginary * v) * per
    state[2] = (imaginary * u + real * v) * per
    return max(share, 0.0)


@part
def behind_mirror(state):
    """A perfect conductor's reflection."""
    _behind(state, 1.0, 1.0, -1.0, 0.0)


@part
def behind_glass(state, cosine_i, eta, cosine2_t, reflects):
    """Reflection or refraction by glass: puts a state, counted from s, behind it and returns the share that is sent
    this way. [Born and Wolf, 1.5]"""
    if cosine2_t <= 0.0:
        if not reflects:
            return 0.0
        x, y = eta * (cosine_i * cosine_i - cosine2_t), np.sqrt(-cosine2_t) * cosine_i * (eta * eta - 1.0)
        size = x * x + y * y
        return _behind(state, 1.0, 1.0, (x * x - y * y) / size, 2.0 * x * y / size)
    cosine_t = np.sqrt(cosine2_t)
    s = (eta * cosine_i - cosine_t) / (eta * cosine_i + cosine_t)
    p = (cosine_i - eta * cosine_t) / (cosine_i + eta * cosine_t)
    if reflects:
        return _behind(state, s * s, p * p, s * p, 0.0)
    through_s, through_p = 1.0 - s * s, 1.0 - p * p
    return _behind(state, through_s, through_p, np.sqrt(through_s * through_p), 0.0)
