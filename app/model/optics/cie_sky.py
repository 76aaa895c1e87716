"""The CIE standard general sky: how bright each place of a sky is against its zenith, for fifteen kinds of weather.

ISO 15469:2004 / CIE S 011/E:2003, Spatial Distribution of Daylight. It gives luminances only; the colour is the
caller's.
"""

from __future__ import annotations

import math

import numpy as np

SKY_TYPES: dict[int, tuple[float, float, float, float, float]] = {
    1: (4.0, -0.70, 0.0, -1.0, 0.00),
    2: (4.0, -0.70, 2.0, -1.5, 0.15),
    3: (1.1, -0.80, 0.0, -1.0, 0.00),
    4: (1.1, -0.80, 2.0, -1.5, 0.15),
    5: (0.0, -1.00, 0.0, -1.0, 0.00),
    6: (0.0, -1.00, 2.0, -1.5, 0.15),
    7: (0.0, -1.00, 5.0, -2.5, 0.30),
    8: (0.0, -1.00, 10.0, -3.0, 0.45),
    9: (-1.0, -0.55, 2.0, -1.5, 0.15),
    10: (-1.0, -0.55, 5.0, -2.5, 0.30),
    11: (-1.0, -0.55, 10.0, -3.0, 0.45),
    12: (-1.0, -0.32, 10.0, -3.0, 0.45),
    13: (-1.0, -0.32, 16.0, -3.0, 0.30),
    14: (-1.0, -0.15, 16.0, -3.0, 0.30),
    15: (-1.0, -0.15, 24.0, -2.8, 0.15),
}
"""Type -> a, b (gradation) and c, d, e (indicatrix), table 1 of the standard. 1 is overcast, 5 uniform, 12 clear, 15
hazy and bright round the sun."""


def relative_luminance(sky_type: int, toward_sky: np.ndarray, toward_sun: np.ndarray) -> np.ndarray:
    """Luminance over that of the zenith, float64 (…,), seen along unit vectors `toward_sky` (…, 3) with z ≥ 0.

    `toward_sun` (3,): unit vector, z ≥ 0. Equations 1 to 6 of the standard.
    """
    a, b, c, d, e = SKY_TYPES[sky_type]

    def gradation(cosine_of_zenith: np.ndarray | float) -> np.ndarray:
        # φ(90°) is 1: the exponential has gone long before the smallest cosine kept here.
        return 1.0 + a * np.exp(b / np.maximum(cosine_of_zenith, 2e-3))

    def indicatrix(cosine_to_sun: np.ndarray | float) -> np.ndarray:
        angle_rad = np.arccos(np.clip(cosine_to_sun, -1.0, 1.0))
        return 1.0 + c * (np.exp(d * angle_rad) - math.exp(0.5 * math.pi * d)) + e * np.square(cosine_to_sun)

    towards = np.asarray(toward_sky, dtype=np.float64)
    sun = np.asarray(toward_sun, dtype=np.float64)
    return indicatrix(towards @ sun) * gradation(towards[..., 2]) / (indicatrix(sun[2]) * gradation(np.float64(1.0)))
