"""Where rays meet curved surfaces, and the normals there, in closed form and compiled: no triangle, no interpolation.

Two kinds do for every shape that the reference knows exactly. A quadric of revolution,
a (x² + y²) + b z² + c z + d = 0, is a sphere, the conic cap of a lens, a cylinder, a cone or a plane; in stretched axes
an ellipsoid. A torus is a quartic, whose roots are enclosed between the extrema of its polynomial. Inside, f < 0.
"""

from __future__ import annotations

import math

from .compiling import compiled, inlined
from .scene_surfaces import COEFFICIENTS, KIND, OUTWARD, RANGE, SHEET, TORUS, TURNS
from .vectors import length, mixed_of, over

_STEPS = 100
"""Most steps of a safeguarded Newton iteration; halving alone needs about 60."""


@inlined
def local_point(form, place):
    """A place in the surface's own frame."""
    return (
        form[0] * place[0] + form[1] * place[1] + form[2] * place[2] + form[3],
        form[4] * place[0] + form[5] * place[1] + form[6] * place[2] + form[7],
        form[8] * place[0] + form[9] * place[1] + form[10] * place[2] + form[11],
    )


@inlined
def _turned_back(form, g):
    """Unit vector along the gradient whose local components are `g`, in the reference's frame."""
    n = (
        form[0] * g[0] + form[4] * g[1] + form[8] * g[2],
        form[1] * g[0] + form[5] * g[1] + form[9] * g[2],
        form[2] * g[0] + form[6] * g[1] + form[10] * g[2],
    )
    size = length(n)
    return over(n, size) if size > 0.0 else (0.0, 0.0, 1.0)


@compiled
def curved_normal(form, place):
    """Unit outward normal at a place of the surface."""
    px, py, pz = local_point(form, place)
    out = form[OUTWARD]
    if form[KIND] == TORUS:
        large = form[COEFFICIENTS]
        radius = math.sqrt(px * px + py * py)
        share = 1.0 - large / radius if radius > 0.0 else 0.0
        return _turned_back(form, (out * share * px, out * share * py, out * pz))
    a, b, c = form[COEFFICIENTS], form[COEFFICIENTS + 1], form[COEFFICIENTS + 2]
    return _turned_back(form, (out * 2.0 * a * px, out * 2.0 * a * py, out * (2.0 * b * pz + c)))


@compiled
def turned_normal(form, place):
    """Unit outward normal between those of a profile's ends; the surface's own where they do not turn."""
    if form[TURNS] == 0.0:
        return curved_normal(form, place)
    px, py, pz = local_point(form, place)
    radius = math.sqrt(px * px + py * py)
    w = form[29] + form[30] * radius + form[31] * pz
    w = min(max(w, 0.0), 1.0)
    if radius > 0.0:
        px, py = px / radius, py / radius
    # Unit vectors where the object is, and then between them: as a mesh's corners have it, also of a stretched one.
    a = _turned_back(form, (form[25] * px, form[25] * py, form[26]))
    b = _turned_back(form, (form[27] * px, form[27] * py, form[28]))
    n = mixed_of(1.0 - w, a, w, b)
    return over(n, length(n))


@inlined
def _is_there(form, x, y, z):
    r2 = x * x + y * y
    return (
        form[RANGE] <= z <= form[RANGE + 1]
        and form[RANGE + 2] <= r2 <= form[RANGE + 3]
        and form[SHEET] + form[SHEET + 1] * z >= 0.0
    )


@compiled
def crossings(form, o, d):
    """(how many, their distances (4), which way each crosses (4): > 0 outwards) of a ray's whole line; in no order."""
    px, py, pz = local_point(form, o)
    qx = form[0] * d[0] + form[1] * d[1] + form[2] * d[2]
    qy = form[4] * d[0] + form[5] * d[1] + form[6] * d[2]
    qz = form[8] * d[0] + form[9] * d[1] + form[10] * d[2]
    if form[KIND] == TORUS:
        return _torus(form, px, py, pz, qx, qy, qz)
    return _quadric(form, px, py, pz, qx, qy, qz)


