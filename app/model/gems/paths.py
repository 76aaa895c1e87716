"""Paths of light through a stone with flat facets, followed from the eye: what a facet shows is where such a path ends.

At every facet the light is reflected and refracted by Fresnel's equations, unpolarised, and both parts go on until less
than a bound is left. Each path carries ∂direction/∂n, of which facets need nothing but the direction: flat ones turn
light alike wherever it meets them. Compiled when it is first imported, which only what computes should do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.compiling import compiled

GLARE, HEAD, HIGH, LOW, LEAK = 0, 1, 2, 3, 4
"""Columns of the sums of a ray: shares of its light that were reflected on the outside, came from within the angle of
the head, up to 45° from the viewer, down to the girdle's plane, from behind it, …"""
REST = 5
"""… or were not followed. These six add up to 1."""
COSINE, COSINE_HEAD, SPREAD, SEEN = 6, 7, 8, 9
"""Sums over what comes from before the girdle's plane through the stone: by the cosine to the viewer, that within the
angle of the head, by the angle between F and C, and what has more of that than the eye's pupil."""
COLUMNS = 10
MOST_EVENTS = 1000
"""Facets that one ray's light meets, with all of its parts."""
_STACK = 64
_NEAR = 1e-12
"""Share of the stone's size: nearer than that a ray is still on the facet that it left."""
_WIDER = 1e-6
"""By which boxes are wider than single precision made them."""


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
"""References are not counted, which would take most of the time: scratch comes from the caller."""


def _part(function: Callable) -> Callable:
    return compiled(function, forceinline=True, **_OPTIONS)


def _whole(function: Callable) -> Callable:
    return compiled(function, **_OPTIONS)


@_part
def _enters(box, o, inverse):
    """How far away a ray enters a box of the tree; infinite where it never does."""
    near, far = 0.0, math.inf
    for a in range(3):
        low = (box[a] - _WIDER - o[a]) * inverse[a]
        high = (box[3 + a] + _WIDER - o[a]) * inverse[a]
        near, far = max(near, min(low, high)), min(far, max(low, high))
    return near if near <= far else math.inf


@_part
def _nearest(ray, inverse, corners, normals, bounds, links, tree):
    """The triangle that `ray` meets first, on the side on which it is, and how far away; −1 where there is none."""
    best, at = -1, math.inf
    o, d, inside, skip = ray[:3], ray[3:6], ray[10] > 0.5, int(ray[12])
    for a in range(3):
        inverse[a] = 1.0 / d[a]
    tree[0] = 0
    count = 1 if _enters(bounds[0], o, inverse) < at else 0
    while count:
        count -= 1
        first, held = links[tree[count], 0], links[tree[count], 1]
        if held == 0:
            left, right = _enters(bounds[first], o, inverse), _enters(bounds[first + 1], o, inverse)
            nearer = first if left <= right else first + 1
            if max(left, right) < at:
                tree[count] = 2 * first + 1 - nearer
                count += 1
            if min(left, right) < at:
                tree[count] = nearer
                count += 1
            continue
        for k in range(first, first + held):
            x, y, z = normals[k, 0], normals[k, 1], normals[k, 2]
            along = d[0] * x + d[1] * y + d[2] * z
            if k == skip or along == 0.0 or (along > 0.0) != inside:
                continue
            ax, ay, az = corners[k, 0, 0] - o[0], corners[k, 0, 1] - o[1], corners[k, 0, 2] - o[2]
            t = (ax * x + ay * y + az * z) / along
            if t <= _NEAR or t >= at:
                continue
            bx, by, bz = corners[k, 1, 0] - o[0], corners[k, 1, 1] - o[1], corners[k, 1, 2] - o[2]
            cx, cy, cz = corners[k, 2, 0] - o[0], corners[k, 2, 1] - o[1], corners[k, 2, 2] - o[2]
            # The same for both triangles at an edge but for the sign: no ray passes between them.
            u = d[0] * (by * cz - bz * cy) + d[1] * (bz * cx - bx * cz) + d[2] * (bx * cy - by * cx)
            v = d[0] * (cy * az - cz * ay) + d[1] * (cz * ax - cx * az) + d[2] * (cx * ay - cy * ax)
            w = d[0] * (ay * bz - az * by) + d[1] * (az * bx - ax * bz) + d[2] * (ax * by - ay * bx)
            if (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0):
                best, at = k, t
    return best, at


