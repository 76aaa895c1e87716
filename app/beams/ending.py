"""The end of a beam: a leaf of the map, or halved where it is not straight enough."""

from __future__ import annotations

import numpy as np

from .compiling import part
from .current import CURRENT, FAINT, SPARE, halve, may_bend, push_both
from .leaves import anchor_density, density_slope, lay_leaf, passes, plane_map
from .nodes import LINES, STATIC, area_of, copy, first_place, last_place, lay_out
from .rays import PARALLEL, REFLECT
from .search import (
    LEAF_RECEIVER,
    LEAF_TAIL,
    NARROWEST,
    SUM_DEPOSITED,
    SUM_LEAVES,
    SUM_LEFT,
    band_share,
    flux_of,
    halve_space,
    halve_spectrum,
    is_curved,
    medium,
    mixed,
    passes_at,
    power_as,
    recentre,
    unit,
)

_UNEVEN = 0.15
"""A density that leaves the straight line by more is not a parabola for certain."""
_COLOURED = 0.02
"""The largest such deviation where absorption has a colour."""
_STEEP = 0.3
"""A relative change of the density over a leaf that is no longer linear."""
_BULGING = 0.03
"""The second order of such a change at a leaf's rim; what is left of it within the leaf is taken on average."""
_CROOKED = 0.25
"""Share of its width that a polygon's edges may miss where it cannot be halved: it still has nearly its own area."""
_SHARP = 0.05
"""Share of a polygon's widest penumbra: an edge of the facet left last that is sharper masks what is drawn."""
_BESIDE = 1e-7
"""GPU units."""


@part
def outline_of(beam, corner, place, work):
    """Corners of the polygon just laid, at one of its places, and the row of `corner` where they begin."""
    begin = work.count[2]
    for a in range(first_place(beam), place):
        begin += beam.corners[a]
    return corner[begin : begin + beam.corners[place]], begin


@part
def misplaced(beam, bent, corner, work):
    """Share of the light of the polygon just laid, in the middle of its band, that edges which miss by `bent`
    misplace."""
    if first_place(beam) > 0:
        return 0.0
    outline, _ = outline_of(beam, corner, 1, work)
    length = 0.0
    for c in range(1, len(outline)):
        u, v = outline[c, 0] - outline[0, 0], outline[c, 1] - outline[0, 1]
        length = max(length, np.sqrt(u * u + v * v))
    area = area_of(outline, len(outline))
    return bent * length / area if bent * length < area else 1.0


@part
def even_out(beam, new, corner, work):
    """Let the leaf just laid have the same density all over at each of its places, with as much flux as the beam."""
    new.slope[0] = new.slope[1] = 0.0
    for a in range(first_place(beam), last_place(beam)):
        outline, _ = outline_of(beam, corner, a, work)
        area = area_of(outline, len(outline))
        new.density[a] = passes_at(beam, beam, a) * beam.boost * work.density / area if area > 0.0 else 0.0
    if first_place(beam) > 0:
        new.density[0] = new.density[2] = new.density[1]


@part
def halve_by_chance(nodes, facets, solids, tables, sources, work):
    """Cut the current beam's band in the middle and leave one half on the stack, by chance, with the light of both."""
    beam, other = nodes[CURRENT], nodes[work.top]
    low, high = halve_spectrum(beam, other, 0.5 * (beam.x[0] + beam.x[2]), facets, solids, tables, sources[0], work)
    lower, upper = flux_of(beam, tables, work) if low else 0.0, flux_of(other, tables, work) if high else 0.0
    if not lower + upper > 0.0:
        return
    is_lower = unit(mixed(beam.key ^ work.seed, np.int64(18))) * (lower + upper) < lower
    kept = beam if is_lower else other
    kept.boost *= (lower + upper) / (lower if is_lower else upper)
    push_both(nodes, is_lower, not is_lower, work)


