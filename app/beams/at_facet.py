"""A beam that arrives at a flat facet: it is cut in two if its rays vary too much, else reflected and refracted."""

from __future__ import annotations

import numpy as np

from .compiling import part
from .current import ALL, CURRENT, FAINT, LAY, SOME, UNKNOWN, distance_at, halve, may_bend, push_both
from .facets import MAX_CORNERS
from .leaves import passes
from .nodes import (
    LEVELS,
    TOTAL,
    copy,
    copy_head,
    copy_outline,
    cut,
    first_place,
    forget_idle_lines,
    go_through,
    last_place,
    lay_out,
)
from .rays import PARALLEL, PASS, REFLECT, REFRACT, at_x, follow, index_of, total_line, transmitted
from .search import (
    LEAF_TAIL,
    SUM_ABSORBED,
    SUM_BEAMS,
    SUM_DEPTH,
    SUM_ROULETTE,
    drifts,
    facing,
    flux_as,
    flux_of,
    halve_space,
    is_curved,
    medium,
    mixed,
    power_as,
    recentre,
    unit,
)

_GRAZING = 1e-9
"""Squared cosines of transmission smaller than this may have either sign: total reflection is just setting in."""
_FADES = 0.3
"""Least over greatest share of light that passes a facet within a band: below, rays that diverge are far from affine
there, and from one place of the band to the next. The share rises as the root of the way from the onset."""


@part
def at_facet(nodes, facets, solids, tables, sources, work):
    """Process the current beam at its facet: cut it in two if necessary, or push its children."""
    beam, source, is_parallel = nodes[CURRENT], sources[0], sources[0].kind == PARALLEL
    facet = facets[beam.facet]
    if beam.total == LAY:
        recentre(beam)
        if not is_parallel or work.absorbing:
            if not lay_out(beam, facets, solids, tables, source, work):
                return
            recentre(beam)
        beam.total = UNKNOWN
    if facet.kind == 2:
        work.sums[SUM_ABSORBED] += flux_of(beam, tables, work)
        return
    power = power_as(beam, beam, tables, work)
    if power > FAINT * work.threshold and drifts(beam, power, work):
        halve(nodes, 0.5 * (beam.x[0] + beam.x[2]), facets, solids, tables, sources, work)
        return
    if not is_parallel and beam.bend >= 0.0:
        bend = is_curved(beam, facets, solids, tables, source, work.tolerance, work)
        if power > FAINT * work.threshold and bend > may_bend(power, work):
            low, high = halve_space(beam, nodes[work.top], work)
            beam.total = nodes[work.top].total = LAY
            push_both(nodes, low, high, work)
            return
        beam.bend = -1.0 if bend < 0.01 else bend
    before = after = -1
    mask = beam.mask
    same = False
    here = medium(solids, beam.mask)
    passed = 1.0
    if work.absorbing:
        distance, _ = distance_at(beam, beam, facet)
        passed = passes(solids, tables, here, beam.x[1], distance)
    if facet.kind == 1:
        passed *= at_x(tables, solids[facet.owner].tint, beam.x[1])
    if facet.kind == 0:
        mask ^= np.int64(1) << solids[facet.owner].bit
        behind = medium(solids, mask)
        # The medium stays the same, since an overlapping solid of higher priority determines it.
        same = here == behind
        before = solids[here].glass if here >= 0 else -1
        after = solids[behind].glass if behind >= 0 else -1
        unknown = not same and beam.total == UNKNOWN
        if unknown and total_from(nodes, before, after, facets, solids, tables, sources, work):
            return
    for turn in range(2):
        # A single call of `child` for all cases, since `child` is long and might be compiled into each call.
        action = PASS if same else (REFRACT if turn == 0 else REFLECT)
        if action == REFRACT and (facet.kind == 1 or beam.total == ALL):
            continue
        behind = beam.mask if action == REFLECT else mask
        if child(nodes, action, before, after, behind, not is_parallel, facets, solids, tables, work):
            beam.ends = LEAF_TAIL
            push_both(nodes, True, False, work)
            return
        if same:
            break
    work.sums[SUM_ABSORBED] += (1.0 - passed) * flux_of(beam, tables, work)


@part
def onset(beam, facets, solids, tables, source, before, after, low, high, work):
    """x between `low` and `high` at which total reflection sets in at the current beam's facet, by bisection."""
    position, direction = work.rays[0], work.rays[1]
    is_low = False
    for turn in range(45):
        x = low if turn == 0 else 0.5 * (low + high)
        u, v = beam.centre[0], beam.centre[1]
        follow(source, facets, solids, tables, beam.path, beam.flight, x, u, v, position, direction, work.state)
        cosine = facing(facets[beam.facet], direction)
        is_total = transmitted(cosine, index_of(tables, before, x) / index_of(tables, after, x)) <= 0.0
        if turn == 0:
            is_low = is_total
        elif is_total == is_low:
            low = x
        else:
            high = x
    return 0.5 * (low + high)


