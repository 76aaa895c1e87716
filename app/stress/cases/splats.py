"""Footprints at their stiffest: stretched, swept over a whole map, collapsed to a point, piled up on one texel, broken.

Photon records made by hand are drawn by the real splat pass; what they should deposit is known: all of their
energy, and for a focus its share of each texel.

A map holds averages over texels, but a splat is sampled at their centres along its sweep and under a Gaussian of
variance `SAMPLED` at least. A texel grid sees such a Gaussian through its harmonics: by Poisson's formula the first
weighs exp(−2π² · SAMPLED), with a cosine of the place, and there are two of each direction. So one splat may be off by
`ONE_SPLAT`, depending on where in a texel it lies. Over a lattice of places the cosines cancel. What is left is
the fast erf's 5e-4 (Abramowitz and Stegun 1964, 7.1.27) at either end of a row of texels, `FAST_ERF`, and the edge:
three standard deviations out a splat ends with exp(−4.5) of its peak, and where it lies in line with the grid whole
rows enter or leave together, which P places average out to `EDGE`/P.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import erf

import numpy as np

from ...features.features import Features
from ...gpu.context import Context
from ...gpu.packed_records import write_records
from ...gpu.records import FLAG_FOOTPRINT_DROPPED
from ...passes.footprint import EXTENT_LIMIT, Photons
from ...passes.light_programs import FAR_TOO_LARGE
from ..case import EPSILON, Held, Measured, Measurement, case, judged, measured, not_finite
from ..rigs.splat_rig import Rig, photons

PLAIN = Features(spectral_groups=1)
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
    found, bad = [], 0
    for first in range(0, len(centre), across * across):
        part = slice(first, first + across * across)
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


def energy_kept(*groups: np.ndarray) -> dict[str, tuple]:
    """Groups of splats (K, P²): K kinds, each at all places of a texel."""
    single = np.concatenate([np.abs(energy - 1.0).ravel() for energy in groups])
    mean = [np.abs(energy.mean(axis=1) - 1.0) for energy in groups]
    bounds = [np.full(len(energy), FAST_ERF + EDGE / np.sqrt(energy.shape[1])) for energy in groups]
    return {
        "energy of one splat": (single, ONE_SPLAT + FAST_ERF),
        "energy, mean over places": (np.concatenate(mean), np.concatenate(bounds)),
    }


@case("stretched", "ratio of the axes", (1.0, 10.0, 100.0, 1e3, 1e4))
def stretched(context: Context, ratios: Sequence[float]) -> Measured:
    """Footprints a thousand times longer than wide, at every angle

    Near a fold one axis of the footprint collapses while the other crosses the map. Across, the texel's own box is
    integrated; along, a Gaussian no narrower than the grid can see is sampled. No energy may be lost or made."""
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    for ratio in ratios:
        groups, bad = [], 0
        # Longest standard deviations from below a texel to a sixtieth of the map, plain and swept aside by as much.
        for longest, cell in ((0.3, 24), (3.0, 48), (20.0, 192)):
            centre, turn = places_and_turns(PLACES if cell < 100 else 2)
            axis_s, axis_t = longest * along(turn), longest / ratio * along(turn + 0.5 * np.pi)
            chord = np.concatenate([np.zeros_like(axis_s), longest * along(turn + 0.6)])
            centre, axis_s, axis_t = (np.tile(vectors, (2, 1)) for vectors in (centre, axis_s, axis_t))
            energy, wrong = energies(rig, cell, centre, axis_s, axis_t, chord)
            groups.append(energy.reshape(2 * len(TURNS), -1))
            bad += wrong
        yield Measurement(ratio, f"{ratio:g} : 1", bad, *judged(energy_kept(*groups)))


SWEEPS = ((0.0, 32, PLACES), (0.1, 32, PLACES), (1.0, 32, PLACES), (10.0, 48, PLACES), (100.0, 144, 2), (1e3, SIDE, 1))
"""Length, texels of each splat's square, places in a texel."""


