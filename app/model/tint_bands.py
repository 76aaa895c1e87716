"""Where a spectrum is cut into bands because glass or mirrors on the way change its shape.

A photon knows its weight at the low end of its band, at its anchor and at the high end, and it is straight between them
(`shaders/lib/band.glsl`). What that misses of a curve is found beforehand, for as much of each glass as light is likely
to pass, and the bands are cut where it is least.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from .optics.colorimetry import VISIBLE_NM, mirror_reflectance
from .optics.spectral_tables import SpectralAxis
from .optics.spectrum import Spectrum
from .scene import Scene, SceneObject

TOLERANCE = 0.01
"""Share of the light that straight weights may miss or put elsewhere, root mean square over the spectrum; and what they
may make of all of it too much or too little, whatever is asked for: wide footprints blur, but they lose no light."""
_LEAST_SHARE = 1e-3
"""A curve that leaves less of the light says nothing: what it gets wrong is dim."""
_PATHS = (0.5, 1.0, 2.0)
"""Lengths of glass, in mean chords of the solid."""
_MIRRORS = (1, 4)
"""Reflections by a coloured mirror."""
_WIDER = 1.0 + 1e-9
"""Rounding of a band's width."""


def tint_curves(scene: Scene, but: np.ndarray | None = None) -> np.ndarray:
    """(N, 401): what gets through each glass that absorbs, or is left by each mirror, on `VISIBLE_NM`; none twice.
    `but`: coefficient (401,) of a glass that is left out."""
    curves: dict[bytes, np.ndarray] = {}
    for item in scene.objects:
        found: Sequence[np.ndarray] = ()
        absorption = item.material.absorption
        if absorption is not None and but is not None and np.array_equal(absorption.coefficient, but):
            continue
        if absorption is not None:
            depth = absorption.coefficient * mean_chord(item)
            with np.errstate(under="ignore"):
                found = [np.exp(-share * depth) for share in _PATHS]
        elif (rgb := getattr(item.material, "reflectance_rgb", None)) is not None and not item.material.receives:
            curve = mirror_reflectance(rgb, VISIBLE_NM)
            found = [curve**times for times in _MIRRORS]
        curves |= {curve.round(6).tobytes(): curve for curve in found if np.ptp(curve) > TOLERANCE}
    return np.array(list(curves.values())).reshape(-1, len(VISIBLE_NM))


def cut_by_tints(
    ends: tuple[float, float],
    least: int,
    most: int,
    curves: np.ndarray,
    light: Spectrum,
    axis: SpectralAxis,
    tolerance: float = TOLERANCE,
) -> np.ndarray:
    """Edges (B + 1,), in x, of `least` to `most` bands between `ends`, none wider than `least` even ones: as many as
    straight weights need to follow `curves` (N, 401) under `light` within `tolerance`, and where these err least. By
    dynamic programming over the nanometres, as curves are fitted by segments (Bellman 1961)."""
    power = power_by_nm(light)
    left = (curves * power).sum(axis=1, keepdims=True)
    told = left[:, 0] > _LEAST_SHARE * power.sum()
    curves, weights = curves[told], power / left[told]
    if not len(curves):
        return np.linspace(*ends, least + 1)
    x = np.asarray(axis.x_of_nm(VISIBLE_NM), np.float64)
    return np.array(_cut(tuple(ends), least, most, tolerance, x.tobytes(), curves.tobytes(), weights.tobytes()))


def power_by_nm(light: Spectrum) -> np.ndarray:
    """float64 (401,), W/nm on `VISIBLE_NM`, lines spread over the nanometre that they are in."""
    power = np.array(light.density)
    for nm, line in light.lines:
        power[round(nm - VISIBLE_NM[0])] += line
    return power


