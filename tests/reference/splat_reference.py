"""What a splat should deposit, by brute force in float64: no closed form, no tables, no code of the renderer.

The spectrum is cut into many wavelengths; each lands as a Gaussian at its own point, which is integrated over
the texels by a product of fine quadratures.
"""

from __future__ import annotations

import numpy as np


def splat_image(
    size: tuple[int, int],
    centre: np.ndarray,
    covariance: np.ndarray,
    chord: np.ndarray,
    places: np.ndarray,
    energies: np.ndarray,
) -> np.ndarray:
    """Energy per texel (height, width, channels), float64.

    `centre` (2,) of the chord and `chord` (2,) in texels; `covariance` (2, 2) texel²; `places` (n,) from -½ to ½ along
    the chord with `energies` (n, channels). A texel is the sum of samples no further apart than the Gaussian's narrow
    standard deviation, where the midpoint rule errs by 2 exp(-2 pi²) = 5e-9.
    """
    narrow = np.sqrt(np.linalg.eigvalsh(covariance)[0])
    subtexels = max(2, int(np.ceil(1.0 / narrow)))
    width, height = size
    step = 1.0 / subtexels
    inverse = np.linalg.inv(covariance)
    norm = step**2 / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))
    x = (np.arange(width * subtexels) + 0.5) * step
    y = (np.arange(height * subtexels) + 0.5) * step
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    image = np.zeros((len(grid), energies.shape[1]))
    for place, energy in zip(places, energies, strict=True):
        r = grid - centre - place * chord
        image += np.exp(-0.5 * np.einsum("ni,ij,nj->n", r, inverse, r))[:, None] * (norm * energy)
    return image.reshape(height, subtexels, width, subtexels, -1).sum(axis=(1, 3))
