"""How much light one rough surface of glass sends on, reflected and transmitted together, when what microfacets throw
at each other is left out; what paths are divided by so that it is not lost [Turquin 2019].

Microfacets are those of GGX with Smith's masking [Walter et al. 2007], drawn as they are seen [Heitz 2018].
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from .coat import smith_lambda

INDEX_STEPS = 20
"""Rows to either side of the one where both media are alike …"""
INDEX_REACH = float(np.log(2.8))
"""… and how far they reach, as the logarithm of the ratio of indices."""
LEAST = 0.05
"""Lest media that are all but alike, met at grazing incidence, make much of little."""
ROWS = 2 * INDEX_STEPS + 1
"""Of one surface's table."""
_NODES, _ROUNDS, _TURNS = 41, 44, 24


def sent_on(alpha: float, eta_it: float, cosine: np.ndarray) -> np.ndarray:
    """Share of unpolarised light from directions of these cosines (N,) that a surface of GGX's width `alpha` sends on
    after one microfacet, float64 (N,); `eta_it` is the index before it over that behind.

    The mean over visible normals of Smith's G₁ on the way out, reflection and refraction weighted by Fresnel's
    reflectance; in the form of a spherical cap [Dupuy and Benyoub 2023].
    """
    mu = np.asarray(cosine, float)[:, None, None]
    nodes, weights = np.polynomial.legendre.leggauss(_ROUNDS)
    height, weights = 0.5 * (nodes + 1.0)[:, None], 0.5 * weights[:, None]
    turn = np.pi * (np.arange(_TURNS)[None, :] + 0.5) / _TURNS  # the other half is alike
    sine = np.sqrt(np.maximum(1.0 - mu * mu, 0.0))
    length = np.hypot(alpha * sine, mu)
    vx, vz = alpha * sine / length, mu / length
    z = (1.0 - height) * (1.0 + vz) - vz
    flat = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    hx, hy, hz = alpha * (flat * np.cos(turn) + vx), alpha * flat * np.sin(turn), np.maximum(z + vz, 0.0)
    size = np.maximum(np.sqrt(hx * hx + hy * hy + hz * hz), 1e-300)
    facing, upright = np.clip((hx * sine + hz * mu) / size, 0.0, 1.0), hz / size
    cosine2 = 1.0 - eta_it**2 * (1.0 - facing**2)
    passes, inside = cosine2 > 0.0, np.sqrt(np.maximum(cosine2, 0.0))
    s = (eta_it * facing - inside) / np.maximum(eta_it * facing + inside, 1e-300)
    p = (facing - eta_it * inside) / np.maximum(facing + eta_it * inside, 1e-300)
    reflectance = np.where(passes, 0.5 * (s * s + p * p), 1.0)
    up = 2.0 * facing * upright - mu
    down = eta_it * mu - (eta_it * facing - inside) * upright
    sent = reflectance * _unhidden(alpha, up) + (1.0 - reflectance) * _unhidden(alpha, down)
    return np.maximum((weights * sent).sum(axis=(1, 2)) / _TURNS, LEAST)


def _unhidden(alpha: float, cosine: np.ndarray) -> np.ndarray:
    """Smith's G₁; 0 from below."""
    return np.where(cosine > 0.0, 1.0 / (1.0 + smith_lambda(alpha, np.clip(cosine, 1e-12, 1.0))), 0.0)


def distinct(widths: Iterable[float]) -> list[float]:
    """Of all objects' widths those of rough ones, in the order of their tables."""
    return sorted({width for width in widths if width > 0.0})


def tables(widths: Iterable[float], samples: int) -> np.ndarray:
    """`distinct` ones' tables, one after the other, float64 (count · ROWS, samples)."""
    return np.concatenate([np.zeros((0, samples)), *(_table(width, samples) for width in distinct(widths))])


def row_defines(first_row: int) -> dict[str, int | str]:
    """Where shaders find them."""
    return {"ROUGH_ROW": first_row, "ROUGH_STEPS": INDEX_STEPS, "ROUGH_REACH": f"{INDEX_REACH:.8f}"}


@lru_cache(maxsize=16)
def _table(alpha: float, samples: int) -> np.ndarray:
    """`sent_on` at `samples` cosines from 0 to 1, float64 (ROWS, samples); the ratio of indices rises row by row."""
    nodes = np.linspace(0.0, 1.0, _NODES) ** 2  # densest where light grazes
    ratios = np.exp(np.linspace(-INDEX_REACH, INDEX_REACH, ROWS))
    at, cosine = np.maximum(nodes, 1e-6), np.linspace(0.0, 1.0, samples)
    return np.stack([np.interp(cosine, nodes, sent_on(alpha, ratio, at)) for ratio in ratios])
