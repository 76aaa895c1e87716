"""`progressive-stochastic`: random wavelengths in passes whose kernel shrinks, so that bias and variance both go to
zero: stochastic progressive photon mapping (Hachisuka and Jensen 2009) in the form of Knaus and Zwicker (2011), who
showed that no statistics of a pass but its number are needed."""

from __future__ import annotations

import math

METHOD = "progressive-stochastic"
ALPHA = 2.0 / 3.0
"""Share of a pass's photons that the next kernel keeps: the authors' value, at which bias² and variance of a density
in the plane fall at the same rate."""
PASS_PHOTONS = 1 << 14
"""Photons of a pass: enough that its fixed costs do not count, few enough that a short rendering has several."""
FIRST_KERNEL = 4.0
"""Of the first pass, in units of the width that other methods have. The bench tries others."""


def kernel_scale(number: int) -> float:
    """Standard deviation of pass `number`'s kernel (from 0) over that of the first: √Π (k + α)/(k + 1), k = 1…number
    (Knaus and Zwicker 2011, eq. 15)."""
    log2 = math.lgamma(number + 1 + ALPHA) - math.lgamma(1 + ALPHA) - math.lgamma(number + 2)
    return math.exp(0.5 * log2)