@part
def stand_still(beam, new, edge, corner, tables, work):
    """Put the leaf just laid, with all of its flux, where the strongest of its three places is: what grazes lands at
    the horizon for some of its wavelengths, and lines mixed from such ends would hold any area."""
    chosen, most = 1, 0.0
    for a in range(3):
        if passes_at(beam, beam, a) > most:
            chosen, most = a, passes_at(beam, beam, a)
    held = most * band_share(beam, tables, work) * beam.boost * work.density
    if held <= 0.0:
        return
    for ln in range(new.edges):
        line = edge[work.count[1] + ln].line
        for k in range(3):
            line[0, k] = line[1, k] = line[2, k] = line[chosen, k]
    _, begin = outline_of(beam, corner, chosen, work)
    for c in range(beam.corners[chosen]):
        for k in range(2):
            corner[work.count[2] + c, k] = corner[begin + c, k]
    new.corners = beam.corners[chosen]
    density = new.density[chosen] * flux_of(beam, tables, work) / held
    for a in range(3):
        new.density[a] = density


@part
def end(nodes, facets, solids, tables, sources, leaf, edge, corner, work):
    """Write the current beam as a leaf, or halve it where it is not straight enough."""
    beam, source, kind = nodes[CURRENT], sources[0], nodes[CURRENT].ends
    if beam.depth == 0:
        return
    is_parallel = source.kind == PARALLEL
    recentre(beam)
    if (not is_parallel or work.absorbing) and not lay_out(beam, facets, solids, tables, source, work):
        return
    # Where rays graze, and where a cone fades away, there is no end to halving: what is faint is straight enough.
    faint = work.threshold if kind == LEAF_TAIL else FAINT * work.threshold
    power = power_as(beam, beam, tables, work)
    is_free = work.top + 2 < len(nodes)
    room = is_free and power > faint
    tolerance = facets[beam.facet].texel if kind == LEAF_RECEIVER else work.tolerance
    bend = 0.0
    if room and not is_parallel and kind == LEAF_RECEIVER:
        bend = is_curved(beam, facets, solids, tables, source, tolerance, work)
    if bend > 0.0 and bend > may_bend(power, work):
        low, high = halve_space(beam, nodes[work.top], work)
        push_both(nodes, low, high, work)
        return
    if kind == LEAF_RECEIVER and work.absorbing:
        absorb(beam, facets, solids, tables, work)
    bent, uneven = lay_leaf(beam, facets, kind, leaf, edge, corner, work)
    if bent < 0.0:
        return
    most = _COLOURED if work.coloured else _UNEVEN
    # What photons carry on where nothing disperses, they carry over their own bands (`passes.beam_emission`).
    uneven = uneven if work.disperses or kind == LEAF_RECEIVER else 0.0
    bent = bent if work.disperses else 0.0
    missed = misplaced(beam, bent, corner, work) if bent > tolerance else 0.0
    is_wide = beam.x[2] - beam.x[0] > NARROWEST
    if room and is_wide and (missed * power > faint or uneven > most):
        halve(nodes, 0.5 * (beam.x[0] + beam.x[2]), facets, solids, tables, sources, work)
        return
    crooked = kind == LEAF_RECEIVER and missed > _CROOKED
    if crooked and is_wide and is_free:
        halve_by_chance(nodes, facets, solids, tables, sources, work)
        return
    row, first = work.count[0], work.count[2]
    new = leaf[row]
    bulge, mean = density_slope(beam, facets, solids, tables, source, kind, new, work)
    steepest = 0.0
    for c in range(first, first + new.corners):
        u, v = corner[c, 0] - new.centre[0], corner[c, 1] - new.centre[1]
        steepest = max(steepest, abs(new.slope[0] * u + new.slope[1] * v))
    if room and (steepest > _STEEP or bulge > _BULGING) and beam.corners[1] > 0:
        low, high = halve_space(beam, nodes[work.top], work)
        push_both(nodes, low, high, work)
        return
    if work.sources > 1:
        own_lines = beam.lines
        if kind == LEAF_RECEIVER:
            hold_in(beam, facets, solids, tables, source, work)
        soften(nodes, kind, facets, solids, tables, sources, leaf, edge, corner, work)
        if kind == LEAF_RECEIVER:
            mask_edges(beam, own_lines, new, edge, corner, work)
    anchor_density(beam, new, work)
    # What cannot be halved and yet is neither straight nor even must hold its own flux at least.
    if crooked or (kind == LEAF_RECEIVER and steepest > 1.0):
        even_out(beam, new, corner, work)
    if crooked:
        stand_still(beam, new, edge, corner, tables, work)
    flux = (1.0 + mean) * flux_of(beam, tables, work)
    new.flux = flux
    for a in range(3):
        new.density[a] *= 1.0 + mean
    work.count[0] += 1
    work.count[1] += new.edges
    work.count[2] += new.corners
    work.sums[SUM_LEAVES] += 1.0
    work.sums[SUM_DEPOSITED if kind == LEAF_RECEIVER else SUM_LEFT] += flux


