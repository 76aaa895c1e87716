"""Footprints at their stiffest: stretched, swept over a whole map, collapsed to a point, and piled up on one texel.

Photon records made by hand go through the real splat pass; what they should deposit is known by itself: all of
their energy, and for a focus its share of each texel. Broken records and very many photons are in `sum_cases.py`.

A map holds averages over texels, but a splat is sampled at their centres along its sweep and under a Gaussian of
variance `SAMPLED` at least. A texel grid sees such a Gaussian through its harmonics: by Poisson's formula the first
weighs exp(−2π² · SAMPLED), with a cosine of the place, and there are two of each direction. So one splat may be off by
`ONE_SPLAT`, depending on where in a texel it lies. Over a lattice of places the cosines cancel. What is left is
the fast erf's 5e-4 (Abramowitz and Stegun 1964, 7.1.27) at either end of a row of texels, `FAST_ERF`, and the edge:
three standard deviations out a splat ends with exp(−4.5) of its peak, and where it lies in line with the grid whole
rows enter or leave together, which P places average out to `EDGE`/P.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import erf

import numpy as np

from ...gpu.context import Context
from ..case import Case, Measurement
from ..judging import judged, not_finite
from ..rigs.splat_rig import Rig, SplatFeatures, photons
from .sum_cases import CASES as SUM_CASES

PLAIN = SplatFeatures()
SIDE = 1152
"""Texels of the map's side."""
SAMPLED = 0.2
"""Texel²; the least variance along a sweep that footprint.comp draws."""
ONE_SPLAT = 4.0 * float(np.exp(-2.0 * np.pi**2 * SAMPLED))
FAST_ERF = 1e-3
EDGE = float(np.exp(-4.5))
PLACES = 6
"""Places within a texel along each axis: harmonics up to the sixth cancel over them."""
TURNS = np.radians([0.0, 7.0, 22.5, 45.0, 60.0, 90.0, 118.0, 135.0])


def energies(
    rig: Rig, cell: int, centre: np.ndarray, axis_s: np.ndarray, axis_t: np.ndarray, chord: np.ndarray
) -> tuple[np.ndarray, int]:
    """(energy of each splat (N,) over what it brought, values not finite or negative).

    Each splat is drawn into a square of `cell` texels of its own, its centre (N, 2) given from the square's
    middle; axes and chord (N, 2), texels.
    """
    across = SIDE // cell
    at_once = across * across
    found, bad = [], 0
    for first in range(0, len(centre), at_once):
        part = slice(first, first + at_once)
        row, column = np.divmod(np.arange(len(centre[part])), across)
        middle = cell * (np.column_stack([column, row]) + 0.5)
        image = rig.draw(photons(PLAIN, middle + centre[part], axis_s[part], axis_t[part], chord[part]))
        bad += not_finite([image]) + int(np.count_nonzero(image < 0.0))
        used = image[: across * cell, : across * cell, 3].reshape(across, cell, across, cell)
        found.append(used.sum(axis=(1, 3)).ravel()[: len(middle)] / rig.light.power_w())
    return np.concatenate(found), bad


def places_and_turns(places: int, turns: np.ndarray = TURNS) -> tuple[np.ndarray, np.ndarray]:
    """Every place of a regular lattice in a texel (N, 2) with every turn (N,), turn by turn."""
    at = (np.arange(places) + 0.37) / places
    lattice = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    return np.tile(lattice, (len(turns), 1)), np.repeat(turns, places * places)


def along(angle_rad: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 2)."""
    return np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


def energy_rows(energy: np.ndarray) -> dict[str, tuple[np.ndarray, float]]:
    """Of splats (K, P²): K kinds, each at all places of a texel."""
    return {
        "energy of one splat": (np.abs(energy - 1.0).ravel(), ONE_SPLAT + FAST_ERF),
        "energy, mean over places": (np.abs(energy.mean(axis=1) - 1.0), FAST_ERF + EDGE / np.sqrt(energy.shape[1])),
    }


def joined(parts: Sequence[tuple[np.ndarray, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Errors and bounds of several groups, each with a bound of its own, as rows."""
    return np.concatenate([error for error, _ in parts]), np.concatenate(
        [np.full(len(error), bound) for error, bound in parts]
    )


def measure_stretched(context: Context) -> Iterator[Measurement]:
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    for ratio in (1.0, 10.0, 100.0, 1e3, 1e4):
        total, bad = [], 0
        # Longest standard deviations from below a texel to a sixtieth of the map, plain and swept aside by as much.
        for longest, cell in ((0.3, 24), (3.0, 48), (20.0, 192)):
            centre, turn = places_and_turns(PLACES if cell < 100 else 2)
            axis_s, axis_t, aside = (
                longest * along(turn),
                longest / ratio * along(turn + 0.5 * np.pi),
                longest * along(turn + 0.6),
            )
            energy, wrong = energies(
                rig,
                cell,
                *(
                    np.concatenate(pair)
                    for pair in ((centre, centre), (axis_s, axis_s), (axis_t, axis_t), (0.0 * aside, aside))
                ),
            )
            total.append(energy.reshape(2 * len(TURNS), -1))
            bad += wrong
        kinds = [energy_rows(energy) for energy in total]
        errors, bounds = judged({name: joined([rows[name] for rows in kinds]) for name in kinds[0]})
        yield Measurement(ratio, f"{ratio:g} : 1", bad, errors, bounds)


