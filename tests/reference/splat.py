"""The swept splat by brute quadrature: what the closed form in the shaders must equal.

A photon of spectral flux Φ_λ at p(λ) = p0 + (λ - λ0) v lands as a Gaussian of covariance Σ; a
bin [a, b] receives its integral over λ.
"""

from __future__ import annotations

import itertools

import numpy as np


def gaussian(point: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Normal density in the plane at points (..., 2)."""
    offset = point - mean
    inverse = np.linalg.inv(covariance)
    exponent = -0.5 * np.einsum("...i,ij,...j->...", offset, inverse, offset)
    # Below exp(-700) float64 has nothing to add, and strict floating point would object.
    return np.exp(np.maximum(exponent, -700.0)) / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))


def swept_gaussian(
    points: np.ndarray,
    p0: np.ndarray,
    velocity: np.ndarray,
    covariance: np.ndarray,
    band: tuple[float, float],
    anchor: float = 0.0,
    nodes: int = 400,
    pieces: int = 20,
) -> np.ndarray:
    """∫ over the band of the moving Gaussian at `points` (..., 2), Φ_λ = 1; composite Gauss–Legendre."""
    x, weight = np.polynomial.legendre.leggauss(nodes // pieces)
    edges = np.linspace(*band, pieces + 1)
    total = np.zeros(np.shape(points)[:-1])
    for low, high in itertools.pairwise(edges):
        for node, part in zip(0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * (high - low) * weight, strict=True):
            total += part * gaussian(points, p0 + (node - anchor) * velocity, covariance)
    return total
