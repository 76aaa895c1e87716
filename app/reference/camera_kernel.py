"""The camera's reference, compiled: one camera path of one wavelength, to the first diffuse surface.

Reflection or refraction is drawn with Fresnel's probability, so that a path's weight changes by absorption and mirrors
only; lights are seen along the way, the environment at its end. At a diffuse surface one random point of every light
is sampled (anything between hides it, glass too: light through glass belongs to the caustic), and the spectral caustic
is looked up. Where the environment or other diffuse surfaces light it, the path continues from there, in a direction
by the cosine or towards what is bright, until it leaves the scene or has met one diffuse surface more than light may
bounce between.

Random numbers: a scrambled Sobol sequence for each part, shifted from pixel to pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .camera_coat import base_reflectance, coat_albedo, coat_lobe, reflected_by_coat, under_coat
from .camera_lights import draw_by_cosine, draw_direction, light_seen, sample_light
from .camera_scene import beyond
from .compiling import FIRST, NO, NONE, compiled, inlined
from .photon_emit import search
from .photon_intersect import blocked, nearest, normal_at
from .photon_scene import BLACK, DIFFUSE
from .sampling import DIMENSIONS, FIRST_CHOICE, choice, mixed, sobol_next, sobol_start, unit, word_number
from .scattering import AIR, begin_light, scatter, side_met, transmitted
from .vectors import dot, moved, negated
from .viewpoint import lens_ray
from .worn_textures import worn_at

_LENS = np.uint64(0xD1B54A32D192ED03)
"""Makes the numbers for the place on the lens independent of those of Fresnel choices."""
_BOUNCE = np.uint64(0x8CB92BA72F3D8DD7)
"""Likewise those at the second diffuse surface of a path and later ones."""
_COAT = np.uint64(0x2545F4914F6CDD1D)
"""Likewise those for coats."""
LOST_DEPTH, LOST_NUMERIC = range(2)
"""Places in a tally of paths that were given up: too many events, or nothing met inside a solid."""


class CausticTables(NamedTuple):
    """The spectral caustic as paths look it up: S sides of flat receivers, each a coarse window (0) and a fine one
    (1)."""

    side: np.ndarray
    """int32 (O, 2): S of an object's front and back, or −1."""
    frame: np.ndarray
    """float64 (S, 3, 3): origin, then the plane's two unit axes."""
    low: np.ndarray
    """float64 (S, 2, 2): a window's lower corner on the plane."""
    texels_per_unit: np.ndarray
    """float64 (S, 2, 2)."""
    size: np.ndarray
    """int64 (S, 2, 2): columns and rows."""
    first: np.ndarray
    """int64 (S, 2): where a window begins in `irradiance`."""
    irradiance: np.ndarray
    """float32 (texels × bins,): W/unit² of each bin, row by row, texel by texel."""
    bins: int


@inlined
def texel_of(tables, side, window, x, y):
    """Number of the texel that holds a point of the plane, counted within its window; −1: outside."""
    column = math.floor((x - tables.low[side, window, 0]) * tables.texels_per_unit[side, window, 0])
    row = math.floor((y - tables.low[side, window, 1]) * tables.texels_per_unit[side, window, 1])
    width, height = tables.size[side, window, 0], tables.size[side, window, 1]
    if column < 0 or column >= width or row < 0 or row >= height:
        return -1
    return int(row) * width + int(column)


@inlined
def on_plane(tables, side, place):
    """Coordinates of a point on a side's plane."""
    f = tables.frame[side]
    r = place[0] - f[0, 0], place[1] - f[0, 1], place[2] - f[0, 2]
    return dot(r, f[1]), dot(r, f[2])


@inlined
def _caustic_texel(tables, side, place):
    """Where the bins of the finest texel that holds the point begin; −1: none does."""
    if side < 0:
        return -1
    x, y = on_plane(tables, side, place)
    for window in (1, 0):
        texel = texel_of(tables, side, window, x, y)
        if texel >= 0:
            return tables.first[side, window] + texel * tables.bins
    return -1