@case("sweeps", "length of the sweep (texels)", SWEEPS)
def sweeps(context: Context, lengths: Sequence[tuple[float, int, int]]) -> Measured:
    """Spectral sweeps from nothing to a thousand texels, over sheared footprints

    A strong prism spreads one photon's spectrum across the whole map. The splat's table is chosen by blur over sweep,
    from 2^-8 to 2^5, and beyond either end something has to give: the blur along a long sweep is widened, never the
    energy changed."""
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    for sweep, cell, places in lengths:
        turns = TURNS if places > 1 else TURNS[::2]
        centre, turn = places_and_turns(places, turns)
        turned = along(0.3 - turn)
        groups, bad = [], 0
        # Axes as a slanting receiver makes them: not at right angles, and one nearly in the other.
        for shear, size in ((0.0, 0.3), (3.0, 0.5)):
            axis_t = size * (along(0.3 - turn + 0.5 * np.pi) + shear * turned)
            energy, wrong = energies(rig, cell, centre, size * turned, axis_t, sweep * along(turn))
            groups.append(energy.reshape(len(turns), -1))
            bad += wrong
        held = energy_kept(*groups)
        if places == 1:
            del held["energy, mean over places"]
        yield Measurement(max(sweep, 1e-2), f"{sweep:g} texels", bad, *judged(held))


@case("collapse", "size of the footprint (texels)", (3.0, 1.0, 0.3, 0.1, 1e-2, 1e-4, 1e-8, 0.0))
def collapse(context: Context, sizes: Sequence[float]) -> Measured:
    """A footprint that shrinks to a line and to a point

    At a perfect focus det A is 0 and irradiance infinite; a texel holds its average, which is finite, and all of the
    energy. The peak is never capped."""
    rig = Rig(context.ctx, PLAIN, size=(SIDE, SIDE))
    place, _ = places_and_turns(PLACES, np.zeros(1))
    for size in sizes:
        # A point, a line, and two columns alike: det A = 0 to the last bit, as on a caustic.
        pairs = np.array([[[size, 0.0], [0.0, size]], [[4.0, 0.0], [0.0, size]], [[2.0, 2.0], [2.0 + size, 2.0]]])
        axes = np.repeat(pairs, len(place), axis=0)
        energy, bad = energies(rig, 64, np.tile(place, (3, 1)), axes[:, 0], axes[:, 1], np.zeros((3 * len(place), 2)))
        held = energy_kept(energy.reshape(3, -1))
        held["energy of a focus"] = np.abs(energy.reshape(3, -1)[:1].mean(axis=1) - 1.0), FAST_ERF
        held["peak of a focus"] = peak_error(rig, size)
        yield Measurement(max(size, 1e-9), f"{size:g} texels", bad, *judged(held))


def peak_error(rig: Rig, size: float) -> tuple[float, float]:
    """(error, bound) of the texel that a round splat lies in the middle of, relative to the Gaussian's exact share.

    A splat below `footprint.comp`'s SMALL_STD is integrated over the texel. A larger one has the texel's box
    replaced by a Gaussian of the same variance along one axis, and is scaled to its energy.
    """
    image = rig.draw(photons(PLAIN, np.array([[32.5, 32.5]]), [size, 0.0], [0.0, size]))
    share = erf(0.5 / size / np.sqrt(2.0)) if size > 1e-3 else 1.0
    replaced = 1.0 / np.sqrt(2.0 * np.pi * (size**2 + 1.0 / 12.0))
    bound = abs(replaced / share - 1.0) + ONE_SPLAT if size >= 0.4 else 1e-5
    return abs(image[32, 32, 3] / rig.light.power_w() / share**2 - 1.0), bound


# ---- sums that grow for ever -------------------------------------------------------------------

