"""Polarised light of shaders/lib/polarisation.glsl in float64, by Jones vectors: coherency matrices instead of Stokes
parameters."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def coherency(stokes: Array) -> Array:
    """Hermitian (..., 2, 2) over (axis, cross(direction, axis)) of (q, u, v), stokes (..., 3); trace 1."""
    q, u, v = np.moveaxis(np.asarray(stokes, float), -1, 0)
    off = u + 1j * v
    return 0.5 * np.stack([np.stack([1.0 + q, off], -1), np.stack([off.conj(), 1.0 - q], -1)], -2)


def stokes_of(matrix: Array) -> tuple[Array, Array]:
    """Intensity, and (q, u, v) over it, of a coherency matrix."""
    intensity = np.trace(matrix, axis1=-2, axis2=-1).real
    parts = [
        matrix[..., 0, 0].real - matrix[..., 1, 1].real,
        2.0 * matrix[..., 0, 1].real,
        2.0 * matrix[..., 0, 1].imag,
    ]
    return intensity, np.stack(parts, -1) / np.maximum(intensity, 1e-300)[..., None]


def seen_from(matrix: Array, angle: Array) -> Array:
    """The matrix over axes turned by an angle about the direction."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], -2)
    return turn @ matrix @ np.swapaxes(turn, -1, -2)


def after(matrix: Array, a_s: Array, a_p: Array) -> Array:
    """What amplitudes for s and p make of a matrix over these."""
    jones = np.zeros((*np.shape(a_s), 2, 2), complex)
    jones[..., 0, 0], jones[..., 1, 1] = a_s, a_p
    return jones @ matrix @ np.swapaxes(jones, -1, -2).conj()