@lru_cache(maxsize=64)
def _cut(ends: tuple[float, float], least: int, most: int, tolerance: float, *arrays: bytes) -> tuple[float, ...]:
    """Every pass of a light asks again; the arrays as in `cut_by_tints`."""
    x, *rows = (np.frombuffer(array, np.float64) for array in arrays)
    curves, weights = (row.reshape(-1, len(x)) for row in rows)
    low, high = min(ends), max(ends)
    # Even bands are among those that may be.
    places = np.unique(np.concatenate([x[(x > low) & (x < high)], np.linspace(low, high, least + 1)]))
    share = np.diff(places, prepend=low) / np.interp(places, x, np.gradient(x))
    missed, lost = np.zeros(1), []
    for curve, weight in zip(curves, weights, strict=True):
        density = np.interp(places, x, weight) * share
        squares, sums = _missed(places, np.interp(places, x, curve), density)
        missed = np.maximum(missed, squares * weight.sum())
        lost.append(sums)
    missed[places[None, :] - places[:, None] > _WIDER * (high - low) / least] = np.inf
    missed[np.tril_indices(len(places))] = np.inf
    # `best[j]`: the least that bands from the low end to place j miss; `before`: where the last of them begins.
    best, before = missed[0], []
    edges = [0, len(places) - 1]
    for count in range(2, most + 1):
        all_lost = max(abs(float(sums[edges[:-1], edges[1:]].sum())) for sums in lost)
        if count > least and best[-1] <= tolerance**2 and all_lost <= TOLERANCE:
            break
        sums = best[:, None] + missed
        before.append(np.argmin(sums, axis=0))
        best = np.min(sums, axis=0)
        edges = _path(before)
    found = [low, *(float(places[edge]) for edge in edges[1:-1]), high]
    return tuple(found if ends[0] <= ends[1] else found[::-1])


def _path(before: list[np.ndarray]) -> list[int]:
    """Edges of the bands to the last place, the first at place 0."""
    edges = [len(before[0]) - 1]
    for step in reversed(before):
        edges.append(int(step[edges[-1]]))
    return [0, *reversed(edges)]


def mean_chord(item: SceneObject) -> float:
    """Of the solid, scene units: four volumes over the surface (Cauchy), exact where it is convex."""
    turn = item.object_to_world[:3, :3]
    area = np.linalg.norm(item.mesh.area_vectors() @ (np.linalg.inv(turn) * np.linalg.det(turn)), axis=1).sum()
    return 4.0 * abs(item.mesh.volume() * float(np.linalg.det(turn))) / float(area)


def _missed(x: np.ndarray, curve: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two of (P, P): the sums of weight · (curve - straight)² and of weight · (curve - straight) over all places x (P,)
    of the band from place i to place j > i, where "straight" leads through the curve at both and in the middle between
    them."""
    middle = 0.5 * (x[:, None] + x[None, :])
    at_middle = np.interp(middle, x, curve)
    turn = np.searchsorted(x, middle, side="right")
    sums = np.cumsum(
        np.pad(weight * np.array([x**0, x, x * x, curve, curve * x, curve * curve]), ((0, 0), (1, 0))), axis=1
    )
    first, last = np.arange(len(x))[:, None], np.arange(len(x))[None, :] + 1

    def of(
        begin: np.ndarray, end: np.ndarray, x0: np.ndarray, y0: np.ndarray, y1: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        one, to_x, to_x2, to_y, to_xy, to_y2 = sums[:, end] - sums[:, begin]
        half = np.where(middle > x[:, None], middle - x[:, None], 1.0)
        slope = (y1 - y0) / half
        y = y0 - slope * x0
        squares = to_y2 - 2.0 * (y * to_y + slope * to_xy) + y * y * one + 2.0 * y * slope * to_x + slope**2 * to_x2
        return squares, to_y - y * one - slope * to_x

    low = of(np.broadcast_to(first, turn.shape), turn, x[:, None], curve[:, None], at_middle)
    high = of(turn, np.broadcast_to(last, turn.shape), middle, at_middle, curve[None, :])
    return np.maximum(low[0] + high[0], 0.0), low[1] + high[1]