HALF = 0.5 * EPSILON
"""One rounding's largest relative error, 2⁻²⁴."""
DEPOSIT = 0.7
"""Energy of a photon: not a dyadic number, so every sum rounds, and always alike: the worst there is."""
SPLATTED = 100_000
"""Photons that are splatted one by one; of more, one real splat stands for a block."""
BLOCK = 1 << 16
"""Photons between two flushes of a map of 1024² texels."""
COUNTS = (1, 1000, 10_000, SPLATTED, 10**6, 10**7, 10**8)


def tiny(centre: np.ndarray, energy: float = 1.0) -> np.ndarray:
    """Photons (n, 2) far smaller than a texel that bring a share `energy` of the light."""
    return photons(PLAIN, centre, (1e-3, 0.0), (0.0, 1e-3), throughput=(energy,) * 3)


@case("one-texel", "photons", COUNTS)
def one_texel(context: Context, counts: Sequence[int]) -> Measured:
    """Every photon on one texel, up to a hundred million

    A float32 sum stops growing at 2^24 equal parts. Photons go to a scratch texture that is added to the total after a
    chunk, and what that addition rounds off stays in the scratch (Kahan): the total is right to its last place however
    long a rendering runs."""
    rig = Rig(context.ctx, PLAIN, size=(64, 64))
    at, each = np.array([[20.5, 20.5]]), DEPOSIT / rig.light.power_w()
    single = rig.draw(tiny(at, each))[..., 3].sum()
    for count in counts:
        if count <= SPLATTED:
            image = rig.draw(tiny(np.repeat(at, count, axis=0), each))[..., 3]
            error = np.abs(np.array([image.max(), image.sum()]) / (count * single) - 1.0)
            # Recursive summation: one rounding an addition, of at most a chunk of photons; and one of the total.
            bound, note = min(count, rig.splatter.chunk(rig.atlas)) * HALF + EPSILON, "every photon splatted"
        else:
            blocks = count // BLOCK
            error = np.array([abs(flushed(rig, tiny(at, BLOCK * each), blocks) - 1.0)])
            # The flush carries over what it rounded off: the total is right to its own last place. A GPU's rounds off.
            bound, note = (
                blocks * HALF if rig.splatter.in_bulk else EPSILON,
                f"{blocks} flushes of a block of {BLOCK:,}",
            )
        yield measured(count, f"{count:,} photons", {"energy in the texel": (error, bound)}, [error], note)


def flushed(rig: Rig, records: np.ndarray, times: int) -> float:
    """The map's sum after so many flushes of these photons, over as many times their energy."""
    once = rig.draw(records)[..., 3].sum()
    struct = rig.splatter.footprints.photon
    buffer = rig.ctx.buffer(reserve=len(records) * struct.stride)
    write_records(struct, buffer, records)
    rig.atlas.clear()
    for _ in range(times):
        rig.splatter.run(Photons(buffer, len(records)), rig.spectra, rig.atlas, rig.receivers, 1.0)
        rig.atlas.flush()
    buffer.release()
    return rig.atlas.read_tile(rig.tile).astype(np.float64)[..., 3].sum() / (times * once)


@case("one-chunk", "photons between two flushes", (64, 1022, 2046))
def one_chunk(context: Context, sides: Sequence[int]) -> Measured:
    """A chunk of photons on one texel of a large map

    Between two flushes a plain float32 sum runs on: a sixteenth of the map's texels in photons, since a flush costs as
    much as the map is large. Equal photons on one texel all round alike and may lose n · 2^-24; photons that differ
    lose its root."""
    for side in sides:
        rig = Rig(context.ctx, PLAIN, size=(side, side))
        count, power = rig.splatter.chunk(rig.atlas), rig.light.power_w()
        rng = np.random.default_rng(7)
        records = tiny(20.5 + rng.uniform(-0.3, 0.3, (count, 2)))
        same = rig.draw(tiny(np.full((count, 2), 20.5), DEPOSIT / power))[..., 3].sum()
        share = rng.uniform(0.2, 1.0, count)
        records["throughput"] = share[:, None]
        mixed = rig.draw(records)[..., 3].sum()
        held: Held = {
            "equal photons": (abs(same / (DEPOSIT * count) - 1.0), count * HALF),
            # Roundings of different numbers are independent: their sum grows as the root, here by five standard
            # deviations.
            "photons that differ": (
                abs(mixed / (power * share.sum()) - 1.0),
                5.0 * np.sqrt(count) * HALF + 8.0 * EPSILON,
            ),
        }
        yield measured(count, f"{count:,} photons", held, [same, mixed], f"map of {side}² texels")


