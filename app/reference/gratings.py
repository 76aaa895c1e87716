"""Gratings as the references know them: directions of orders and, of grooves with a profile, their shares.

Single facets bend rays here as any surface does, one after the other, and Bessel functions go down by their recurrence:
other ways than those of `model.optics.gratings` and of the shaders.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.scene import Grating, Scene
from .compiling import compiled, inlined
from .vectors import combined, cross, dot, length, mixed_of, moved, negated, over

COLUMNS = 8
"""Of the table `orders`: order / line spacing in 1/µm, factor of its share, order, lines per µm, profile, relief, index
of what is ruled (0: it reflects), one over the width that light covers in 1/µm."""
_SHIFT, _FACTOR, _ORDER, _LINES, _PROFILE, _RELIEF, _INDEX, _SPREAD = range(8)
_BLAZED, _LAMELLAR = 1, 2


def gratings(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`lines`, `first_order` and `orders` of a `PhotonScene`."""
    lines = np.zeros((len(scene.objects), 3))
    counts, orders = [0], [np.zeros((0, COLUMNS))]
    for index, item in enumerate(scene.objects):
        material = item.material
        counts.append(0)
        if isinstance(material, Grating):
            lines[index] = material.lines_in_world(item.object_to_world)
            rows = np.zeros((len(material.orders), COLUMNS))
            rows[:, _SHIFT], rows[:, _FACTOR] = material.shift_per_um, material.fixed_shares
            rows[:, _ORDER], rows[:, _LINES] = material.orders, 1e-3 * material.lines_per_mm
            rows[:, _PROFILE], rows[:, _RELIEF] = material.profile_code, material.relief
            rows[:, _INDEX], rows[:, _SPREAD] = material.relief_index, material.spread_per_um
            orders.append(rows)
            counts[-1] = len(rows)
    return lines, np.cumsum(counts).astype(np.int32), np.concatenate([*orders, np.zeros((1, COLUMNS))])


@inlined
def diffracted(d, n, lines, step, reflects):
    """(direction, whether it is real) of an order: `step` = m λ / (Λ n) across `lines`, along lines × n, is added
    to the direction's part in the surface; `n` is the outward normal."""
    a = cross(lines, n)
    size = length(a)
    theta = dot(d, n)
    t = (
        d[0] - theta * n[0] + step * a[0] / size,
        d[1] - theta * n[1] + step * a[1] / size,
        d[2] - theta * n[2] + step * a[2] / size,
    )
    cosine2 = 1.0 - dot(t, t)
    cosine = math.sqrt(max(cosine2, 0.0))
    if (theta < 0.0) != reflects:
        cosine = -cosine
    return moved(t, cosine, n), cosine2 > 0.0


@compiled
def _bent(d, m, eta):
    """Refracted at a face whose normal on this side is `m`; along the face where nothing would leave it."""
    cosine = -dot(d, m)
    cosine_t = math.sqrt(max(1.0 - eta * eta * (1.0 - cosine * cosine), 0.0))
    return mixed_of(eta, d, eta * cosine - cosine_t, m)


@compiled
def bessel(order, x):
    """J of a whole order >= 0 at x >= 0, by Miller's downward recurrence."""
    if x == 0.0:
        return 1.0 if order == 0 else 0.0
    start = 2 * ((max(order, int(x)) + 40) // 2)
    above, here, found, total = 0.0, 1e-300, 0.0, 0.0
    for k in range(start, 0, -1):
        above, here = here, 2.0 * k / x * here - above
        if abs(here) > 1e200:
            above, here, found, total = above * 1e-200, here * 1e-200, found * 1e-200, total * 1e-200
        if k - 1 == order:
            found = here
        if (k - 1) % 2 == 0:
            total += here if k == 1 else 2.0 * here
    return found / total


@compiled
def order_share(row, d, n, lines, index, nm):
    """Share of light that arrives along `d` in a medium of this index, in the order of this row of `orders`; `n`: the
    outward normal."""
    if row[_PROFILE] == 0.0:
        return row[_FACTOR]
    um, ruled, m = nm * 1e-3, row[_INDEX], row[_ORDER]
    theta = dot(d, n)
    if row[_PROFILE] == _BLAZED:
        a = cross(lines, n)
        a = over(a, length(a))
        facet = combined(math.sin(row[_RELIEF]), a, math.cos(row[_RELIEF]), n, 0.0, n)
        size = index
        if ruled == 0.0:
            r = moved(d, -2.0 * dot(d, facet), facet)
        elif theta < 0.0:
            r = _bent(_bent(d, n, index / ruled), facet, ruled / index)
        else:
            r, size = _bent(d, negated(facet), index / ruled), ruled
        x = math.pi * (m - (size * dot(r, a) - index * dot(d, a)) / (row[_LINES] * um))
        return row[_FACTOR] * (1.0 if abs(x) < 1e-9 else (math.sin(x) / x) ** 2)
    rise = index * abs(theta)
    if ruled == 0.0:
        fall = 2.0 * rise
    else:
        fall = math.sqrt(max(ruled * ruled - index * index + rise * rise, 0.0)) - rise
    phase = math.pi * row[_RELIEF] * fall / um
    if row[_PROFILE] == _LAMELLAR:
        if m == 0.0:
            return row[_FACTOR] * math.cos(phase) ** 2
        return row[_FACTOR] * (math.sin(phase) * (1.0 - math.cos(math.pi * m)) / (math.pi * m)) ** 2
    return row[_FACTOR] * bessel(abs(int(m)), abs(phase)) ** 2
