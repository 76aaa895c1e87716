"""What happens to a path at a surface and between surfaces, compiled: the one set of rules of all references.

The tracers of photons (`photon_kernel`) and of camera rays (`camera_kernel`) call these functions: Fresnel's exact
reflectance decides by chance, nested solids follow their rank, an interpolated normal that would send a ray through its
own facet gives way to the facet's, Beer's law thins what passes. Rough glass has microfacets drawn by their area
(Walter et al. 2007, eq. 35, 36, 41), whether the ray sees them or not: another way than the shaders', with the same
mean; light that goes from one microfacet to another leaves like the rest (Turquin 2019).
"""

from __future__ import annotations

import math

import numpy as np

from .compiling import NONE, compiled, inlined
from .crystals import begin_in_crystal, solve_interface, take_wave, through_sheet
from .curved_surfaces import turned_normal
from .gratings import diffracted, order_share
from .photon_intersect import normal_at
from .photon_scene import GRATING, MIRROR, POLARISER, SHEET
from .polarised import amplitudes, begin_unpolarised, senkrecht, share_of, turn_fields
from .rough_albedo import masking, sent_on
from .sampling import mixed, word_number
from .thin_films import film_amplitudes, film_nm
from .vectors import across, combined, cross, dot, length, mixed_of, moved, negated, over

AIR = NONE
_TABLE_SCALE = 20.0
_TABLE_LAST = 8000


@compiled
def table(rows, row, nm):
    """A row on `TABLE_NM` at a wavelength, linear between its values."""
    at = (nm - 380.0) * _TABLE_SCALE
    cell = min(int(at), _TABLE_LAST - 1)
    share = at - cell
    return rows[row, cell] + share * (rows[row, cell + 1] - rows[row, cell])


@compiled
def medium(scene, mask, alone):
    """The object whose substance fills a place: the highest rank in the mask, or the solid `alone`."""
    for rank in range(scene.stack.shape[0] - 1, -1, -1):
        if (mask >> np.uint64(rank)) & np.uint64(1):
            return scene.stack[rank]
    return alone


@compiled
def _refractive_index(scene, thing, nm):
    return 1.0 if thing == AIR else table(scene.refractive_index, scene.medium[thing], nm)


@compiled
def fresnel(cosine_i, eta):
    """(unpolarised reflectance, cosine of the transmitted angle) with eta = n_i/n_t; (1, 0) is total reflection."""
    cosine2 = (1.0 - eta) * (1.0 + eta) + eta * eta * cosine_i * cosine_i
    if cosine2 <= 0.0:
        return 1.0, 0.0
    cosine_t = math.sqrt(cosine2)
    s = (eta * cosine_i - cosine_t) / (eta * cosine_i + cosine_t)
    p = (cosine_i - eta * cosine_t) / (cosine_i + eta * cosine_t)
    return 0.5 * (s * s + p * p), cosine_t


@inlined
def transmitted(scene, mask, alone, nm, distance):
    """What Beer's law leaves after `distance` in the medium a ray is in."""
    filling = medium(scene, mask, alone)
    if filling == AIR or scene.weight[filling] < 0:
        return 1.0
    return math.exp(-table(scene.weights, scene.weight[filling], nm) * distance)


@inlined
def side_met(scene, triangle, place, d):
    """0 where a ray comes to a surface's front (against its normal) at a place, else 1."""
    return 1 if dot(d, normal_at(scene, triangle, place)) > 0.0 else 0


@inlined
def _shading_normal(scene, triangle, place, u, v, d, g, entering):
    """Unit normal against the ray: interpolated where that faces the ray, else the surface's `g`."""
    row = scene.smooth[triangle]
    curved = scene.curved[triangle]
    if curved >= 0:
        n = turned_normal(scene.forms[curved], place)
    elif row < 0:
        return g
    else:
        m = scene.corner_normals[row]
        n = combined(1.0 - u - v, m[:3], u, m[3:6], v, m[6:])
    size = length(n)
    if size == 0.0:
        return g
    n = over(n, size if entering else -size)
    return n if -dot(d, n) > 1e-6 else g


@compiled
def _share_of_order(scene, row, d, n, lines, index, nm):
    """Of the light that comes along `d`, or of what comes back along the order to a camera's ray."""
    orders = scene.orders[row]
    if scene.backwards:
        r, _ = diffracted(d, n, lines, orders[0] * nm * 1e-3 / index, orders[6] == 0.0)
        return order_share(orders, negated(r), n, lines, index, nm)
    return order_share(orders, d, n, lines, index, nm)