@part
def absorb(beam, facets, solids, tables, work):
    """Take from a beam what the medium of its last flight absorbs."""
    inside = medium(solids, beam.mask)
    for a in range(first_place(beam), last_place(beam)):
        distance, _ = plane_map(facets[beam.facet], beam.position[a], beam.direction[a], work.map[a], work)
        beam.weight[a] *= passes(solids, tables, inside, beam.x[a], distance)


@part
def hold_in(beam, facets, solids, tables, source, work):
    """Give a beam the half-planes of all edges of the facet that it left last. Its outline may be within them, but
    penumbrae are as wide as other edges make them, and none may reach beyond a facet that touches the receiver."""
    last = beam.flight - 1
    if last < 0:
        return
    number = np.int64(beam.path[last, 0])
    facet, normal, towards = facets[number], facets[number].plane, beam.direction[1]
    along = normal[0] * towards[0, 0] + normal[1] * towards[0, 1] + normal[2] * towards[0, 2]
    way = 1 if (along > 0.0) == (beam.path[last, 1] != REFLECT) else 2
    before = beam.lines
    for e in range(facet.corners):
        is_known = beam.lines >= LINES - 1
        for ln in range(before):
            made = beam.made[ln]
            is_known = is_known or (made[0] == last and made[1] == number and made[2] == e and made[3] > 0)
        if not is_known:
            made = beam.made[beam.lines]
            made[0], made[1], made[2], made[3] = last, number, e, way
            beam.lines += 1
    if beam.lines > before:
        lay_out(beam, facets, solids, tables, source, work)
        if work.absorbing:
            absorb(beam, facets, solids, tables, work)


@part
def is_of_last(beam, ln):
    """Whether a half-plane is of an edge of the facet left last: not of what stands before that."""
    made, last = beam.made[ln], beam.flight - 1
    return made[0] == last and made[1] == beam.path[last, 0] and made[2] >= 0


@part
def mask_edges(beam, own_lines, new, edge, corner, work):
    """Turn those half-planes of the facet left last that penumbrae reach, and that are sharper than these, into masks
    (negative softness): behind the first `own_lines`, which stay what they are. The others of `hold_in` are dropped."""
    first, lines = work.count[1], beam.lines
    widest = 0.0
    for ln in range(own_lines):
        widest = max(widest, edge[first + ln].soft)
    kept = lines
    for ln in range(lines):
        if not is_of_last(beam, ln) or not edge[first + ln].soft < _SHARP * widest:
            continue
        line, nearest, begin = edge[first + ln].line, 1e300, work.count[2]
        for a in range(first_place(beam), last_place(beam)):
            for c in range(begin, begin + beam.corners[a]):
                nearest = min(nearest, line[a, 0] * corner[c, 0] + line[a, 1] * corner[c, 1] + line[a, 2])
            begin += beam.corners[a]
        if nearest < widest:
            mask = edge[first + kept]
            for a in range(3):
                for c in range(3):
                    mask.line[a, c] = line[a, c]
                # Of two lines in one place the edge bounds the outline.
                mask.line[a, 2] += _BESIDE
            mask.soft = -max(edge[first + ln].soft, _BESIDE)
            kept += 1
    for ln in range(lines, kept):
        edge[first + own_lines + ln - lines] = edge[first + ln]
    new.edges = own_lines + kept - lines


@part
def direction_through(beam, point, facet, out):
    """Direction of a beam's ray, in the middle of its band, that leaves through `point` of the facet left last."""
    x, d, across = beam.position[1], beam.direction[1], facet.frame
    a = b = uu = uv = vu = vv = 0.0
    for k in range(3):
        off = point[k] - x[0, k]
        a += off * across[1, k]
        b += off * across[2, k]
        uu += x[1, k] * across[1, k]
        uv += x[1, k] * across[2, k]
        vu += x[2, k] * across[1, k]
        vv += x[2, k] * across[2, k]
    det = uu * vv - uv * vu
    du = dv = 0.0
    if abs(det) > 1e-30:
        du, dv = (a * vv - b * vu) / det, (b * uu - a * uv) / det
    for k in range(3):
        out[k] = d[0, k] + du * d[1, k] + dv * d[2, k]