@compiled
def gather(tables, points, watts, ends, count, sums):
    """Add landed photons to `sums` (as `CausticTables.irradiance`, but W a texel).

    A photon counts in the finest window that holds it; returns the power beyond all windows.
    """
    outside = 0.0
    for i in range(count):
        texel = _caustic_texel(tables, ends[i, 0], points[i])
        if texel >= 0:
            sums[texel + ends[i, 1]] += watts[i]
        else:
            outside += watts[i]
    return outside


@inlined
def _surface(scene, pictures, triangle, u, v):
    """A diffuse surface's reflectance at a point: (class, r, g, b); the colour counts in class 0 only."""
    thing = scene.owner[triangle]
    r, g, b = worn_at(pictures, thing, triangle, u, v)
    colour = pictures.colour[thing]
    return scene.reflectance_class[thing], colour[0] * r, colour[1] * g, colour[2] * b


@inlined
def _at_light(lights, i, place, a, b):
    """`sample_light` of light i: the plastic number's fractions move the sample's place on from light to light."""
    at, bt = a + i * 0.7548776662466927, b + i * 0.5698402909980532
    return sample_light(lights, i, place, at - math.floor(at), bt - math.floor(bt))


@inlined
def gain_of_light(scene, lights, i, triangle, side, place, a, b, stack):
    """(irradiance by light i, per unit of its quantity, on a facet's front (side 0) or back (1), unit direction to the
    light)."""
    toward, distance, gain = _at_light(lights, i, place, a, b)
    gain *= (1.0 if side == 0 else -1.0) * dot(toward, normal_at(scene, triangle, place))
    # A hair less than the way, so that a surface which the light touches does not hide it.
    if gain <= 0.0 or blocked(scene, place, toward, distance * (1.0 - 1e-9), triangle, stack):
        return 0.0, toward
    return gain, toward


@inlined
def _added(table, i, row, red, green, blue, factor, xyz):
    """Add row i of a table of XYZ by reflectance (`Spectra.light_xyz`) to `xyz` (3,)."""
    for c in range(3):
        xyz[c] += factor * (
            table[i, 2 + row, c] if row > 0 else red * table[i, 0, c] + green * table[i, 1, c] + blue * table[i, 2, c]
        )


@inlined
def _finished(scene, pictures, spectra, atom, triangle, u, v, o, i, n):
    """Reflectance in an atom of a finished surface's base, under its coat, for light from `i` (0: from all sides)."""
    made, thing = pictures.finishes, scene.owner[triangle]
    row, red, green, blue = _surface(scene, pictures, triangle, u, v)
    cosine = dot(o, n)
    basis, rough = spectra.basis[atom], made.roughness[thing]
    reflectance = spectra.classes[row, atom]
    if row == 0:
        reflectance = basis[0] * base_reflectance(red, rough, cosine, o, i, n)
        reflectance += basis[1] * base_reflectance(green, rough, cosine, o, i, n)
        reflectance += basis[2] * base_reflectance(blue, rough, cosine, o, i, n)
    return reflectance * under_coat(made, thing, cosine, dot(i, n) if dot(i, i) > 0.5 else -1.0)


@inlined
def _coat_highlights(scene, lights, spectra, pictures, atom, triangle, place, side, o, n, a, b, scratch):
    """Radiance in an atom that a coat reflects of lights without extent, which no path runs into."""
    found = 0.0
    for i in range(lights.kind.shape[0]):
        if lights.measure[i] == 0.0 and spectra.lights[i, atom] > 0.0:
            gain, toward = gain_of_light(scene, lights, i, triangle, side, place, a, b, scratch.stack)
            if gain > 0.0:
                lobe = coat_lobe(pictures.finishes, scene.owner[triangle], o, toward, n)
                found += spectra.lights[i, atom] * gain / dot(toward, n) * lobe
    return found


@inlined
def _finished_base(scene, lights, spectra, pictures, tables, atom, triangle, u, v, place, side, o, n, a, b, scratch):
    """Radiance in an atom that a finished surface's base scatters."""
    total = 0.0
    for i in range(lights.kind.shape[0]):
        if spectra.lights[i, atom] > 0.0:
            gain, toward = gain_of_light(scene, lights, i, triangle, side, place, a, b, scratch.stack)
            if gain > 0.0:
                seen = _finished(scene, pictures, spectra, atom, triangle, u, v, o, toward, n)
                total += spectra.lights[i, atom] * gain * seen
    texel = _caustic_texel(tables, tables.side[scene.owner[triangle], side], place)
    if texel >= 0:
        irradiance = spectra.share[atom] * tables.irradiance[texel + spectra.bin[atom]]
        total += irradiance * _finished(scene, pictures, spectra, atom, triangle, u, v, o, (0.0, 0.0, 0.0), n)
    return total / math.pi


