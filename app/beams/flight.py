"""The flight of a beam: cut into fragments by the facets ahead, each of what nearer ones leave of it."""

from __future__ import annotations

import numpy as np

from .compiling import part
from .current import CURRENT, DEAD, LAY, SPARE, distance_at, push_both
from .nodes import copy, cut, exists_throughout, first_place, forget_idle_lines, last_place
from .rays import PARALLEL, moments
from .search import (
    FRAGMENTS,
    LEAF_PIECE,
    SUM_ESCAPED,
    SUM_NUMERIC,
    flux_of,
    halve_space,
    is_ahead,
    lay_edges,
    mixed,
    near_boxes,
    near_sphere,
    power_as,
    recentre,
    spread_of,
)

_TOUCHES = 1e-7
"""GPU units: surfaces of glass this close are in contact."""
_WORTHLESS = 1e-6
"""Share of the threshold below which a beam with too many facets ahead is lost instead of halved."""
_COATS = 3e-5
"""GPU units: what is opaque and this close to glass is a coat on it (NEAR_DISTANCE of shaders/lib/intersect.glsl)."""
_LEANING = 0.9
"""Surfaces whose normals' cosine is less meet in an edge at most (CONTACT_COSINE there)."""


@part
def facet_of(hit):
    """The facet of a hit: its number where it is met from its inner side, else ~number."""
    return hit if hit >= 0 else ~hit


@part
def cut_to_facet(beam, flight, hit, facet, work):
    """Keep of an outline what meets a facet whose edges `lay_edges` laid; returns whether anything is left."""
    way = 1 if hit >= 0 else 2
    for turn in range(2):
        if turn == 1 and exists_throughout(beam):
            break
        # Where a place is empty, edges that cut at none of the others may cut in between.
        for e in range(facet.corners):
            is_turn = (work.cuts[e] != 0) == (turn == 0)
            if is_turn and not cut(beam, work.lines[e], 1.0, flight, facet_of(hit), e, way, work):
                return False
    return True


@part
def subtract(nodes, first, top, hit, facets, tables, work):
    """Take what meets a facet away from all outlines first … top; returns the new top."""
    current, spare = nodes[CURRENT], nodes[SPARE]
    number, way = facet_of(hit), 1 if hit >= 0 else 2
    facet = facets[number]
    end = top
    for j in range(first, end):
        if not lay_edges(nodes[j], current, facet, hit, work):
            continue
        copy(nodes[j], spare)
        nodes[j].facet = DEAD
        for e in range(facet.corners):
            if work.cuts[e] == 0:
                continue
            copy(spare, nodes[top])
            if cut(nodes[top], work.lines[e], -1.0, current.flight, number, e, way, work):
                forget_idle_lines(nodes[top], work)
                nodes[top].key = mixed(spare.key, 1000 + e)
                top += 1
            if not cut(spare, work.lines[e], 1.0, current.flight, number, e, way, work):
                break
    return closed_up(nodes, first, top)


@part
def closed_up(nodes, first, top):
    """Close the gaps that dead beams leave between first and top; returns the new top."""
    kept = first
    for j in range(first, top):
        if nodes[j].facet != DEAD:
            if j != kept:
                copy(nodes[j], nodes[kept])
            kept += 1
    return kept


@part
def is_nearer(facets, solids, current, one, other, t_one, t_other, cosine):
    """Whether facet `one` is met before `other`, at distances along a ray that meets them at such a `cosine`. Of
    surfaces in contact a solid is entered before one is left, and what is opaque comes before glass: a coat is met from
    inside as from outside."""
    leaning = 0.0
    for k in range(3):
        leaning += facets[one].plane[k] * facets[other].plane[k]
    is_coat = (facets[one].kind == 0) != (facets[other].kind == 0) and abs(leaning) > _LEANING
    if abs(t_one - t_other) * (abs(cosine) if is_coat else 1.0) > (_COATS if is_coat else _TOUCHES):
        return t_one < t_other
    return rank(facets, solids, current, one) < rank(facets, solids, current, other)


@part
def rank(facets, solids, current, facet):
    """Order of surfaces in contact: of several solids that are entered the one that wins comes first, of several that
    are left it comes last, so that light meets one interface. Equal ones are ordered by the facet's number."""
    first = facets[facet].kind
    if first == 0:
        bit = solids[facets[facet].owner].bit
        first = 128 + bit if (current.mask >> bit) & 1 else 127 - bit
    return (first << 32) + facet


