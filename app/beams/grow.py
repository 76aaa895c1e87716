"""The steps of the search: flight, facet, end."""

from __future__ import annotations

import numpy as np

from .leaves import density_slope, grown, has_room, lay_leaf, passes
from .nodes import LEVELS, STATIC, TOTAL, copy, copy_head, copy_outline, cut, forget_idle_lines, lay_out
from .rays import (
    PARALLEL,
    PASS,
    REFLECT,
    REFRACT,
    advance,
    at_x,
    edge_line,
    follow,
    index_of,
    jit,
    meet,
    total_line,
    transmitted,
)
from .search import (
    _MOST_FRAGMENTS,
    _NARROWEST,
    _TOUCHES,
    LEAF_OPEN,
    LEAF_PIECE,
    LEAF_RECEIVER,
    SUM_ABSORBED,
    SUM_BEAMS,
    SUM_DEPOSITED,
    SUM_DEPTH,
    SUM_ESCAPED,
    SUM_HANDED,
    SUM_LEAVES,
    SUM_NUMERIC,
    SUM_ROULETTE,
    _flux,
    drifts,
    facing,
    halve_space,
    halve_spectrum,
    is_ahead,
    is_curved,
    medium,
    mixed,
    near_boxes,
    near_sphere,
    power_of,
    recentre,
    spread_of,
    unit,
)

_UNEVEN = 0.15
"""A density that leaves the straight line by more is not a parabola for certain."""
_COLOURED = 0.02
"""The same where absorption has a colour."""
_STEEP = 0.3
"""A relative change of the density over a leaf that is no longer linear."""
_FAINT = 0.02
"""Share of the threshold below which a beam is not halved."""
_HAND, _SPARE = 0, 1
"""Rows of the stack that are the beam in hand, and room to try a cut."""
FIRST = 2
_DEAD = -3
"""Facet of an outline that is no longer."""
_GRAZING = 1e-9
"""Squared cosines below this may count as either side of total reflection."""
_LAY, _UNKNOWN, _SOME, _ALL = -2, -1, 0, 1
"""States of `Nodes.total`; _LAY: rays are those of a larger outline."""


@jit
def facet_lines(nodes, i, facets, facet, edge, sign, lines):
    """The half-planes of a facet's edge for beam i's flight, (3, 3) by place."""
    for a in range(3):
        edge_line(facets, facet, edge, sign, nodes[i].position[a], nodes[i].direction[a], nodes[i].centre, lines[a])


@jit
def facet_of(hit):
    """The facet of a hit (`cut_to_facet`)."""
    return hit if hit >= 0 else ~hit


@jit
def cut_to_facet(nodes, i, facets, hit, lines, made, spare_corner, spare_side):
    """Keep of outline i what meets a facet; `i` flies as the beam in hand does. `hit`: the facet's number, met from its
    inner side; ~number: from outside."""
    facet, sign = facet_of(hit), 1.0 if hit >= 0 else -1.0
    made[0], made[1], made[3] = nodes[_HAND].flight, facet, 1 if hit >= 0 else 2
    for e in range(facets[facet].corners):
        facet_lines(nodes, _HAND, facets, facet, e, sign, lines)
        made[2] = e
        if not cut(nodes, i, lines, made, spare_corner, spare_side):
            return False
    return True


@jit
def subtract(nodes, first, top, facets, hit, lines, made, spare_corner, spare_side):
    """Take what meets a facet away from all outlines first … top; returns the new top."""
    facet, sign = facet_of(hit), 1.0 if hit >= 0 else -1.0
    way = 1 if hit >= 0 else 2
    end = top
    for j in range(first, end):
        copy(nodes, j, _SPARE)
        nodes[j].facet = _DEAD
        for e in range(facets[facet].corners):
            facet_lines(nodes, _HAND, facets, facet, e, sign, lines)
            made[0], made[1], made[2], made[3] = nodes[_HAND].flight, facet, e, -way
            copy(nodes, _SPARE, top)
            if cut(nodes, top, -lines, made, spare_corner, spare_side):
                forget_idle_lines(nodes, top)
                nodes[top].key = mixed(nodes[_SPARE].key, 1000 + e)
                top += 1
            made[3] = way
            if not cut(nodes, _SPARE, lines, made, spare_corner, spare_side):
                break
    return closed_up(nodes, first, top)


