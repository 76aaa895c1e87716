"""The known answers T1 to T16 of geometrical optics.

The numbers are the literature's formulas, evaluated on their own in double precision; no tracer had a part in them.
`tests/gpu/test_known_answers_gpu.py` holds them against all that walks rays on the device (`walkers.py`), on meshes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM

LINES = (F_NM, D_NM, C_NM)


def n_of(name: str, nm: float) -> float:
    return float(glasses.index(name, nm))


N_BK7_D = n_of("N-BK7", D_NM)


@dataclass(frozen=True)
class IndexTable:
    """T1."""

    n_fdc: tuple[float, float, float]
    abbe: float
    slope_per_um: float


INDEX_TABLES = {
    "N-BK7": IndexTable((1.522376, 1.516800, 1.514322), 64.167, -0.041799),
    "F2": IndexTable((1.632081, 1.620040, 1.615032), 36.366, -0.086493),
    "N-SF11": IndexTable((1.806513, 1.784720, 1.775955), 25.680, -0.152878),
    "diamond": IndexTable((2.435538, 2.417486, 2.409906), 55.301, -0.131002),
    "water": IndexTable((1.337492, 1.333403, 1.331513), 55.760, -0.031340),
    "fused silica": IndexTable((1.463126, 1.458464, 1.456367), 67.821, -0.035215),
}


@dataclass(frozen=True)
class MinimumDeviation:
    """T2: a prism of 60°, entered at the angle that is least bent at the d line."""

    incidence_deg: float
    deviations_deg: tuple[float, float, float]
    slope_rad_um: float


MINIMUM_DEVIATIONS = {
    "N-BK7": MinimumDeviation(49.32335, (39.13905, 38.64670, 38.42932), -0.064130),
    "F2": MinimumDeviation(54.09789, (49.38809, 48.19578, 47.70902), -0.147498),
    "N-SF11": MinimumDeviation(63.17131, (69.25084, 66.34263, 65.24956), -0.338731),
}
APEX = np.pi / 3

SLABS = {"N-BK7": (0.526946, 0.018554), "N-SF11": (0.431514, 0.043846)}
"""T3, a slab of thickness 1 met at 45°: advance inside at the d line, and its derivative by wavelength in µm."""


def slab_advance(name: str, nm: float = D_NM) -> tuple[float, float]:
    """T3 by its formula, for any glass."""
    n, slope, s = n_of(name, nm), float(glasses.slope(name, nm)), np.sin(np.pi / 4)
    return s / np.sqrt(n * n - s * s), -s * n * slope / (n * n - s * s) ** 1.5


BALL_FOCAL_LENGTHS = (1.45716, 1.46749, 1.47215)
"""T4, a ball of radius 1 of N-BK7: nR/2(n − 1) at the lines."""
PLANO_CONVEX_FOCAL_LENGTHS = (1.91433, 1.93498, 1.94431)
"""T5, radius 1, N-BK7, at the lines."""
APLANATIC_IMAGES = {(F_NM, 10): -1.5309890, (F_NM, 80): -1.5635224} | {
    (D_NM, a): -1.516800 for a in (1, 10, 45, 80, 89)
}
"""T6, a source at −R/n_d in a ball of N-BK7: image by line and angle in degrees."""
ELLIPSOID_MISSES = (-0.002093068, 0.0, 0.000934928)
"""T7, eccentricity 1/n_d, N-BK7: miss of the far focus at height 0.3, at the lines."""
DIACAUSTIC_DEG, DIACAUSTIC_POINT = 25.0, (0.131883, -0.400415)
"""T8, a point 1 below a plane face of N-BK7, d line: point of the caustic of the ray of 25°."""


def diacaustic_lame(x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray | float:
    """T8: 1 on the caustic."""
    return (N_BK7_D * np.abs(y)) ** (2 / 3) + (np.sqrt(N_BK7_D**2 - 1) * np.abs(x)) ** (2 / 3)


NEPHROID_DEG, NEPHROID_POINT = 30.0, (0.649519, 0.125)
"""T9, a cylindrical mirror of radius 1."""


def nephroid(t: np.ndarray | float) -> np.ndarray:
    """T9: points (…, 2) of the caustic of rays that meet the mirror at the angle t."""
    return np.stack([3 * np.cos(t) - np.cos(3 * t), 3 * np.sin(t) - np.sin(3 * t)], axis=-1) / 4


RAINBOW_LINES = (400.0, D_NM, 700.0)
RAINBOWS = {1: ((40.5674, 42.0195, 42.4405), -2.53492), 2: ((53.6198, 50.9964, 50.2379), 4.57002)}
"""T10, water: by reflections, radii in degrees at `RAINBOW_LINES`, ∂radius/∂n at the d line."""


def rainbow_height(n: float, reflections: int) -> float:
    """T10: of the ray that turns, from the axis of a ball of radius 1."""
    return float(np.sqrt(1 - (n * n - 1) / (reflections * (reflections + 2))))


ACHROMAT_PARTS, ACHROMAT_FOCAL_LENGTHS = (43.3255, -76.4463), (100.04996, 100.0, 100.04996)
"""T11, thin lenses of N-BK7 and F2 of focal length 100 at the d line: of the parts, and at the lines."""


def achromat_parts() -> tuple[float, float]:
    """T11: f_1 = 100 (V_1 − V_2)/V_1, f_2 = −100 (V_1 − V_2)/V_2."""
    crown, flint = ((n[1] - 1) / (n[0] - n[2]) for n in (glasses.index(g, np.array(LINES)) for g in ("N-BK7", "F2")))
    return 100 * (crown - flint) / crown, -100 * (crown - flint) / flint


AMICI_TILT_DEG, AMICI_SLOPE = 31.388079, 0.257201
AMICI_DEVIATIONS_DEG = {F_NM: -2.21096, D_NM: 0.0, C_NM: 0.82305, 400.0: -6.65042}
"""T12, N-BK7, N-SF11, N-BK7: tilt of the outer faces, ∂deviation/∂λ at the d line in rad/µm, deviations."""
SPLIT_DEG, SPLIT_NM, SPLIT_INDEX = 41.10, 503.239, 1.521201
"""T13, N-BK7 met from inside at this angle: shorter waves are reflected totally."""
SPECTRUM_NM = (400.0, 500.0, 600.0, 700.0)
SPECTRA = {
    "N-BK7": (49.39911, (19.1320, 4.4542, -3.4169, -8.3520), (4.788, 9.743, 16.545, 24.675)),
    "N-SF11": (63.58268, (143.1368, 26.3026, -18.2710, -41.9603), None),
}
"""T14, the prism of T2 at minimum deviation for 550 nm: incidence in degrees, places on a screen at 1 m in mm, dλ/dx in
nm/mm."""
FOLD_PLANE, FOLD_HEIGHT = 1.2, 0.5028279
FOLD_RADII = (0.0615807, 0.06458174, 0.0659364)
FOLD_SHARES = {0.9: 0.237054, 0.99: 0.0740836}
FOLD_INSIDE = 0.717808
"""T15, a ball of N-BK7 in a beam of radius 1, on the plane x = 1.2: the ring of the fold at the lines, and without
Fresnel the shares of the light between so many radii and the ring, and within it."""
FRESNEL = {0.0: 0.042165, 45.0: 0.052595, 60.0: 0.091958, 75.0: 0.256144}
BREWSTER_DEG = 56.6038
"""T16, N-BK7, d line, unpolarised: reflectance by angle in degrees."""
