"""The steps of the search: flight, facet, end."""

from __future__ import annotations

from .at_facet import at_facet
from .compiling import jit, part
from .current import CURRENT, FIRST, START, UNKNOWN
from .ending import end
from .flight import fly
from .leaves import has_room
from .nodes import copy, lay_out
from .rays import PARALLEL
from .search import FRAGMENTS, LEAF_PIECE, LEAF_RECEIVER, SUM_NUMERIC, flux_of


@part
def starts(beam, facets, solids, tables, source, work):
    """Lay out a source's whole light, its rays not of unit length where they diverge: exactly affine."""
    if not lay_out(beam, facets, solids, tables, source, work):
        return False
    if source.kind != PARALLEL:
        for a in range(3):
            for c in range(1, 3):
                for k in range(3):
                    beam.direction[a, c, k] += beam.growth[a, c - 1] * beam.direction[a, 0, k]
                beam.growth[a, c - 1] = 0.0
    beam.total = UNKNOWN
    return True


@jit
def run(nodes, facets, solids, tables, sources, obstacles, works, leaf, edge, corner):
    """Follow all beams on the stack (rows FIRST … `top` of the work) to their ends, for so many steps at most or until
    there is no room for leaves."""
    work, beam = works[0], nodes[CURRENT]
    limit = len(nodes) - 2 * FRAGMENTS - 64
    while work.top > FIRST and work.steps > 0 and has_room(leaf, edge, corner, work):
        work.steps -= 1
        work.top -= 1
        copy(nodes[work.top], beam)
        if beam.facet >= 0 and beam.ends < 0 and facets[beam.facet].kind >= 3:
            beam.ends = LEAF_RECEIVER if facets[beam.facet].kind == 3 else LEAF_PIECE
        if beam.ends >= 0:
            if beam.depth > 0 or beam.facet < 0:
                end(nodes, facets, solids, tables, sources, leaf, edge, corner, work)
        elif work.top > limit:
            work.sums[SUM_NUMERIC] += flux_of(beam, tables, work)
        elif beam.facet >= 0:
            at_facet(nodes, facets, solids, tables, sources, work)
        elif beam.total != START or starts(beam, facets, solids, tables, sources[0], work):
            fly(nodes, facets, solids, tables, sources[0], obstacles, work)
