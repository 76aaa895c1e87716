"""Rays against triangles and curved surfaces in float64, compiled: the reference renderer's own walk through the tree.

Near the place that a photon left, the side of the surface that it is on decides, not an offset: on the object
just left only the opposite crossing can be true, and of two touching solids the photon's own
record of what it is inside of says which surface it has crossed already. What is no glass and touches
something is one interface with it, and comes first: silver, black and paint are met from within glass as from outside.
"""

from __future__ import annotations

import numpy as np

from .compiling import compiled, inlined
from .curved_surfaces import crossings, curved_normal
from .photon_scene import DIELECTRIC, GRATING
from .vectors import cross, dot, moved

SLACK = 1e-10
"""Barycentric: facets that share an edge overlap by this much, so that no ray slips between them."""
STACK_SIZE = 64
_LEANING = 0.9
"""Surfaces in contact whose normals' cosine is less meet in an edge and are two."""
_GRAZING = 0.1
"""Rays that graze a surface in contact more than this (cosine) are met as if they did not."""


@compiled
def _enter(bounds, node, o, inverse, far, behind):
    """Distance at which the ray enters a node's box, or infinity; boxes up to `behind` its start count."""
    low, high = -np.inf, np.inf
    for k in range(3):
        a, b = (bounds[node, k] - o[k]) * inverse[k], (bounds[node, k + 3] - o[k]) * inverse[k]
        low, high = max(low, min(a, b)), min(high, max(a, b))
    slack = 1e-14 * (abs(low) + abs(high))
    if low <= high + slack and high >= -slack - behind and low <= far + slack:
        return low
    return np.inf


@compiled
def _one_over(component):
    return 1.0 / component if abs(component) > 1e-200 else 1e200


@inlined
def _inverse(d):
    return _one_over(d[0]), _one_over(d[1]), _one_over(d[2])


@inlined
def _meets(scene, i, o, d):
    """(whether the ray's line meets facet i, distance, u, v, which way it crosses: > 0 outwards); Möller and Trumbore
    1997."""
    corners = scene.corners
    edge = corners[i, 3], corners[i, 4], corners[i, 5]
    other = corners[i, 6], corners[i, 7], corners[i, 8]
    p = cross(d, other)
    determinant = dot(edge, p)
    if determinant == 0.0:
        return False, 0.0, 0.0, 0.0, 0.0
    inverse = 1.0 / determinant
    s = o[0] - corners[i, 0], o[1] - corners[i, 1], o[2] - corners[i, 2]
    u = dot(s, p) * inverse
    if not -SLACK <= u <= 1.0 + SLACK:
        return False, 0.0, 0.0, 0.0, 0.0
    q = cross(s, edge)
    v = dot(d, q) * inverse
    if not (v >= -SLACK and u + v <= 1.0 + SLACK):
        return False, 0.0, 0.0, 0.0, 0.0
    return True, dot(other, q) * inverse, u, v, -determinant


@compiled
def _crossed_already(bit, mask, facing):
    """Whether a photon inside the solids of `mask` has this surface behind it."""
    inside = (mask >> np.uint64(bit)) & np.uint64(1)
    return (inside == np.uint64(1)) == (facing < 0.0)


@inlined
def normal_at(scene, i, place):
    """Unit outward normal of facet or curved surface i at a place on it."""
    row = scene.curved[i]
    if row >= 0:
        return curved_normal(scene.forms[row], place)
    return scene.normals[i, 0], scene.normals[i, 1], scene.normals[i, 2]


@inlined
def _steepness(scene, i, t, o, d):
    """Way along the normal of surface i to each unit of the ray's, where it meets that at distance t."""
    return abs(dot(d, normal_at(scene, i, moved(o, t, d))))


@inlined
def _behind(scene, i, t, o, d, last):
    """Whether a sheet's surface i, at distance t, is one interface with surface `last`, which the ray has left."""
    n = normal_at(scene, i, moved(o, t, d))
    if abs(dot(n, normal_at(scene, last, o))) <= _LEANING:
        return False
    height = t * abs(dot(d, n))
    return height <= (scene.contact if scene.kind[scene.owner[i]] >= GRATING else scene.near)


