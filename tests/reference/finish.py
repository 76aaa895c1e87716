"""Coats and rough bases in float64 numpy, for tests of the shaders' functions and of the tables."""

from __future__ import annotations

import numpy as np


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def fresnel(cosine: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Unpolarised, by the angles' sines and tangents: another form than any that is tested."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    s, p = (cosine - index * inside) / (cosine + index * inside), (index * cosine - inside) / (index * cosine + inside)
    return 0.5 * (s**2 + p**2)


def smith_g1(alpha: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Share of facets that are seen [Walter et al. 2007, eq. 34]."""
    return 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)))


def smith_g2(alpha: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Share seen from both sides, heights correlated [Heitz 2014, eq. 99]."""
    return 1.0 / (1.0 / smith_g1(alpha, a) + 1.0 / smith_g1(alpha, b) - 1.0)


def density(alpha: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """GGX [Walter et al. 2007, eq. 33]."""
    tangent2 = 1.0 / cosine**2 - 1.0
    return alpha**2 / (np.pi * cosine**4 * (alpha**2 + tangent2) ** 2)


def lobe(alpha: np.ndarray, index: np.ndarray, o: np.ndarray, i: np.ndarray) -> np.ndarray:
    """D F G / (4 cos cos) times the cosine of incidence, directions (…, 3) over the plane z = 0."""
    h = unit(o + i)
    g = smith_g2(alpha, o[..., 2], i[..., 2])
    return density(alpha, h[..., 2]) * fresnel(dot(o, h), index) * g / (4.0 * o[..., 2])


def hemisphere(rings: int, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) over the plane z = 0 with weights (N,) of an integral over solid angle."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    z, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    turn = 2.0 * np.pi * (np.arange(turns) + 0.5) / turns
    flat = np.sqrt(1.0 - z**2)
    directions = np.stack(
        [flat[:, None] * np.cos(turn), flat[:, None] * np.sin(turn), np.broadcast_to(z[:, None], (rings, turns))], -1
    )
    return directions.reshape(-1, 3), np.repeat(weights * 2.0 * np.pi / turns, turns)


def toward(cosine: float) -> np.ndarray:
    return np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])


def eon(rgb: np.ndarray, roughness: float, o: np.ndarray, i: np.ndarray) -> np.ndarray:
    """π f of [Portsmouth, Kutz and Hill 2025], its listing with the exact albedo, directions (…, 3)."""
    first, second = 0.5 - 2.0 / (3.0 * np.pi), 2.0 / 3.0 - 28.0 / (15.0 * np.pi)

    def single(mu: np.ndarray) -> np.ndarray:
        s = np.sqrt(1.0 - mu**2)
        g = s * (np.arccos(mu) - s * mu) + 2.0 / 3.0 * (s / mu * (1.0 - s**3) - s)
        return a + roughness * a / np.pi * g

    a = 1.0 / (1.0 + first * roughness)
    mu_o, mu_i = o[..., 2], i[..., 2]
    s = dot(o, i) - mu_o * mu_i
    ratio = np.where(s > 0.0, s / np.maximum(mu_o, mu_i), s)
    mean = a * (1.0 + second * roughness)
    multiple = rgb**2 * mean / (1.0 - rgb * (1.0 - mean))
    lost = (1.0 - single(mu_o)) * (1.0 - single(mu_i)) / (1.0 - mean)
    return rgb * (a * (1.0 + roughness * ratio))[..., None] + multiple * lost[..., None]
