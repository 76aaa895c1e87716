"""Rough surfaces in float64, from the definitions: GGX as a density of slopes, shadowing by the area that is seen
(Heitz 2014, eq. 14), what one surface sends on as integrals over its microfacets. No sampling, no formula of Smith's.

Microfacets are integrated over on a grid of polar coordinates (s, φ) of their slopes, tan θ = α sqrt(s / (1 - s)),
of which GGX's projected area is even: D(m) |m · n| dm = ds dφ / 2π.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from reference.textbook_optics import fresnel_reflectance
from spectrasplat.reference import optics

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Grid:
    """Microfacets about +z."""

    normal: np.ndarray
    """float64 (N, 3)."""
    area: np.ndarray
    """float64 (N,): projected area, together 1."""


@lru_cache(maxsize=8)
def grid(width: float, tilts: int = 600, turns: int = 256) -> Grid:
    """Gaussian quadrature over s; steep microfacets, which are few but seen large, have more places."""
    t, weight = np.polynomial.legendre.leggauss(tilts)
    t, weight = 0.5 * (t + 1.0), 0.5 * weight
    s = 1.0 - (1.0 - t) ** 4
    weight = weight * 4.0 * (1.0 - t) ** 3
    slope = width * np.sqrt(s) / (1.0 - t) ** 2
    cosine = 1.0 / np.sqrt(1.0 + slope * slope)
    sine = slope * cosine
    turn = (np.arange(turns) + 0.5) * 2.0 * np.pi / turns
    normal = np.stack(
        np.broadcast_arrays(sine[:, None] * np.cos(turn), sine[:, None] * np.sin(turn), cosine[:, None]), axis=-1
    )
    return Grid(normal.reshape(-1, 3), np.repeat(weight / turns, turns))


def toward(angle: float) -> np.ndarray:
    """Unit vector at this angle to the normal."""
    return np.array([np.sin(angle), 0.0, np.cos(angle)])


def seen_area(direction: np.ndarray, width: float) -> float:
    """Area of all microfacets that face `direction`, projected onto it; hidden ones count too."""
    facets = grid(width)
    facing = np.maximum(facets.normal @ direction, 0.0)
    return float(np.sum(facing / facets.normal[:, 2] * facets.area))


def unhidden(angle: float, width: float) -> float:
    """Share of the facing microfacets that are not hidden: together they cover the surface as it is seen, cos θ."""
    return float(np.cos(angle) / seen_area(toward(angle), width))


class Unhidden:
    """`unhidden` by a direction's cosine to the normal, interpolated; 0 from below."""

    def __init__(self, width: float) -> None:
        self._angle = np.linspace(0.0, 0.5 * np.pi - 1e-3, 400)
        self._share = np.array([unhidden(angle, width) for angle in self._angle])

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        """Of each."""
        share = np.interp(np.arccos(np.clip(cosine, 0.0, 1.0)), self._angle, self._share)
        return np.where(cosine > 0.0, share, 0.0)


@lru_cache(maxsize=8)
def shares(angle: float, width: float, eta_it: float) -> tuple[float, float]:
    """(reflected, transmitted) shares of light that falls on a rough surface at this angle, once; what is left hits
    other microfacets."""
    light = toward(angle)
    facets, hidden = grid(width), Unhidden(width)
    facing = facets.normal @ light
    seen = facing > 0.0
    normal, incident = facets.normal[seen], np.broadcast_to(-light, (int(seen.sum()), 3))
    met = facing[seen] / facets.normal[seen, 2] * facets.area[seen] * unhidden(angle, width) / np.cos(angle)
    reflectance = fresnel_reflectance(incident, normal, np.array(eta_it))
    reflected = np.sum(met * reflectance * hidden(optics.reflect(incident, normal)[:, 2]))
    passes = optics.transmitted_cosine2(incident, normal, np.array(eta_it)) > 0.0
    refracted = optics.refract(incident[passes], normal[passes], np.array(eta_it))
    transmitted = np.sum((met * (1.0 - reflectance))[passes] * hidden(-refracted[:, 2]))
    return float(reflected), float(transmitted)


def area_density(microfacet: np.ndarray, width: float) -> np.ndarray:
    """GGX's D(m) of unit vectors (N, 3) about +z, Walter et al. 2007, eq. 33."""
    cosine2 = microfacet[:, 2] ** 2
    return width**2 / (np.pi * (cosine2 * (width**2 - 1.0) + 1.0) ** 2)


def lobe_on_plane(radius: np.ndarray, height: float, width: float, index: float) -> np.ndarray:
    """Irradiance, 1/unit², on a plane `height` above a rough surface onto which a pencil of light of 1 W falls
    straight down, by distance (N,) from the axis: D F G / 4 of the microfacet half way, Walter et al. 2007, eq. 20."""
    tilt = np.arctan(np.asarray(radius, float) / height)
    microfacet = toward_many(0.5 * tilt)
    hidden = Unhidden(width)
    down = np.broadcast_to(-UP, microfacet.shape)
    reflectance = fresnel_reflectance(down, microfacet, np.array(1.0 / index))
    intensity = area_density(microfacet, width) * reflectance * hidden(np.cos(tilt)) / 4.0
    return intensity * np.cos(tilt) ** 3 / height**2


def toward_many(angle: np.ndarray) -> np.ndarray:
    """`toward` (N, 3)."""
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
