"""A grating in float64, by other means than the shaders: vectors in the frame (across, along, normal)."""

from __future__ import annotations

import numpy as np
from spectrasplat.reference.optics import cross, dot, times, unit


def diffract(
    direction: np.ndarray, normal_out: np.ndarray, lines: np.ndarray, step: np.ndarray, reflects: bool
) -> np.ndarray:
    """Directions (N, 3) of an order that adds `step` (N,) = m λ / (Λ n) across the lines; NaN where it is evanescent.

    `normal_out`: the sheet's own normal, whichever side the light comes from."""
    across = unit(cross(lines, normal_out))
    along = cross(normal_out, across)
    a = dot(direction, across) + step
    b = dot(direction, along)
    c2 = 1.0 - a * a - b * b
    with np.errstate(invalid="ignore"):
        c = np.sqrt(np.where(c2 > 0.0, c2, np.nan))
    forward = np.sign(dot(direction, normal_out)) * (-1.0 if reflects else 1.0)
    return times(a, across) + times(b, along) + times(forward * c, normal_out)