@part
def moves(beam, spare, ln, facets, work):
    """How far an edge of the facet that a beam left last moves on the receiver for another point of the lamp: its
    height above the receiver times the change of direction through it, so 0 where it touches the receiver. Taken from
    the edge itself, since half-planes in q are straight about one ray only."""
    facet, ground = facets[beam.made[ln, 1]], facets[beam.facet]
    e, number = beam.made[ln, 2], facet.corners
    begin, end_of = facet.corner[e], facet.corner[e + 1 if e + 1 < number else 0]
    foot, old, new = work.rays[0, 0], work.rays[0, 1], work.rays[0, 2]
    along = size = height = 0.0
    for k in range(3):
        side = end_of[k] - begin[k]
        along += (beam.position[1, 0, k] - begin[k]) * side
        size += side * side
    along = min(max(along / size, 0.0), 1.0)
    for k in range(3):
        foot[k] = begin[k] + along * (end_of[k] - begin[k])
    direction_through(beam, foot, facet, old)
    direction_through(spare, foot, facet, new)
    here = there = 0.0
    for k in range(3):
        height += ground.plane[k] * foot[k]
        here += ground.plane[k] * old[k]
        there += ground.plane[k] * new[k]
    height = abs(height - ground.plane[3])
    if abs(here) < 1e-9 or abs(there) < 1e-9:
        return 0.0
    # Across the edge's image, which lies along the edge seen in the old direction.
    tu = tv = mu = mv = 0.0
    slant = 0.0
    for k in range(3):
        slant += ground.plane[k] * (end_of[k] - begin[k])
    for k in range(3):
        side = end_of[k] - begin[k] - slant / here * old[k]
        turned = new[k] / there - old[k] / here
        tu += ground.frame[1, k] * side
        tv += ground.frame[2, k] * side
        mu += ground.frame[1, k] * turned
        mv += ground.frame[2, k] * turned
    length = np.sqrt(tu * tu + tv * tv)
    return height * abs(mu * tv - mv * tu) / length if length > 0.0 else 0.0


@part
def soften(nodes, kind, facets, solids, tables, sources, leaf, edge, corner, work):
    """Set the penumbra of the leaf just laid from where its edges are for two other points of an extended light.

    The light's part is a disc whose radius is the way to those points. An edge's cover over it rises as the disc's
    cumulative profile; a ramp of the same variance is sqrt(3)/2 of the disc's projected radius wide to each side.
    Where a beam was cut in halves nothing ends: of every point's light either half has what lands on its side. Nor does
    it at the onset of total reflection, where all is reflected on either side, and what passes goes to the horizon."""
    beam, spare = nodes[CURRENT], nodes[SPARE]
    first, n = work.count[1], nodes[CURRENT].lines
    soft, own = work.soft, work.own
    new = leaf[work.count[0]]
    cu, cv, slope_u, slope_v = new.centre[0], new.centre[1], new.slope[0], new.slope[1]
    for turn in range(work.sources):
        if turn > 0:
            copy(beam, spare)
            lay_out(spare, facets, solids, tables, sources[turn], work)
            lay_leaf(spare, facets, kind, leaf, edge, corner, work)
        for ln in range(n):
            e = edge[first + ln].line
            at = e[1, 0] * cu + e[1, 1] * cv + e[1, 2]
            if turn == 0:
                own[ln], soft[ln] = at, 0.0
            elif kind == LEAF_RECEIVER and is_of_last(beam, ln):
                moved = moves(beam, spare, ln, facets, work)
                soft[ln] += moved * moved
            elif beam.made[ln, 2] >= 0 or (beam.made[ln, 2] == STATIC and kind == LEAF_RECEIVER):
                soft[ln] += (at - own[ln]) * (at - own[ln])
    lay_leaf(beam, facets, kind, leaf, edge, corner, work)
    new.slope[0], new.slope[1] = slope_u, slope_v
    for ln in range(n):
        edge[first + ln].soft = 0.8660254 * np.sqrt(soft[ln])
