"""Thin films of the references, compiled: Airy's sum over the reflections within each layer, from the last to the first
[Born and Wolf, 1.6.4], where the renderer multiplies matrices into tables beforehand (`model.optics.thin_films`)."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from ..model.optics.metals import metals
from ..model.optics.thin_films import Medium
from ..model.scene import Scene
from .compiling import compiled


class Films(NamedTuple):
    """Films of O objects, L layers, M distinct media."""

    has: np.ndarray
    """bool (O,)."""
    first: np.ndarray
    """int32 (O + 1,): where each object's layers begin, from outside to inside."""
    medium: np.ndarray
    """int32 (L or 1,): row of `indices`."""
    nm: np.ndarray
    """float64 (L or 1,)."""
    share: np.ndarray
    """float64 (O,): reflected whatever the layers; below 0: what they do."""
    alone: np.ndarray
    """bool (O,): behind it is what is before it."""
    metal: np.ndarray
    """int32 (O,): row of `indices` of what is behind, or −1."""
    ends_nm: np.ndarray
    """float64 (O, 2): thickness where it begins and where it ends; below 0: the film is even."""
    begin: np.ndarray
    """float64 (O, 3): a point where it begins."""
    across: np.ndarray
    """float64 (O, 3): the way from there to where it ends, divided by the square of its length; 0: it varies by the
    square of the distance from `begin` …"""
    reach: np.ndarray
    """float64 (O,): … and ends at this one."""
    indices: np.ndarray
    """complex128 (M or 1, 8001): n + ik on the scene's grid of wavelengths."""


def films_of(scene: Scene, grid_nm: np.ndarray, centre: np.ndarray | float = 0.0) -> Films:
    """Those of a scene whose places are counted from `centre`."""
    media: list[Medium] = []
    rows: list[np.ndarray] = []

    def row(medium: Medium) -> int:
        if medium not in media:
            media.append(medium)
            rows.append(np.asarray(medium.index(grid_nm), complex))
        return media.index(medium)

    films = [item.material.film for item in scene.objects]
    layers = [() if film is None else film.layers for film in films]
    flat = [layer for of in layers for layer in of]
    metal = [row(metals()[item.material.metal]) if item.material.metal else -1 for item in scene.objects]
    ends, reach = np.full((len(films), 2), -1.0), np.ones(len(films))
    begin, across = np.zeros((len(films), 3)), np.zeros((len(films), 3))
    for index, (film, item) in enumerate(zip(films, scene.objects, strict=True)):
        if film is None or film.profile is None:
            continue
        corners, place = item.mesh.vertices, item.object_to_world
        ends[index] = film.profile.from_nm, film.profile.to_nm
        begin[index] = place[:3, 3] - centre
        if film.profile.along is None:
            reach[index] = np.linalg.norm(corners @ place[:3, :3].T, axis=1).max()
        else:
            along = np.asarray(film.profile.along)
            low, high = (corners @ along).min(), (corners @ along).max()
            # The normal of a plane of even thickness goes with the inverse's rows.
            across[index] = along @ np.linalg.inv(place[:3, :3]) / (high - low)
            begin[index] += place[:3, :3] @ along * low
    return Films(
        np.array([film is not None for film in films]),
        np.cumsum([0, *map(len, layers)]).astype(np.int32),
        np.array([row(layer.medium) for layer in flat] or [0], np.int32),
        np.array([layer.nm for layer in flat] or [0.0]),
        np.array([-1.0 if film is None or film.share is None else film.share for film in films]),
        np.array([film is not None and film.alone for film in films]),
        np.array(metal, np.int32),
        ends,
        begin,
        across,
        reach,
        np.array(rows or [np.ones(len(grid_nm), complex)]),
    )


@compiled
def film_index(films, row, nm):
    """n + ik of a medium at a wavelength."""
    at = (nm - 380.0) * 20.0
    cell = min(int(at), 7999)
    share = at - cell
    return films.indices[row, cell] + share * (films.indices[row, cell + 1] - films.indices[row, cell])


@compiled
def _along_normal(n, tangential):
    q = cmath.sqrt(n * n - tangential * tangential)
    return q if abs(q) > 1e-9 else complex(1e-9)


@compiled
def film_nm(films, thing, place):
    """Thickness at a place of a film that varies; below 0: it is even."""
    if films.ends_nm[thing, 0] < 0.0:
        return -1.0
    share, away = 0.0, 0.0
    for k in range(3):
        way = place[k] - films.begin[thing, k]
        share += way * films.across[thing, k]
        away += way * way
    if films.across[thing, 0] == 0.0 and films.across[thing, 1] == 0.0 and films.across[thing, 2] == 0.0:
        share = away / films.reach[thing] ** 2
    share = min(max(share, 0.0), 1.0)
    return (1.0 - share) * films.ends_nm[thing, 0] + share * films.ends_nm[thing, 1]


@compiled
def _airy(films, thing, n_first, n_last, tangential, from_back, nm, of_p, own_nm):
    """(r, t) of s or p; t is of the root of the power. `own_nm`: as of `film_nm`."""
    first, end = films.first[thing], films.first[thing + 1]
    q = _along_normal(n_last, tangential)
    behind = n_last * n_last / q if of_p else q
    outer = _along_normal(n_first, tangential)
    begin = n_first * n_first / outer if of_p else outer
    root = math.sqrt(max(behind.real, 0.0) / max(begin.real, 1e-300))
    r, t, phase = complex(0.0), complex(1.0), complex(1.0)
    # From the last face to the first: each has a layer before it, or what the light comes from.
    for k in range(end - first, -1, -1):
        if k > 0:
            layer = first + k - 1 if not from_back else end - k
            n = film_index(films, films.medium[layer], nm)
            q = _along_normal(n, tangential)
            before = n * n / q if of_p else q
        else:
            before = begin
        face = (before - behind) / (before + behind)
        inner = r * phase * phase
        t = (1.0 + face) * t * phase / (1.0 + face * inner)
        r = (face + inner) / (1.0 + face * inner)
        if k > 0:
            phase = cmath.exp(complex(0.0, 2.0 * math.pi * (films.nm[layer] if own_nm < 0.0 else own_nm) / nm) * q)
        behind = before
    return (-r if of_p else r), t * root


@compiled
def film_amplitudes(films, thing, n_outside, n_inside, tangential, from_back, nm, own_nm):
    """(r_s, r_p, t_s, t_p) of an object's film, where n sin θ is `tangential`; p turns with the ray. `own_nm`: its
    thickness here, as of `film_nm`."""
    if films.share[thing] >= 0.0:
        r, t = math.sqrt(films.share[thing]), math.sqrt(1.0 - films.share[thing])
        return complex(-r), complex(r), complex(t), complex(t)
    inside = complex(n_outside) if films.alone[thing] else complex(n_inside)
    if films.metal[thing] >= 0:
        inside = film_index(films, films.metal[thing], nm)
    a, b = complex(n_outside), inside
    if from_back:
        a, b = b, a
    r_s, t_s = _airy(films, thing, a, b, tangential, from_back, nm, False, own_nm)
    r_p, t_p = _airy(films, thing, a, b, tangential, from_back, nm, True, own_nm)
    return r_s, r_p, t_s, t_p
