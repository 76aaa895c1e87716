"""Three numbers as a vector, compiled: tuples or rows of an array."""

from __future__ import annotations

import math

from .compiling import compiled, inlined


@inlined
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def length(a):
    """Euclidean length."""
    return math.sqrt(dot(a, a))


@inlined
def over(a, number):
    """A vector divided by a number."""
    return a[0] / number, a[1] / number, a[2] / number


@inlined
def scaled(a, number):
    """A vector times a number."""
    return a[0] * number, a[1] * number, a[2] * number


@inlined
def negated(a):
    """The opposite vector."""
    return -a[0], -a[1], -a[2]


@inlined
def minus(a, b):
    """Difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def moved(a, t, b):
    """a + t b."""
    return a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]


@inlined
def mixed_of(s, a, t, b):
    """s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@inlined
def combined(a, u, b, v, c, w):
    """a u + b v + c w: a vector of the components a, b, c along three others."""
    return (
        a * u[0] + b * v[0] + c * w[0],
        a * u[1] + b * v[1] + c * w[1],
        a * u[2] + b * v[2] + c * w[2],
    )


@compiled
def across(d):
    """A unit vector across a direction."""
    if abs(d[0]) < 0.5:
        side = (0.0, -d[2], d[1])
    else:
        side = (d[2], 0.0, -d[0])
    return over(side, length(side))


@inlined
def angle_between(d, axis):
    """Angle between a direction and an axis (unit vectors), rad; exact near 0 too."""
    return math.atan2(length(cross(d, axis)), dot(d, axis))
