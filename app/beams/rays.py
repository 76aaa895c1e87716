"""Rays as affine functions of their emission coordinates, through flat facets: float64, compiled by numba.

A bundle is an array (3, 3) for positions and one for directions: [value at the centre, derivative by q_u, derivative
by q_v][xyz]. For parallel light all this is exact; for light that diverges it is the first order [Igehy 1999] about the
centre, and beams are kept small enough.
"""

from __future__ import annotations

import numpy as np

from .compiling import jit, part
from .polarised import begin, behind_glass, behind_mirror, count_from_s, is_followed

PARALLEL, POINT = 0, 1
"""Kinds of sources. Rays of the second diverge."""
REFLECT, REFRACT, PASS = 0, 1, 2
"""What a beam does at a facet; PASS: the medium does not change there."""

SOURCE = np.dtype(
    [
        ("kind", "i8"),
        ("origin", "f8", 3),
        ("forward", "f8", 3),
        ("right", "f8", 3),
        ("up", "f8", 3),
        ("axis", "f8", 3),
        ("cone", "f8", 2),
        ("lambert", "?"),
        ("polarised", "?"),
    ]
)
"""Where beams set out from. Parallel: from origin + q_u right + q_v up along `forward`. Diverging: from `origin` along
forward + q_u right + q_v up, made a unit vector (a gnomonic plane: straight edges stay straight). `axis` and `cone`: of
a spot, and the half angles between which it fades, rad; beyond pi: none; `lambert`: by the cosine to `axis`;
`polarised`: its beams carry states of polarisation. Records
instead of tuples of arrays throughout: what numba compiles takes a hundredth of the time."""


FACET, ACTION, BEFORE, AFTER, ABSORBS = range(5)
"""Columns of a path (flights, 5): the facet at the end of each flight, what the beam does there, rows of the glass on
the side it comes from and behind (-1: air), row of what the flight's medium absorbs (-1: nothing)."""


@part
def at_x(table, row, x):
    """A row of a spectral table at x, linear between its samples; what is constant is so to the last bit."""
    place = min(max(x, 0.0), 1.0) * (table.shape[1] - 1)
    i = min(int(place), table.shape[1] - 2)
    part = place - i
    return table[row, i] + part * (table[row, i + 1] - table[row, i])


@part
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def emit(source, u, v, position, direction):
    """The bundle that leaves a source about q = (u, v)."""
    for k in range(3):
        if source.kind == PARALLEL:
            position[0, k] = source.origin[k] + u * source.right[k] + v * source.up[k]
            position[1, k], position[2, k] = source.right[k], source.up[k]
            direction[0, k] = source.forward[k]
            direction[1, k] = direction[2, k] = 0.0
        else:
            position[0, k] = source.origin[k]
            position[1, k] = position[2, k] = 0.0
            direction[0, k] = source.forward[k] + u * source.right[k] + v * source.up[k]
            direction[1, k], direction[2, k] = source.right[k], source.up[k]
    if source.kind != PARALLEL:
        length = 0.0
        for k in range(3):
            length += direction[0, k] * direction[0, k]
        shrink = 1.0 / np.sqrt(length)
        for c in range(3):
            along = 0.0
            for k in range(3):
                along += direction[0, k] * direction[c, k]
            for k in range(3):
                direction[c, k] = shrink * (direction[c, k] - (along * direction[0, k] if c > 0 else 0.0))


@part
def lengthening(source, u, v, out):
    """Relative change per unit of q of the length of forward + u right + v up: rays whose directions grow so are
    exactly affine where they leave the source; unit vectors are not."""
    out[0] = out[1] = 0.0
    if source.kind != PARALLEL:
        size = 0.0
        for k in range(3):
            towards = source.forward[k] + u * source.right[k] + v * source.up[k]
            size += towards * towards
            out[0] += towards * source.right[k]
            out[1] += towards * source.up[k]
        out[0], out[1] = out[0] / size, out[1] / size


