"""The steps of the search: flight, facet, end. The beam in hand is row HAND of the stack; what becomes of it goes on
top."""

from __future__ import annotations

import numpy as np

from .compiling import jit, part
from .facets import MAX_CORNERS
from .leaves import density_slope, has_room, lay_leaf, passes, plane_map
from .nodes import (
    LEVELS,
    STATIC,
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
from .rays import (
    PARALLEL,
    PASS,
    REFLECT,
    REFRACT,
    at_x,
    emit_straight,
    follow,
    index_of,
    meet,
    moments,
    total_line,
    transmitted,
)
from .search import (
    FRAGMENTS,
    LEAF_OPEN,
    LEAF_PIECE,
    LEAF_RECEIVER,
    LEAF_TAIL,
    NARROWEST,
    SUM_ABSORBED,
    SUM_BEAMS,
    SUM_DEPOSITED,
    SUM_DEPTH,
    SUM_ESCAPED,
    SUM_HANDED,
    SUM_LEAVES,
    SUM_NUMERIC,
    SUM_ROULETTE,
    drifts,
    facing,
    flux_as,
    flux_of,
    halve_space,
    halve_spectrum,
    is_ahead,
    is_curved,
    lay_edges,
    medium,
    mixed,
    near_boxes,
    near_sphere,
    place_of,
    power_as,
    recentre,
    spread_of,
    unit,
)

_FAINT, _FAINT_HANDED = 0.02, 0.25
"""Share of the threshold below which a beam is not halved; where all that comes of it is handed over."""
_TOUCHES = 1e-7
"""GPU units: surfaces this close are in contact."""
_UNEVEN = 0.15
"""A density that leaves the straight line by more is not a parabola for certain."""
_COLOURED = 0.02
"""The same where absorption has a colour."""
_STEEP = 0.3
"""A relative change of the density over a leaf that is no longer linear."""
_STRAY = 0.1
"""Of the tolerance: how far rays may leave their parabola over the band (what they see is swept over many pixels)."""
HAND, _SPARE = 0, 1
"""Rows of the stack that are the beam in hand, and room to try a cut."""
FIRST = 2
_DEAD = -3
"""Facet of an outline that is no longer."""
_GRAZING = 1e-9
"""Squared cosines below this may count as either side of total reflection."""
START = -3
_LAY, _UNKNOWN, _SOME, _ALL = -2, -1, 0, 1
"""States of a beam's `total`; START: a source's whole light; _LAY: rays are those of a larger outline."""


@part
def facet_of(hit):
    """The facet of a hit: its number where it is met from its inner side, else ~number."""
    return hit if hit >= 0 else ~hit


@part
def cut_to_facet(beam, flight, hit, facet, work):
    """Keep of an outline what meets a facet whose edges `lay_edges` laid; returns whether anything is left."""
    way = 1 if hit >= 0 else 2
    for e in range(facet.corners):
        if work.cuts[e] != 0 and not cut(beam, work.lines[e], 1.0, flight, facet_of(hit), e, way, work):
            return False
    return True


@part
def subtract(nodes, first, top, hit, facets, tables, work):
    """Take what meets a facet away from all outlines first … top; returns the new top."""
    hand, spare = nodes[HAND], nodes[_SPARE]
    number, way = facet_of(hit), 1 if hit >= 0 else 2
    facet = facets[number]
    end = top
    for j in range(first, end):
        if not lay_edges(nodes[j], hand, facet, hit, work):
            continue
        copy(nodes[j], spare)
        nodes[j].facet = _DEAD
        for e in range(facet.corners):
            if work.cuts[e] == 0:
                continue
            copy(spare, nodes[top])
            if cut(nodes[top], work.lines[e], -1.0, hand.flight, number, e, way, work):
                forget_idle_lines(nodes[top], work)
                nodes[top].key = mixed(spare.key, 1000 + e)
                top += 1
            if not cut(spare, work.lines[e], 1.0, hand.flight, number, e, way, work):
                break
    return closed_up(nodes, first, top)


@part
def closed_up(nodes, first, top):
    """Close the gaps that dead beams leave between first and top; returns the new top."""
    kept = first
    for j in range(first, top):
        if nodes[j].facet != _DEAD:
            if j != kept:
                copy(nodes[j], nodes[kept])
            kept += 1
    return kept


@part
def distance_at(hand, beam, facet):
    """Distance from the beam in hand's ray of an outline's centre to a facet's plane, at the place where the outline
    exists; and its cosine."""
    a = place_of(beam)
    u, v = beam.centre[0] - hand.centre[0], beam.centre[1] - hand.centre[1]
    n, p, d = facet.plane, hand.position, hand.direction
    at = towards = 0.0
    for k in range(3):
        at += n[k] * (p[a, 0, k] + u * p[a, 1, k] + v * p[a, 2, k])
        towards += n[k] * (d[a, 0, k] + u * d[a, 1, k] + v * d[a, 2, k])
    if abs(towards) < 1e-14:
        return -1.0, 0.0
    return (n[3] - at) / towards, towards


@part
def is_nearer(facets, solids, hand, one, other, t_one, t_other):
    """Whether facet `one` is met before `other`; of surfaces in contact a solid is entered before one is left, and
    glass comes before what is opaque."""
    if abs(t_one - t_other) > _TOUCHES:
        return t_one < t_other
    return rank(facets, solids, hand, one) < rank(facets, solids, hand, other)


@part
def rank(facets, solids, hand, facet):
    """Order of surfaces in contact: of several solids that are entered the one that wins comes first, of several that
    are left it comes last, so that light meets one interface. The facet's number tells equals apart."""
    first = 64 * (1 + facets[facet].kind)
    if first == 64:
        bit = solids[facets[facet].owner].bit
        first = 64 + bit if (hand.mask >> bit) & 1 else 63 - bit
    return (first << 32) + facet


@part
def fly(nodes, facets, solids, tables, source, obstacles, work):
    """Cut the beam in hand by the facets ahead; the fragments lie on the stack afterwards."""
    first = top = work.top
    hand, spread, flight = nodes[HAND], work.spread, nodes[HAND].flight
    spread_of(hand, spread)
    for a in range(first_place(hand), last_place(hand)):
        moments(hand.position[a], hand.direction[a], work.moment[a])
    last = np.int64(hand.path[flight - 1, 0]) if flight > 0 else -1
    owner, crossing, is_parallel = -1, False, source.kind == PARALLEL
    for o in range(work.objects):
        if solids[o].first == solids[o].last:
            continue
        if flight > 0 and not near_sphere(hand, solids[o].centre, solids[o].radius, spread):
            continue
        for turn in range(2 * solids[o].first, 2 * solids[o].last):
            f = turn >> 1
            hit = f if turn & 1 else ~f
            if f == last or top - first == FRAGMENTS or not is_ahead(facets[f], solids, hand, turn & 1, is_parallel):
                continue
            if flight > 0 and not near_sphere(hand, facets[f].centre, facets[f].radius, spread):
                continue
            if not lay_edges(hand, hand, facets[f], hit, work):
                continue
            new = nodes[top]
            copy(hand, new)
            if not cut_to_facet(new, flight, hit, facets[f], work):
                continue
            recentre(new)
            distance, towards = distance_at(hand, new, facets[f])
            if distance < -_TOUCHES or (towards > 0.0) != (hit >= 0):
                continue
            new.facet, new.total = f, _LAY
            new.key = mixed(hand.key, 2000 + f)
            forget_idle_lines(new, work)
            # Light meets both sides of what is not glass.
            crossing = crossing or (owner >= 0 and owner != o) or not solids[o].convex or facets[f].kind != 0
            owner = o
            work.hits[top - first] = hit
            top += 1
    count = top - first
    if crossing and count > 1:
        top = hide(nodes, first, top, facets, solids, tables, work)
    missing = flux_of(hand, tables, work)
    for j in range(first, top):
        missing -= flux_of(nodes[j], tables, work)
    # What a source sends past all facets never was a beam.
    missing = max(missing, 0.0) if flight > 0 else 0.0
    boxed = len(obstacles) > 0 and near_boxes(hand, 1e9, obstacles, spread)
    if boxed:
        # What may meet an obstacle before its facet is handed over.
        for j in range(first, top):
            distance, _ = distance_at(hand, nodes[j], facets[nodes[j].facet])
            if near_boxes(hand, distance + spread[0], obstacles, spread):
                nodes[j].facet, nodes[j].ends = -1, LEAF_PIECE
    is_lost = count == FRAGMENTS or (hand.mask != 0 and not boxed)
    if is_lost or not (boxed or work.sees):
        # There is no way out of a solid but through its facets.
        work.sums[SUM_NUMERIC if is_lost else SUM_ESCAPED] += missing
        work.top = top
        return
    # What meets no facet.
    rest = top
    copy(hand, nodes[top])
    nodes[top].facet = -1
    top += 1
    for h in range(count):
        top = subtract(nodes, rest, top, work.hits[h], facets, tables, work)
    for j in range(rest, top):
        # Of the part alone: its rays are still about the whole beam's centre.
        spread_of(nodes[j], spread)
        if boxed and near_boxes(nodes[j], 1e9, obstacles, spread):
            nodes[j].ends = LEAF_PIECE
        elif work.sees:
            nodes[j].ends = LEAF_OPEN
        else:
            work.sums[SUM_ESCAPED] += flux_of(nodes[j], tables, work)
            nodes[j].facet = _DEAD
    work.top = closed_up(nodes, rest, top)


@part
def hide(nodes, first, top, facets, solids, tables, work):
    """Take from every fragment what nearer facets hide; returns the new top. Fragment first + h meets hits[h]."""
    hand, spare, hits, hidden = nodes[HAND], nodes[_SPARE], work.hits, work.hidden
    count = top - first
    for h in range(count):
        one = facets[facet_of(hits[h])]
        if hand.depth == 0 and one.kind > 1:
            # What a light throws on it directly is no beam; it only hides others.
            nodes[first + h].facet = _DEAD
            continue
        some = False
        for g in range(count):
            hidden[h, g] = 0
            other = facets[facet_of(hits[g])]
            if g == h or (one.owner == other.owner and solids[one.owner].convex and other.kind == 0):
                continue
            if not lay_edges(nodes[first + h], hand, other, hits[g], work):
                continue
            copy(nodes[first + h], spare)
            if not cut_to_facet(spare, hand.flight, hits[g], other, work):
                continue
            recentre(spare)
            t_h, _ = distance_at(hand, spare, one)
            t_g, _ = distance_at(hand, spare, other)
            if t_g >= -_TOUCHES and is_nearer(facets, solids, hand, facet_of(hits[g]), facet_of(hits[h]), t_g, t_h):
                hidden[h, g], some = 1, True
        if some:
            start = top
            copy(nodes[first + h], nodes[top])
            nodes[first + h].facet = _DEAD
            top += 1
            for g in range(count):
                if hidden[h, g] != 0:
                    top = subtract(nodes, start, top, hits[g], facets, tables, work)
    return closed_up(nodes, first, top)


@part
def faint_share(work):
    """Share of the threshold below which a beam is not halved."""
    return _FAINT_HANDED if work.faint > 0.0 else _FAINT


@part
def push_both(nodes, low, high, work):
    """Leave on the stack what is left of the beam in hand and of that at the top."""
    if high:
        work.top += 1
    if low:
        copy(nodes[HAND], nodes[work.top])
        work.top += 1


@part
def halve(nodes, x, facets, solids, tables, sources, work):
    """Cut the beam in hand at x and leave both on the stack."""
    low, high = halve_spectrum(nodes[HAND], nodes[work.top], x, facets, solids, tables, sources[0], work)
    push_both(nodes, low, high, work)


@part
def end(nodes, facets, solids, tables, sources, leaf, edge, corner, work):
    """Write the beam in hand as a leaf, or halve it where it is not straight enough."""
    hand, source, kind = nodes[HAND], sources[0], nodes[HAND].ends
    if hand.depth == 0 and kind != LEAF_OPEN:
        return
    is_parallel = source.kind == PARALLEL
    recentre(hand)
    if (not is_parallel or work.absorbing) and not lay_out(hand, facets, solids, tables, source, work):
        return
    # Where rays graze, and where a cone fades away, there is no end to halving: what is faint is straight enough.
    faint = work.threshold if kind == LEAF_TAIL else faint_share(work) * work.threshold
    room = work.top + 2 < len(nodes) and power_as(hand, hand, tables, work) > faint
    tolerance = facets[hand.facet].texel if kind == LEAF_RECEIVER else work.tolerance
    bend = 0.0
    if room and not is_parallel and kind == LEAF_RECEIVER:
        bend = is_curved(hand, facets, solids, tables, source, tolerance, work)
    if bend > 1.0:
        low, high = halve_space(hand, nodes[work.top], work)
        push_both(nodes, low, high, work)
        return
    if kind == LEAF_RECEIVER and work.absorbing:
        absorb(hand, facets, solids, tables, work)
    bent, uneven = lay_leaf(hand, facets, kind, leaf, edge, corner, work)
    if bent < 0.0:
        return
    if work.sees and room and hand.x[2] - hand.x[0] > NARROWEST and strays(hand, facets, solids, tables, source, work):
        halve(nodes, 0.5 * (hand.x[0] + hand.x[2]), facets, solids, tables, sources, work)
        return
    # What absorbs may be coloured, with steps that three places do not see.
    most = _COLOURED if work.absorbing else _UNEVEN
    if room and hand.x[2] - hand.x[0] > NARROWEST and (bent > tolerance or uneven > most):
        halve(nodes, 0.5 * (hand.x[0] + hand.x[2]), facets, solids, tables, sources, work)
        return
    row, first = work.count[0], work.count[2]
    new = leaf[row]
    density_slope(hand, facets, solids, tables, source, kind, new, work)
    steepest = 0.0
    for c in range(first, first + new.head[7]):
        u, v = corner[c, 0] - new.centre[0], corner[c, 1] - new.centre[1]
        steepest = max(steepest, abs(new.slope[0] * u + new.slope[1] * v))
    if room and steepest > _STEEP and hand.corners[1] > 0:
        low, high = halve_space(hand, nodes[work.top], work)
        push_both(nodes, low, high, work)
        return
    if work.sources > 1:
        soften(nodes, kind, facets, solids, tables, sources, leaf, edge, corner, work)
    flux = flux_of(hand, tables, work)
    new.flux = flux
    work.count[0] += 1
    work.count[1] += new.head[6]
    work.count[2] += new.head[7]
    work.sums[SUM_LEAVES] += 1.0
    work.sums[SUM_DEPOSITED if kind == LEAF_RECEIVER else SUM_HANDED] += flux


@part
def strays(hand, facets, solids, tables, source, work):
    """Whether rays over the band leave the parabola through those at its three places by more than the tolerance."""
    position, direction = work.rays[0], work.rays[1]
    for turn in range(2):
        x = hand.x[2 * turn] + (0.25 - 0.5 * turn) * (hand.x[2] - hand.x[0])
        follow(
            source,
            facets,
            solids,
            tables,
            hand.path,
            hand.flight,
            x,
            hand.centre[0],
            hand.centre[1],
            position,
            direction,
        )
        off = across = along = 0.0
        near, middle, far = hand.direction[2 * turn], hand.direction[1], hand.direction[2 - 2 * turn]
        for k in range(3):
            change = direction[0, k] - (0.375 * near[0, k] + 0.75 * middle[0, k] - 0.125 * far[0, k])
            off += change * change
            across += middle[1, k] * middle[1, k]
            along += middle[2, k] * middle[2, k]
        per = min(across, along)
        if off > _STRAY * _STRAY * work.tolerance * work.tolerance * per and per > 0.0:
            return True
    return False


@part
def absorb(beam, facets, solids, tables, work):
    """Take from a beam what the medium of its last flight absorbs."""
    inside = medium(solids, beam.mask)
    for a in range(first_place(beam), last_place(beam)):
        distance, _ = plane_map(facets[beam.facet], beam.position[a], beam.direction[a], work.map[a], work)
        beam.weight[a] *= passes(solids, tables, inside, beam.x[a], distance)


@part
def soften(nodes, kind, facets, solids, tables, sources, leaf, edge, corner, work):
    """Set the penumbra of the leaf just laid from where its edges lie for two other points of an extended light.

    The light's part is a disc whose radius is the way to those points. An edge's cover over it rises as the disc's
    cumulative profile; a ramp of the same variance is sqrt(3)/2 of the disc's projected radius wide to each side."""
    hand, spare = nodes[HAND], nodes[_SPARE]
    first, n = work.count[1], nodes[HAND].lines
    soft, own = work.soft, work.own
    new = leaf[work.count[0]]
    cu, cv, slope_u, slope_v = new.centre[0], new.centre[1], new.slope[0], new.slope[1]
    for turn in range(work.sources):
        if turn > 0:
            copy(hand, spare)
            lay_out(spare, facets, solids, tables, sources[turn], work)
            lay_leaf(spare, facets, kind, leaf, edge, corner, work)
        for ln in range(n):
            e = edge[first + ln].line
            at = e[1, 0] * cu + e[1, 1] * cv + e[1, 2]
            if turn == 0:
                own[ln], soft[ln] = at, 0.0
            elif hand.made[ln, 2] != STATIC or kind == LEAF_RECEIVER:
                soft[ln] += (at - own[ln]) * (at - own[ln])
    lay_leaf(hand, facets, kind, leaf, edge, corner, work)
    new.slope[0], new.slope[1] = slope_u, slope_v
    for ln in range(n):
        edge[first + ln].soft = 0.8660254 * np.sqrt(soft[ln])


@part
def onset(hand, facets, solids, tables, source, before, after, low, high, work):
    """x between two places at which the facet of the beam in hand begins to reflect everything."""
    position, direction = work.rays[0], work.rays[1]
    is_low = False
    for turn in range(45):
        x = low if turn == 0 else 0.5 * (low + high)
        u, v = hand.centre[0], hand.centre[1]
        follow(source, facets, solids, tables, hand.path, hand.flight, x, u, v, position, direction)
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
def at_facet(nodes, facets, solids, tables, sources, work):
    """The beam in hand meets its facet: halved where it has to be, or sent on."""
    hand, source, is_parallel = nodes[HAND], sources[0], sources[0].kind == PARALLEL
    facet = facets[hand.facet]
    if hand.total == _LAY:
        recentre(hand)
        if not is_parallel or work.absorbing:
            if not lay_out(hand, facets, solids, tables, source, work):
                return
            recentre(hand)
        hand.total = _UNKNOWN
    if facet.kind == 2:
        work.sums[SUM_ABSORBED] += flux_of(hand, tables, work)
        return
    power = power_as(hand, hand, tables, work)
    if power > work.threshold and drifts(hand, power, work):
        halve(nodes, 0.5 * (hand.x[0] + hand.x[2]), facets, solids, tables, sources, work)
        return
    if not is_parallel and hand.bend >= 0.0:
        bend = is_curved(hand, facets, solids, tables, source, work.tolerance, work)
        if bend > 1.0 and power_as(hand, hand, tables, work) > faint_share(work) * work.threshold:
            low, high = halve_space(hand, nodes[work.top], work)
            hand.total = nodes[work.top].total = _LAY
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
        unknown = not keeps and hand.total == _UNKNOWN
        if unknown and total_from(nodes, before, after, facets, solids, tables, sources, work):
            return
    work.sums[SUM_ABSORBED] += (1.0 - kept) * flux_of(hand, tables, work)
    for turn in range(2):
        # One call of `child`, which is long, for all cases.
        action = PASS if keeps else (REFLECT if turn == 0 else REFRACT)
        if turn == 1 and (keeps or facet.kind == 1 or hand.total == _ALL):
            break
        child(nodes, action, before, after, hand.mask if action == REFLECT else mask, facets, solids, tables, work)


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
    total = _SOME if most > 0.0 else _ALL
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
        part_of.total = _SOME if turn == 0 else _ALL
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
        new.weight[a] *= meet(facets, solids, tables, new.path, flight, new.x[a], new.position[a], new.direction[a])
    new.flight, new.depth, new.mask = flight + 1, depth, mask
    new.facet, new.total = -1, _UNKNOWN
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


@part
def starts(hand, facets, solids, tables, source, work):
    """Lay out a source's whole light, its rays not of unit length where they diverge: exactly affine."""
    if not lay_out(hand, facets, solids, tables, source, work):
        return False
    if source.kind != PARALLEL:
        for a in range(3):
            emit_straight(source, hand.centre[0], hand.centre[1], hand.position[a], hand.direction[a])
    hand.total = _UNKNOWN
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
        if hand.facet >= 0 and hand.ends < 0:
            kind = facets[hand.facet].kind
            if kind == 3 or (kind == 2 and work.sees and hand.depth > 0):
                hand.ends = LEAF_OPEN if work.sees else LEAF_RECEIVER
            elif work.sees and hand.depth >= work.depth:
                # Light that would still be caught inside is seen as if it left here, as camera paths do.
                hand.ends = LEAF_OPEN
        if hand.ends >= 0:
            if hand.depth > 0 or hand.facet < 0:
                end(nodes, facets, solids, tables, sources, leaf, edge, corner, work)
        elif work.top > limit:
            work.sums[SUM_NUMERIC] += flux_of(hand, tables, work)
        elif hand.facet >= 0:
            at_facet(nodes, facets, solids, tables, sources, work)
        elif hand.total != START or starts(hand, facets, solids, tables, sources[0], work):
            fly(nodes, facets, solids, tables, sources[0], obstacles, work)
