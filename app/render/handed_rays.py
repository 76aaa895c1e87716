"""How many photons carry on what beams left, and where in the lattices of a pass they are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..base.random_words import Dimension, random_word, shift
from ..passes.beam_emission import BeamEmission

_TAIL_SHARE = 1.0
"""Photons that carry on weak beams, over those that a round asks for. `brilliant` at 100 k, 240×135, processor seconds
and relMSE: 4.7 s 0.065 with a half; 5.5 s 0.037 with all; 5.0 s 0.045 with all and half as many beams; 7.4 s 0.034
with twice as many and half the beams; 5.9 s 0.048 with a half and twice the beams."""
_TAIL_DENSITY = 64.0
"""As many times more of them than an even lattice would have there, at most."""
_FEWEST = 256
"""Photons over the pieces of a light."""


def handed_rays(
    emission: BeamEmission, entered_w: float, photons: float, weight: float, most: int, seed: int, number: int
) -> Iterator[tuple[int, np.ndarray]]:
    """Light and ray records, at most `most` at once, of photons that carry on pieces, all tails or none, in round
    `number` of all passes.

    `entered_w`: W that met facets, `photons`: of the round, `weight`: factor on their flux. What something curved may
    meet is as dense as the lattices of emission; tails, which are little light, are denser, and shared out among lights
    by the root of their flux."""
    pieces = emission.pieces
    flux_w = {int(light): emission.flux_w(int(light)) for light in np.unique(pieces.light)}
    entered_w, total = max(entered_w, 1e-300), sum(flux_w.values())
    roots = sum(watts**0.5 for watts in flux_w.values())
    for light, watts in flux_w.items():
        if watts <= 0.0:
            continue
        count = photons * min(1.0, watts / entered_w)
        if pieces.is_tail[0]:
            count = photons * min(_TAIL_SHARE, _TAIL_DENSITY * total / entered_w) * watts**0.5 / roots
            if count < 1.0:
                continue  # less than a 64th of a photon's power
        shifts = shift(seed, light, number, Dimension.LATTICE_U), shift(seed, light, number, Dimension.LATTICE_V)
        key = random_word(seed, light, number, Dimension.BRANCH)
        for rays in emission.batches(light, max(_FEWEST, int(count)), weight, shifts, key, most):
            yield light, rays
