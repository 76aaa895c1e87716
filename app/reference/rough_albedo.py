"""The share of light that leaves a rough surface after one microfacet, compiled in float64.

A quadrature over microfacets as `scattering.scatter` draws them, by the area that GGX gives them, which is not how
the shaders' tables are made."""

from __future__ import annotations

import math

import numpy as np

from .compiling import compiled

RATIOS = np.exp(np.linspace(-1.2, 1.2, 65))
"""Ratios of indices, before the surface over behind it: rows of a table."""
NODES = 65
"""Cosines of a row, the square of evenly spaced numbers from 0 to 1."""


@compiled
def masking(cosine, width):
    """Smith's G1 of GGX for a direction at this cosine to the surface's normal: 1 where nothing is hidden."""
    if cosine <= 0.0:
        return 0.0
    tangent2 = max(1.0 - cosine * cosine, 0.0) / (cosine * cosine)
    return 2.0 / (1.0 + math.sqrt(1.0 + width * width * tangent2))


@compiled
def _sent_on(width, eta, mu, tilts, weights, turns):
    """Share of light at the cosine `mu`: `tilts`, `weights` a quadrature of [0, 1]."""
    sine = math.sqrt(1.0 - mu * mu)
    total = 0.0
    for i in range(len(tilts)):
        # Steep microfacets, which are few but seen large, have more places.
        t = tilts[i]
        slope = width * math.sqrt(1.0 - (1.0 - t) ** 4) / (1.0 - t) ** 2
        upright = 1.0 / math.sqrt(1.0 + slope * slope)
        across = slope * upright
        weight = weights[i] * 4.0 * (1.0 - t) ** 3 / turns
        for k in range(turns):
            # The half turn left out is alike.
            facing = across * math.cos(math.pi * (k + 0.5) / turns) * sine + upright * mu
            if facing <= 0.0:
                continue
            seen = weight * facing * masking(mu, width) / (mu * upright)
            cosine2 = 1.0 - eta * eta * (1.0 - facing * facing)
            reflectance = 1.0
            if cosine2 > 0.0:
                inside = math.sqrt(cosine2)
                s = (eta * facing - inside) / (eta * facing + inside)
                p = (facing - eta * inside) / (facing + eta * inside)
                reflectance = 0.5 * (s * s + p * p)
                down = eta * mu - (eta * facing - inside) * upright
                total += seen * (1.0 - reflectance) * masking(down, width)
            total += seen * reflectance * masking(2.0 * facing * upright - mu, width)
    return total


@compiled
def _fill(table, width, ratios, cosines, tilts, weights, turns):
    for i in range(len(ratios)):
        for k in range(len(cosines)):
            table[i, k] = max(_sent_on(width, ratios[i], cosines[k], tilts, weights, turns), 0.05)


def albedo_tables(widths: np.ndarray, is_mirror: np.ndarray) -> np.ndarray:
    """A table for each object's width (O,): float64 (O, ratios, NODES), shared by equal widths; ones where all are
    polished, of which one is enough. A mirror (O,) is dense beyond measure, whatever the ratio."""
    if not np.any(widths > 0.0):
        return np.ones((1, len(RATIOS), NODES))
    tables = np.ones((len(widths), len(RATIOS), NODES))
    tilts, weights = np.polynomial.legendre.leggauss(80)
    cosines = np.maximum(np.linspace(0.0, 1.0, NODES) ** 2, 1e-6)
    for width, mirror in {(w, m) for w, m in zip(widths.tolist(), is_mirror.tolist(), strict=True) if w > 0.0}:
        table = np.empty(tables.shape[1:])
        ratios = np.full(1, 1e9) if mirror else RATIOS
        _fill(table[: len(ratios)], width, ratios, cosines, 0.5 * (tilts + 1.0), 0.5 * weights, 48)
        tables[(widths == width) & (is_mirror == mirror)] = table[:1] if mirror else table
    return tables


@compiled
def sent_on(tables, thing, cosine, eta):
    """Share of light at this cosine that leaves an object, linear between the table's nodes."""
    rows, nodes = tables.shape[1], tables.shape[2]
    row = min(max((math.log(eta) + 1.2) * (rows - 1) / 2.4, 0.0), rows - 1.001)
    node = min(math.sqrt(max(cosine, 0.0)) * (nodes - 1), nodes - 1.001)
    i, k = int(row), int(node)
    u = row - i
    v = (cosine - (k / (nodes - 1.0)) ** 2) * (nodes - 1.0) ** 2 / (2 * k + 1)
    low = (1.0 - v) * tables[thing, i, k] + v * tables[thing, i, k + 1]
    high = (1.0 - v) * tables[thing, i + 1, k] + v * tables[thing, i + 1, k + 1]
    return (1.0 - u) * low + u * high
