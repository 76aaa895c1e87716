"""How much wider footprints are while a picture has few photons yet.

A footprint is a photon's neighbourhood to first order. Behind curved glass neighbours of a coarse lattice land far
apart and elsewhere than that order says: their footprints do not meet, and what is left between them looks like ripples
and stray rainbows, that is, like caustics. Wider ones meet. Every finer pass starts anew with narrower ones, and the
finest has those that were asked for: nothing of this stays.
"""

from __future__ import annotations

from ...model.scene import Scene

KNOWN_PHOTONS = 1 << 18
"""From so many on, footprints meet as they are."""
_ROOT = 8.0
"""Measured on `ball` (320×180, luminance at scales below 3 pixels, against 1 M photons): 16 k photons had false detail
of 0.0184 of the mean with footprints as they are, 0.0103 when 1.4 times as wide, 0.0080 when twice as wide; true detail
that was lost grew from 0.0275 to 0.0343 and 0.0391."""


def needs_widening(scene: Scene) -> bool:
    """Glass or mirrors are curved; behind plane facets the first order is exact."""
    return any(o.material.is_specular and o.mesh.corner_normals is not None for o in scene.objects)


def widening(photons: float, finest: float) -> float:
    """Of footprints in a pass of so many photons, where the finest pass has `finest`."""
    if photons >= min(finest, KNOWN_PHOTONS):
        return 1.0
    return float((KNOWN_PHOTONS / max(photons, 1.0)) ** (1.0 / _ROOT))