@_part
def _ended(weight, ray, up, head, dn, pupil, out):
    """Add light that comes from the direction of `ray` to the sums `out`."""
    c = ray[3] * up[0] + ray[4] * up[1] + ray[5] * up[2]
    if ray[11] == 0.0:  # it was never inside
        out[GLARE] += weight
        return
    if c <= 0.0:
        out[LEAK] += weight
        return
    out[COSINE] += weight * c
    if c >= head:
        out[HEAD] += weight
        out[COSINE_HEAD] += weight * c
    elif c >= math.sqrt(0.5):
        out[HIGH] += weight
    else:
        out[LOW] += weight
    angle = abs(dn) * math.sqrt(ray[6] ** 2 + ray[7] ** 2 + ray[8] ** 2)
    angle = min(angle, 0.5 * math.pi)  # near the critical angle the derivative has no bound
    out[SPREAD] += weight * angle
    if angle > pupil:
        out[SEEN] += weight


@_part
def _reflected(ray, m, theta, to):
    """The direction of `ray` and its column after reflection at a facet of normal `m`, on the ray's side."""
    dt = ray[6] * m[0] + ray[7] * m[1] + ray[8] * m[2]
    for a in range(3):
        to[a] = ray[a]
        to[3 + a] = ray[3 + a] - 2.0 * theta * m[a]
        to[6 + a] = ray[6 + a] - 2.0 * dt * m[a]
    to[10], to[11] = ray[10], ray[11]


@_part
def _refracted(ray, m, theta, eta, deta, w, to):
    """Likewise after refraction: `eta` = n_i/n_t with its derivative by n, `w` the cosine behind the facet."""
    dt = ray[6] * m[0] + ray[7] * m[1] + ray[8] * m[2]
    mu = (1.0 - eta) * (1.0 + eta) / (w - eta * theta)
    s2 = (1.0 - theta) * (1.0 + theta)
    for a in range(3):
        to[a] = ray[a]
        to[3 + a] = eta * ray[3 + a] - mu * m[a]
        turned = deta / w * (w * (ray[3 + a] - theta * m[a]) + eta * s2 * m[a])
        to[6 + a] = turned + eta * ray[6 + a] - eta * mu / w * dt * m[a]
    to[10], to[11] = 1.0 - ray[10], 1.0


@_whole
def traced(origins, towards, corners, normals, bounds, links, n, up, head, dn, pupil, least, tree, rays, out):
    """The light that eyes see at `origins` (N, 3) by rays that go `towards`, of light round `up`; `out` (N, COLUMNS).

    Whoever sees past the stone has sums of 0. `least`: shares of light that are followed no further. `tree`, `rays`:
    of `room`.
    """
    ray, m, inverse = rays[_STACK], rays[_STACK + 1], rays[_STACK + 2]
    for i in range(len(origins)):
        for a in range(3):
            rays[0, a], rays[0, 3 + a], rays[0, 6 + a] = origins[i, a], towards[a], 0.0
        rays[0, 9], rays[0, 10], rays[0, 11], rays[0, 12] = 1.0, 0.0, 0.0, -1.0
        waiting, events = 1, 0
        while waiting:
            waiting -= 1
            for a in range(13):
                ray[a] = rays[waiting, a]
            weight, inside = ray[9], ray[10] > 0.5
            k, at = _nearest(ray, inverse, corners, normals, bounds, links, tree)
            if k < 0:
                if inside:
                    out[i, REST] += weight  # past a facet that it grazes, by rounding
                elif events:
                    _ended(weight, ray, up, head, dn, pupil, out[i])
                continue
            events += 1
            theta = ray[3] * normals[k, 0] + ray[4] * normals[k, 1] + ray[5] * normals[k, 2]
            for a in range(3):
                m[a] = -normals[k, a] if inside else normals[k, a]
                ray[a] += at * ray[3 + a]
            theta = -abs(theta)
            eta = n if inside else 1.0 / n
            w2 = (1.0 - eta) * (1.0 + eta) + eta * eta * theta * theta
            w = math.sqrt(max(w2, 0.0))
            across = (eta * theta + w) / (eta * theta - w)
            along = (theta + eta * w) / (theta - eta * w)
            back = weight * (0.5 * (across * across + along * along) if w2 > 0.0 else 1.0)
            passed = weight - back
            if back >= least and events < MOST_EVENTS and waiting < _STACK:
                _reflected(ray, m, theta, rays[waiting])
                rays[waiting, 9], rays[waiting, 12] = back, k
                waiting += 1
            else:
                out[i, REST] += back
            if passed >= least and events < MOST_EVENTS and waiting < _STACK:
                _refracted(ray, m, theta, eta, 1.0 if inside else -eta * eta, w, rays[waiting])
                rays[waiting, 9], rays[waiting, 12] = passed, k
                waiting += 1
            else:
                out[i, REST] += passed


def room() -> tuple[np.ndarray, np.ndarray]:
    """`tree` and `rays` of `traced`, for one thread."""
    return np.empty(96, np.int64), np.empty((_STACK + 3, 13))
