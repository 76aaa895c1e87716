"""How many photons the passes of a rendering have, and with what weight each enters the sum of all.

A lattice of N photons errs less than two of N/2 each: footprints are narrower, bands too, and neighbours are evenly
spaced. So a rendering of a given number of photons is one pass, and one without end (`progressive`) takes passes that
grow: each is planned anew for its own number, and three quarters of all photons are always in the finest.

Errors of independent passes average out best when each has a weight inverse to its squared error. Every pass counts by
a power of its photons: coarse ones, whose blur would stay in an even mean, fade as finer ones come, and yet none is
lost.

`progressive-stochastic` takes random wavelengths in equal passes whose kernel shrinks, so that bias and variance both
go to zero: stochastic progressive photon mapping (Hachisuka and Jensen 2009) in the form of Knaus and Zwicker (2011),
who showed that no statistics of a pass but its number are needed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from itertools import pairwise

PROGRESSIVE, SHRINKING = "progressive", "progressive-stochastic"
FIRST_PHOTONS = 1 << 13
"""Photons of the first pass of a rendering without end: few enough for an early picture, enough that setting up is not
all."""
GROWTH = 4
"""Photons of a pass over those of the one before it. What has been traced by the end of a pass errs GROWTH / (GROWTH -
1) times as much as one pass of all of it, and GROWTH times that just before the next has ended."""
LARGEST_PHOTONS = 1 << 28
"""Passes grow no further: points of a lattice are counted in 32 bits, and bands are as many as there may be."""
WEIGHT_POWER = 3.0
"""As for errors that are blur: where they are noise, all that is lost is the quarter of the photons that is not in the
finest pass."""
ALPHA = 2.0 / 3.0
"""Share of a pass's photons that the next kernel keeps: the authors' value, at which bias² and variance of a density
in the plane fall at the same rate."""
PASS_PHOTONS = 1 << 14
"""Photons of a pass whose kernel shrinks: enough that its fixed costs do not count, few enough that a short rendering
has several."""
FIRST_KERNEL = 4.0
"""Width of the first such pass's kernel, in units of that of other methods."""


def endless_passes(method: str) -> Iterator[int]:
    """Photons of one pass after another of a method that is made to go on for ever."""
    if method == SHRINKING:
        yield from itertools.repeat(PASS_PHOTONS)
    photons = FIRST_PHOTONS
    while True:
        yield photons
        photons = min(GROWTH * photons, LARGEST_PHOTONS)


def pass_sizes(method: str, photons: int) -> list[int]:
    """Photons of the passes, in turn, that a rendering of about `photons` consists of. Doubling ones end with a whole
    pass: the first is as much larger as that takes."""
    photons = max(photons, 1)
    if method == SHRINKING:
        count = max(1, round(photons / PASS_PHOTONS))
        return [max(1, round(photons / count))] * count
    if method != PROGRESSIVE:
        return [photons]
    count = max(1, math.floor(math.log(1.0 + photons / FIRST_PHOTONS * (GROWTH - 1.0), GROWTH)))
    first = photons * (GROWTH - 1.0) / (GROWTH**count - 1.0)
    ends = [round(first * (GROWTH**k - 1.0) / (GROWTH - 1.0)) for k in range(count + 1)]
    return [end - begin for begin, end in pairwise(ends)]


def emphasis(photons: float, first: float) -> float:
    """What a photon of a pass of `photons` counts, over one of a pass of `first`."""
    return (photons / first) ** (WEIGHT_POWER - 1.0)


def kernel_scale(number: int) -> float:
    """Standard deviation of pass `number`'s kernel (from 0) over that of the first: √Π (k + α)/(k + 1), k = 1…number
    (Knaus and Zwicker 2011, eq. 15)."""
    log2 = math.lgamma(number + 1 + ALPHA) - math.lgamma(1 + ALPHA) - math.lgamma(number + 2)
    return math.exp(0.5 * log2)
