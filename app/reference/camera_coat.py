"""Finishes of receivers in the camera's reference, compiled in float64: a coat's lobe, and a rough base.

Half vectors are sampled by the microfacets' own density, not by the visible ones as in the shaders, and lights of some
extent are found by the continued path alone. The coat's directional albedo comes from the table that the shaders use
too, which has a test of its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.materials.diffuse import SMOOTH_ROUGHNESS
from ..model.optics.rough_surfaces import coat_tables
from ..model.scene import Scene
from .compiling import inlined
from .rough_albedo import masking
from .scattering import fresnel, microfacet
from .vectors import dot, length, moved

_COSINES = 1025


class Finishes(NamedTuple):
    """Finishes of O objects."""

    alpha: np.ndarray
    """float64 (O,): of the coat; 0: perfectly smooth; below 0: none."""
    coat_index: np.ndarray
    """float64 (O,): its refractive index."""
    tables: np.ndarray
    """float64 (O, 2, 1025): `optics.rough_surfaces.coat_tables`."""
    roughness: np.ndarray
    """float64 (O,): of the base."""


def finishes(scene: Scene) -> Finishes:
    """The finishes of all objects of `scene`."""
    count = len(scene.objects)
    found = Finishes(np.full(count, -1.0), np.ones(count), np.zeros((count, 2, _COSINES)), np.zeros(count))
    for i, item in enumerate(scene.objects):
        material = item.material
        found.roughness[i] = material.diffuse_roughness
        if material.has_coat:
            found.alpha[i] = material.roughness**2 if material.roughness >= SMOOTH_ROUGHNESS else 0.0
            found.coat_index[i] = material.coat_index
            found.tables[i] = coat_tables(found.alpha[i], material.coat_index, _COSINES)
    return found


@inlined
def _looked_up(table, cosine):
    at = min(max(cosine, 0.0), 1.0) * (table.shape[0] - 1)
    cell = min(int(at), table.shape[0] - 2)
    return table[cell] + (at - cell) * (table[cell + 1] - table[cell])


@inlined
def coat_albedo(made, thing, cosine):
    """Share of light from a direction that the coat reflects."""
    return _looked_up(made.tables[thing, 0], cosine)


@inlined
def under_coat(made, thing, cosine, from_cosine):
    """Factor on the base for light from one direction; `from_cosine` below 0: for light from all sides."""
    if made.alpha[thing] < 0.0:
        return 1.0
    out = 1.0 - _looked_up(made.tables[thing, 0], cosine)
    return out if from_cosine < 0.0 else out * _looked_up(made.tables[thing, 1], from_cosine)


@inlined
def coat_lobe(made, thing, o, i, n):
    """The lobe for light from `i` seen from `o` (units, away from the surface of unit normal `n`), times the cosine of
    incidence."""
    alpha = made.alpha[thing]
    to, ti = dot(o, n), dot(i, n)
    if alpha <= 0.0 or to <= 0.0 or ti <= 0.0:
        return 0.0
    h = moved(o, 1.0, i)
    size = length(h)
    facing, hn = 0.5 * size, dot(h, n) / size
    spread = 1.0 + hn * hn * (alpha * alpha - 1.0)
    density = alpha * alpha / (math.pi * spread * spread)
    reflected, _ = fresnel(facing, 1.0 / made.coat_index[thing])
    return reflected * density / (4.0 * to * (1.0 / masking(to, alpha) + 1.0 / masking(ti, alpha) - 1.0))


@inlined
def reflected_by_coat(made, thing, d, n, a, b):
    """(direction, weight) of a path that comes along d and is reflected by a facet that two numbers choose; of weight 0
    into the surface."""
    alpha = made.alpha[thing]
    h = microfacet(n, alpha, a, b)
    facing, to = -dot(d, h), -dot(d, n)
    r = moved(d, 2.0 * facing, h)
    ti = dot(r, n)
    if facing <= 0.0 or to <= 0.0 or ti <= 0.0:
        return r, 0.0
    reflected, _ = fresnel(facing, 1.0 / made.coat_index[thing])
    if alpha == 0.0:
        return r, reflected
    hidden = 1.0 / masking(to, alpha) + 1.0 / masking(ti, alpha) - 1.0
    return r, reflected * facing / (to * dot(h, n) * hidden)


@inlined
def _single(cosine, roughness):
    """Directional albedo of a white rough base's single scattering [Portsmouth, Kutz and Hill 2025, eq. of FON]."""
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    loss = 1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * roughness
    if cosine < 1e-9:
        turned = 0.5 * math.pi - 2.0 / 3.0
    else:
        turned = sine * (math.acos(min(cosine, 1.0)) - sine * cosine)
        turned += 2.0 / 3.0 * (sine / cosine * (1.0 - sine**3) - sine)
    return (1.0 + roughness * turned / math.pi) / loss


@inlined
def base_reflectance(rgb, roughness, cosine, o, i, n):
    """Reflectance by channel of a rough base, for light from `i`, or, where that is no unit vector but zero, from all
    sides; `rgb` is one channel."""
    if roughness == 0.0:
        return rgb
    loss = 1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * roughness
    mean = (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * math.pi)) * roughness) / loss
    multiple = rgb * rgb * mean / (1.0 - rgb * (1.0 - mean))
    single = _single(cosine, roughness)
    if dot(i, i) < 0.5:
        return rgb * single + multiple * (1.0 - single)
    from_cosine = dot(i, n)
    turned = dot(o, i) - cosine * from_cosine
    if turned > 0.0:
        turned /= max(cosine, from_cosine)
    lost = (1.0 - single) * (1.0 - _single(from_cosine, roughness)) / (1.0 - mean)
    return rgb * (1.0 + roughness * turned) / loss + multiple * lost