@part
def emitted(source, u, v, direction):
    """Relative intensity of a source towards q = (u, v), per unit of q: equal steps on a gnomonic plane are smaller
    solid angles farther out, and a spot fades (`spot.glsl`)."""
    if source.kind != POINT:
        return 1.0
    right, up = dot(source.right, source.right), dot(source.up, source.up)
    weight = np.sqrt(right * up) / (1.0 + u * u * right + v * v * up) ** 1.5
    d, axis = direction, source.axis
    cosine = d[0, 0] * axis[0] + d[0, 1] * axis[1] + d[0, 2] * axis[2]
    if source.cone[1] - source.cone[0] > 1e-7:
        across = 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            side = d[0, i] * axis[j] - d[0, j] * axis[i]
            across += side * side
        angle = np.arctan2(np.sqrt(across), cosine)
        t = min(max((source.cone[1] - angle) / (source.cone[1] - source.cone[0]), 0.0), 1.0)
        weight *= t * t * (3.0 - 2.0 * t)
    if source.lambert:
        weight *= max(cosine, 0.0)
    return weight


@jit
def intensities(sources, q, out, position, direction):
    """`emitted` of the first source towards each q (N, 2), into `out` (N,); the other two are scratch, (3, 3)."""
    for i in range(len(q)):
        emit(sources[0], q[i, 0], q[i, 1], position, direction)
        out[i] = emitted(sources[0], q[i, 0], q[i, 1], direction)


@part
def advance(position, direction, plane):
    """Move a bundle to the plane (n, d); returns the distance at the centre."""
    cosine = plane[0] * direction[0, 0] + plane[1] * direction[0, 1] + plane[2] * direction[0, 2]
    if abs(cosine) < 1e-12:
        cosine = 1e-12 if cosine >= 0.0 else -1e-12
    away = plane[3] - (plane[0] * position[0, 0] + plane[1] * position[0, 1] + plane[2] * position[0, 2])
    distance = away / cosine
    for c in range(1, 3):
        moved = 0.0
        for k in range(3):
            position[c, k] += distance * direction[c, k]
            moved += plane[k] * position[c, k]
        change = -moved / cosine
        for k in range(3):
            position[c, k] += change * direction[0, k]
    for k in range(3):
        position[0, k] += distance * direction[0, k]
    return distance


@part
def transmitted(cosine, eta):
    """Squared cosine of the transmitted angle, <= 0: total reflection; `eta` = n_incident / n_transmitted."""
    return (1.0 - eta) * (1.0 + eta) + eta * eta * cosine * cosine


@part
def reflectance(cosine_i, eta, cosine2_t):
    """Unpolarised Fresnel reflectance; `cosine_i` > 0."""
    if cosine2_t <= 0.0:
        return 1.0
    cosine_t = np.sqrt(cosine2_t)
    s = (eta * cosine_i - cosine_t) / (eta * cosine_i + cosine_t)
    p = (cosine_i - eta * cosine_t) / (cosine_i + eta * cosine_t)
    return 0.5 * (s * s + p * p)


@part
def reflect(direction, plane):
    """Turn a bundle's directions at a facet."""
    for c in range(3):
        twice = 2.0 * (plane[0] * direction[c, 0] + plane[1] * direction[c, 1] + plane[2] * direction[c, 2])
        for k in range(3):
            direction[c, k] -= twice * plane[k]


@part
def refract(direction, plane, eta):
    """Turn a bundle's directions by refraction at a facet; grazing where it would be totally reflected. Derivatives:
    physics of `optics.glsl`, written for a flat facet."""
    theta = plane[0] * direction[0, 0] + plane[1] * direction[0, 1] + plane[2] * direction[0, 2]
    sign = -1.0 if theta > 0.0 else 1.0
    theta = -abs(theta)
    omega = np.sqrt(max(transmitted(theta, eta), 1e-12))
    mu = (1.0 - eta) * (1.0 + eta) / (omega - eta * theta)
    for c in range(1, 3):
        bend = sign * (plane[0] * direction[c, 0] + plane[1] * direction[c, 1] + plane[2] * direction[c, 2])
        bend *= eta * mu / omega
        for k in range(3):
            direction[c, k] = eta * direction[c, k] - sign * bend * plane[k]
    length = 0.0
    for k in range(3):
        direction[0, k] = eta * direction[0, k] - sign * mu * plane[k]
        length += direction[0, k] * direction[0, k]
    for k in range(3):
        direction[0, k] /= np.sqrt(length)


