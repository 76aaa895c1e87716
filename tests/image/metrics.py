"""Errors of a linear picture against a reference, as the prism case defines them."""

from __future__ import annotations

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def relative_mse(image: np.ndarray, reference: np.ndarray) -> float:
    """mean[(I − R)² / (R² + ε)], ε = 0.01 · (mean luminance of the lit pixels)²; (H, W, 3) each."""
    luminance = reference @ LUMINANCE
    lit = luminance[luminance > 1e-4 * luminance.max()].mean()
    return float(np.mean((image - reference) ** 2 / (reference**2 + 0.01 * lit**2)))


def normalised_rmse(image: np.ndarray, reference: np.ndarray) -> float:
    """√(Σ(I − R)² / ΣR²)."""
    return float(np.sqrt(np.sum((image - reference) ** 2) / np.sum(reference**2)))