def measure_sweeps(context: Context) -> Iterator[Measurement]:
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    for sweep, cell, places in (
        (0.0, 32, PLACES),
        (0.1, 32, PLACES),
        (1.0, 32, PLACES),
        (10.0, 48, PLACES),
        (100.0, 144, 2),
        (1000.0, SIDE, 1),
    ):
        turns = TURNS if places > 1 else TURNS[::2]
        centre, turn = places_and_turns(places, turns)
        turned = along(0.3 - turn)
        total, bad = [], 0
        # Axes as a slanting receiver makes them: not at right angles, and one nearly in the other.
        for shear, size in ((0.0, 0.3), (3.0, 0.5)):
            axis_t = size * (along(0.3 - turn + 0.5 * np.pi) + shear * turned)
            energy, wrong = energies(rig, cell, centre, size * turned, axis_t, sweep * along(turn))
            total.append(energy.reshape(len(turns), -1))
            bad += wrong
        rows = energy_rows(np.concatenate(total))
        if places == 1:
            del rows["energy, mean over places"]
        errors, bounds = judged(rows)
        yield Measurement(max(sweep, 1e-2), f"{sweep:g} texels", bad, errors, bounds)


def measure_collapse(context: Context) -> Iterator[Measurement]:
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    place, _ = places_and_turns(PLACES, np.zeros(1))
    for size in (3.0, 1.0, 0.3, 0.1, 1e-2, 1e-4, 1e-8, 0.0):
        # A point, a line, and two columns alike: det A = 0 to the last bit, as on a caustic.
        pairs = np.array([[[size, 0.0], [0.0, size]], [[4.0, 0.0], [0.0, size]], [[2.0, 2.0], [2.0 + size, 2.0]]])
        axes = np.repeat(pairs, len(place), axis=0)
        energy, bad = energies(rig, 64, np.tile(place, (3, 1)), axes[:, 0], axes[:, 1], np.zeros((3 * len(place), 2)))
        rows = energy_rows(energy.reshape(3, -1))
        rows["energy of a focus"] = np.abs(energy.reshape(3, -1)[:1].mean(axis=1) - 1.0), FAST_ERF
        rows["peak of a focus"] = peak_error(rig, size)
        errors, bounds = judged(rows)
        yield Measurement(max(size, 1e-9), f"{size:g} texels", bad, errors, bounds)


def peak_error(rig: Rig, size: float) -> tuple[np.ndarray, float]:
    """Of the texel that a round splat lies in the middle of, relative to the Gaussian's exact share.

    A splat below `footprint.comp`'s SMALL_STD is integrated over the texel. A larger one has the texel's box
    replaced by a Gaussian of the same variance along one axis, and is scaled to its energy.
    """
    image = rig.draw(photons(PLAIN, np.array([[32.5, 32.5]]), [size, 0.0], [0.0, size]))
    share = erf(0.5 / size / np.sqrt(2.0)) if size > 1e-3 else 1.0
    replaced = 1.0 / np.sqrt(2.0 * np.pi * (size**2 + 1.0 / 12.0))
    bound = abs(replaced / share - 1.0) + ONE_SPLAT if size >= 0.4 else 1e-5
    return np.array([abs(image[32, 32, 3] / rig.light.power_w() / share**2 - 1.0)]), bound


CASES = (
    Case(
        "stretched",
        "Footprints a thousand times longer than wide, at every angle",
        "Near a fold one axis of the footprint collapses while the other crosses the map. Across, the texel's own box "
        "is integrated; "
        "along, a Gaussian no narrower than the grid can see is sampled. No energy may be lost or made.",
        "ratio of the axes",
        measure_stretched,
        steps=5,
    ),
    Case(
        "sweeps",
        "Spectral sweeps from nothing to a thousand texels, over sheared footprints",
        "A strong prism throws one photon's spectrum across the whole map. The splat's table is chosen by blur over "
        "sweep, from 2^-8 to 2^5, "
        "and beyond either end something has to give: the blur along a long sweep is widened, never the energy "
        "changed.",
        "length of the sweep (texels)",
        measure_sweeps,
        steps=6,
    ),
    Case(
        "collapse",
        "A footprint that shrinks to a line and to a point",
        "At a perfect focus det A is 0 and irradiance infinite; a texel holds its average, which is finite, and all "
        "of the energy. The peak is never capped.",
        "size of the footprint (texels)",
        measure_collapse,
        steps=8,
    ),
    *SUM_CASES,
)
