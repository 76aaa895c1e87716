"""A beam at its facet: halved where it has to be, or sent on reflected and refracted."""

from __future__ import annotations

import numpy as np

from .compiling import part
from .facets import MAX_CORNERS
from .hand import ALL, HAND, LAY, SOME, UNKNOWN, distance_at, faint_share, halve, push_both
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
    last_place,
    lay_out,
)
from .rays import PARALLEL, PASS, REFLECT, REFRACT, at_x, follow, index_of, meet, total_line, transmitted
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
"""Squared cosines below this may count as either side of total reflection."""

_DRIFTING = 0.03
"""Share of the threshold below which a beam is not halved for its outline's motion."""


@part
def at_facet(nodes, facets, solids, tables, sources, work):
    """The beam in hand meets its facet: halved where it has to be, or sent on."""
    hand, source, is_parallel = nodes[HAND], sources[0], sources[0].kind == PARALLEL
    facet = facets[hand.facet]
    if hand.total == LAY:
        recentre(hand)
        if not is_parallel or work.absorbing:
            if not lay_out(hand, facets, solids, tables, source, work):
                return
            recentre(hand)
        hand.total = UNKNOWN
    if facet.kind == 2:
        work.sums[SUM_ABSORBED] += flux_of(hand, tables, work)
        return
    power = power_as(hand, hand, tables, work)
    if power > _DRIFTING * work.threshold and drifts(hand, power, work):
        halve(nodes, 0.5 * (hand.x[0] + hand.x[2]), facets, solids, tables, sources, work)
        return
    if not is_parallel and hand.bend >= 0.0:
        bend = is_curved(hand, facets, solids, tables, source, work.tolerance, work)
        if bend > 1.0 and power_as(hand, hand, tables, work) > faint_share(work) * work.threshold:
            low, high = halve_space(hand, nodes[work.top], work)
            hand.total = nodes[work.top].total = LAY
            push_both(nodes, low, high, work)
            return
        hand.bend = -1.0 if bend < 0.01 else bend
    before = after = -1
    mask = hand.mask
    keeps = False
    one = medium(solids, hand.mask)
    kept = 1.0
    if work.absorbing:
        distance, _ = distance_at(hand, hand, facet)
        kept = passes(solids, tables, one, hand.x[1], distance)
    if facet.kind == 1:
        kept *= at_x(tables, solids[facet.owner].tint, hand.x[1])
    if facet.kind == 0:
        mask ^= np.int64(1) << solids[facet.owner].bit
        other = medium(solids, mask)
        # A facet that is left for the same medium as before, under a solid of higher priority.
        keeps = one == other
        before = solids[one].glass if one >= 0 else -1
        after = solids[other].glass if other >= 0 else -1
        unknown = not keeps and hand.total == UNKNOWN
        if unknown and total_from(nodes, before, after, facets, solids, tables, sources, work):
            return
    work.sums[SUM_ABSORBED] += (1.0 - kept) * flux_of(hand, tables, work)
    for turn in range(2):
        # One call of `child`, which is long, for all cases.
        action = PASS if keeps else (REFLECT if turn == 0 else REFRACT)
        if turn == 1 and (keeps or facet.kind == 1 or hand.total == ALL):
            break
        child(nodes, action, before, after, hand.mask if action == REFLECT else mask, facets, solids, tables, work)


