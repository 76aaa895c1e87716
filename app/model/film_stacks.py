"""The films of a scene, each between the media that it lies between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from .contacts import contacts, nested_pairs
from .optics.colorimetry import VISIBLE_NM
from .optics.glass import Dispersion
from .optics.metals import find_metal
from .optics.spectral_tables import SpectralAxis
from .optics.thin_films import ABOVE, AIR, BELOW, Stack, power
from .scene import Scene, SceneObject

_THICKNESSES = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Parts of the thickness of a film that varies, whose curves are known."""
_COSINES = (1.0, 0.75, 0.5)
_BLUR_NM = 12
"""Ripples finer than this are no colours to the eye; behind a prism they are shown blurred."""
_MOST_ROWS = 12_000
"""Textures have 16384, and other tables lie beside."""


def scene_media(scene: Scene) -> list[Dispersion]:
    """Each once, in the order of the objects that are of it."""
    found = (item.material.dispersion for item in scene.objects)
    return list(dict.fromkeys(medium for medium in found if medium is not None))


def film_stacks(scene: Scene) -> dict[int, tuple[Stack | None, ...]]:
    """By object that has a film, its stacks: in air, and in each medium that some film touches or lies in, in the order
    of `scene_media` (None: not this one)."""
    films = {i: item.material for i, item in enumerate(scene.objects) if item.material.film is not None}
    touched = {i: set[Dispersion]() for i in films}
    for pair in nested_pairs(scene) + contacts(scene) if films else ():
        for i, j in (pair, pair[::-1]):
            if i in films and scene.objects[j].material.is_solid:
                touched[i].add(scene.objects[j].material.dispersion)
    media = [medium for medium in scene_media(scene) if any(medium in of for of in touched.values())]
    found: dict[int, tuple[Stack | None, ...]] = {}
    for index, material in films.items():
        film, metal = material.film, find_metal(material.metal, "") if material.metal else None
        found[index] = tuple(
            Stack(outside, film, outside if film.alone else metal or material.dispersion)
            if outside is AIR or outside in touched[index]
            else None
            for outside in (AIR, *media)
        )
    return found


@dataclass(frozen=True)
class FilmTables:
    """As shaders read them (`shaders/lib/film.glsl`)."""

    number: dict[int, int]
    """1 + the first row of each object's film in air, those without left out. FILM_MEDIUM_ROWS times FILM_SLOTS[medium]
    further on begin those in a medium of `scene_media`."""
    rows: np.ndarray
    """`Stack.table` of each film in each medium, one after the other; before those of one that varies, its `waves`."""
    defines: dict[str, int | str]


def film_tables(scene: Scene, nm: np.ndarray, polarised: bool) -> FilmTables:
    """Tables for wavelengths at even steps of x. Raises UserError where there are too many."""
    stacks = film_stacks(scene)
    absorbs = any(stack.film.absorbs for of in stacks.values() for stack in of if stack)
    below, is_alone = absorbs or polarised, not (absorbs or polarised)
    first: dict[tuple[Stack | None, ...], int] = {}
    tables = [np.zeros((0, len(nm)), np.float32)]
    steps = ABOVE + 1 + BELOW * below
    count = steps * (1 if is_alone else 12 if polarised else 3)
    for of in stacks.values():
        if of not in first:
            tables += [stack.waves(nm) for stack in of[:1] if stack is not None and stack.film.profile]
            first[of] = 1 + sum(map(len, tables))
            none = np.zeros((count, len(nm)), np.float32)
            tables += [none if stack is None else stack.table(nm, polarised, below)[:count] for stack in of]
    rows = np.concatenate(tables)
    if len(rows) > _MOST_ROWS:
        raise UserError(
            f"scene '{scene.name}': its {len(first)} different films take {len(rows)} rows of tables and there is room "
            f"for {_MOST_ROWS}; give some objects the same film, or leave polarisation out"
        )
    slots = list(dict.fromkeys(stack.before for of in zip(*stacks.values(), strict=True) for stack in of if stack))
    known = [slots.index(medium) if medium in slots else 0 for medium in scene_media(scene)] if len(slots) > 1 else []
    defines: dict[str, int | str] = {
        "FILM_STEPS": steps,
        "FILM_BELOW": BELOW * below,
        "FILM_TABLES": 1 if is_alone else 3,
        "FILM_MEDIUM_ROWS": count if known else 0,
        "FILM_SLOTS": f"uint[]({', '.join(f'{slot}u' for slot in known or [0])})",
    }
    return FilmTables({index: first[of] for index, of in stacks.items()}, rows, defines)


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
    for stack in dict.fromkeys(stack for of in film_stacks(scene).values() for stack in of if stack):
        varied = [stack.film.of_thickness(share) for share in _THICKNESSES] if stack.film.profile else [stack.film]
        for film in varied:
            for cosine in _COSINES:
                curves += [_blurred(c) for c in power(Stack(stack.before, film, stack.behind), cosine, VISIBLE_NM)]
    return curves


def film_thickness(item: SceneObject) -> tuple[np.ndarray, float, np.ndarray, float]:
    """Where the film of an object in the world is how thick, as a share of where it is thickest: origin (3,), `bend`,
    `slope` (3,) and `least`, such that at a place q away from the origin it is least + slope · q + bend |q|²."""
    profile, turn, origin = item.material.film.profile, item.object_to_world[:3, :3], item.object_to_world[:3, 3]
    thickest = max(profile.from_nm, profile.to_nm)
    least, rise = profile.from_nm / thickest, (profile.to_nm - profile.from_nm) / thickest
    vertices = item.mesh.vertices
    if profile.along is None:
        return origin, rise / max(float(((vertices @ turn.T) ** 2).sum(axis=1).max()), 1e-300), np.zeros(3), least
    ends = vertices @ np.array(profile.along)
    rise /= max(float(np.ptp(ends)), 1e-300)
    return origin, 0.0, rise * np.linalg.inv(turn).T @ profile.along, least - rise * float(ends.min())


def _blurred(curve: np.ndarray) -> np.ndarray:
    wide = np.pad(curve, _BLUR_NM // 2, mode="edge")
    return np.convolve(wide, np.full(_BLUR_NM + 1, 1.0 / (_BLUR_NM + 1)), mode="valid")