@compiled
def _shift_drawn(row, word):
    """Order / line spacing of an order, in 1/µm, and off it as light behind an opening is: by sinc² of the place, drawn
    by rejection from Cauchy's distribution, of which it is 1.48 times at most."""
    if row[7] == 0.0:
        return row[0]
    while True:
        word = mixed(word + np.uint64(0x9E3779B97F4A7C15))
        turn = math.tan(math.pi * (word_number(word) - 0.5))
        word = mixed(word + np.uint64(0x9E3779B97F4A7C15))
        ratio = 1.0 if abs(turn) < 1e-9 else math.sin(turn) ** 2 * (1.0 + 1.0 / turn**2)
        if 1.48 * word_number(word) < ratio:
            return row[0] + row[7] * turn / math.pi


@compiled
def _diffract(scene, triangle, place, u, v, d, mask, alone, nm, draw, word, field):
    """`scatter` at a grating: `draw` chooses an order as they are strong; what they leave, and an order that is
    evanescent, is absorbed. Both polarisations fare alike."""
    thing = scene.owner[triangle]
    g = normal_at(scene, triangle, place)
    entering = dot(d, g) < 0.0
    n = _shading_normal(scene, triangle, place, u, v, d, g if entering else negated(g), entering)
    outward = n if entering else negated(n)
    index = _refractive_index(scene, medium(scene, mask, alone), nm)
    first, end = scene.first_order[thing], scene.first_order[thing + 1]
    efficiency, chosen = 0.0, first
    # Twice: their sum, and where the draw falls in it.
    for count in range(2):
        wanted, below = draw * efficiency, 0.0
        for row in range(first, end):
            if count == 1 and below <= wanted:
                chosen = row
            below += _share_of_order(scene, row, d, outward, scene.lines[thing], index, nm)
        efficiency = below
    reflects = scene.orders[chosen, 6] == 0.0
    step = _shift_drawn(scene.orders[chosen], word) * nm * 1e-3 / index
    r, real = diffracted(d, outward, scene.lines[thing], step, reflects)
    if (dot(r, g) * (1.0 if entering else -1.0) > 0.0) != reflects:  # to the wrong side of the facet
        r, real = diffracted(d, g, scene.lines[thing], step, reflects)
    if scene.polarised and real:
        turn_fields(field, d, r, senkrecht(d, r), complex(-1.0 if reflects else 1.0), complex(1.0))
    return r, mask, alone, entering != reflects, True, efficiency if real else 0.0, True


_MIRROR_INDEX = 1e9


@compiled
def _optics(scene, thing, nm):
    """(n_o, n_e, axis, whether it is a crystal) of an object's substance."""
    if thing == AIR or scene.extraordinary[thing] < 0:
        n = _refractive_index(scene, thing, nm)
        return n, n, (0.0, 0.0, 1.0), False
    axis = scene.axis[thing]
    n_e = table(scene.refractive_index, scene.extraordinary[thing], nm)
    return _refractive_index(scene, thing, nm), n_e, (axis[0], axis[1], axis[2]), True


@compiled
def begin_light(scene, field, d, mask, alone, nm, number):
    """Unpolarised light that begins along `d`; in a crystal `number` in [0, 1) chooses which of its kinds."""
    n_o, n_e, axis, is_crystal = _optics(scene, medium(scene, mask, alone), nm)
    if is_crystal:
        begin_in_crystal(field, d, n_o, n_e, axis, number < 0.5)
    else:
        begin_unpolarised(field, d)


@compiled
def _meet_crystal(scene, before, after, n, g, d, nm, draw, field, is_mirror):
    """(direction, whether it is reflected) of one wave of an interface with a crystal, drawn by its share of the power;
    a normal that sends it to the wrong side of the facet `g` gives way to that. A mirror is dense beyond measure."""
    first, second = _optics(scene, before, nm), _optics(scene, after, nm)
    if is_mirror:
        second = _MIRROR_INDEX, _MIRROR_INDEX, (0.0, 0.0, 1.0), False
    for attempt in range(2):
        shares = solve_interface(field, d, n if attempt == 0 else g, first, second)
        last = 1 if is_mirror else 3
        left, wave = draw * (shares[0] + shares[1] + (0.0 if is_mirror else shares[2] + shares[3])), 0
        while wave < last and left >= shares[wave]:
            left -= shares[wave]
            wave += 1
        while shares[wave] <= 0.0 and wave > 0:  # rounding went past the last of them
            wave -= 1
        reflects = wave < 2
        kept = field[0, 0], field[0, 1], field[0, 2], field[1, 0], field[1, 1], field[1, 2]
        waves = field[2, 0], field[2, 1], field[2, 2]
        r = take_wave(field, wave, first if reflects else second)
        if attempt == 1 or (dot(r, g) > 0.0) == reflects:
            break
        for k in range(3):
            field[0, k], field[1, k], field[2, k] = kept[k], kept[3 + k], waves[k]
    return r, reflects


