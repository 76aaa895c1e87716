"""Beams in thin haze in float64: the functions of shaders/lib/haze.glsl, and a slab of light in closed form."""

from __future__ import annotations

import numpy as np


def henyey_greenstein(cosine: np.ndarray, g: np.ndarray | float) -> np.ndarray:
    """Phase function, 1/sr; `g`: mean cosine [Henyey and Greenstein 1941]."""
    return (1.0 - np.square(g)) / (4.0 * np.pi * (1.0 + np.square(g) - 2.0 * g * cosine) ** 1.5)


def nearest(start: np.ndarray, beam: np.ndarray, ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ways (n,) along two lines, from `start` along unit `beam` and from the origin along unit `ray`, to where they are
    nearest: by least squares, line by line."""
    ways = [
        np.linalg.lstsq(np.stack([-b, r], axis=1), s, rcond=None)[0] for s, b, r in zip(start, beam, ray, strict=True)
    ]
    on_beam, on_ray = np.array(ways).T
    return on_beam, on_ray


def beam_radiance(
    irradiance: float, chord: float, scattering: float, g: float, cosine: float, before: float, after: float
) -> float:
    """Radiance of a collimated beam of even irradiance where a ray crosses it: the scattered part of a chord, with what
    haze takes on the ways `before` it, of the light, and `after` it, to the eye. Haze takes little over the chord."""
    phase = float(henyey_greenstein(np.array(cosine), g))
    return irradiance * scattering * phase * chord * float(np.exp(-scattering * (before + after)))
