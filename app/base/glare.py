"""Veiling glare: the share of the light that a lens scatters over the picture, as a halo round what is bright.

Light scattered by glass, dust and the eye falls off about as 1/θ² (Spencer, Shirley, Zimmerman, Greenberg 1995,
*Physically-Based Glare Effects for Digital Images*, SIGGRAPH), which is the same energy in every octave of θ: Gaussians
whose widths double, of equal weight. Widths are shares of the picture's height, so that the halo is the same at every
size. Energy is kept but for what leaves the picture. Only pictures to look at have it, never linear data.
"""

from __future__ import annotations

import numpy as np

WIDEST = 1.0 / 8.0
"""Standard deviation of the widest Gaussian, picture heights."""
OCTAVES = 6


def with_glare(rgb: np.ndarray, share: float) -> np.ndarray:
    """Linear `rgb` (H, W, 3) of which the lens scatters `share`, 0 to 1, float32; the picture itself where that is 0.

    Beyond its border the picture is black.
    """
    if share <= 0.0:
        return rgb
    # numpy's transforms: to import scipy's takes 0.3 s, longer than to use them on most pictures.
    height, width = rgb.shape[:2]
    margin = int(np.ceil(3.0 * WIDEST * height))
    rows, columns = (_fast_length(side + margin) for side in (height, width))
    up, along = np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None, :]
    # Heat's kernel on the pixels: a Gaussian narrower than one has no ripples round it and no negative light.
    frequency2 = (2.0 - np.cos(2.0 * np.pi * up) - np.cos(2.0 * np.pi * along)) / (2.0 * np.pi**2)
    transfer = (1.0 - share) + share * _transfer(frequency2, height)
    found = np.empty_like(rgb, dtype=np.float32)
    for channel in range(3):
        spectrum = np.fft.rfft2(rgb[..., channel].astype(np.float64), (rows, columns))
        found[..., channel] = np.fft.irfft2(spectrum * transfer, (rows, columns))[:height, :width]
    return found


def _fast_length(least: int) -> int:
    """The least product of twos, threes and fives that is not below `least`: transforms of other lengths are slow."""
    lengths = (
        odd * 2 ** max(0, (-(-least // odd) - 1).bit_length())
        for odd in (3**a * 5**b for a in range(12) for b in range(8))
    )
    return min(lengths)


def _transfer(frequency2: np.ndarray, height: int) -> np.ndarray:
    """Fourier transform of what is scattered, at squared frequencies in cycles a pixel."""
    widths = WIDEST * height * 0.5 ** np.arange(OCTAVES)
    total = np.zeros_like(frequency2)
    for width in widths:
        total += np.exp(-np.minimum(2.0 * np.pi**2 * width**2 * frequency2, 700.0))
    return total / OCTAVES