@part
def onset(hand, facets, solids, tables, source, before, after, low, high, work):
    """x between two places at which the facet of the beam in hand begins to reflect everything."""
    position, direction = work.rays[0], work.rays[1]
    is_low = False
    for turn in range(45):
        x = low if turn == 0 else 0.5 * (low + high)
        u, v = hand.centre[0], hand.centre[1]
        follow(source, facets, solids, tables, hand.path, hand.flight, x, u, v, position, direction, work.state)
        cosine = facing(facets[hand.facet], direction)
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
    """Find out whether the facet of the beam in hand reflects everything; where that changes over its band or its
    outline, cut it, leave the parts on the stack and return True."""
    hand, source = nodes[HAND], sources[0]
    facet = facets[hand.facet]
    last, most, side = 0.0, -1e300, 0
    for a in range(first_place(hand), last_place(hand)):
        eta = index_of(tables, before, hand.x[a]) / index_of(tables, after, hand.x[a])
        k = transmitted(facing(facet, hand.direction[a]), eta)
        if (last > _GRAZING and k < -_GRAZING) or (last < -_GRAZING and k > _GRAZING):
            # Since the last place that is not at the onset itself.
            x = onset(hand, facets, solids, tables, source, before, after, hand.x[side], hand.x[a], work)
            halve(nodes, x, facets, solids, tables, sources, work)
            return True
        if abs(k) > _GRAZING:
            last, side = k, a
        most = max(most, k)
    total = SOME if most > 0.0 else ALL
    if source.kind == PARALLEL:
        hand.total = total
        return False
    least, most = 1e300, -1e300
    flight, lines = hand.flight, work.lines[MAX_CORNERS]
    hand.path[flight, 2], hand.path[flight, 3] = before, after
    for a in range(first_place(hand), last_place(hand)):
        total_line(facet, tables, before, after, hand.x[a], hand.direction[a], hand.centre[0], hand.centre[1], lines[a])
    for c in range(hand.corners[1]):
        value = lines[1, 0] + lines[1, 1] * hand.corner[1, c, 0] + lines[1, 2] * hand.corner[1, c, 1]
        least, most = min(least, value), max(most, value)
    if not (least < -_GRAZING and most > _GRAZING):
        hand.total = total
        return False
    copy(hand, nodes[work.top])
    number = hand.facet
    some, rest, onset_edge, way = number < 0, number < 0, np.int64(TOTAL), np.int64(1)
    for turn in range(2):
        part_of = nodes[HAND if turn == 0 else work.top]
        is_left = cut(part_of, lines, 1.0 - 2.0 * turn, flight, number, onset_edge, way, work)
        forget_idle_lines(part_of, work)
        recentre(part_of)
        part_of.key = mixed(part_of.key, 16 - turn)
        lay_out(part_of, facets, solids, tables, source, work)
        part_of.total = SOME if turn == 0 else ALL
        if turn == 0:
            some = is_left
        else:
            rest = is_left
    push_both(nodes, some, rest, work)
    return True


@part
def child(nodes, action, before, after, mask, facets, solids, tables, work):
    """Send the beam in hand on from its facet."""
    hand, new = nodes[HAND], nodes[work.top]
    flight = hand.flight
    depth = hand.depth + (0 if action == PASS else 1)
    copy_head(hand, new)
    row, inside = new.path[flight], medium(solids, hand.mask)
    row[0], row[1], row[2], row[3] = hand.facet, action, before, after
    row[4] = solids[inside].tint if inside >= 0 else -1
    for a in range(first_place(hand), last_place(hand)):
        new.weight[a] *= meet(
            facets, solids, tables, new.path, flight, new.x[a], new.position[a], new.direction[a], new.state[a]
        )
    new.flight, new.depth, new.mask = flight + 1, depth, mask
    new.facet, new.total = -1, UNKNOWN
    new.key = mixed(hand.key, 3 + action)
    if depth > work.depth or flight >= LEVELS - 2:
        work.sums[SUM_DEPTH] += flux_as(hand, new, tables, work)
        return
    power = power_as(hand, new, tables, work)
    if power <= 0.0:
        return
    hands_over = power < work.threshold and work.faint > 0.0
    limit = work.faint if hands_over else work.threshold
    if power < limit:
        chance = power / limit
        flux = flux_as(hand, new, tables, work)
        if unit(mixed(new.key ^ work.seed, np.int64(17))) >= chance:
            work.sums[SUM_ROULETTE] += flux
            return
        new.boost /= chance
        work.sums[SUM_ROULETTE] -= flux * (1.0 / chance - 1.0)
    if hands_over:
        new.ends = LEAF_TAIL
    else:
        work.sums[SUM_BEAMS] += 1.0
    copy_outline(hand, new)
    work.top += 1