@part
def fly(nodes, facets, solids, tables, source, obstacles, work):
    """Cut the current beam by the facets ahead; the fragments are on the stack afterwards."""
    first = top = work.top
    current, spread, flight = nodes[CURRENT], work.spread, nodes[CURRENT].flight
    spread_of(current, spread)
    for a in range(first_place(current), last_place(current)):
        moments(current.position[a], current.direction[a], current.growth[a], work.moment[a])
    last = np.int64(current.path[flight - 1, 0]) if flight > 0 else -1
    owner, crossing, is_parallel = -1, False, source.kind == PARALLEL
    for o in range(work.objects):
        if solids[o].first == solids[o].last:
            continue
        if flight > 0 and not near_sphere(current, solids[o].centre, solids[o].radius, spread):
            continue
        for turn in range(2 * solids[o].first, 2 * solids[o].last):
            f = turn >> 1
            hit = f if turn & 1 else ~f
            if f == last or top - first == FRAGMENTS or not is_ahead(facets[f], solids, current, turn & 1, is_parallel):
                continue
            if flight > 0 and not near_sphere(current, facets[f].centre, facets[f].radius, spread):
                continue
            if not lay_edges(current, current, facets[f], hit, work):
                continue
            new = nodes[top]
            copy(current, new)
            if not cut_to_facet(new, flight, hit, facets[f], work):
                continue
            recentre(new)
            distance, towards = distance_at(current, new, facets[f])
            if distance < -_TOUCHES or (towards > 0.0) != (hit >= 0):
                continue
            new.facet, new.total = f, LAY
            new.key = mixed(current.key, 2000 + f)
            forget_idle_lines(new, work)
            # Light meets both sides of what is not glass.
            crossing = crossing or (owner >= 0 and owner != o) or not solids[o].convex or facets[f].kind != 0
            owner = o
            work.hits[top - first] = hit
            top += 1
    count = top - first
    if count == FRAGMENTS and power_as(current, current, tables, work) > _WORTHLESS * work.threshold:
        # There may be more facets ahead than can be kept: each half meets fewer.
        low, high = halve_space(current, nodes[work.top], work)
        push_both(nodes, low, high, work)
        return
    if crossing and count > 1:
        top = hide(nodes, first, top, facets, solids, tables, work)
    missing = flux_of(current, tables, work)
    for j in range(first, top):
        missing -= flux_of(nodes[j], tables, work)
    # What a source sends past all facets never was a beam.
    missing = max(missing, 0.0) if flight > 0 else 0.0
    boxed = len(obstacles) > 0 and near_boxes(current, 1e9, obstacles, spread)
    if boxed:
        # What may meet an obstacle before its facet is left to photons.
        for j in range(first, top):
            distance, _ = distance_at(current, nodes[j], facets[nodes[j].facet])
            if near_boxes(current, distance + spread[0], obstacles, spread):
                nodes[j].facet, nodes[j].ends = -1, LEAF_PIECE
    is_lost = count == FRAGMENTS or (current.mask != 0 and not boxed)
    if is_lost or not boxed:
        # There is no way out of a solid but through its facets.
        work.sums[SUM_NUMERIC if is_lost else SUM_ESCAPED] += missing
        work.top = top
        return
    # What meets no facet.
    rest = top
    copy(current, nodes[top])
    nodes[top].facet = -1
    top += 1
    for h in range(count):
        top = subtract(nodes, rest, top, work.hits[h], facets, tables, work)
    for j in range(rest, top):
        # Spread of the part alone: its rays are still about the whole beam's centre.
        spread_of(nodes[j], spread)
        if near_boxes(nodes[j], 1e9, obstacles, spread):
            nodes[j].ends = LEAF_PIECE
        else:
            work.sums[SUM_ESCAPED] += flux_of(nodes[j], tables, work)
            nodes[j].facet = DEAD
    work.top = closed_up(nodes, rest, top)


@part
def hide(nodes, first, top, facets, solids, tables, work):
    """Take from every fragment what nearer facets hide; returns the new top. Fragment first + h meets hits[h]."""
    current, spare, hits, hidden = nodes[CURRENT], nodes[SPARE], work.hits, work.hidden
    count = top - first
    for h in range(count):
        one = facets[facet_of(hits[h])]
        if current.depth == 0 and one.kind > 1:
            # What a light casts on it directly is no beam; it only hides others.
            nodes[first + h].facet = DEAD
            continue
        some = False
        for g in range(count):
            hidden[h, g] = 0
            other = facets[facet_of(hits[g])]
            if g == h or (one.owner == other.owner and solids[one.owner].convex and other.kind == 0):
                continue
            if not lay_edges(nodes[first + h], current, other, hits[g], work):
                continue
            copy(nodes[first + h], spare)
            if not cut_to_facet(spare, current.flight, hits[g], other, work):
                continue
            recentre(spare)
            t_h, towards = distance_at(current, spare, one)
            t_g, _ = distance_at(current, spare, other)
            if t_g >= -_TOUCHES and is_nearer(
                facets, solids, current, facet_of(hits[g]), facet_of(hits[h]), t_g, t_h, towards
            ):
                hidden[h, g], some = 1, True
        if some:
            start = top
            copy(nodes[first + h], nodes[top])
            nodes[first + h].facet = DEAD
            top += 1
            for g in range(count):
                if hidden[h, g] != 0:
                    top = subtract(nodes, start, top, hits[g], facets, tables, work)
    return closed_up(nodes, first, top)