@inlined
def _quadric(form, px, py, pz, qx, qy, qz):
    a, b = form[COEFFICIENTS], form[COEFFICIENTS + 1]
    c, d = form[COEFFICIENTS + 2], form[COEFFICIENTS + 3]
    # From the place nearest the middle, where least is lost to cancellation.
    start = -(px * qx + py * qy + pz * qz) / (qx * qx + qy * qy + qz * qz)
    px, py, pz = px + start * qx, py + start * qy, pz + start * qz
    second = a * (qx * qx + qy * qy) + b * qz * qz
    half = a * (px * qx + py * qy) + (b * pz + 0.5 * c) * qz
    first = a * (px * px + py * py) + (b * pz + c) * pz + d
    count, t0, t1, f0, f1 = 0, 0.0, 0.0, 0.0, 0.0
    square = half * half - second * first
    if square > 0.0:
        root = math.sqrt(square)
        if half < 0.0:
            root = -root
        q = -(half + root)
        far, near = q / second if second != 0.0 else math.inf, first / q
        # Half the polynomial's slope is second · t + half, at the roots ∓ root.
        if abs(far) < math.inf and _is_there(form, px + far * qx, py + far * qy, pz + far * qz):
            count, t0, f0 = 1, start + far, -root * form[OUTWARD]
        if _is_there(form, px + near * qx, py + near * qy, pz + near * qz):
            if count == 0:
                t0, f0 = start + near, root * form[OUTWARD]
            else:
                t1, f1 = start + near, root * form[OUTWARD]
            count += 1
    return count, (t0, t1, 0.0, 0.0), (f0, f1, 0.0, 0.0)


@inlined
def _quartic(t, c2, c1, c0):
    return ((t * t + c2) * t + c1) * t + c0


@inlined
def _cubic(t, c2, c1):
    return (4.0 * t * t + 2.0 * c2) * t + c1


@compiled
def _bracketed(low, high, c2, c1, c0, is_slope):
    """The one zero of the quartic, or of its slope where `is_slope`, between two places where its signs differ; `high`
    where they do not. Newton's iteration, halved where it leaves its bracket."""
    is_low = (_cubic(low, c2, c1) if is_slope else _quartic(low, c2, c1, c0)) < 0.0
    if is_slope and is_low == (_cubic(high, c2, c1) < 0.0):
        return high
    left, right, t, last = low, high, 0.5 * (low + high), math.inf
    for _ in range(_STEPS):
        value = _cubic(t, c2, c1) if is_slope else _quartic(t, c2, c1, c0)
        if (value < 0.0) == is_low:
            left = t
        else:
            right = t
        slope = 12.0 * t * t + 2.0 * c2 if is_slope else _cubic(t, c2, c1)
        step = t - value / slope if slope != 0.0 else left
        step = step if left < step < right else 0.5 * (left + right)
        if abs(step - t) <= 1e-16 or step == last:
            break
        t, last = step, t
    return t


@inlined
def _torus(form, px, py, pz, qx, qy, qz):
    """As a depressed quartic about the ray's nearest place, in units of the torus's own size."""
    size = form[COEFFICIENTS] + form[COEFFICIENTS + 1]
    large, small = form[COEFFICIENTS] / size, form[COEFFICIENTS + 1] / size
    speed = math.sqrt(qx * qx + qy * qy + qz * qz)
    qx, qy, qz = qx / speed, qy / speed, qz / speed
    px, py, pz = px / size, py / size, pz / size
    start = -(px * qx + py * qy + pz * qz)
    px, py, pz = px + start * qx, py + start * qy, pz + start * qz
    away = px * px + py * py + pz * pz
    reach = 1.0 - away
    count, t0, t1, t2, t3, f0, f1, f2, f3 = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if reach > 0.0:
        end = math.sqrt(reach) + 1e-9
        k = away + large * large - small * small
        four = 4.0 * large * large
        c2 = 2.0 * k - four * (qx * qx + qy * qy)
        c1 = -2.0 * four * (px * qx + py * qy)
        c0 = k * k - four * (px * px + py * py)
        bend = math.sqrt(-c2 / 6.0) if c2 < 0.0 else 0.0
        bend = min(bend, end)
        e1 = _bracketed(-end, -bend, c2, c1, c0, True)
        e2 = _bracketed(-bend, bend, c2, c1, c0, True)
        e3 = _bracketed(bend, end, c2, c1, c0, True)
        low = -end
        for high in (e1, e2, e3, end):
            falls = _quartic(low, c2, c1, c0) >= 0.0
            if falls != (_quartic(high, c2, c1, c0) >= 0.0):
                t = (start + _bracketed(low, high, c2, c1, c0, False)) * size / speed
                f = -form[OUTWARD] if falls else form[OUTWARD]
                # Those found before move up by one.
                t0, t1, t2, t3 = t, t0, t1, t2
                f0, f1, f2, f3 = f, f0, f1, f2
                count += 1
            low = high
    return count, (t0, t1, t2, t3), (f0, f1, f2, f3)
