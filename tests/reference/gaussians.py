"""Float64 reference of shaders/lib/gaussian.glsl, from the error function's own definition."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def erf(x: Array) -> Array:
    """The error function."""
    from scipy.special import erf as error_function

    return error_function(np.asarray(x, np.float64))


def gaussian_box(y: Array, half_width: Array) -> Array:
    """Normal probability of [y - half_width, y + half_width], arguments in units of √2 standard deviations."""
    return 0.5 * (erf(y + half_width) - erf(y - half_width))


def normal_excess(z: Array) -> Array:
    """E[max(Z - z, 0)] of a standard normal Z: density minus z times the upper tail (by erfc, so no cancellation)."""
    from scipy.special import erfc

    return np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi) - 0.5 * z * erfc(z / np.sqrt(2.0))


def sinc_pi(x: Array) -> Array:
    """sin(πx) / (πx)."""
    return np.sinc(x)
