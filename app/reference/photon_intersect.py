"""Rays against triangles and curved surfaces in float64, compiled: the reference renderer's own walk through the tree.

The side of a surface a photon is on decides near the place it left, not an offset: on the object
just left only the opposite crossing can be true, and of two touching solids the photon's own
record of what it is inside of says which surface it has crossed already. What is no glass and touches
something is one interface with it, and comes first: silver, black and paint are met from within glass as from outside.
"""

from __future__ import annotations

import numpy as np

from .compiling import compiled, inlined
from .curved_surfaces import crossings, curved_normal
from .photon_scene import DIELECTRIC, GRATING

SLACK = 1e-10
"""Barycentric: facets that share an edge overlap by this much, so that no ray slips between them."""
STACK_SIZE = 64
_LEANING = 0.9
"""Surfaces in contact whose normals' cosine is less meet in an edge and are two."""
_GRAZING = 0.1
"""Rays that graze a surface in contact more than this (cosine) are met as if they did not."""


@compiled
def _enter(bounds, node, ox, oy, oz, ix, iy, iz, far, behind):
    """Distance at which the ray enters a node's box, or infinity; boxes up to `behind` its start count."""
    a = (bounds[node, 0] - ox) * ix
    b = (bounds[node, 3] - ox) * ix
    low = min(a, b)
    high = max(a, b)
    a = (bounds[node, 1] - oy) * iy
    b = (bounds[node, 4] - oy) * iy
    low = max(low, min(a, b))
    high = min(high, max(a, b))
    a = (bounds[node, 2] - oz) * iz
    b = (bounds[node, 5] - oz) * iz
    low = max(low, min(a, b))
    high = min(high, max(a, b))
    slack = 1e-14 * (abs(low) + abs(high))
    if low <= high + slack and high >= -slack - behind and low <= far + slack:
        return low
    return np.inf


@compiled
def _inverse(component):
    return 1.0 / component if abs(component) > 1e-200 else 1e200


@inlined
def _meets(scene, i, ox, oy, oz, dx, dy, dz):
    """(whether the ray's line meets facet i, distance, u, v, which way it crosses: > 0 outwards); Möller and Trumbore
    1997."""
    e1x, e1y, e1z = scene.corners[i, 3], scene.corners[i, 4], scene.corners[i, 5]
    e2x, e2y, e2z = scene.corners[i, 6], scene.corners[i, 7], scene.corners[i, 8]
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    determinant = e1x * px + e1y * py + e1z * pz
    if determinant == 0.0:
        return False, 0.0, 0.0, 0.0, 0.0
    inverse = 1.0 / determinant
    sx, sy, sz = ox - scene.corners[i, 0], oy - scene.corners[i, 1], oz - scene.corners[i, 2]
    u = (sx * px + sy * py + sz * pz) * inverse
    if not -SLACK <= u <= 1.0 + SLACK:
        return False, 0.0, 0.0, 0.0, 0.0
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) * inverse
    if not (v >= -SLACK and u + v <= 1.0 + SLACK):
        return False, 0.0, 0.0, 0.0, 0.0
    return True, (e2x * qx + e2y * qy + e2z * qz) * inverse, u, v, -determinant


@compiled
def _crossed_already(bit, mask, facing):
    """Whether a photon inside the solids of `mask` has this surface behind it."""
    inside = (mask >> np.uint64(bit)) & np.uint64(1)
    return (inside == np.uint64(1)) == (facing < 0.0)


@inlined
def normal_at(scene, i, x, y, z):
    """Unit outward normal of facet or curved surface i, which holds the place."""
    row = scene.curved[i]
    if row >= 0:
        return curved_normal(scene.forms[row], x, y, z)
    return scene.normals[i, 0], scene.normals[i, 1], scene.normals[i, 2]


@inlined
def _steepness(scene, i, t, ox, oy, oz, dx, dy, dz):
    """Way along the normal of surface i to each unit of the ray's, where it meets that at distance t."""
    nx, ny, nz = normal_at(scene, i, ox + t * dx, oy + t * dy, oz + t * dz)
    return abs(dx * nx + dy * ny + dz * nz)


