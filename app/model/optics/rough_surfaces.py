"""How much light rough surfaces send on in all: a glossy coat, ground glass, rough metal.

A coat's lobe is single scattering by microfacets of the GGX distribution with height-correlated shadowing and masking
[Walter et al. 2007; Heitz 2014] and Fresnel's reflectance. Its base gets what the lobe leaves on the way in and lets it
out on the way back, (1 − E(μ_i)) (1 − E(μ_o)) / (1 − E_mean) [Kelemen and Szirmay-Kalos 2001]: reciprocal, and with a
base that absorbs nothing all light comes back, from every direction. What single scattering leaves out of the lobe is
part of what the base gets, so that nothing is lost.

Ground glass has the same microfacets: `glass_sent_on` is what is left where light between microfacets is ignored, and
paths are divided by it so that it is not lost [Turquin 2019]. A mirror's microfacets reflect again what they throw at
each other: where each reflects the share r, and E leaves after one of them where r is 1, r / (1 − r (1 − E)) leaves.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

_COAT_NODES, _GLASS_NODES = 257, 41
"""Cosines at which albedos are computed; tables are linear between them."""
GLASS_INDEX_STEPS = 20
"""Rows of a table on either side of the one where both media are alike …"""
_INDEX_REACH = float(np.log(2.8))
"""… and how far they reach, as the logarithm of the ratio of indices."""
MIRROR_ROW = 2 * GLASS_INDEX_STEPS + 1
"""The row that follows them: of a mirror that loses nothing."""
_OF_MIRROR = 1e9
"""Its ratio of indices: all is reflected totally."""
_ROWS = MIRROR_ROW + 1
"""Rows of the table of one width."""
_LEAST = 0.05
"""Bound of `glass_sent_on`: media that are almost alike, met at grazing incidence, would make much of little."""


# ---- microfacets --------------------------------------------------------------------------


def fresnel(cosine: np.ndarray, index: float) -> np.ndarray:
    """Unpolarised reflectance of a surface, met at `cosine`; `index`: that behind it over that before. 1 where light is
    totally reflected."""
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / index**2, 0.0))
    s = (cosine - index * inside) / np.maximum(cosine + index * inside, 1e-300)
    p = (index * cosine - inside) / np.maximum(index * cosine + inside, 1e-300)
    return 0.5 * (s * s + p * p)


def _smith_lambda(alpha: float, cosine: np.ndarray) -> np.ndarray:
    """Smith's Λ of GGX at a direction of this cosine."""
    tangent2 = (1.0 - cosine**2) / np.maximum(cosine**2, 1e-300)
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * tangent2) - 1.0)


def _visible_normals(alpha: float, mu: np.ndarray, rounds: int, turn: np.ndarray) -> tuple[np.ndarray, ...]:
    """Quadrature over the normals that are visible from the cosine `mu`, in the form of a spherical cap [Heitz 2018;
    Dupuy and Benyoub 2023]: weights (rounds, 1), the normals' cosine to the direction of view, and their height and
    length before they are normalised (rounds, turns). `turn`: azimuths, rad."""
    nodes, weights = _gauss_legendre(rounds)
    height = 0.5 * (nodes + 1.0)[:, None]
    sine = np.sqrt(np.maximum(1.0 - mu * mu, 0.0))
    length = np.hypot(alpha * sine, mu)
    vx, vz = alpha * sine / length, mu / length
    z = (1.0 - height) * (1.0 + vz) - vz
    flat = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    hx, hy, hz = alpha * (flat * np.cos(turn) + vx), alpha * flat * np.sin(turn), np.maximum(z + vz, 0.0)
    size = np.maximum(np.sqrt(hx * hx + hy * hy + hz * hz), 1e-300)
    return 0.5 * weights[:, None], (hx * sine + hz * mu) / size, hz, size


_gauss_legendre = lru_cache(np.polynomial.legendre.leggauss)


# ---- a coat -------------------------------------------------------------------------------


def directional_albedo(alpha: float, index: float, cosine: np.ndarray) -> np.ndarray:
    """Share E of light from directions of these cosines (N,) that the lobe reflects, float64 (N,).

    The mean of F G₂ / G₁ over visible normals. An alpha of 0 is a perfectly smooth coat. An `index` of infinity is a
    lossless mirror's: what is missing from 1 is single scattering's own loss."""
    if alpha == 0.0:
        return np.ones(len(cosine)) if np.isinf(index) else fresnel(np.asarray(cosine, float), index)
    turns = 48
    turn = 2.0 * np.pi * (np.arange(turns)[None, :] + 0.5) / turns
    found = np.empty(len(cosine))
    for i, mu in enumerate(np.asarray(cosine, float)):
        weights, facing, height, length = _visible_normals(alpha, mu, 48, turn)
        out = 2.0 * facing * height / length - mu
        reflected = 1.0 if np.isinf(index) else fresnel(np.clip(facing, 0.0, 1.0), index)
        shadow = _smith_lambda(alpha, np.array(mu))
        seen = (1.0 + shadow) / (1.0 + shadow + _smith_lambda(alpha, np.clip(out, 1e-12, 1.0)))
        found[i] = (weights * np.where(out > 0.0, reflected * seen, 0.0)).sum() / turns
    return found