@jit
def closed_up(nodes, first, top):
    """Close the gaps that dead beams leave between first and top; returns the new top."""
    kept = first
    for j in range(first, top):
        if nodes[j].facet != _DEAD:
            if j != kept:
                copy(nodes, j, kept)
            kept += 1
    return kept


@jit
def distance_at(nodes, i, q, facets, facet):
    """Distance from the beam in hand's ray of q to a facet's plane, at the place where outline i exists; and its
    cosine."""
    a = 1 if nodes[i].corners[1] > 0 else (0 if nodes[i].corners[0] > 0 else 2)
    u, v = q[0] - nodes[_HAND].centre[0], q[1] - nodes[_HAND].centre[1]
    n = facets[facet].plane
    at = towards = 0.0
    for k in range(3):
        p, d = nodes[_HAND].position[a], nodes[_HAND].direction[a]
        at += n[k] * (p[0, k] + u * p[1, k] + v * p[2, k])
        towards += n[k] * (d[0, k] + u * d[1, k] + v * d[2, k])
    if abs(towards) < 1e-14:
        return -1.0, 0.0
    return (n[3] - at) / towards, towards


@jit
def is_nearer(facets, solids, nodes, one, other, t_one, t_other):
    """Whether facet `one` is met before `other`; of surfaces in contact a solid is entered before one is left, and
    glass comes before what is opaque."""
    if abs(t_one - t_other) > _TOUCHES:
        return t_one < t_other
    return rank(facets, solids, nodes, one) < rank(facets, solids, nodes, other)


@jit
def rank(facets, solids, nodes, facet):
    """Order of surfaces in contact: of several solids that are entered the one that wins comes first, of several that
    are left it comes last, so that light meets one interface. The facet's number tells equals apart."""
    kind = facets[facet].kind
    first = (1 + kind) * 64
    if kind == 0:
        bit = solids[facets[facet].owner].bit
        first = 64 + bit if (nodes[_HAND].mask >> bit) & 1 else 63 - bit
    return (first << 32) + facet


@jit
def fly(
    nodes, top, facets, solids, tables, sources, obstacles, task, leaves, sums, lines, made, spare_corner, spare_side
):
    """Cut the beam in hand by the facets ahead; the fragments lie on the stack afterwards. Returns (top, leaves)."""
    first = top
    spread = np.empty(2)
    spread_of(nodes, _HAND, spread)
    flight = nodes[_HAND].flight
    last = nodes[_HAND].path[0, flight - 1] if flight > 0 else -1
    owner, crossing = -1, False
    hits = np.empty(_MOST_FRAGMENTS, np.int64)
    count = 0
    for o in range(len(solids)):
        if solids[o].first == solids[o].last:
            continue
        if flight > 0 and not near_sphere(nodes, _HAND, solids[o].centre, solids[o].radius, spread):
            continue
        for turn in range(2 * solids[o].first, 2 * solids[o].last):
            f = turn >> 1
            hit = f if turn & 1 else ~f
            if f == last or not is_ahead(facets, solids, nodes, _HAND, f, turn & 1, sources[0].kind == PARALLEL):
                continue
            if flight > 0 and not near_sphere(nodes, _HAND, facets[f].centre, facets[f].radius, spread):
                continue
            copy_outline(nodes, _HAND, top)
            if not cut_to_facet(nodes, top, facets, hit, lines, made, spare_corner, spare_side):
                continue
            copy_head(nodes, _HAND, top)
            recentre(nodes, top)
            distance, towards = distance_at(nodes, top, nodes[top].centre, facets, f)
            if distance < -_TOUCHES or (towards > 0.0) != (hit >= 0):
                continue
            nodes[top].facet, nodes[top].total = f, _LAY
            nodes[top].key = mixed(nodes[_HAND].key, 2000 + f)
            forget_idle_lines(nodes, top)
            # Light meets both sides of what is not glass.
            crossing = crossing or (owner >= 0 and owner != o) or not solids[o].convex or facets[f].kind != 0
            owner = o
            hits[count] = hit
            count += 1
            top += 1
            if count == _MOST_FRAGMENTS:
                break
        if count == _MOST_FRAGMENTS:
            break
    if crossing:
        top = hide(nodes, first, top, hits, facets, solids, lines, made, spare_corner, spare_side)
    reached = 0.0
    for j in range(first, top):
        reached += _flux(nodes, j, tables, task)
    missed = max(_flux(nodes, _HAND, tables, task) - reached, 0.0)
    boxed = len(obstacles) > 0 and near_boxes(nodes, _HAND, 1e9, obstacles, spread)
    if boxed:
        top, leaves = hand_over(
            nodes, first, top, facets, solids, tables, sources, obstacles, spread, task, leaves, sums, spare_corner,
            spare_side,
        )
    if count == _MOST_FRAGMENTS or nodes[_HAND].mask != 0 and not boxed:
        # There is no way out of a solid but through its facets.
        sums[SUM_NUMERIC] += missed
        return top, leaves
    if not (boxed or task.sees):
        sums[SUM_ESCAPED] += missed
        return top, leaves
    # What meets no facet.
    rest = top
    copy(nodes, _HAND, top)
    nodes[top].facet = -1
    top += 1
    for h in range(count):
        top = subtract(nodes, rest, top, facets, hits[h], lines, made, spare_corner, spare_side)
    while top > rest:
        top -= 1
        blocked = boxed and near_boxes(nodes, top, 1e9, obstacles, spread)
        if task.sees or blocked:
            leaves = end(
                nodes, top, LEAF_PIECE if blocked else LEAF_OPEN, facets, solids, tables, sources, task, leaves, sums,
                spare_corner, spare_side,
            )
        else:
            sums[SUM_ESCAPED] += _flux(nodes, top, tables, task)
    return top, leaves


