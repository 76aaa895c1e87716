"""Polarised light of shaders/lib/polarisation.glsl in float64, by Jones vectors: coherency matrices instead of Stokes
parameters, complex amplitudes instead of their products."""

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


def amplitudes(cosine_i: Array, eta: Array) -> tuple[Array, Array, Array, Array]:
    """r_s, r_p, and the root of the shares let through for s and p, with r_p = -r_s upright. [Born and Wolf, 1.5.2]"""
    cosine_t = np.sqrt((1.0 - eta**2 * (1.0 - cosine_i**2)).astype(complex))
    r_s = (eta * cosine_i - cosine_t) / (eta * cosine_i + cosine_t)
    r_p = (cosine_i - eta * cosine_t) / (cosine_i + eta * cosine_t)
    root = np.sqrt(cosine_t.real / (eta * cosine_i))
    t_s = 2.0 * eta * cosine_i / (eta * cosine_i + cosine_t) * root
    t_p = 2.0 * eta * cosine_i / (cosine_i + eta * cosine_t) * root
    return r_s, r_p, t_s, t_p


def after(matrix: Array, a_s: Array, a_p: Array) -> Array:
    """What amplitudes for s and p make of a matrix over these."""
    jones = np.zeros((*np.shape(a_s), 2, 2), complex)
    jones[..., 0, 0], jones[..., 1, 1] = a_s, a_p
    return jones @ matrix @ np.swapaxes(jones, -1, -2).conj()