@inlined
def _plain(scene, pictures, spectra, atom, triangle, u, v):
    """Reflectance in an atom of a Lambertian surface."""
    row, red, green, blue = _surface(scene, pictures, triangle, u, v)
    basis = spectra.basis[atom]
    return spectra.classes[row, atom] if row > 0 else red * basis[0] + green * basis[1] + blue * basis[2]


@inlined
def _diffuse(scene, lights, spectra, pictures, tables, atom, triangle, u, v, place, side, a, b, scratch):
    """Radiance in an atom that a side of a Lambertian surface scatters; without atom (−1) that of all wavelengths is
    added to `scratch.xyz`."""
    xyz = scratch.xyz
    row, red, green, blue = _surface(scene, pictures, triangle, u, v)
    white = atom < 0
    total = 0.0
    for i in range(lights.kind.shape[0]):
        if white or spectra.lights[i, atom] > 0.0:
            gain, _ = gain_of_light(scene, lights, i, triangle, side, place, a, b, scratch.stack)
            if white and gain > 0.0:
                _added(spectra.light_xyz, i, row, red, green, blue, gain / math.pi, xyz)
            elif gain > 0.0:
                total += spectra.lights[i, atom] * gain
    texel = _caustic_texel(tables, tables.side[scene.owner[triangle], side], place)
    if white:
        if texel >= 0:
            for i in range(tables.bins):
                irradiance = tables.irradiance[texel + i]
                if irradiance > 0.0:
                    _added(spectra.bin_xyz, i, row, red, green, blue, irradiance / math.pi, xyz)
        return 0.0
    if texel >= 0:
        total += spectra.share[atom] * tables.irradiance[texel + spectra.bin[atom]]
    return total * _plain(scene, pictures, spectra, atom, triangle, u, v) / math.pi


@inlined
def _wavelength(spectra, chance):
    """(atom, nm) drawn by a number in [0, 1)."""
    atom = search(spectra.cdf, chance)
    part = (chance - spectra.cdf[atom]) / (spectra.cdf[atom + 1] - spectra.cdf[atom])
    return atom, spectra.start_nm[atom] + spectra.width_nm[atom] * part


@inlined
def _start_ray(camera, column, row, noise):
    """The ray through the picture's point, from a place on the lens that the hash `noise` chooses."""
    first, second = noise + np.uint64(1) * _LENS, noise + np.uint64(2) * _LENS
    return lens_ray(camera, column, row, word_number(first), word_number(second))


@inlined
def _at_diffuse(state, shift, noise, number):
    """Two numbers in [0, 1) for the diffuse surface `number` of a path."""
    if number == 0:
        return unit(state[3] ^ shift[3]), unit(state[4] ^ shift[4])
    first = noise + np.uint64(2 * number) * _BOUNCE
    return word_number(first), word_number(noise + np.uint64(2 * number + 1) * _BOUNCE)


@inlined
def _of_coat(noise, events, number):
    """The choice between coat and base (0) after so many events, or a number for its facet (1, 2): in [0, 1)."""
    return word_number(mixed(noise + np.uint64(events + 1) * _COAT) + np.uint64(number) * _LENS)