@jit
def hide(nodes, first, original, hits, facets, solids, lines, made, spare_corner, spare_side):
    """Take from every fragment what nearer facets hide; returns the new top. Fragment first + h meets hits[h]."""
    top = original
    count = original - first
    hidden = np.zeros((count, count), np.bool_)
    for h in range(count):
        for g in range(count):
            if g == h:
                continue
            one, other = facet_of(hits[g]), facet_of(hits[h])
            same = facets[one].owner == facets[other].owner
            if same and solids[facets[one].owner].convex and facets[one].kind == 0:
                continue
            copy(nodes, first + h, _SPARE)
            if not cut_to_facet(nodes, _SPARE, facets, hits[g], lines, made, spare_corner, spare_side):
                continue
            recentre(nodes, _SPARE)
            q = nodes[_SPARE].centre.copy()
            t_h, _ = distance_at(nodes, _SPARE, q, facets, other)
            t_g, _ = distance_at(nodes, _SPARE, q, facets, one)
            hidden[h, g] = t_g >= -_TOUCHES and is_nearer(facets, solids, nodes, one, other, t_g, t_h)
    for h in range(count):
        if not hidden[h].any():
            continue
        copy(nodes, first + h, top)
        nodes[first + h].facet = _DEAD
        start = top
        top += 1
        for g in range(count):
            if hidden[h, g]:
                top = subtract(nodes, start, top, facets, hits[g], lines, made, spare_corner, spare_side)
    return closed_up(nodes, first, top)


@jit
def hand_over(
    nodes, first, top, facets, solids, tables, sources, obstacles, spread, task, leaves, sums, spare_corner, spare_side
):
    """Keep as pieces those fragments that may meet an obstacle before their facet; returns (top, leaves)."""
    kept = first
    for j in range(first, top):
        distance, _ = distance_at(nodes, j, nodes[j].centre, facets, nodes[j].facet)
        if near_boxes(nodes, _HAND, distance + spread[0], obstacles, spread):
            copy(nodes, j, top)
            nodes[top].facet = -1
            leaves = end(
                nodes, top, LEAF_PIECE, facets, solids, tables, sources, task, leaves, sums, spare_corner, spare_side
            )
        else:
            if j != kept:
                copy(nodes, j, kept)
            kept += 1
    return kept, leaves


