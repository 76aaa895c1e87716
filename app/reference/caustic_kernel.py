"""Photons that land on flat receivers, compiled: where, in which spectral bin, with how much power.

The photons are those of the light's reference (`photon_emission`: densities; `photon_emit`: rays); only
their end differs: they are counted on the receiver, not in a pixel, so that the camera's reference may look at them
through glass.
"""

from __future__ import annotations

import numpy as np

from .camera_kernel import on_plane, texel_of
from .compiling import compiled
from .photon_emit import emit_coloured
from .photon_intersect import nearest
from .photon_scene import BLACK, DIFFUSE
from .polarised import begin_unpolarised
from .sampling import FIRST_CHOICE, choice, mixed, sobol_next, sobol_start
from .scattering import AIR, scatter, side_met, transmitted


@compiled
def land(scene, domain, colour, band_of, side, sequence, first, count, share, max_depth, points, watts, ends, scratch):
    """Trace photons [first, first + count) of a domain and note those that land after glass or a mirror: their number.

    `band_of` int32 (A,): bin of each atom of `colour`; `side` (O, 2): number of a receiver's front and back (−1: not
    counted);
    `share`: factor on every weight. Fills `points` (count, 3), `watts` (count,) and `ends` int32 (count, 4): side, bin,
    and the cell of the domain they came from (row, column).
    """
    stack, stack_distance, state, shift = scratch.stack, scratch.stack_distance, scratch.state, scratch.shift
    sobol_start(sequence, first, state)
    landed = 0
    for i in range(first, first + count):
        if i > first:
            sobol_next(sequence, i, state)
        px, py, pz, dx, dy, dz, watt, row, column, atom, nm = emit_coloured(domain, colour, share, state)
        noise = mixed(sequence.key ^ mixed(np.uint64(i)))
        last, last_object, within, mask, alone, events = -1, -1, False, np.uint64(0), AIR, 0
        if scene.polarised:
            begin_unpolarised(scratch.field, dx, dy, dz)
        while watt > 0.0:
            t, triangle, u, v = nearest(
                scene, px, py, pz, dx, dy, dz, last, last_object, within, mask, stack, stack_distance
            )
            if triangle < 0:
                break
            watt *= transmitted(scene, mask, alone, nm, t)
            px, py, pz = px + t * dx, py + t * dy, pz + t * dz
            place = px, py, pz
            thing = scene.owner[triangle]
            kind = scene.kind[thing]
            if kind == BLACK or (kind != DIFFUSE and events >= max_depth):
                break
            if kind == DIFFUSE:
                at = side[thing, side_met(scene, triangle, place, dx, dy, dz)]
                if events > 0 and at >= 0:  # straight from the light it is no caustic
                    points[landed, 0], points[landed, 1], points[landed, 2] = px, py, pz
                    watts[landed] = watt
                    ends[landed, 0], ends[landed, 1], ends[landed, 2], ends[landed, 3] = at, band_of[atom], row, column
                    landed += 1
                break
            last, last_object = triangle, thing
            draw = choice(state, shift, FIRST_CHOICE + events, noise, events)
            dx, dy, dz, mask, alone, within, is_event, kept, _ = scatter(
                scene, triangle, place, u, v, dx, dy, dz, mask, alone, nm, draw, noise, events, scratch.field
            )
            watt *= kept
            events += is_event
    return landed


@compiled
def gather(tables, points, watts, ends, count, sums):
    """Add landed photons to `sums` (as `CausticTables.irradiance`, but W a texel).

    A photon counts in the finest window that holds it; returns the power beyond all windows.
    """
    outside = 0.0
    for i in range(count):
        at = ends[i, 0]
        x, y = on_plane(tables, at, points[i, 0], points[i, 1], points[i, 2])
        held = False
        for window in (1, 0):
            texel = texel_of(tables, at, window, x, y)
            if texel >= 0:
                held = True
                sums[tables.first[at, window] + texel * tables.bins + ends[i, 1]] += watts[i]
                break
        if not held:
            outside += watts[i]
    return outside