@inlined
def sample(scene, lights, spectra, pictures, tables, start, ray, noise, max_depth, bounces, tally, scratch):
    """Add what a camera ray sees to `scratch.xyz`; diffuse surfaces light each other `bounces` times over.

    Up to the first event at glass or a mirror nothing depends on a wavelength, and all are added at once;
    then one is drawn, and its probability divides its contribution.
    """
    place, d = ray
    state, shift, xyz = scratch.state, scratch.shift, scratch.xyz
    last, within, mask, alone, events = NONE, NO, start.mask, start.alone, FIRST
    atom, nm, found, weight, surfaces = -1, 0.0, 0.0, 1.0, 0
    if mask != np.uint64(0) or alone != AIR:  # in glass wavelengths part at once
        atom, nm = _wavelength(spectra, unit(state[2] ^ shift[2]))
    if scene.polarised:  # by reciprocity a path loses what light that came along it would
        begin_light(scene, scratch.field, d, mask, alone, nm, _of_coat(noise, -1, 0))
    while True:
        t, triangle, u, v = nearest(scene, place, d, last, within, mask, scratch)
        far = t if triangle >= 0 else np.inf
        for i in range(0 if surfaces > 0 else lights.kind.shape[0]):
            seen = light_seen(lights, i, place, d, far)
            if seen > 0.0 and atom < 0:
                _added(spectra.light_xyz, i, 0, 1.0, 1.0, 1.0, seen, xyz)
            elif seen > 0.0:
                found += weight * seen * spectra.lights[i, atom]
        if triangle < 0:
            if mask != np.uint64(0) or alone != AIR:
                tally[LOST_NUMERIC] += 1.0
                break
            red, green, blue = beyond(pictures, d)
            if atom < 0:
                _added(spectra.beyond_xyz, 0, 0, red, green, blue, 1.0, xyz)
            else:
                basis = spectra.basis[atom]
                found += weight * spectra.daylight[atom] * (red * basis[0] + green * basis[1] + blue * basis[2])
            break
        if atom >= 0:
            weight *= transmitted(scene, mask, alone, nm, t)
        place = moved(place, t, d)
        thing = scene.owner[triangle]
        kind = scene.kind[thing]
        if kind == BLACK or weight <= 0.0 or (surfaces > bounces and kind == DIFFUSE):
            break
        if kind == DIFFUSE:
            a, b = _at_diffuse(state, shift, noise, surfaces)
            side = side_met(scene, triangle, place, d)
            n = normal_at(scene, triangle, place)
            n = n if side == 0 else negated(n)
            made, o = pictures.finishes, negated(d)
            ends = surfaces == bounces and not pictures.draw.lights
            # Finishes count at the first surface alone: light between surfaces is scattered as by plain ones.
            coated = surfaces == 0 and made.alpha[thing] >= 0.0
            finished = coated or (surfaces == 0 and made.roughness[thing] > 0.0)
            if atom < 0 and (finished or not ends):
                atom, nm = _wavelength(spectra, unit(state[2] ^ shift[2]))
            if coated:
                found += weight * _coat_highlights(
                    scene, lights, spectra, pictures, atom, triangle, place, side, o, n, a, b, scratch
                )
                # To the coat or to its base, by what the coat reflects.
                by_coat = min(max(coat_albedo(made, thing, dot(o, n)), 0.3), 0.7)
                if _of_coat(noise, events, 0) < by_coat:
                    facet_a, facet_b = _of_coat(noise, events, 1), _of_coat(noise, events, 2)
                    d, share = reflected_by_coat(made, thing, d, n, facet_a, facet_b)
                    weight *= share / by_coat
                    if scene.polarised:  # a coat takes light as unpolarised, and leaves it so
                        begin_light(scene, scratch.field, d, mask, alone, nm, _of_coat(noise, events, 3))
                    last, within, events = triangle, side == 1, events + 1
                    if weight <= 0.0 or events >= max_depth:
                        break
                    continue
                weight /= 1.0 - by_coat
            if finished:
                found += weight * _finished_base(
                    scene, lights, spectra, pictures, tables, atom, triangle, u, v, place, side, o, n, a, b, scratch
                )
            else:
                found += weight * _diffuse(
                    scene, lights, spectra, pictures, tables, atom, triangle, u, v, place, side, a, b, scratch
                )
            if ends:
                break
            d, share = draw_direction(pictures.draw, n, a, b)
            if finished:
                weight *= _finished(scene, pictures, spectra, atom, triangle, u, v, o, d, n)
            else:
                weight *= _plain(scene, pictures, spectra, atom, triangle, u, v)
            if scene.polarised:  # a diffuse surface depolarises
                begin_light(scene, scratch.field, d, mask, alone, nm, _of_coat(noise, events, 3))
            weight *= share
            last, within, surfaces = triangle, side == 1, surfaces + 1
            continue
        if events >= max_depth:
            tally[LOST_DEPTH] += 1.0
            break
        if atom < 0:
            atom, nm = _wavelength(spectra, unit(state[2] ^ shift[2]))
        last = triangle
        draw = choice(state, shift, FIRST_CHOICE + events, noise, events)
        d, mask, alone, within, is_event, kept, _ = scatter(
            scene, triangle, place, u, v, d, mask, alone, nm, draw, noise, events, scratch.field
        )
        weight *= kept
        events += is_event
    if found > 0.0:
        for c in range(3):
            xyz[c] += found * spectra.response[atom, c]


