"""The reference's light tracer, compiled: one photon, one wavelength, one path, one pixel.

Reflection or refraction is drawn with Fresnel's probability, absorption is Beer's law on the
weight, and nothing is cut off but what exceeds the depth. At a diffuse surface the photon's flux
goes to the one pixel that sees the point. Numbers come from a scrambled Sobol sequence (place,
wavelength, place on the light, then one a Fresnel choice) and, when its dimensions are used up, from a hash.
"""

from __future__ import annotations

import math

import numpy as np

from .camera_rays import project
from .compiling import compiled
from .photon_emit import emit_coloured
from .photon_intersect import blocked, nearest, normal_at
from .photon_scene import BLACK, DIFFUSE
from .polarised import begin_unpolarised
from .sampling import DIMENSIONS, FIRST_CHOICE, choice, mixed, sobol_next, sobol_start
from .scattering import AIR, scatter, side_met, transmitted
from .worn_textures import worn_at

EMITTED, DEPOSITED, DIRECT, ABSORBED, ESCAPED, LOST_DEPTH, LOST_NUMERIC = range(7)
COUNTED = 7
"""Places in a tally (`photon_run.TALLY` and what follows)."""


@compiled
def _deposit(scene, camera, worn, colour, atom, triangle, u, v, place, from_front, watt, picture, stack):
    """Add a landed photon to its pixel; returns (row, column, luminance added), row −1 where the camera does not see
    it."""
    px, py, pz = place
    row, column, factor, tx, ty, tz, distance = project(camera, px, py, pz)
    if row < 0:
        return -1, -1, 0.0
    nx, ny, nz = normal_at(scene, triangle, px, py, pz)
    cosine = tx * nx + ty * ny + tz * nz
    # An opaque sheet: light on one side is not seen from the other.
    if (cosine > 0.0) != from_front or cosine == 0.0:
        return -1, -1, 0.0
    if blocked(scene, px, py, pz, tx, ty, tz, distance, triangle, stack):
        return -1, -1, 0.0
    pixel_area = 4.0 * camera.half_width * camera.half_height / (camera.width * camera.height)
    radiance = watt * abs(cosine) * factor / (math.pi * pixel_area)
    thing = scene.owner[triangle]
    rgb = colour.rgb[scene.reflectance_class[thing], atom]
    red, green, blue = worn_at(worn, thing, triangle, u, v)
    r = radiance * rgb[0] * scene.reflectance[thing, 0] * red
    g = radiance * rgb[1] * scene.reflectance[thing, 1] * green
    b = radiance * rgb[2] * scene.reflectance[thing, 2] * blue
    picture[row, column, 0] += r
    picture[row, column, 1] += g
    picture[row, column, 2] += b
    return row, column, 0.2126 * r + 0.7152 * g + 0.0722 * b


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
    stack, stack_distance, state, shift = scratch.stack, scratch.stack_distance, scratch.state, scratch.shift
    sobol_start(sequence, first, state)
    pilot = importance.shape[0] > 0
    for i in range(first, first + count):
        if i > first:
            sobol_next(sequence, i, state)
        px, py, pz, dx, dy, dz, watt, row, column, atom, nm = emit_coloured(domain, colour, share, state)
        if watt <= 0.0:
            continue
        if scene.polarised:
            begin_unpolarised(scratch.field, dx, dy, dz)
        tally[EMITTED] += watt
        tally[COUNTED] += 1.0
        noise = mixed(sequence.key ^ mixed(np.uint64(i)))
        dimension = FIRST_CHOICE if domain.extended else FIRST_CHOICE - 2
        last, last_object, within, mask, alone, depth = -1, -1, False, np.uint64(0), AIR, 0
        while True:
            t, triangle, u, v = nearest(
                scene, px, py, pz, dx, dy, dz, last, last_object, within, mask, stack, stack_distance
            )
            if triangle < 0:
                tally[ESCAPED if mask == np.uint64(0) and alone == AIR else LOST_NUMERIC] += watt
                break
            kept = transmitted(scene, mask, alone, nm, t)
            tally[ABSORBED] += watt * (1.0 - kept)
            watt *= kept
            if watt <= 0.0:
                break
            px, py, pz = px + t * dx, py + t * dy, pz + t * dz
            place = px, py, pz
            thing = scene.owner[triangle]
            kind = scene.kind[thing]
            if kind == DIFFUSE:
                if depth == 0:  # no caustic
                    tally[DIRECT] += watt
                    break
                tally[DEPOSITED] += watt
                is_front = side_met(scene, triangle, place, dx, dy, dz) == 0
                y, x, added = _deposit(
                    scene, camera, worn, colour, atom, triangle, u, v, place, is_front, watt, picture, stack
                )
                if y >= 0:
                    tally[COUNTED + 1] += 1.0
                    if pilot:
                        importance[row, column] += added * added * pixel_weight[y, x]
                break
            if kind == BLACK:
                tally[ABSORBED] += watt
                break
            if depth >= max_depth:
                tally[LOST_DEPTH] += watt
                break
            last, last_object = triangle, thing
            draw = choice(state, shift, dimension, noise, dimension - DIMENSIONS + 1)
            dx, dy, dz, mask, alone, within, is_event, kept, drawn = scatter(
                scene, triangle, place, u, v, dx, dy, dz, mask, alone, nm, draw, noise, depth, scratch.field
            )
            depth += is_event
            dimension += drawn
            tally[ABSORBED] += watt * (1.0 - kept)
            watt *= kept
            if watt <= 0.0:
                break
