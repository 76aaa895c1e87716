"""Where a spectrum is cut into bands because glass or mirrors on the way change its shape.

A photon knows its weight at the low end of its band, at its anchor and at the high end, and it is straight between them
(`shaders/lib/band.glsl`). What that misses of a curve is found beforehand, for as much of each glass as light is likely
to pass, and the bands are cut where it is least.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from .film_stacks import film_curves
from .materials import Grating
from .optics.colorimetry import VISIBLE_NM, cmf_xyz, mirror_reflectance
from .optics.spectral_tables import SpectralAxis
from .optics.spectrum import Spectrum
from .scene import Polariser, Scene, SceneObject

TOLERANCE = 0.01
"""Share of the light that straight weights may miss or put elsewhere, root mean square over the spectrum; and what they
may make of all of it too much or too little, by power and by brightness, whatever is asked for: wide footprints blur,
but they lose no light."""
_LEAST_SHARE = 1e-3
"""A curve that leaves less of the light says nothing: what it gets wrong is dim."""
_PATHS = (0.5, 1.0, 2.0)
"""Lengths of glass, in mean chords of the solid."""
_MIRRORS = (1, 4)
"""Reflections by a coloured mirror, or passages of a coloured surface of glass."""
_ONTO_GRATINGS = ((0.0, 0.0, -1.0), (0.5, 0.0, -0.866), (-0.5, 0.0, -0.866))
"""Directions that light meets a grating in, as of `Grating.shares`."""
_LEAST_RIPPLE = 1e-3
"""Least height of a film's curve that counts: what it reflects, however little, is a colour."""
_BRIGHTENED = 0.5
"""Share of the wanted tolerance by which the light's brightness may be off where footprints are so broad that all
wavelengths of a band have one weight; twice `TOLERANCE` at least, for few are.

Measured on `random_all_5_12` of `bench-agreement --random-kinds all` (a tinted diamond beside tinted water under three
lines, 96×54, 100,000 photons): 4.1 % too much light without that."""
_FLAT_SHARE = 0.02
"""What of such footprints' misses counts where bands are placed: little, for most are narrower than that."""
_WIDER = 1.0 + 1e-9
"""Rounding of a band's width."""


def tint_curves(scene: Scene, but: np.ndarray | None = None) -> np.ndarray:
    """(N, 401): what gets through each glass that absorbs or wave plate, or is left by each mirror or film, on
    `VISIBLE_NM`; none twice. `but`: coefficient (401,) of a glass that is left out."""
    curves = {curve.round(6).tobytes(): curve for curve in film_curves(scene) if np.ptp(curve) > _LEAST_RIPPLE}
    for item in scene.objects:
        material = item.material
        found: list[np.ndarray] = []
        absorption = material.absorption if material.is_solid else None
        if absorption is not None and (but is None or not np.array_equal(absorption.coefficient, but)):
            chord, turn = mean_chord(item), item.object_to_world[:3, :3]
            _, broad, long = np.sort(np.ptp(item.mesh.vertices @ turn.T, axis=0))
            # Light may come the long way through a rod.
            paths = (*_PATHS, long / chord) if long > 4.0 * max(broad, chord) else _PATHS
            with np.errstate(under="ignore"):
                found += [np.exp(-share * absorption.coefficient * chord) for share in paths]
        if isinstance(material, Grating) and material.profile_code:
            found += [share for light in _ONTO_GRATINGS for share in material.shares(VISIBLE_NM, np.array(light))]
        if material.is_mirror:
            found += [mirror_reflectance(material.reflectance_rgb, VISIBLE_NM) ** times for times in _MIRRORS]
        if isinstance(material, Polariser):
            # What of it a second polariser lets through.
            found.append(0.5 + 0.5 * np.cos(2.0 * np.pi * material.retardance_nm / VISIBLE_NM))
        if material.filters:
            found += [material.surface_filter**times for times in _MIRRORS]
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
    bins: int | None = None,
) -> np.ndarray:
    """Edges (B + 1,), in x, of `least` to `most` bands between `ends`, none wider than `least` even ones: as many as
    straight weights need to follow `curves` (N, 401) under `light` within `tolerance`, and where these err least. By
    dynamic programming over the nanometres, as curves are fitted by segments (Bellman 1961). `bins`: spectral bins that
    are kept (`bin_of_nm`), each of which must hold its own light as the picture must hold all; the dim count as much as
    the bright."""
    power = power_by_nm(light)
    left = (curves * power).sum(axis=1, keepdims=True)
    matters = left[:, 0] > _LEAST_SHARE * power.sum()
    curves = curves[matters]
    if not len(curves):
        return np.linspace(*ends, least + 1)
    x = np.asarray(axis.x_of_nm(VISIBLE_NM), np.float64)
    arrays = x.tobytes(), curves.tobytes(), power.tobytes()
    return np.array(_cut(tuple(ends), least, most, tolerance, bins or 1, *arrays))