@part
def index_of(tables, glass, x):
    """Refractive index of a glass's row, 1 for air."""
    return 1.0 if glass < 0 else at_x(tables, glass, x)


@part
def meet(facets, solids, tables, path, k, x, position, direction, state):
    """End flight k of a bundle, whose chief ray has a state of polarisation, at its facet and send it on as the path
    says; returns the share of its power that is sent this way, what the medium absorbed on the flight included."""
    facet = path[k, FACET]
    plane = facets[facet].plane
    distance = advance(position, direction, plane)
    weight = 1.0
    if path[k, ABSORBS] >= 0:
        weight = np.exp(-at_x(tables, np.int64(path[k, ABSORBS]), x) * max(distance, 0.0))
    if path[k, ACTION] == PASS:
        return weight
    followed = is_followed(state)
    if followed:
        count_from_s(state, direction, plane)
    if facets[facet].kind == 1:
        reflect(direction, plane)
        if followed:
            behind_mirror(state)
        return weight * at_x(tables, solids[facets[facet].owner].tint, x)
    theta = plane[0] * direction[0, 0] + plane[1] * direction[0, 1] + plane[2] * direction[0, 2]
    eta = index_of(tables, np.int64(path[k, BEFORE]), x) / index_of(tables, np.int64(path[k, AFTER]), x)
    cosine2 = transmitted(theta, eta)
    reflects = path[k, ACTION] == REFLECT
    if followed:
        weight *= behind_glass(state, abs(theta), eta, cosine2, reflects)
    else:
        share = reflectance(abs(theta), eta, cosine2)
        weight *= share if reflects else 1.0 - share
    if reflects:
        reflect(direction, plane)
    else:
        refract(direction, plane, eta)
    return weight


@part
def follow(source, facets, solids, tables, path, flights, x, u, v, position, direction, state):
    """A bundle about q = (u, v) from the source through the first `flights` facets of its path, and its state of
    polarisation; returns its weight."""
    emit(source, u, v, position, direction)
    weight = emitted(source, u, v, direction)
    begin(source, direction, state)
    for k in range(flights):
        weight *= meet(facets, solids, tables, path, k, x, position, direction, state)
    return weight


@part
def moments(position, direction, growth, out):
    """A bundle's rays as lines [Pluecker]: out[c] = direction, moment X x D; their derivatives for c > 0. `growth` of
    the directions changes no line, but how far from the chief ray side products with edges are linear."""
    for c in range(3):
        longer = growth[c - 1] if c > 0 else 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            moment = position[c, i] * direction[0, j] - position[c, j] * direction[0, i]
            if c > 0:
                moment += position[0, i] * (direction[c, j] + longer * direction[0, j])
                moment -= position[0, j] * (direction[c, i] + longer * direction[0, i])
            out[c, k] = direction[c, k] + longer * direction[0, k]
            out[c, 3 + k] = moment


@part
def edge_line(facet, edge, sign, moment, u, v, line):
    """Which side of a facet's edge rays pass: line[0] + line[1] q_u + line[2] q_v >= 0 inside, the side product of
    ray and edge [Pluecker]; it stays finite where the ray runs along the facet. `sign`: 1 for rays that leave through
    the facet (along its normal), -1 for those that come in; rays of the other way are inside of no facet."""
    e = facet.edge
    for c in range(3):
        side = 0.0
        for k in range(3):
            side += e[edge, k] * moment[c, 3 + k] + e[edge, 3 + k] * moment[c, k]
        line[c] = sign * side
    line[0] -= line[1] * u + line[2] * v


@part
def total_line(facet, tables, before, after, x, direction, u, v, line):
    """Where a facet transmits: the squared cosine of the transmitted angle to first order, as a line."""
    n = facet.plane
    eta = index_of(tables, before, x) / index_of(tables, after, x)
    theta = n[0] * direction[0, 0] + n[1] * direction[0, 1] + n[2] * direction[0, 2]
    line[0] = transmitted(theta, eta)
    for c in range(1, 3):
        change = n[0] * direction[c, 0] + n[1] * direction[c, 1] + n[2] * direction[c, 2]
        line[c] = 2.0 * eta * eta * theta * change
    line[0] -= line[1] * u + line[2] * v
