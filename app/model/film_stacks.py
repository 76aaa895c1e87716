"""The films of a scene, each between the media that it lies between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from .optics.colorimetry import VISIBLE_NM
from .optics.metals import find_metal
from .optics.spectral_tables import SpectralAxis
from .optics.thin_films import ABOVE, AIR, BELOW, Stack, power
from .scene import Scene
from .scene_checks import contains

_COSINES = (1.0, 0.75, 0.5)
_BLUR_NM = 12
"""Ripples finer than this are no colours to the eye; behind a prism they are shown blurred."""
_MOST_ROWS = 12_000
"""Textures have 16384, and other tables lie beside."""


def film_stacks(scene: Scene) -> dict[int, Stack]:
    """By object. Solids and mirrors stand in air; sheets in whatever solid holds their middle."""
    found = {}
    for index, item in enumerate(scene.objects):
        film, material = item.material.film, item.material
        if film is None:
            continue
        before = AIR
        if material.thin:
            corners = item.mesh.vertices[item.mesh.triangles[0]].mean(axis=0)
            middle = item.object_to_world[:3, :3] @ corners + item.object_to_world[:3, 3]
            for other in scene.objects:
                if other.material.is_solid and contains(other, middle):
                    before = other.material.dispersion
        behind = before if film.alone else material.dispersion if material.transmits else find_metal(material.metal, "")
        found[index] = Stack(before, film, behind)
    return found


@dataclass(frozen=True)
class FilmTables:
    """As shaders read them (`shaders/lib/film.glsl`)."""

    number: dict[int, int]
    """1 + the first row of each object's film, those without left out."""
    rows: np.ndarray
    """`Stack.table` of each film, one after the other."""
    defines: dict[str, int]


def film_tables(scene: Scene, nm: np.ndarray, polarised: bool) -> FilmTables:
    """Of wavelengths at even steps of x. Raises UserError where there are too many."""
    stacks = film_stacks(scene)
    absorbs = any(stack.film.absorbs for stack in stacks.values())
    below, is_alone = absorbs or polarised, not (absorbs or polarised)
    first: dict[Stack, int] = {}
    tables = [np.zeros((0, len(nm)), np.float32)]
    steps = ABOVE + 1 + BELOW * below
    for stack in stacks.values():
        if stack not in first:
            first[stack] = 1 + sum(map(len, tables))
            table = stack.table(nm, polarised, below)
            tables.append(table[:steps] if is_alone else table)
    rows = np.concatenate(tables)
    if len(rows) > _MOST_ROWS:
        raise UserError(
            f"scene '{scene.name}': its {len(first)} different films take {len(rows)} rows of tables and there is room "
            f"for {_MOST_ROWS}; give some objects the same film, or leave polarisation out"
        )
    defines = {"FILM_STEPS": steps, "FILM_BELOW": BELOW * below, "FILM_TABLES": 1 if is_alone else 3}
    return FilmTables({index: first[stack] for index, stack in stacks.items()}, rows, defines)


def film_parts(axis: SpectralAxis, samples: int) -> np.ndarray:
    """Parts of the spectrum of which a camera path knows what films have left, most of them where it is seen: rows
    (2, samples), x at even steps over all parts, and how far through the parts each of even steps of x is."""
    steps = np.linspace(0.0, 1.0, samples)
    edges_nm, share = (380.0, 410.0, 690.0, 780.0), (0.0, 0.03, 0.96, 1.0)
    return np.stack([axis.x_of_nm(np.interp(steps, share, edges_nm)), np.interp(axis.nm_of_x(steps), edges_nm, share)])


def film_curves(scene: Scene) -> list[np.ndarray]:
    """(401,) each on `VISIBLE_NM`: what each film reflects and lets through, met at a few angles, as the eye tells its
    colours."""
    curves = []
    for stack in film_stacks(scene).values():
        for cosine in _COSINES:
            curves += [_blurred(curve) for curve in power(stack, cosine, VISIBLE_NM)]
    return curves


def _blurred(curve: np.ndarray) -> np.ndarray:
    wide = np.pad(curve, _BLUR_NM // 2, mode="edge")
    return np.convolve(wide, np.full(_BLUR_NM + 1, 1.0 / (_BLUR_NM + 1)), mode="valid")
