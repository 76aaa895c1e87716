"""A rough diffuse surface that loses no energy: EON [Portsmouth, Kutz and Hill 2025], Fujii's form of Oren and Nayar's
model with the light that grooves scatter more than once given back.

Functions of numpy arrays, after the paper's equations; `shaders/lib/rough_diffuse.glsl` holds the same for the camera.
"""

from __future__ import annotations

import numpy as np

_MEAN_LOSS = 0.5 - 2.0 / (3.0 * np.pi)
_HEMISPHERE_LOSS = 2.0 / 3.0 - 28.0 / (15.0 * np.pi)


def single_albedo(cosine: np.ndarray, roughness: float) -> np.ndarray:
    """Directional albedo of single scattering by white facets."""
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    steep = sine * (np.arctan2(sine, cosine) - sine * cosine)
    # (sin/cos)(1 − sin³), in a form that is exact at grazing angles.
    grazing = sine * cosine * (1.0 + sine + sine * sine) / (1.0 + sine)
    turned = steep + 2.0 / 3.0 * (grazing - sine)
    return (1.0 + roughness * turned / np.pi) / (1.0 + _MEAN_LOSS * roughness)


def multiple_colour(reflectance: np.ndarray, roughness: float) -> np.ndarray:
    """Colour of what is scattered more than once, for facets of this reflectance."""
    mean = (1.0 + _HEMISPHERE_LOSS * roughness) / (1.0 + _MEAN_LOSS * roughness)
    return reflectance**2 * mean / (1.0 - reflectance * (1.0 - mean))


def albedo(reflectance: np.ndarray, roughness: float, cosine: np.ndarray) -> np.ndarray:
    """Share of light from a direction that is sent back; by reciprocity the mean, times π, of what goes there."""
    single = single_albedo(cosine, roughness)
    return reflectance * single + multiple_colour(reflectance, roughness) * (1.0 - single)