@jit
def end(nodes, at, kind, facets, solids, tables, sources, task, leaves, sums, spare_corner, spare_side):
    """Write the beam at row `at` (rows above are free), halved until it is straight enough; returns the leaves."""
    if nodes[at].depth == 0:
        if kind == LEAF_PIECE:
            return leaves
    top = at + 1
    while top > at:
        i = top - 1
        recentre(nodes, i)
        if not lay_out(nodes, i, facets, solids, tables, sources[0], task.room, spare_corner, spare_side):
            top -= 1
            continue
        # Where rays graze, and where a cone fades away, there is no end to halving: what is faint is straight enough.
        room = top + 2 < len(nodes) and power_of(nodes, i, tables, task) > _FAINT * task.threshold
        tolerance = facets[nodes[i].facet].texel if kind == LEAF_RECEIVER else task.tolerance
        if room and sources[0].kind != PARALLEL and kind == LEAF_RECEIVER:
            if is_curved(nodes, i, facets, solids, tables, sources[0], tolerance, 1) > 1.0:
                halve_space(nodes, i, top, spare_corner, spare_side)
                top += 1
                continue
        if kind == LEAF_RECEIVER and task.absorbing:
            absorb(nodes, i, facets, solids, tables)
        if not has_room(leaves):
            leaves = grown(leaves)
        bent, uneven = lay_leaf(nodes, i, facets, kind, task.density, leaves)
        leaves.soft[leaves.count[1] : leaves.count[1] + nodes[i].lines] = 0.0
        wide = nodes[i].x[2] - nodes[i].x[0] > _NARROWEST
        # What absorbs may be coloured, with steps that three places do not see.
        most = _COLOURED if task.absorbing else _UNEVEN
        if room and wide and (bent > tolerance or uneven > most):
            middle = 0.5 * (nodes[i].x[0] + nodes[i].x[2])
            halve_spectrum(
                nodes, i, top, middle, facets, solids, tables, sources[0], task, spare_corner, spare_side
            )
            top += 1
            continue
        if bent >= 0.0:
            density_slope(nodes, i, facets, solids, tables, sources[0], task, kind, leaves)
            if room and slope_over(leaves) > _STEEP and nodes[i].corners[1] > 0:
                halve_space(nodes, i, top, spare_corner, spare_side)
                top += 1
                continue
            if len(sources) > 1:
                soften(nodes, i, top, kind, facets, solids, tables, sources, task, leaves, spare_corner, spare_side)
            finish(nodes, i, tables, task, leaves, sums)
            sums[SUM_DEPOSITED if kind == LEAF_RECEIVER else SUM_HANDED] += _flux(nodes, i, tables, task)
        top -= 1
    return leaves


@jit
def absorb(nodes, i, facets, solids, tables):
    """Take from beam i what the medium of its last flight absorbs."""
    inside = medium(solids, nodes[i].mask)
    for a in range(3):
        at, towards = nodes[i].position[a].copy(), nodes[i].direction[a].copy()
        distance, _, _ = advance(at, towards, facets[nodes[i].facet].plane)
        nodes[i].weight[a] *= passes(solids, tables, inside, nodes[i].x[a], distance)


@jit
def soften(nodes, i, spare, kind, facets, solids, tables, sources, task, leaves, spare_corner, spare_side):
    """Set the penumbra of the leaf just laid from where its edges lie for two other points of an extended light.

    The light's part is a disc whose radius is the way to those points. An edge's cover over it rises as the disc's
    cumulative profile; a ramp of the same variance is sqrt(3)/2 of the disc's projected radius wide to each side."""
    row, first = leaves.count[0], leaves.count[1]
    n = nodes[i].lines
    soft, own = np.zeros(n), np.empty(n)
    centre = leaves.centre[row].copy()
    density, slope, bounds = leaves.density[row].copy(), leaves.slope[row].copy(), leaves.head[row].copy()
    for l in range(n):
        e = leaves.edge[first + l, 1]
        own[l] = e[0] * centre[0] + e[1] * centre[1] + e[2]
    for other in range(1, len(sources)):
        copy(nodes, i, spare)
        lay_out(nodes, spare, facets, solids, tables, sources[other], task.room, spare_corner, spare_side)
        lay_leaf(nodes, spare, facets, kind, task.density, leaves)
        for l in range(n):
            if nodes[i].made[l, 2] != STATIC or kind == LEAF_RECEIVER:
                e = leaves.edge[first + l, 1]
                soft[l] += (e[0] * centre[0] + e[1] * centre[1] + e[2] - own[l]) ** 2
    lay_leaf(nodes, i, facets, kind, task.density, leaves)
    leaves.head[row], leaves.density[row], leaves.slope[row] = bounds, density, slope
    for l in range(n):
        leaves.soft[first + l] = 0.8660254 * np.sqrt(soft[l])