_TILT, _TURN, _LINE = np.uint64(0xA24BAED4963EE407), np.uint64(0x9FB21C651E98DF25), np.uint64(0xD6E8FEB86659FD93)
"""Make the numbers for a microfacet, and for the place on a grating's line, independent of those of Fresnel choices."""


@compiled
def microfacet(n, width, a, b):
    """Normal of a microfacet of GGX about `n`, by two numbers in [0, 1); density D(m) |m · n|."""
    slope = width * math.sqrt(a / (1.0 - a))
    cosine = 1.0 / math.sqrt(1.0 + slope * slope)
    sine = slope * cosine
    s = across(n)
    turn = 2.0 * math.pi * b
    return combined(sine * math.cos(turn), s, sine * math.sin(turn), cross(n, s), cosine, n)


@compiled
def _both_faces(a_s, a_p):
    """(r_s, r_p, t_s, t_p) of a thin sheet, of whose faces one alone reflects `a_s` and `a_p`: the powers of all that
    is reflected between both add up, and phases are those of the first."""
    s, p = abs(a_s) ** 2, abs(a_p) ** 2
    r_s, r_p = 2.0 * s / (1.0 + s), 2.0 * p / (1.0 + p)
    one_s, one_p = math.copysign(1.0, a_s.real), math.copysign(1.0, a_p.real)
    return (
        complex(one_s * math.sqrt(r_s)),
        complex(one_p * math.sqrt(r_p)),
        complex(math.sqrt(1.0 - r_s)),
        complex(math.sqrt(1.0 - r_p)),
    )


@inlined
def _film_share(scene, field, d, s, a_s, a_p):
    """Share of the power that amplitudes leave, of a path's own state in a polarised scene."""
    return share_of(field, d, s, a_s, a_p) if scene.polarised else 0.5 * (abs(a_s) ** 2 + abs(a_p) ** 2)


