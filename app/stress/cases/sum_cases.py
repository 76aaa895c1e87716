"""Sums that grow for ever, and photons whose columns are broken: neither may cost energy or leave a NaN behind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...gpu.context import Context
from ...gpu.records import FLAG_FOOTPRINT_DROPPED
from ...passes.splat import CHUNK, EXTENT_LIMIT
from ...passes.variants import FAR_TOO_LARGE
from ..case import Case, Measurement
from ..judging import EPSILON, judged, not_finite
from ..rigs.splat_rig import Rig, SplatFeatures, photons

PLAIN = SplatFeatures()
ONE_SPLAT = 0.08
"""What one sampled splat's energy may be off by (splat_cases.py derives it)."""
HALF = 0.5 * EPSILON
"""One rounding's largest relative error, 2⁻²⁴."""
TINY = (1e-3, 0.0)
DEPOSIT = 0.7
"""Energy of a photon: not a dyadic number, so every sum rounds, and always alike: the worst there is."""
REAL_PHOTONS = 100_000
BLOCK = 1 << 16
"""Photons between two flushes of a map of 1024² texels."""


def measure_one_texel(context: Context) -> Iterator[Measurement]:
    """Up to `REAL_PHOTONS` are splatted one by one; beyond, one real splat stands for a block of `BLOCK`, which the
    real flush adds."""
    rig = Rig(context.ctx, PLAIN, size=(64, 64))
    at = np.array([[20.5, 20.5]])

    def deposited(count: int, energy: float) -> tuple[float, float]:
        """(largest texel, sum of the map) after `count` photons of that energy."""
        factor = energy / rig.light.power_w()
        image = rig.draw(photons(PLAIN, np.repeat(at, count, axis=0), TINY, TINY[::-1], throughput=(factor,) * 3))[
            ..., 3
        ]
        return float(image.max()), float(image.sum())

    single = deposited(1, DEPOSIT)[1]
    for count in (1, 1000, 10_000, REAL_PHOTONS):
        peak, total = deposited(count, DEPOSIT)
        # Recursive summation: one rounding an addition, of at most a chunk of photons; and one of the total.
        chunk = min(count, 2048)
        error = np.abs(np.array([peak, total]) / (count * single) - 1.0)
        errors, bounds = judged({"energy in the texel": (error, chunk * HALF + EPSILON)})
        yield Measurement(
            float(count), f"{count:,} photons", not_finite([error]), errors, bounds, note="every photon splatted"
        )

    for count in (10**6, 10**7, 10**8):
        blocks = count // BLOCK
        factor = BLOCK * DEPOSIT / rig.light.power_w()
        records = photons(PLAIN, at, TINY, TINY[::-1], throughput=(factor,) * 3)
        block = rig.draw(records)[..., 3].sum()
        buffer = context.ctx.buffer(records)
        rig.atlas.clear()
        for _ in range(blocks):
            rig.splatter.run(buffer, 1, rig.variable, rig.tables, rig.atlas, rig.receivers, 1.0)
            rig.atlas.flush()
        buffer.release()
        total = rig.atlas.read_tile(rig.tile).astype(np.float64)[..., 3].sum()
        error = np.array([abs(total / (blocks * block) - 1.0)])
        # The flush carries over what it rounded off: the total is right to its own last place.
        errors, bounds = judged({"energy in the texel": (error, EPSILON)})
        yield Measurement(
            float(count),
            f"{count:,} photons",
            not_finite([error]),
            errors,
            bounds,
            note=f"{blocks} flushes of a block of {BLOCK:,}",
        )