@jit
def slope_over(leaves):
    """Largest relative change of the density of the leaf just laid, from its centre to a corner."""
    row, first = leaves.count[0], leaves.count[2]
    most = 0.0
    for c in range(first, first + leaves.head[row, 7]):
        u, v = leaves.corner[c, 0] - leaves.centre[row, 0], leaves.corner[c, 1] - leaves.centre[row, 1]
        most = max(most, abs(leaves.slope[row, 0] * u + leaves.slope[row, 1] * v))
    return most


@jit
def finish(nodes, i, tables, task, leaves, sums):
    """Count the leaf that was laid."""
    row = leaves.count[0]
    leaves.flux[row] = _flux(nodes, i, tables, task)
    leaves.count[1] += leaves.head[row, 6]
    leaves.count[2] += leaves.head[row, 7]
    leaves.count[0] += 1
    sums[SUM_LEAVES] += 1.0


@jit
def onset(nodes, facets, solids, tables, sources, before, after, low, high):
    """x between two places at which the facet of the beam in hand begins to reflect everything."""
    path = nodes[_HAND].path
    plane = facets[nodes[_HAND].facet].plane
    position, direction = np.empty((3, 3)), np.empty((3, 3))
    ends = np.zeros(2)
    at = np.array([low, high])
    for turn in range(45):
        x = at[turn] if turn < 2 else 0.5 * (at[0] + at[1])
        follow(
            sources[0], facets, solids, tables, path, nodes[_HAND].flight, x, nodes[_HAND].centre, position, direction
        )
        cosine = plane[0] * direction[0, 0] + plane[1] * direction[0, 1] + plane[2] * direction[0, 2]
        k = transmitted(cosine, index_of(tables, before, x) / index_of(tables, after, x))
        if turn < 2:
            ends[turn] = k
        elif (k > 0.0) == (ends[0] > 0.0):
            at[0] = x
        else:
            at[1] = x
    return 0.5 * (at[0] + at[1])


