"""The reference's photons, compiled: one photon, one wavelength, one path, to where it ends.

Reflection or refraction is drawn with Fresnel's probability, absorption is Beer's law on the weight, and only what
exceeds the depth is cut off. A photon that reaches a diffuse surface by glass or mirrors is added to the one pixel
that sees the place (`trace`), or recorded there (`land`), so that camera paths can look it up, through glass too.
Random numbers are a scrambled Sobol sequence (place, wavelength, place on the light, then one a Fresnel choice) and,
when its dimensions are used up, a hash.
"""

from __future__ import annotations

import math

import numpy as np

from .compiling import FIRST, NO, NONE, compiled, inlined
from .photon_emit import emit_coloured
from .photon_intersect import blocked, nearest, normal_at
from .photon_scene import BLACK, DIFFUSE
from .polarised import begin_unpolarised
from .sampling import DIMENSIONS, FIRST_CHOICE, choice, mixed, sobol_next, sobol_start
from .scattering import AIR, scatter, side_met, transmitted
from .vectors import dot, moved
from .viewpoint import project
from .worn_textures import worn_at

EMITTED, DEPOSITED, DIRECT, ABSORBED, ESCAPED, LOST_DEPTH, LOST_NUMERIC = range(7)
COUNTED = 7
"""Places in a tally (`photon_reference.KIND` and what follows)."""
_LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Y of linear Rec.709."""


@inlined
def _follow(scene, place, d, nm, watt, noise, dimension, by_event, max_depth, tally, scratch):
    """A photon to its end: (its fate, a place in `tally`, place, direction, triangle, u, v, W left).

    What is absorbed on the way is added to `tally`, and all of it where nothing is left. Choices take their numbers
    from `dimension` of the sequence on: one an event (`by_event`), or one for each event where it decides anything.
    """
    if scene.polarised:
        begin_unpolarised(scratch.field, d)
    last, within, mask, alone, depth = NONE, NO, np.uint64(0), AIR, FIRST
    while True:
        t, triangle, u, v = nearest(scene, place, d, last, within, mask, scratch)
        if triangle < 0:
            fate = ESCAPED if mask == np.uint64(0) and alone == AIR else LOST_NUMERIC
            break
        kept = transmitted(scene, mask, alone, nm, t)
        tally[ABSORBED] += watt * (1.0 - kept)
        watt *= kept
        place = moved(place, t, d)
        kind = scene.kind[scene.owner[triangle]]
        if watt <= 0.0 or kind == BLACK:
            fate = ABSORBED
            break
        if kind == DIFFUSE:
            fate = DEPOSITED if depth > 0 else DIRECT  # straight from the light it is no caustic
            break
        if depth >= max_depth:
            fate = LOST_DEPTH
            break
        last = triangle
        turn = depth if by_event else dimension - DIMENSIONS + 1
        draw = choice(scratch.state, scratch.shift, dimension, noise, turn)
        d, mask, alone, within, is_event, kept, drawn = scatter(
            scene, triangle, place, u, v, d, mask, alone, nm, draw, noise, depth, scratch.field
        )
        depth += is_event
        dimension += is_event if by_event else drawn
        tally[ABSORBED] += watt * (1.0 - kept)
        watt *= kept
        if watt <= 0.0:
            fate = ABSORBED
            break
    return fate, place, d, triangle, u, v, watt


@compiled
def _deposit(scene, camera, worn, colour, atom, triangle, u, v, place, from_front, watt, picture, stack):
    """Add a landed photon to its pixel; returns (row, column, luminance added), row −1 where the camera does not see
    it."""
    row, column, factor, toward, distance = project(camera, place)
    if row < 0:
        return -1, -1, 0.0
    cosine = dot(toward, normal_at(scene, triangle, place))
    # An opaque sheet: light on one side is not seen from the other.
    if (cosine > 0.0) != from_front or cosine == 0.0:
        return -1, -1, 0.0
    if blocked(scene, place, toward, distance, triangle, stack):
        return -1, -1, 0.0
    pixel_area = 4.0 * camera.half_width * camera.half_height / (camera.width * camera.height)
    radiance = watt * abs(cosine) * factor / (math.pi * pixel_area)
    thing = scene.owner[triangle]
    rgb = colour.rgb[scene.reflectance_class[thing], atom]
    texture = worn_at(worn, thing, triangle, u, v)
    luminance = 0.0
    for c in range(3):
        value = radiance * rgb[c] * scene.reflectance[thing, c] * texture[c]
        picture[row, column, c] += value
        luminance += _LUMINANCE[c] * value
    return row, column, luminance


@compiled
def trace(
    scene,
    camera,
    worn,
    domain,
    colour,
    sequence,
    first,
    count,
    share,
    max_depth,
    picture,
    tally,
    pixel_weight,
    importance,
    scratch,
):
    """Trace photons [first, first + count) of one domain.

    `share`: factor on every weight. `picture` (H, W, 3) and `tally` (9,) are added to. With a non-empty
    `importance` (GRID, GRID), squares of what each cell's photons add, times `pixel_weight` (H, W), are added to it.
    """
    state = scratch.state
    sobol_start(sequence, first, state)
    for i in range(first, first + count):
        if i > first:
            sobol_next(sequence, i, state)
        place, d, watt, row, column, atom, nm = emit_coloured(domain, colour, share, state)
        if watt <= 0.0:
            continue
        tally[EMITTED] += watt
        tally[COUNTED] += 1.0
        noise = mixed(sequence.key ^ mixed(np.uint64(i)))
        dimension = FIRST_CHOICE if domain.extended else FIRST_CHOICE - 2
        fate, place, d, triangle, u, v, watt = _follow(
            scene, place, d, nm, watt, noise, dimension, False, max_depth, tally, scratch
        )
        tally[fate] += watt
        if fate == DEPOSITED:
            from_front = side_met(scene, triangle, place, d) == 0
            y, x, added = _deposit(
                scene, camera, worn, colour, atom, triangle, u, v, place, from_front, watt, picture, scratch.stack
            )
            if y >= 0:
                tally[COUNTED + 1] += 1.0
                if importance.shape[0] > 0:
                    importance[row, column] += added * added * pixel_weight[y, x]


@compiled
def land(
    scene, domain, colour, band_of, side, sequence, first, count, share, max_depth, tally, points, watts, ends, scratch
):
    """Trace photons [first, first + count) of a domain and note those that land after glass or a mirror: their number.

    `band_of` int32 (A,): bin of each atom of `colour`; `side` (O, 2): number of a receiver's front and back (−1: not
    counted); `share`: factor on every weight. Fills `points` (count, 3), `watts` (count,) and `ends` int32 (count, 4):
    side, bin, and the cell of the domain they came from (row, column). `tally` (9,) is added to.
    """
    state = scratch.state
    sobol_start(sequence, first, state)
    landed = 0
    for i in range(first, first + count):
        if i > first:
            sobol_next(sequence, i, state)
        place, d, watt, row, column, atom, nm = emit_coloured(domain, colour, share, state)
        if watt <= 0.0:
            continue
        noise = mixed(sequence.key ^ mixed(np.uint64(i)))
        fate, place, d, triangle, _, _, watt = _follow(
            scene, place, d, nm, watt, noise, FIRST_CHOICE, True, max_depth, tally, scratch
        )
        if fate == DEPOSITED:
            at = side[scene.owner[triangle], side_met(scene, triangle, place, d)]
            if at >= 0:
                points[landed, 0], points[landed, 1], points[landed, 2] = place
                watts[landed] = watt
                ends[landed, 0], ends[landed, 1], ends[landed, 2], ends[landed, 3] = at, band_of[atom], row, column
                landed += 1
    return landed