@inlined
def scatter(scene, triangle, place, u, v, d, mask, alone, nm, draw, noise, event, field):
    """One event at a place of glass, a mirror or a grating, met along `d`: (direction, mask, alone, on the object's
    inner side, is an event, share kept, whether `draw` mattered).

    `draw` in [0, 1) decides by Fresnel's reflectance, unless all is reflected. "Is an event" is false where the same
    substance is on both sides; a mirror keeps its reflectance, glass what its surface lets through, and what is rough
    also the weight of a microfacet that words `event` of the hash `noise` draw (its mean is 1). In a polarised scene
    `field`, of the shape `crystals.FIELD_SHAPE`, turns with the ray.
    """
    if scene.kind[scene.owner[triangle]] == GRATING:
        word = (noise ^ _LINE) + np.uint64(event + 1) * np.uint64(0x9E3779B97F4A7C15)
        return _diffract(scene, triangle, place, u, v, d, mask, alone, nm, draw, word, field)
    g = normal_at(scene, triangle, place)
    cosine_g = -dot(d, g)
    entering = cosine_g > 0.0
    thing = scene.owner[triangle]
    if scene.kind[thing] == POLARISER:
        kept = through_sheet(
            field, d, scene.axis[thing], scene.sheet[thing, 0], scene.sheet[thing, 1], scene.sheet[thing, 2] / nm
        )
        return d, mask, alone, entering, True, kept, False
    mirror, sheet = scene.kind[thing] == MIRROR, scene.kind[thing] == SHEET
    before, after, mask_after, alone_after = AIR, AIR, mask, alone
    if sheet:
        before, after = medium(scene, mask, alone), thing
    elif not mirror:
        bit = scene.bit[thing]
        if bit >= 0:
            own = np.uint64(1) << np.uint64(bit)
            mask_before = mask & ~own if entering else mask | own
            mask_after = mask | own if entering else mask & ~own
            before, after = medium(scene, mask_before, AIR), medium(scene, mask_after, AIR)
            if before == after:
                return d, mask_after, alone, entering, False, 1.0, False
        else:
            before = AIR if entering else thing
            after = thing if entering else AIR
            alone_after = after
    if not entering:
        g, cosine_g = negated(g), -cosine_g
    n = _shading_normal(scene, triangle, place, u, v, d, g, entering)
    cosine = -dot(d, n)
    if scene.birefringent and not sheet:
        if mirror:
            before = medium(scene, mask, alone)
        if (before != AIR and scene.extraordinary[before] >= 0) or (after != AIR and scene.extraordinary[after] >= 0):
            r, reflects = _meet_crystal(scene, before, after, n, g, d, nm, draw, field, mirror)
            row = scene.weight[thing] if mirror else scene.filter[thing]
            kept = table(scene.weights, row, nm) if row >= 0 and (mirror or not reflects) else 1.0
            if reflects:
                return r, mask, alone, not entering, True, kept, True
            return r, mask_after, alone_after, entering, True, kept, True
    width, whole, facing = scene.microfacet_width[thing], n, cosine
    if width > 0.0:
        word = noise + np.uint64(event + 1) * np.uint64(0x9E3779B97F4A7C15)
        n = microfacet(n, width, word_number(word ^ _TILT), word_number(word ^ _TURN))
        cosine = -dot(d, n)
        if cosine <= 0.0:  # seen from behind
            return d, mask, alone, not entering, True, 0.0, False
    kept, reflects, drawn, cosine_t, eta_it, share = 1.0, True, False, 0.0, 1.0, 1.0
    s, a_s, a_p = (0.0, 0.0, 0.0), complex(-1.0), complex(1.0)
    if scene.polarised:
        s = senkrecht(d, n)
    has_film = scene.films.has[thing]
    if mirror:
        kept = table(scene.weights, scene.weight[thing], nm)
        if has_film:
            n_i = _refractive_index(scene, medium(scene, mask, alone), nm)
            sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
            a_s, a_p, t_s, t_p = film_amplitudes(scene.films, thing, n_i, 1.0, n_i * sine, False, nm, -1.0)
            share = _film_share(scene, field, d, s, a_s, a_p)
            kept *= share
    else:
        eta_it = _refractive_index(scene, before, nm) / _refractive_index(scene, after, nm)
        reflectance, cosine_t = fresnel(cosine, eta_it)
        if scene.polarised:
            a_s, a_p, t_s, t_p = amplitudes(cosine, eta_it)
            if reflectance < 1.0:
                reflectance = share_of(field, d, s, a_s, a_p)
            if sheet:
                a_s, a_p, t_s, t_p = _both_faces(a_s, a_p)
                reflectance = share_of(field, d, s, a_s, a_p)
            if draw >= reflectance:
                a_s, a_p = t_s, t_p
        elif sheet:
            reflectance = 2.0 * reflectance / (1.0 + reflectance)
        if has_film:
            n_i, n_t = _refractive_index(scene, before, nm), _refractive_index(scene, after, nm)
            sine, own_nm = n_i * math.sqrt(max(1.0 - cosine * cosine, 0.0)), film_nm(scene.films, thing, place)
            back = not entering
            if back and not sheet:
                n_i, n_t = n_t, n_i
            a_s, a_p, t_s, t_p = film_amplitudes(scene.films, thing, n_i, n_t, sine, back, nm, own_nm)
            reflected, passed = _film_share(scene, field, d, s, a_s, a_p), _film_share(scene, field, d, s, t_s, t_p)
            kept = reflected + passed if cosine_t > 0.0 or sheet else reflected
            reflectance = reflected / kept
            if draw >= reflectance:
                a_s, a_p = t_s, t_p
        reflects, drawn = draw < reflectance, reflectance < 1.0
        if sheet:
            eta_it, cosine_t = 1.0, cosine
        if not reflects and scene.filter[thing] >= 0:
            kept *= table(scene.weights, scene.filter[thing], nm)
    if reflects:
        r = moved(d, 2.0 * cosine, n)
        if width <= 0.0 and dot(r, g) <= 0.0:  # into the facet
            r = moved(d, 2.0 * cosine_g, g)
        mask_after, alone_after, inner = mask, alone, not entering
    else:
        r = mixed_of(eta_it, d, eta_it * cosine - cosine_t, n)
        if width <= 0.0 and dot(r, g) >= 0.0:  # back out of the facet
            cosine2 = (1.0 - eta_it) * (1.0 + eta_it) + eta_it * eta_it * cosine_g * cosine_g
            r = mixed_of(eta_it, d, eta_it * cosine_g - math.sqrt(max(cosine2, 1e-12)), g)
        inner = entering
    r = over(r, length(r))
    if width > 0.0:
        side = 1.0 if reflects else -1.0
        leaving = side * dot(r, whole)
        kept *= cosine * masking(facing, width) * masking(leaving, width) / (facing * dot(n, whole))
        # What does not leave meets other microfacets, which share it out as the first: of a metal, less and less.
        kept /= 1.0 - share * (1.0 - sent_on(scene.albedo, thing, facing, eta_it))
        if side * dot(r, g) <= 0.0:
            kept = 0.0
    if scene.polarised and kept > 0.0:
        turn_fields(field, d, r, s, a_s, a_p)
    return r, mask_after, alone_after, inner, True, kept, drawn