@part
def total_from(nodes, before, after, facets, solids, tables, sources, work):
    """Set `total`, whether the current beam is totally reflected at its facet. Where that changes within its band or
    its outline, cut the beam there instead, leave both parts on the stack and return True."""
    beam, source = nodes[CURRENT], sources[0]
    facet = facets[beam.facet]
    last, most, side = 0.0, -1e300, 0
    for a in range(first_place(beam), last_place(beam)):
        eta = index_of(tables, before, beam.x[a]) / index_of(tables, after, beam.x[a])
        k = transmitted(facing(facet, beam.direction[a]), eta)
        if (last > _GRAZING and k < -_GRAZING) or (last < -_GRAZING and k > _GRAZING):
            # It changed since `side`, the last place that was not itself at the onset.
            x = onset(beam, facets, solids, tables, source, before, after, beam.x[side], beam.x[a], work)
            halve(nodes, x, facets, solids, tables, sources, work)
            return True
        if abs(k) > _GRAZING:
            last, side = k, a
        most = max(most, k)
    total = SOME if most > 0.0 else ALL
    if source.kind == PARALLEL:
        beam.total = total
        return False
    least, most = 1e300, -1e300
    flight, lines = beam.flight, work.lines[MAX_CORNERS]
    beam.path[flight, 2], beam.path[flight, 3] = before, after
    for a in range(first_place(beam), last_place(beam)):
        total_line(facet, tables, before, after, beam.x[a], beam.direction[a], beam.centre[0], beam.centre[1], lines[a])
        for c in range(beam.corners[a]):
            value = lines[a, 0] + lines[a, 1] * beam.corner[a, c, 0] + lines[a, 2] * beam.corner[a, c, 1]
            least, most = min(least, value), max(most, value)
    if not (least < -_GRAZING and most > _GRAZING):
        beam.total = total
        return False
    copy(beam, nodes[work.top])
    number = beam.facet
    low, high, onset_edge, way = number < 0, number < 0, np.int64(TOTAL), np.int64(1)
    for turn in range(2):
        half = nodes[CURRENT if turn == 0 else work.top]
        exists = cut(half, lines, 1.0 - 2.0 * turn, flight, number, onset_edge, way, work)
        forget_idle_lines(half, work)
        recentre(half)
        half.key = mixed(half.key, 16 - turn)
        lay_out(half, facets, solids, tables, source, work)
        half.total = SOME if turn == 0 else ALL
        if turn == 0:
            low = exists
        else:
            high = exists
    push_both(nodes, low, high, work)
    return True


@part
def child(nodes, action, before, after, mask, diverges, facets, solids, tables, work):
    """Push the current beam's child that takes `action` at the facet, unless it is too deep or roulette ends it.
    Returns whether photons must take the beam itself to the facet instead: what refracts would be left to them, and
    next to the onset of total reflection its rays (which may all be behind it at a place of the band) say too little
    of where they go."""
    beam, new = nodes[CURRENT], nodes[work.top]
    flight = beam.flight
    depth = beam.depth + (0 if action == PASS else 1)
    copy_head(beam, new)
    row, inside = new.path[flight], medium(solids, beam.mask)
    row[0], row[1], row[2], row[3] = beam.facet, action, before, after
    row[4] = solids[inside].tint if inside >= 0 else -1
    least, most = 1e300, 0.0
    for a in range(first_place(beam), last_place(beam)):
        share = go_through(new, a, flight, facets, solids, tables)
        new.weight[a] *= share
        least, most = min(least, share), max(most, share)
    new.flight, new.depth, new.mask = flight + 1, depth, mask
    new.facet, new.total = -1, UNKNOWN
    new.key = mixed(beam.key, 3 + action)
    if depth > work.depth or flight >= LEVELS - 2:
        work.sums[SUM_DEPTH] += flux_as(beam, new, tables, work)
        return False
    power = power_as(beam, new, tables, work)
    if power <= 0.0:
        return False
    as_tail = power < work.threshold and work.faint > 0.0
    if as_tail and diverges and action == REFRACT and least <= _FADES * most and beam.depth > 0:
        return True
    limit = work.faint if as_tail else work.threshold
    if power < limit:
        chance = power / limit
        flux = flux_as(beam, new, tables, work)
        if unit(mixed(new.key ^ work.seed, np.int64(17))) >= chance:
            work.sums[SUM_ROULETTE] += flux
            return False
        new.boost /= chance
        work.sums[SUM_ROULETTE] -= flux * (1.0 / chance - 1.0)
    if as_tail:
        new.ends = LEAF_TAIL
    else:
        work.sums[SUM_BEAMS] += 1.0
    copy_outline(beam, new)
    work.top += 1
    return False