def ends_of(light: Spectrum, axis: SpectralAxis) -> tuple[float, float]:
    """x between which a light has power, half a nanometre beyond; of one that has none, all."""
    low, high = light.support_nm()
    first, last = VISIBLE_NM[0], VISIBLE_NM[-1]
    return float(axis.x_of_nm(max(low - 0.5, first))), float(axis.x_of_nm(min(high + 0.5, last)))


def bin_of_nm(bins: int) -> np.ndarray:
    """int (401,): which of `bins` even bins between the ends of `VISIBLE_NM` holds each of its nanometres."""
    return np.minimum((np.arange(len(VISIBLE_NM)) * bins) // (len(VISIBLE_NM) - 1), bins - 1)


def power_by_nm(light: Spectrum) -> np.ndarray:
    """float64 (401,), W/nm on `VISIBLE_NM`, lines spread over the nanometre that they are in."""
    power = np.array(light.density)
    for nm, line in light.lines:
        power[round(nm - VISIBLE_NM[0])] += line
    return power


@lru_cache(maxsize=64)
def _cut(
    ends: tuple[float, float], least: int, most: int, tolerance: float, bins: int, *arrays: bytes
) -> tuple[float, ...]:
    """Every pass of a light asks again; the arrays as in `cut_by_tints`."""
    x, curves, power = (np.frombuffer(array, np.float64) for array in arrays)
    curves, luminous = curves.reshape(-1, len(x)), power * cmf_xyz()[:, 1]
    low, high = min(ends), max(ends)
    # Between nanometres, so that a line lies within one band; even bands are among those that may be.
    between = 0.5 * (x[1:] + x[:-1])
    between = between[(between > low) & (between < high)]
    places = np.unique(np.concatenate([between, np.linspace(low, high, least + 1)]))
    missed, flat, lost, brightened = np.zeros(1), np.zeros(1), [], []
    for curve in curves:
        left_luminous = float(curve @ luminous)
        squared, kept = np.zeros(1), _kept_apart(bins, curve, power)
        for some in kept:
            of_bin, watts = float(curve @ some), float(some.sum())
            squares, sums = _missed(places, x, curve, some / of_bin)
            squared = squared + squares * watts / of_bin
            lost.append(sums)
        missed = np.maximum(missed, squared / len(kept))
        if left_luminous > _LEAST_SHARE * luminous.sum():
            squares, sums = _missed_by_means(places, x, curve, power, luminous)
            flat = np.maximum(flat, squares * luminous.sum() / left_luminous**2)
            brightened.append(sums / left_luminous)
    cost = missed + _FLAT_SHARE * flat
    cost[places[None, :] - places[:, None] > _WIDER * (high - low) / least] = np.inf
    cost[np.tril_indices(len(places))] = np.inf
    # `best[j]`: the least that bands from the low end to place j cost; `before`: where the last of them begins.
    best, before = cost[0], []
    edges = [0, len(places) - 1]
    for count in range(2, most + 1):
        bands = edges[:-1], edges[1:]
        if (
            count > least
            and missed[bands].sum() <= tolerance**2
            and _most_in_all(lost, bands) <= TOLERANCE
            and _most_in_all(brightened, bands) <= max(2.0 * TOLERANCE, _BRIGHTENED * tolerance)
        ):
            break
        sums = best[:, None] + cost
        before.append(np.argmin(sums, axis=0))
        best = np.min(sums, axis=0)
        edges = _path(before)
    found = [low, *(float(places[edge]) for edge in edges[1:-1]), high]
    return tuple(found if ends[0] <= ends[1] else found[::-1])


def _kept_apart(bins: int, curve: np.ndarray, power: np.ndarray) -> list[np.ndarray]:
    """`power` (401,) bin by bin, zero outside of each; those without light left out."""
    of_nm = bin_of_nm(bins)
    parts = [np.where(of_nm == number, power, 0.0) for number in range(bins)]
    return [part for part in parts if float(curve @ part) > _LEAST_SHARE * float(curve @ power)]


def _most_in_all(of_curves: Sequence[np.ndarray], bands: tuple[Sequence[int], Sequence[int]]) -> float:
    """The largest of the curves' sums over these bands, whatever its sign."""
    return max((abs(float(sums[bands].sum())) for sums in of_curves), default=0.0)


def _path(before: list[np.ndarray]) -> list[int]:
    """Edges of the bands to the last place, the first at place 0."""
    edges = [len(before[0]) - 1]
    for step in reversed(before):
        edges.append(int(step[edges[-1]]))
    return [0, *reversed(edges)]


def mean_chord(item: SceneObject) -> float:
    """Mean chord of the solid, scene units: four volumes over the surface (Cauchy), exact where it is convex."""
    turn = item.object_to_world[:3, :3]
    area = np.linalg.norm(item.mesh.area_vectors() @ (np.linalg.inv(turn) * np.linalg.det(turn)), axis=1).sum()
    return 4.0 * abs(item.mesh.volume() * float(np.linalg.det(turn))) / float(area)


def _missed_by_means(
    places: np.ndarray, x: np.ndarray, curve: np.ndarray, power: np.ndarray, luminous: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Two of (P, P): the sums of luminous · (curve - mean)² and of luminous · (mean - curve) over the band from place i
    to place j > i, where all its wavelengths have one weight, the mean of `curve` over their `power`: so are they drawn
    in a footprint that is much broader than its sweep. Arguments as of `_missed`."""
    below = np.searchsorted(x, places)
    rows = np.array([power, power * curve, luminous, luminous * curve, luminous * curve**2])
    sums = np.cumsum(np.pad(rows, ((0, 0), (1, 0))), axis=1)
    some_power, kept_power, some, kept, kept_twice = sums[:, below[None, :]] - sums[:, below[:, None]]
    mean = np.where(some_power > 0.0, kept_power / np.where(some_power > 0.0, some_power, 1.0), 0.0)
    return np.maximum(kept_twice - 2.0 * mean * kept + mean**2 * some, 0.0), mean * some - kept


def _missed(places: np.ndarray, x: np.ndarray, curve: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two of (P, P): the sums of weight · (curve - straight)² and of weight · (curve - straight) over the band from
    place i to place j > i, where "straight" leads through the curve at both and in the middle between them. `curve`,
    `weight` (N,): at x (N,), rising; what lies at a place belongs to the band above it."""
    middle, at = 0.5 * (places[:, None] + places[None, :]), np.interp(places, x, curve)
    at_middle = np.interp(middle, x, curve)
    below = np.searchsorted(x, places)
    first, last = np.broadcast_arrays(below[:, None], below[None, :])
    turn = np.searchsorted(x, middle, side="right")
    sums = np.cumsum(
        np.pad(weight * np.array([x**0, x, x * x, curve, curve * x, curve * curve]), ((0, 0), (1, 0))), axis=1
    )

    def of(
        begin: np.ndarray, end: np.ndarray, x0: np.ndarray, y0: np.ndarray, y1: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        one, to_x, to_x2, to_y, to_xy, to_y2 = sums[:, end] - sums[:, begin]
        half = np.where(middle > places[:, None], middle - places[:, None], 1.0)
        slope = (y1 - y0) / half
        y = y0 - slope * x0
        squares = to_y2 - 2.0 * (y * to_y + slope * to_xy) + y * y * one + 2.0 * y * slope * to_x + slope**2 * to_x2
        return squares, to_y - y * one - slope * to_x

    low = of(first, turn, places[:, None], at[:, None], at_middle)
    high = of(turn, last, middle, at_middle, at[None, :])
    return np.maximum(low[0] + high[0], 0.0), low[1] + high[1]