@inlined
def _behind(scene, i, t, ox, oy, oz, dx, dy, dz, last):
    """Whether a sheet's surface i, at distance t, is one interface with surface `last`, which the ray has left."""
    nx, ny, nz = normal_at(scene, i, ox + t * dx, oy + t * dy, oz + t * dz)
    mx, my, mz = normal_at(scene, last, ox, oy, oz)
    if abs(nx * mx + ny * my + nz * mz) <= _LEANING:
        return False
    height = t * abs(dx * nx + dy * ny + dz * nz)
    return height <= (scene.contact if scene.kind[scene.owner[i]] >= GRATING else scene.near)


@inlined
def _met(scene, i, last, ox, oy, oz, dx, dy, dz):
    """Where a ray's line crosses surface i: (how often, distances (4), which way (4): > 0 outwards, u, v). A facet that
    the ray starts on it does not cross."""
    row = scene.curved[i]
    if row >= 0:
        count, t, facing = crossings(scene.forms[row], ox, oy, oz, dx, dy, dz)
        return count, t, facing, 0.0, 0.0
    hit, t, u, v, facing = _meets(scene, i, ox, oy, oz, dx, dy, dz)
    return 1 if hit and i != last else 0, (t, 0.0, 0.0, 0.0), (facing, 0.0, 0.0, 0.0), u, v


@compiled
def nearest(scene, ox, oy, oz, dx, dy, dz, last, last_object, within, mask, stack, stack_distance):
    """(distance, triangle or curved surface, u, v) of the nearest surface; −1: none.

    `last`, `last_object`: surface and object the ray starts on (−1: none), `within`: on its inner
    side; `mask`: solids it is inside of; `stack`, `stack_distance`: scratch (STACK_SIZE,).
    """
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
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
                count, ways, facings, u, v = _met(scene, i, last, ox, oy, oz, dx, dy, dz)
                owner = scene.owner[i]
                sheet = scene.kind[owner] != DIELECTRIC
                for k in range(count):
                    t, facing = ways[k], facings[k]
                    key = t + near if nested and facing > 0.0 else t
                    if sheet:  # `contact` is meant along its normal
                        key = t - scene.contact / max(_steepness(scene, i, t, ox, oy, oz, dx, dy, dz), _GRAZING)
                    # Rays from a lamp or a camera that lies on a surface leave it, unless it is glass that they enter.
                    if last_object < 0 and abs(t) <= near and (sheet or facing > 0.0):
                        continue
                    beside = best_triangle >= 0 and abs(key - best_key) < near and owner != scene.owner[best_triangle]
                    if sheet and beside:
                        if owner > scene.owner[best_triangle]:
                            continue
                    elif key >= best_key:
                        continue
                    if owner == last_object:
                        if t <= -near or (t < near and (t <= 0.0 or within == (facing < 0.0))):
                            continue
                    elif sheet:
                        if t <= -near or (last >= 0 and _behind(scene, i, t, ox, oy, oz, dx, dy, dz, last)):
                            continue
                    elif scene.bit[owner] >= 0:
                        if t <= -behind or (
                            (t < near or t * _steepness(scene, i, t, ox, oy, oz, dx, dy, dz) < 2.0 * scene.contact)
                            and _crossed_already(scene.bit[owner], mask, facing)
                        ):
                            continue
                    elif t <= -near:
                        continue
                    best_key, best, best_triangle, best_u, best_v = key, t, i, u, v
        else:
            left = scene.node_first[node]
            far = best_key + behind + near
            a = _enter(scene.node_bounds, left, ox, oy, oz, ix, iy, iz, far, behind)
            b = _enter(scene.node_bounds, left + 1, ox, oy, oz, ix, iy, iz, far, behind)
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
def blocked(scene, ox, oy, oz, dx, dy, dz, far, last, stack):
    """Whether any surface but the place on `last` lies between the start and `far`."""
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    node = 0
    top = 0
    while True:
        if scene.node_count[node] > 0:
            first = scene.node_first[node]
            for i in range(first, first + scene.node_count[node]):
                count, ways, _, _, _ = _met(scene, i, last, ox, oy, oz, dx, dy, dz)
                for k in range(count):
                    if scene.near < ways[k] < far:
                        return True
        else:
            left = scene.node_first[node]
            if _enter(scene.node_bounds, left, ox, oy, oz, ix, iy, iz, far, 0.0) < np.inf:
                stack[top] = left
                top += 1
            if _enter(scene.node_bounds, left + 1, ox, oy, oz, ix, iy, iz, far, 0.0) < np.inf:
                stack[top] = left + 1
                top += 1
        if top == 0:
            return False
        top -= 1
        node = stack[top]