@jit
def at_facet(nodes, top, facets, solids, tables, sources, task, leaves, sums, lines, made, spare_corner, spare_side):
    """The beam in hand meets its facet: halved where it has to be, ended, or sent on. Returns (top, leaves)."""
    facet = nodes[_HAND].facet
    kind = facets[facet].kind
    if kind == 3:
        if nodes[_HAND].depth > 0:
            copy(nodes, _HAND, top)
            leaves = end(
                nodes, top, LEAF_RECEIVER, facets, solids, tables, sources, task, leaves, sums, spare_corner, spare_side
            )
        return top, leaves
    if nodes[_HAND].total == _LAY:
        recentre(nodes, _HAND)
        if sources[0].kind != PARALLEL or task.absorbing:
            if not lay_out(nodes, _HAND, facets, solids, tables, sources[0], task.room, spare_corner, spare_side):
                return top, leaves
            recentre(nodes, _HAND)
        nodes[_HAND].total = _UNKNOWN
    if kind == 2:
        sums[SUM_ABSORBED] += _flux(nodes, _HAND, tables, task)
        return top, leaves
    # Nothing of it can be followed farther for certain.
    weak = power_of(nodes, _HAND, tables, task) < task.threshold
    if not weak and drifts(nodes, _HAND, task.drift):
        middle = 0.5 * (nodes[_HAND].x[0] + nodes[_HAND].x[2])
        low, high = halve_spectrum(
            nodes, _HAND, top, middle, facets, solids, tables, sources[0], task, spare_corner, spare_side
        )
        return pushed(nodes, top, low, high), leaves
    if sources[0].kind != PARALLEL and nodes[_HAND].bend >= 0.0:
        bend = is_curved(nodes, _HAND, facets, solids, tables, sources[0], task.tolerance, 0)
        if bend > 1.0 and power_of(nodes, _HAND, tables, task) > _FAINT * task.threshold:
            halve_space(nodes, _HAND, top, spare_corner, spare_side)
            nodes[_HAND].total = nodes[top].total = _LAY
            return pushed(nodes, top, True, True), leaves
        nodes[_HAND].bend = -1.0 if bend < 0.01 else bend
    owner = facets[facet].owner
    inside_of = medium(solids, nodes[_HAND].mask)
    kept = 1.0
    if task.absorbing:
        distance, _ = distance_at(nodes, _HAND, nodes[_HAND].centre, facets, facet)
        kept = passes(solids, tables, inside_of, nodes[_HAND].x[1], distance)
    if kind == 1:
        kept *= at_x(tables, solids[owner].tint, nodes[_HAND].x[1])
        sums[SUM_ABSORBED] += (1.0 - kept) * _flux(nodes, _HAND, tables, task)
        top = child(nodes, top, REFLECT, -1, -1, nodes[_HAND].mask, facets, solids, tables, task, sums)
        return top, leaves
    bit = np.int64(1) << solids[owner].bit
    inside = (nodes[_HAND].mask & bit) != 0
    mask = nodes[_HAND].mask ^ bit
    one, other = inside_of, medium(solids, mask)
    # A facet that is left for the same medium as before, under a solid of higher priority.
    before = solids[one].glass if one >= 0 else -1
    after = solids[other].glass if other >= 0 else -1
    if one == other:
        sums[SUM_ABSORBED] += (1.0 - kept) * _flux(nodes, _HAND, tables, task)
        return child(nodes, top, PASS, before, after, mask, facets, solids, tables, task, sums), leaves
    if nodes[_HAND].total == _UNKNOWN:
        k = np.empty(3)
        for a in range(3):
            eta = index_of(tables, before, nodes[_HAND].x[a]) / index_of(tables, after, nodes[_HAND].x[a])
            k[a] = transmitted(facing(facets, facet, nodes[_HAND].direction[a, 0]), eta)
        for a in range(3):
            # Lower half, upper half, and both ends, should the middle be at the onset itself.
            one, other = (a, a + 1) if a < 2 else (0, 2)
            if (k[one] > _GRAZING and k[other] < -_GRAZING) or (k[one] < -_GRAZING and k[other] > _GRAZING):
                x = onset(nodes, facets, solids, tables, sources, before, after, nodes[_HAND].x[one], nodes[_HAND].x[other])
                low, high = halve_spectrum(
                    nodes, _HAND, top, x, facets, solids, tables, sources[0], task, spare_corner, spare_side
                )
                return pushed(nodes, top, low, high), leaves
        if sources[0].kind != PARALLEL:
            least, most = 1e300, -1e300
            path_row = nodes[_HAND].flight
            nodes[_HAND].path[2, path_row], nodes[_HAND].path[3, path_row] = before, after
            for a in range(3):
                total_line(
                    facets, tables, before, after, facet, nodes[_HAND].x[a], nodes[_HAND].direction[a],
                    nodes[_HAND].centre, lines[a],
                )
            for c in range(nodes[_HAND].corners[1]):
                q = nodes[_HAND].corner[1, c]
                value = lines[1, 0] + lines[1, 1] * q[0] + lines[1, 2] * q[1]
                least, most = min(least, value), max(most, value)
            if least < -_GRAZING and most > _GRAZING:
                made[0], made[1], made[2], made[3] = path_row, facet, TOTAL, 1
                copy(nodes, _HAND, top)
                some = cut(nodes, _HAND, lines, made, spare_corner, spare_side)
                made[3] = -1
                rest = cut(nodes, top, -lines, made, spare_corner, spare_side)
                for j in (_HAND, top):
                    forget_idle_lines(nodes, j)
                    recentre(nodes, j)
                    nodes[j].key = mixed(nodes[j].key, 15 if j == top else 16)
                    lay_out(nodes, j, facets, solids, tables, sources[0], task.room, spare_corner, spare_side)
                nodes[_HAND].total, nodes[top].total = _SOME, _ALL
                return pushed(nodes, top, some, rest), leaves
        nodes[_HAND].total = _SOME if max(k[0], max(k[1], k[2])) > 0.0 else _ALL
    sums[SUM_ABSORBED] += (1.0 - kept) * _flux(nodes, _HAND, tables, task)
    total = nodes[_HAND].total == _ALL
    top = child(nodes, top, REFLECT, before, after, nodes[_HAND].mask, facets, solids, tables, task, sums)
    if not total:
        top = child(nodes, top, REFRACT, before, after, mask, facets, solids, tables, task, sums)
    return top, leaves


