"""Whose caustic lies at a point: the photons stored there know what they came through."""

from __future__ import annotations

import math

import numpy as np

REACH = 0.03
"""Radius about the point from which photons are asked, share of the extent of the glass's light on that receiver."""
MIN_BRIGHTNESS = 0.25
"""Irradiance within that radius over the mean within the extent: fainter is stray light, not a caustic."""
MIN_SHARE = 0.2
"""Of the flux near the point, that must have come through one object."""


def source_at(
    point: np.ndarray,
    receiver: int,
    position: np.ndarray,
    flux_w: np.ndarray,
    source: np.ndarray,
    photon_receiver: np.ndarray,
) -> int | None:
    """Index of the object that throws most of the light near a world `point` of object `receiver`, or None.

    Photons: `position` (n, 3) world, `flux_w` (n,), `source` (n,) the object met first (negative:
    straight from a light), `photon_receiver` (n,).
    """
    through_glass = (photon_receiver == receiver) & (source >= 0) & (flux_w > 0.0)
    if not through_glass.any():
        return None
    places, flux, origins = position[through_glass], flux_w[through_glass], source[through_glass]
    extent = float(np.linalg.norm(np.percentile(places, 95, axis=0) - np.percentile(places, 5, axis=0)))
    radius = REACH * max(extent, 1e-12)
    near = np.linalg.norm(places - np.asarray(point, float), axis=1) <= radius
    mean = flux.sum() / max(extent, 1e-12) ** 2
    if not near.any() or flux[near].sum() < MIN_BRIGHTNESS * mean * math.pi * radius**2:
        return None
    totals = np.bincount(origins[near], weights=flux[near])
    best = int(totals.argmax())
    return best if totals[best] >= MIN_SHARE * totals.sum() else None