def measure_one_chunk(context: Context) -> Iterator[Measurement]:
    for side in (64, 1022, 2046):
        rig = Rig(context.ctx, PLAIN, size=(side, side))
        count = int(np.clip((side + 2) ** 2 // 16, 2048, CHUNK))
        rng = np.random.default_rng(7)
        centre = 20.5 + rng.uniform(-0.3, 0.3, (count, 2))
        power = rig.light.power_w()
        same = rig.draw(photons(PLAIN, np.full((count, 2), 20.5), TINY, TINY[::-1], throughput=(DEPOSIT / power,) * 3))[
            ..., 3
        ].sum()
        share = rng.uniform(0.2, 1.0, count)
        records = photons(PLAIN, centre, TINY, TINY[::-1])
        records["throughput"] = share[:, None]
        mixed = rig.draw(records)[..., 3].sum()
        errors, bounds = judged(
            {
                "equal photons": (np.array([abs(same / (DEPOSIT * count) - 1.0)]), count * HALF),
                # Roundings of different numbers are independent: their sum grows as the root, here by five standard
                # deviations.
                "photons that differ": (
                    np.array([abs(mixed / (power * share.sum()) - 1.0)]),
                    5.0 * np.sqrt(count) * HALF + 8.0 * EPSILON,
                ),
            }
        )
        yield Measurement(
            float(count),
            f"{count:,} photons",
            not_finite([np.array([same, mixed])]),
            errors,
            bounds,
            note=f"map of {side}² texels",
        )


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


def measure_overflow(context: Context) -> Iterator[Measurement]:
    rig = Rig(context.ctx, PLAIN, size=(32, 16))
    severe = {
        1.0: 1.0,
        1e10: 1e10,
        1e20: 1e20,
        1e30: 1e30,
        1e38: 1e38,
        -3e38: 3e38,
        float("inf"): 1e39,
        float("-inf"): 1e40,
        float("nan"): 1e41,
    }
    for value, severity in severe.items():
        records = broken_records(value)
        sound = np.isfinite(value) and abs(value) < EXTENT_LIMIT
        # What is merely too large keeps its shape at the limit: it is drawn by itself, and makes no firefly.
        large = np.isfinite(value) and not sound and abs(value) < FAR_TOO_LARGE
        images = [rig.draw(records[6:] if large else records)]
        counted, broken = int(rig.splatter.counts()["footprints_dropped"]), 1 if sound else 7
        if large:
            images.append(rig.draw(records[:6]))
            counted += int(rig.splatter.counts()["footprints_dropped"])
        # A dropped footprint is one texel's splat: nothing of it leaves its own square of eight texels.
        squares = images[0][..., 3].reshape(2, 8, 4, 8).sum(axis=(1, 3)).ravel() / rig.light.power_w()
        dropped = [7] if sound or large else [0, 1, 2, 3, 4, 5, 7]
        fireflies = [image[..., 3].max() / rig.light.power_w() for image in images[1:]] or [0.0]
        errors, bounds = judged(
            {
                "energy of each": (np.abs(squares[6 if large else 0 :] - 1.0), ONE_SPLAT),
                "energy of dropped ones": (np.abs(squares[dropped] - 1.0), 1e-5),
                "brightest texel of large ones": (np.array(fireflies), 0.01),
                "miscounted": (np.array([abs(counted - broken)]), 0.0),
            }
        )
        yield Measurement(
            severity,
            f"{value:g}",
            not_finite(images),
            errors,
            bounds,
            fallbacks={"footprint dropped": counted},
            dropped=broken,
        )


CASES = (
    Case(
        "one-texel",
        "Every photon on one texel, up to a hundred million",
        "A float32 sum stops growing at 2^24 equal parts. Photons go to a scratch texture that is added to the total "
        "after a chunk, "
        "and what that addition rounds off stays in the scratch (Kahan): the total is right to its last place however "
        "long a rendering runs.",
        "photons",
        measure_one_texel,
        steps=7,
    ),
    Case(
        "one-chunk",
        "A chunk of photons on one texel of a large map",
        "Between two flushes a plain float32 sum runs on: a sixteenth of the map's texels in photons, since a flush "
        "costs as much as the map is large. "
        "Equal photons on one texel all round alike and may lose n · 2^-24; photons that differ lose its root.",
        "photons between two flushes",
        measure_one_chunk,
        steps=3,
    ),
    Case(
        "overflow",
        "Columns of 1e10, 1e38, infinity and NaN",
        "A photon whose columns overflowed has lost its shape, not its light: it is drawn as one texel, and counted. "
        "What is finite but larger than any map is drawn as large as can be, and counted too.",
        "value put into a column (infinite from 1e39, NaN 1e41)",
        measure_overflow,
        steps=9,
    ),
)
