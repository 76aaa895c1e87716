"""Six glasses as printed in their sources; the reference's own, so that the catalogue is not its own judge.

Schott data sheets (N-BK7, F2, N-SF11), Peter 1923 (diamond), Daimon and Masumura 2007 (water
at 20 °C), Malitson 1965 (fused silica). Wavelengths in nanometres, derivatives per micrometre.
"""

from __future__ import annotations

import numpy as np

F_NM, D_NM, C_NM = 486.1327, 587.5618, 656.2725

_SELLMEIER = {
    "N-BK7": ([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653]),
    "F2": ([1.34533359, 0.209073176, 0.937357162], [0.00997743871, 0.0470450767, 111.886764]),
    "N-SF11": ([1.73759695, 0.313747346, 1.89878101], [0.013188707, 0.0623068142, 155.23629]),
    "diamond": ([0.3306, 4.3356], [0.1750**2, 0.1060**2]),
    "water": (
        [0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688],
        [0.005101829712, 0.01821153936, 0.02620722293, 10.69792721],
    ),
    "fused silica": ([0.6961663, 0.4079426, 0.8974794], [0.0684043**2, 0.1162414**2, 9.896161**2]),
}


def sellmeier_terms(glass: str) -> tuple[list[float], list[float]]:
    """(B, C in µm²) of a glass."""
    return _SELLMEIER[glass]


def index(glass: str, wavelength_nm: float | np.ndarray) -> np.ndarray:
    """n(λ): n² = 1 + Σ B λ²/(λ² - C)."""
    b, c = (np.array(x) for x in _SELLMEIER[glass])
    um2 = (np.asarray(wavelength_nm, np.float64)[..., None] * 1e-3) ** 2
    return np.sqrt(1.0 + np.sum(b * um2 / (um2 - c), axis=-1))


def slope(glass: str, wavelength_nm: float | np.ndarray) -> np.ndarray:
    """n'(λ) per micrometre: 2 n n' = -Σ 2 B C λ/(λ² - C)²."""
    b, c = (np.array(x) for x in _SELLMEIER[glass])
    um = np.asarray(wavelength_nm, np.float64)[..., None] * 1e-3
    return -np.sum(b * c * um / (um**2 - c) ** 2, axis=-1) / index(glass, wavelength_nm)
