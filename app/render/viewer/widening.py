"""How much wider footprints are while a picture has few photons yet.

A footprint is a photon's neighbourhood to first order. Behind curved glass neighbours of a coarse lattice land far
apart, and elsewhere than the first order says: their footprints do not meet, and the gaps look like ripples and stray
rainbows, that is, like caustics. Wider ones meet. Every finer pass begins with empty maps and narrower footprints, and
those of the finest pass are not widened.
"""

from __future__ import annotations

from ...model.scene import Scene

KNOWN_PHOTONS = 1 << 18
"""From so many on, footprints meet as they are."""
_ROOT = 8.0
"""Widths go as this root of the photons that are missing: wider footprints remove false detail, and true detail too."""


def needs_widening(scene: Scene) -> bool:
    """Glass or mirrors are curved; behind plane facets the first order is exact."""
    return any(o.material.is_specular and o.mesh.corner_normals is not None for o in scene.objects)


def widening(photons: float, finest: float) -> float:
    """How much wider footprints are in a pass of so many photons, where the finest pass has `finest`."""
    if photons >= min(finest, KNOWN_PHOTONS):
        return 1.0
    return float((KNOWN_PHOTONS / max(photons, 1.0)) ** (1.0 / _ROOT))