def coat_tables(alpha: float, index: float, samples: int) -> np.ndarray:
    """Over `samples` cosines from 0 to 1, float64 (2, samples): E, and (1 − E) / (1 − its mean over a hemisphere)."""
    nodes = np.linspace(0.0, 1.0, _COAT_NODES) ** 2  # densest where light grazes
    cosine = np.linspace(0.0, 1.0, samples)
    # At grazing incidence itself everything is reflected or nothing known; the limit is what is next to it.
    albedo = np.interp(cosine, nodes, directional_albedo(alpha, index, np.maximum(nodes, 1e-6)))
    mean = 2.0 * np.trapezoid(albedo * cosine, cosine)
    return np.stack([albedo, (1.0 - albedo) / (1.0 - mean)])


# ---- ground glass -------------------------------------------------------------------------


def glass_sent_on(alpha: float, eta_it: float, cosine: np.ndarray) -> np.ndarray:
    """Share of unpolarised light from directions of these cosines (N,) that a surface of GGX's width `alpha` reflects
    or transmits after one microfacet, float64 (N,); `eta_it` is the index before it over that behind.

    The mean over visible normals of Smith's G₁ on the way out, reflection and refraction weighted by Fresnel's
    reflectance.
    """
    mu = np.asarray(cosine, float)[:, None, None]
    turns = 24
    turn = np.pi * (np.arange(turns)[None, :] + 0.5) / turns  # the other half is alike
    weights, facing, height, length = _visible_normals(alpha, mu, 44, turn)
    facing, upright = np.clip(facing, 0.0, 1.0), height / length
    inside = np.sqrt(np.maximum(1.0 - eta_it**2 * (1.0 - facing**2), 0.0))
    reflectance = fresnel(facing, 1.0 / eta_it)
    up = 2.0 * facing * upright - mu
    down = eta_it * mu - (eta_it * facing - inside) * upright
    sent = reflectance * _unhidden(alpha, up) + (1.0 - reflectance) * _unhidden(alpha, down)
    return np.maximum((weights * sent).sum(axis=(1, 2)) / turns, _LEAST)


def _unhidden(alpha: float, cosine: np.ndarray) -> np.ndarray:
    """Smith's G₁; 0 from below."""
    return np.where(cosine > 0.0, 1.0 / (1.0 + _smith_lambda(alpha, np.clip(cosine, 1e-12, 1.0))), 0.0)


def distinct_widths(widths: Iterable[float]) -> list[float]:
    """The widths of rough objects among `widths`, each once, in the order of their tables."""
    return sorted({width for width in widths if width > 0.0})


def glass_tables(widths: Iterable[float], samples: int) -> np.ndarray:
    """Tables of `distinct_widths`, one after the other, float64 (rows, samples)."""
    return np.concatenate(
        [np.zeros((0, samples)), *(_glass_table(width, samples) for width in distinct_widths(widths))]
    )


def first_row_of(width: float, widths: list[float], is_mirror: bool) -> int:
    """Where the table of one of the `distinct_widths` begins; a mirror's one row."""
    return _ROWS * widths.index(width) + MIRROR_ROW * is_mirror


def glass_defines(first_row: int) -> dict[str, int | str]:
    """Where shaders find the tables, whose first row is `first_row`."""
    return {"ROUGH_ROW": first_row, "ROUGH_STEPS": GLASS_INDEX_STEPS, "ROUGH_REACH": f"{_INDEX_REACH:.8f}"}


@lru_cache(maxsize=16)
def _glass_table(alpha: float, samples: int) -> np.ndarray:
    """`glass_sent_on` at `samples` cosines from 0 to 1, float64 (_ROWS, samples): the ratio of indices rises; last,
    a mirror's."""
    nodes = np.linspace(0.0, 1.0, _GLASS_NODES) ** 2  # densest where light grazes
    ratios = *np.exp(np.linspace(-_INDEX_REACH, _INDEX_REACH, MIRROR_ROW)), _OF_MIRROR
    at, cosine = np.maximum(nodes, 1e-6), np.linspace(0.0, 1.0, samples)
    return np.stack([np.interp(cosine, nodes, glass_sent_on(alpha, ratio, at)) for ratio in ratios])
