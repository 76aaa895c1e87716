"""What parts of a receiver get of the environment by way of glass and mirrors, in float64: every path has one
wavelength, traced exactly, by the reference's own surfaces. It knows no columns, no bands and no texels."""

from __future__ import annotations

import math

import numpy as np
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.scene import Scene
from spectrasplat.reference.camera_reference import MAX_DEPTH
from spectrasplat.reference.camera_scene import beyond, pictures, spectra, with_upsampled_mirrors
from spectrasplat.reference.compiling import compiled
from spectrasplat.reference.photon_emit import search
from spectrasplat.reference.photon_intersect import nearest
from spectrasplat.reference.photon_scene import BLACK, DIFFUSE, photon_scene
from spectrasplat.reference.sampling import mixed, scratch, word_number
from spectrasplat.reference.scattering import AIR, scatter, transmitted
from spectrasplat.reference.vectors import combined, cross, dot, length, minus, moved, over

WAVELENGTHS = 16
"""Paths of each place and direction."""
_STEP = np.uint64(0x9E3779B97F4A7C15)


def irradiance(scene: Scene, corners: np.ndarray, sides: np.ndarray, samples: int) -> np.ndarray:
    """Mean irradiance, linear Rec.709, lm/unit², float64 (n, 3), of parallelograms from world `corners` (n, 3) along
    `sides` (n, 2, 3) on a flat receiver; their product shows the side."""
    photons, centre = photon_scene(scene)
    photons = with_upsampled_mirrors(photons, scene)
    seen, colours = pictures(scene, photons), spectra(scene, 1)
    points = [o.world_vertices - centre for o in scene.objects if o.material.is_specular]
    middle = 0.5 * (np.concatenate(points).min(axis=0) + np.concatenate(points).max(axis=0))
    radius = float(np.linalg.norm(np.concatenate(points) - middle, axis=1).max())
    found = np.zeros((len(corners), 3))
    for number, (corner, (u, v)) in enumerate(zip(corners - centre, sides, strict=True)):
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        corner = corner + 1e-5 * normal  # off the receiver
        _add(photons, seen, colours, corner, u, v, normal, middle, radius, number, samples, found, scratch())
    return xyz_to_rgb709(found / samples)


@compiled
def _add(photons, seen, colours, corner, u, v, normal, middle, radius, number, samples, found, memory):
    for i in range(samples):
        noise = mixed(np.uint64(number * 1000003 + 17) ^ mixed(np.uint64(i)))
        # Places and directions by a Kronecker sequence, wavelengths and choices by the hash.
        a, b = (0.5 + 0.8566748838545029 * i) % 1.0, (0.5 + 0.733891856627126 * i) % 1.0
        c, e = (0.5 + 0.6287067210378087 * i) % 1.0, (0.5 + 0.5385972572236101 * i) % 1.0
        place = moved(moved((corner[0], corner[1], corner[2]), a, u), b, v)
        way = minus(middle, place)
        distance = length(way)
        opening = 2.0
        if distance > radius:
            opening = 1.0 - math.sqrt(1.0 - (radius / distance) ** 2)
        z, axis = 1.0 - c * opening, over(way, distance)
        side = (axis[1], -axis[0], 0.0) if abs(axis[2]) < 0.9 else (0.0, axis[2], -axis[1])
        side = over(side, length(side))
        flat, angle = math.sqrt(max(1.0 - z * z, 0.0)), 2.0 * math.pi * e
        d = combined(flat * math.cos(angle), side, flat * math.sin(angle), cross(axis, side), z, axis)
        start, toward, cosine = place, d, 2.0 * math.pi * opening * dot(d, normal) / WAVELENGTHS
        for j in range(WAVELENGTHS):
            place, d, weight = start, toward, cosine
            chance = (j + word_number(noise)) / WAVELENGTHS
            atom = search(colours.cdf, chance)
            part = (chance - colours.cdf[atom]) / (colours.cdf[atom + 1] - colours.cdf[atom])
            nm = colours.start_nm[atom] + colours.width_nm[atom] * part
            last, within, mask, alone, events = -1, False, np.uint64(0), AIR, 0
            while weight > 0.0 and events < MAX_DEPTH:
                t, triangle, p, q = nearest(photons, place, d, last, within, mask, memory)
                if triangle < 0:
                    if events > 0:
                        rgb, basis = beyond(seen, d), colours.basis[atom]
                        light = rgb[0] * basis[0] + rgb[1] * basis[1] + rgb[2] * basis[2]
                        for k in range(3):
                            found[number, k] += weight * light * colours.daylight[atom] * colours.response[atom, k]
                    break
                weight *= transmitted(photons, mask, alone, nm, t)
                place, last = moved(place, t, d), triangle
                kind = photons.kind[photons.owner[triangle]]
                if kind in (BLACK, DIFFUSE):
                    break
                draw = word_number(noise + np.uint64(events + 1) * _STEP)
                d, mask, alone, within, is_event, kept, _ = scatter(
                    photons, triangle, place, p, q, d, mask, alone, nm, draw, noise, events, memory.field
                )
                weight *= kept
                events += is_event