# ---- columns that are broken -------------------------------------------------------------------

VALUES = (1.0, 1e10, 1e20, 1e30, 1e38, -3e38, np.inf, -np.inf, np.nan)
PLACE_OF = {-3e38: 3e38, np.inf: 1e39, -np.inf: 1e40}
"""Places on the axis of what a logarithm cannot show; NaN is at 1e41."""


def broken_records(value: float) -> np.ndarray:
    """Photons far from each other, each with `value` in another component of its columns; the seventh is sound, the
    eighth flagged."""
    names = ("dposition_ds", "dposition_dt", "dposition_dvar0")
    centre = np.array([[4.5 + 8.0 * i, 4.5 + 8.0 * j] for j in range(2) for i in range(4)])
    records = photons(PLAIN, centre, [0.3, 0.0], [0.0, 0.3], [0.5, 0.2])
    for i, (name, component) in enumerate((name, component) for name in names for component in (0, 1)):
        records[name][i, component] = value
    records["flags"][7] = FLAG_FOOTPRINT_DROPPED
    return records


@case("overflow", "value put into a column (infinite from 1e39, NaN 1e41)", VALUES)
def overflow(context: Context, values: Sequence[float]) -> Measured:
    """Columns of 1e10, 1e38, infinity and NaN

    A photon whose columns overflowed has lost its shape, not its light: it is drawn as one texel, and counted. What is
    finite but larger than any map is drawn as large as can be, and counted too."""
    rig = Rig(context.ctx, PLAIN, size=(32, 16))
    for value in values:
        records = broken_records(value)
        sound = np.isfinite(value) and abs(value) < EXTENT_LIMIT
        # What is merely too large keeps its shape at the limit: it is drawn by itself, and makes no firefly.
        large = np.isfinite(value) and not sound and abs(value) < FAR_TOO_LARGE
        images = [rig.draw(records[6:] if large else records)]
        counted, broken = int(rig.splatter.footprints.counts()["footprints_dropped"]), 1 if sound else 7
        if large:
            images.append(rig.draw(records[:6]))
            counted += int(rig.splatter.footprints.counts()["footprints_dropped"])
        # A dropped footprint is one texel's splat: nothing of it leaves its own square of eight texels.
        squares = images[0][..., 3].reshape(2, 8, 4, 8).sum(axis=(1, 3)).ravel() / rig.light.power_w()
        dropped = [7] if sound or large else [0, 1, 2, 3, 4, 5, 7]
        fireflies = [image[..., 3].max() / rig.light.power_w() for image in images[1:]] or [0.0]
        held: Held = {
            "energy of each": (np.abs(squares[6 if large else 0 :] - 1.0), ONE_SPLAT),
            "energy of dropped ones": (np.abs(squares[dropped] - 1.0), 1e-5),
            "brightest texel of large ones": (fireflies, 0.01),
            "miscounted": (abs(counted - broken), 0.0),
        }
        severity, counts = 1e41 if np.isnan(value) else PLACE_OF.get(value, value), {"footprint dropped": counted}
        bad = not_finite(images)
        yield Measurement(severity, f"{value:g}", bad, *judged(held), fallbacks=counts, dropped=broken)
