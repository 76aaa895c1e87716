"""How much a glossy coat reflects in all: the directional albedo of its lobe, and what is left for the base under it.

The lobe is single scattering by microfacets of the GGX distribution with height-correlated shadowing and masking
[Walter et al. 2007; Heitz 2014] and Fresnel's reflectance. Its base gets what the lobe leaves on the way in and lets it
out on the way back, (1 − E(μ_i)) (1 − E(μ_o)) / (1 − E_mean) [Kelemen and Szirmay-Kalos 2001]: reciprocal, and with a
base that absorbs nothing all light comes back, from every direction. What single scattering leaves out of the lobe is
part of what the base gets, so that nothing is lost.
"""

from __future__ import annotations

import numpy as np

ALBEDO_NODES = 257
_ROUNDS, _TURNS = 48, 48


def fresnel(cosine: np.ndarray, index: float) -> np.ndarray:
    """Unpolarised reflectance of a surface of relative index `index`, met at `cosine` from outside."""
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / index**2, 0.0))
    s = (cosine - index * inside) / np.maximum(cosine + index * inside, 1e-300)
    p = (index * cosine - inside) / np.maximum(index * cosine + inside, 1e-300)
    return 0.5 * (s * s + p * p)


def smith_lambda(alpha: float, cosine: np.ndarray) -> np.ndarray:
    """Smith's Λ of GGX at a direction of this cosine."""
    tangent2 = (1.0 - cosine**2) / np.maximum(cosine**2, 1e-300)
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * tangent2) - 1.0)


def directional_albedo(alpha: float, index: float, cosine: np.ndarray) -> np.ndarray:
    """Share E of light from directions of these cosines (N,) that the lobe reflects, float64 (N,).

    The mean of F G₂ / G₁ over visible normals [Heitz 2018], in the form of a spherical cap [Dupuy and Benyoub 2023].
    An alpha of 0 is a perfectly smooth coat. An `index` of infinity is a lossless mirror's: what is missing from 1 is
    single scattering's own loss."""
    if alpha == 0.0:
        return np.ones(len(cosine)) if np.isinf(index) else fresnel(np.asarray(cosine, float), index)
    nodes, weights = np.polynomial.legendre.leggauss(_ROUNDS)
    height, weights = 0.5 * (nodes + 1.0)[:, None], 0.5 * weights[:, None]
    turn = 2.0 * np.pi * (np.arange(_TURNS)[None, :] + 0.5) / _TURNS
    found = np.empty(len(cosine))
    for i, mu in enumerate(np.asarray(cosine, float)):
        sine = np.sqrt(max(1.0 - mu * mu, 0.0))
        length = np.hypot(alpha * sine, mu)
        vx, vz = alpha * sine / length, mu / length
        z = (1.0 - height) * (1.0 + vz) - vz
        flat = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        hx, hy, hz = alpha * (flat * np.cos(turn) + vx), alpha * flat * np.sin(turn), np.maximum(z + vz, 0.0)
        size = np.maximum(np.sqrt(hx * hx + hy * hy + hz * hz), 1e-300)
        facing = (hx * sine + hz * mu) / size
        out = 2.0 * facing * hz / size - mu
        reflected = 1.0 if np.isinf(index) else fresnel(np.clip(facing, 0.0, 1.0), index)
        shadow = smith_lambda(alpha, np.array(mu))
        seen = (1.0 + shadow) / (1.0 + shadow + smith_lambda(alpha, np.clip(out, 1e-12, 1.0)))
        found[i] = (weights * np.where(out > 0.0, reflected * seen, 0.0)).sum() / _TURNS
    return found


def coat_tables(alpha: float, index: float, samples: int) -> np.ndarray:
    """Over `samples` cosines from 0 to 1, float64 (2, samples): E, and (1 − E) / (1 − its mean over a hemisphere)."""
    nodes = np.linspace(0.0, 1.0, ALBEDO_NODES) ** 2  # densest where light grazes
    cosine = np.linspace(0.0, 1.0, samples)
    # At grazing incidence itself everything is reflected or nothing known; the limit is what lies beside it.
    albedo = np.interp(cosine, nodes, directional_albedo(alpha, index, np.maximum(nodes, 1e-6)))
    mean = 2.0 * np.trapezoid(albedo * cosine, cosine)
    return np.stack([albedo, (1.0 - albedo) / (1.0 - mean)])
