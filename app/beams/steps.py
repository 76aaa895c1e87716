"""The steps of the search: flight, facet, end."""

from __future__ import annotations

from .at_facet import at_facet
from .compiling import jit, part
from .ending import end
from .flight import fly
from .hand import FIRST, HAND, START, UNKNOWN
from .leaves import has_room
from .nodes import copy, lay_out
from .rays import PARALLEL, emit_straight
from .search import FRAGMENTS, LEAF_RECEIVER, SUM_NUMERIC, flux_of


@part
def starts(hand, facets, solids, tables, source, work):
    """Lay out a source's whole light, its rays not of unit length where they diverge: exactly affine."""
    if not lay_out(hand, facets, solids, tables, source, work):
        return False
    if source.kind != PARALLEL:
        for a in range(3):
            emit_straight(source, hand.centre[0], hand.centre[1], hand.position[a], hand.direction[a])
    hand.total = UNKNOWN
    return True


@jit
def run(nodes, facets, solids, tables, sources, obstacles, works, leaf, edge, corner):
    """Follow all beams on the stack (rows FIRST … `top` of the work) to their ends, for so many steps at most or until
    there is no room for leaves."""
    work, hand = works[0], nodes[HAND]
    limit = len(nodes) - 2 * FRAGMENTS - 64
    while work.top > FIRST and work.steps > 0 and has_room(leaf, edge, corner, work):
        work.steps -= 1
        work.top -= 1
        copy(nodes[work.top], hand)
        if hand.facet >= 0 and hand.ends < 0 and facets[hand.facet].kind == 3:
            hand.ends = LEAF_RECEIVER
        if hand.ends >= 0:
            if hand.depth > 0 or hand.facet < 0:
                end(nodes, facets, solids, tables, sources, leaf, edge, corner, work)
        elif work.top > limit:
            work.sums[SUM_NUMERIC] += flux_of(hand, tables, work)
        elif hand.facet >= 0:
            at_facet(nodes, facets, solids, tables, sources, work)
        elif hand.total != START or starts(hand, facets, solids, tables, sources[0], work):
            fly(nodes, facets, solids, tables, sources[0], obstacles, work)