@jit
def pushed(nodes, top, low, high):
    """Leave on the stack what is left of the beam in hand and of that at `top`; returns the new top."""
    if high:
        top += 1
    if low:
        copy(nodes, _HAND, top)
        top += 1
    return top


@jit
def child(nodes, top, action, before, after, mask, facets, solids, tables, task, sums):
    """Send the beam in hand on from its facet; returns the new top."""
    flight = nodes[_HAND].flight
    depth = nodes[_HAND].depth + (0 if action == PASS else 1)
    copy_head(nodes, _HAND, top)
    row = nodes[top].path
    row[0, flight], row[1, flight] = nodes[_HAND].facet, action
    row[2, flight], row[3, flight] = before, after
    inside = medium(solids, nodes[_HAND].mask)
    row[4, flight] = solids[inside].tint if inside >= 0 else -1
    path = nodes[top].path
    for a in range(3):
        if a > 0 and nodes[top].x[a] == nodes[top].x[a - 1]:
            nodes[top].position[a] = nodes[top].position[a - 1]
            nodes[top].direction[a] = nodes[top].direction[a - 1]
            nodes[top].weight[a] = nodes[top].weight[a - 1]
            continue
        share = meet(
            facets, solids, tables, path, flight, nodes[top].x[a], nodes[top].position[a], nodes[top].direction[a]
        )
        nodes[top].weight[a] *= share
    nodes[top].flight, nodes[top].depth, nodes[top].mask = flight + 1, depth, mask
    nodes[top].facet, nodes[top].total = -1, _UNKNOWN
    nodes[top].key = mixed(nodes[_HAND].key, 3 + action)
    copy_outline(nodes, _HAND, top)
    if depth > task.depth or flight >= LEVELS - 2:
        sums[SUM_DEPTH] += _flux(nodes, top, tables, task)
        return top
    power = power_of(nodes, top, tables, task)
    if power <= 0.0:
        return top
    if power < task.threshold:
        chance = power / task.threshold
        flux = _flux(nodes, top, tables, task)
        if unit(mixed(nodes[top].key ^ task.seed, 17)) >= chance:
            sums[SUM_ROULETTE] += flux
            return top
        nodes[top].boost /= chance
        sums[SUM_ROULETTE] -= flux * (1.0 / chance - 1.0)
    sums[SUM_BEAMS] += 1.0
    return top + 1


@jit
def run(nodes, top, facets, solids, tables, sources, obstacles, task, leaves, sums):
    """Follow all beams on the stack (rows FIRST … top) to their ends; returns the leaves."""
    lines, made = np.zeros((3, 3)), np.zeros(4, np.int64)
    spare_corner, spare_side = np.empty((128, 2)), np.empty(128, np.int64)
    limit = len(nodes) - 2 * _MOST_FRAGMENTS - 64
    while top > FIRST:
        top -= 1
        copy(nodes, top, _HAND)
        if top > limit:
            sums[SUM_NUMERIC] += _flux(nodes, _HAND, tables, task)
        elif nodes[_HAND].facet >= 0:
            top, leaves = at_facet(
                nodes, top, facets, solids, tables, sources, task, leaves, sums, lines, made, spare_corner, spare_side
            )
        else:
            top, leaves = fly(
                nodes, top, facets, solids, tables, sources, obstacles, task, leaves, sums, lines, made, spare_corner,
                spare_side,
            )
    return leaves