@inlined
def _met(scene, i, last, o, d):
    """Where a ray's line crosses surface i: (how often, distances (4), which way (4): > 0 outwards, u, v). A facet that
    the ray starts on it does not cross."""
    row = scene.curved[i]
    if row >= 0:
        count, t, facing = crossings(scene.forms[row], o, d)
        return count, t, facing, 0.0, 0.0
    hit, t, u, v, facing = _meets(scene, i, o, d)
    return 1 if hit and i != last else 0, (t, 0.0, 0.0, 0.0), (facing, 0.0, 0.0, 0.0), u, v


@compiled
def nearest(scene, o, d, last, within, mask, scratch):
    """(distance, triangle or curved surface, u, v) of the nearest surface along `d` from `o`; −1: none.

    `last`: surface that the ray starts on (−1: none), `within`: on its inner side; `mask`: solids it is inside of.
    """
    stack, stack_distance, inverse = scratch.stack, scratch.stack_distance, _inverse(d)
    last_object = scene.owner[last] if last >= 0 else -1
    best_key, best, best_triangle, best_u, best_v = np.inf, np.inf, -1, 0.0, 0.0
    near, behind = scene.near, 2.0 * scene.contact / _GRAZING
    # Of two surfaces at one place the one that is entered comes first: no film of air between solids.
    nested = scene.stack[0] >= 0
    node = 0
    top = 0
    while True:
        if scene.node_count[node] > 0:
            first = scene.node_first[node]
            for i in range(first, first + scene.node_count[node]):
                count, ways, facings, u, v = _met(scene, i, last, o, d)
                owner = scene.owner[i]
                sheet = scene.kind[owner] != DIELECTRIC
                for k in range(count):
                    t, facing = ways[k], facings[k]
                    key = t + near if nested and facing > 0.0 else t
                    if sheet:  # `contact` is meant along its normal
                        key = t - scene.contact / max(_steepness(scene, i, t, o, d), _GRAZING)
                    # Rays from a lamp or a camera on a surface leave it, unless it is glass that they enter.
                    if last_object < 0 and abs(t) <= near and (sheet or facing > 0.0):
                        continue
                    at_once = best_triangle >= 0 and abs(key - best_key) < near and owner != scene.owner[best_triangle]
                    if sheet and at_once:
                        if owner > scene.owner[best_triangle]:
                            continue
                    elif key >= best_key:
                        continue
                    if owner == last_object:
                        if t <= -near or (t < near and (t <= 0.0 or within == (facing < 0.0))):
                            continue
                    elif sheet:
                        if t <= -near or (last >= 0 and _behind(scene, i, t, o, d, last)):
                            continue
                    elif scene.bit[owner] >= 0:
                        if t <= -behind or (
                            (t < near or t * _steepness(scene, i, t, o, d) < 2.0 * scene.contact)
                            and _crossed_already(scene.bit[owner], mask, facing)
                        ):
                            continue
                    elif t <= -near:
                        continue
                    best_key, best, best_triangle, best_u, best_v = key, t, i, u, v
        else:
            left = scene.node_first[node]
            far = best_key + behind + near
            a = _enter(scene.node_bounds, left, o, inverse, far, behind)
            b = _enter(scene.node_bounds, left + 1, o, inverse, far, behind)
            if a < np.inf or b < np.inf:
                nearer = left if a <= b else left + 1
                if a < np.inf and b < np.inf:
                    stack[top] = 2 * left + 1 - nearer
                    stack_distance[top] = max(a, b)
                    top += 1
                node = nearer
                continue
        node = -1
        while top > 0:
            top -= 1
            if stack_distance[top] <= best_key + behind + near:
                node = stack[top]
                break
        if node < 0:
            return best, best_triangle, best_u, best_v


@compiled
def blocked(scene, o, d, far, last, stack):
    """Whether any surface but the place on `last` is between the start and `far`."""
    inverse = _inverse(d)
    node = 0
    top = 0
    while True:
        if scene.node_count[node] > 0:
            first = scene.node_first[node]
            for i in range(first, first + scene.node_count[node]):
                count, ways, _, _, _ = _met(scene, i, last, o, d)
                for k in range(count):
                    if scene.near < ways[k] < far:
                        return True
        else:
            left = scene.node_first[node]
            if _enter(scene.node_bounds, left, o, inverse, far, 0.0) < np.inf:
                stack[top] = left
                top += 1
            if _enter(scene.node_bounds, left + 1, o, inverse, far, 0.0) < np.inf:
                stack[top] = left + 1
                top += 1
        if top == 0:
            return False
        top -= 1
        node = stack[top]
