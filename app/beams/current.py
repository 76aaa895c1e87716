"""The current beam, row CURRENT of the stack; what becomes of it is put on top."""

from __future__ import annotations

from .compiling import part
from .nodes import copy
from .search import halve_spectrum, place_of

CURRENT, SPARE = 0, 1
"""Rows of the stack: the current beam, and room to try a cut."""
FIRST = 2
DEAD = -3
"""Facet of an outline that is no longer."""
START = -3
LAY, UNKNOWN, SOME, ALL = -2, -1, 0, 1
"""States of a beam's `total`, whether its facet reflects everything; START: a source's whole light; LAY: rays are those
of a larger outline."""
FAINT = 0.03
"""Share of the threshold below which a beam is not halved, nor a polygon that misplaces less light."""
WEAKEST_BENT = 16.0
"""Tolerances that rays of a beam as weak as the threshold may miss the affine map by, before it is halved. Stronger
ones may miss it by as much less, down to one: what is misplaced counts by its light, and of slivers that are swept over
facets some is lost."""


@part
def may_bend(power, work):
    """Tolerances that rays of a beam with this power may miss the affine map by."""
    return max(WEAKEST_BENT * min(work.threshold / power, 1.0), 1.0)


@part
def push_both(nodes, low, high, work):
    """Leave on the stack what is left of the current beam and of that at the top."""
    if high:
        work.top += 1
    if low:
        copy(nodes[CURRENT], nodes[work.top])
        work.top += 1


@part
def halve(nodes, x, facets, solids, tables, sources, work):
    """Cut the current beam at x and leave both on the stack."""
    low, high = halve_spectrum(nodes[CURRENT], nodes[work.top], x, facets, solids, tables, sources[0], work)
    push_both(nodes, low, high, work)


@part
def distance_at(current, beam, facet):
    """Distance along the current beam's ray of an outline's centre to a facet's plane, at the place where the outline
    exists; and its cosine."""
    a = place_of(beam)
    u, v = beam.centre[0] - current.centre[0], beam.centre[1] - current.centre[1]
    n, p, d = facet.plane, current.position, current.direction
    at = towards = 0.0
    for k in range(3):
        at += n[k] * (p[a, 0, k] + u * p[a, 1, k] + v * p[a, 2, k])
        towards += n[k] * (d[a, 0, k] + u * d[a, 1, k] + v * d[a, 2, k])
    if abs(towards) < 1e-14:
        return -1.0, 0.0
    return (n[3] - at) / towards, towards