@compiled
def trace_camera(
    scene,
    camera,
    lights,
    spectra,
    pictures,
    tables,
    start,
    sequence,
    first,
    count,
    max_depth,
    bounces,
    sums,
    tally,
    scratch,
):
    """Add samples [first, first + count) of every pixel to `sums` (H, W, 3), XYZ of each: divide by their number."""
    beginning, state, shift, xyz = scratch.beginning, scratch.state, scratch.shift, scratch.xyz
    sobol_start(sequence, first, beginning)
    for row in range(camera.height):
        for column in range(camera.width):
            key = mixed(sequence.key ^ mixed(np.uint64(row * camera.width + column)))
            for d in range(DIMENSIONS):
                key += np.uint64(0x9E3779B97F4A7C15)
                shift[d] = np.uint32(mixed(key) >> np.uint64(32))
                state[d] = beginning[d]
            for i in range(first, first + count):
                if i > first:
                    sobol_next(sequence, i, state)
                noise = mixed(key ^ mixed(np.uint64(i)))
                x, y = column + unit(state[0] ^ shift[0]), row + unit(state[1] ^ shift[1])
                ray = _start_ray(camera, x, y, noise)
                sample(scene, lights, spectra, pictures, tables, start, ray, noise, max_depth, bounces, tally, scratch)
            for c in range(3):
                sums[row, column, c] += xyz[c]
                xyz[c] = 0.0


@compiled
def seen_points(scene, camera, start, sequence, count, nm, max_depth, bounces, side, points, which, scratch):
    """Where `count` camera paths spread over the picture meet sides of receivers, with so many bounces, for fitting
    windows: the number found.

    `side` (O, 2) as in `CausticTables`; fills `points` (count × (bounces + 1), 4): place, and length of the way there;
    `which` (…, 2): side, events on the way.
    """
    state, shift = scratch.state, scratch.shift
    sobol_start(sequence, 0, state)
    found = 0
    for i in range(count):
        if i > 0:
            sobol_next(sequence, i, state)
        noise = mixed(sequence.key ^ mixed(np.uint64(i)))
        place, d = _start_ray(camera, unit(state[0]) * camera.width, unit(state[1]) * camera.height, noise)
        last, within, mask, alone, events, way, surfaces = NONE, NO, start.mask, start.alone, FIRST, 0.0, FIRST
        if scene.polarised:
            begin_light(scene, scratch.field, d, mask, alone, nm, _of_coat(noise, -1, 0))
        while events <= max_depth:
            t, triangle, u, v = nearest(scene, place, d, last, within, mask, scratch)
            if triangle < 0:
                break
            place, way = moved(place, t, d), way + t
            thing = scene.owner[triangle]
            kind = scene.kind[thing]
            if kind == BLACK:
                break
            last = triangle
            if kind == DIFFUSE:
                met = side_met(scene, triangle, place, d)
                at = side[thing, met]
                if at >= 0:
                    points[found, 0], points[found, 1], points[found, 2] = place
                    points[found, 3], which[found, 0], which[found, 1] = way, at, events
                    found += 1
                if surfaces == bounces:
                    break
                n = normal_at(scene, triangle, place)
                surfaces += 1
                a, b = _at_diffuse(state, shift, noise, surfaces)
                d = draw_by_cosine(n if met == 0 else negated(n), a, b)
                if scene.polarised:
                    begin_light(scene, scratch.field, d, mask, alone, nm, _of_coat(noise, events, 3))
                within = met == 1
                continue
            draw = choice(state, shift, FIRST_CHOICE + events, noise, events)
            d, mask, alone, within, is_event, _, _ = scatter(
                scene, triangle, place, u, v, d, mask, alone, nm, draw, noise, events, scratch.field
            )
            events += is_event
    return found
