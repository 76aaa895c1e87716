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
    subtexels: int = 6,
    pixel: bool = True,
) -> np.ndarray:
    """Energy per texel (height, width, channels), float64.

    `centre` (2,) of the chord and `chord` (2,) in texels; `covariance` (2, 2) texel²; `places` (n,) from -½ to ½ along the
    chord with `energies` (n, channels). Each texel holds the mean of subtexels² samples.
    """
    width, height = size
    step = 1.0 / subtexels
    # A sample stands for a small square: its variance is added so that the narrowest Gaussians stay resolved.
    blurred = np.asarray(covariance, np.float64) + np.eye(2) * step**2 / 3.0
    inverse = np.linalg.inv(blurred)
    norm = step**2 / (2.0 * np.pi * np.sqrt(np.linalg.det(blurred)))
    x = (np.arange(width * subtexels) + 0.5) * step
    y = (np.arange(height * subtexels) + 0.5) * step
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    image = np.zeros((len(grid), energies.shape[1]))
    for place, energy in zip(places, energies, strict=True):
        r = grid - centre - place * chord
        image += np.exp(-0.5 * np.einsum("ni,ij,nj->n", r, inverse, r))[:, None] * (norm * energy)
    return image.reshape(height, subtexels, width, subtexels, -1).sum(axis=(1, 3))
