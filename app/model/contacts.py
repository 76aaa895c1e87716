"""Which surfaces may touch, by their bounds: only scenes that have such pay for looking at contacts, ray by ray."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .scene import Scene, SceneObject

Box = np.ndarray | Sequence[np.ndarray]
"""Low and high corner (..., 3)."""
_SLACK = 1e-4
"""Share of the specular objects' half diagonal: above what the shaders take for contact (`NEAR_DISTANCE` of
shaders/lib/intersect.glsl)."""
_SOLID_SLACK = 1e-5
"""Of the glass's longest side, between two solids."""


def world_bounds(item: SceneObject) -> np.ndarray:
    """World axis-aligned bounds, float64 (2, 3)."""
    points = item.mesh.vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]
    return np.stack([points.min(axis=0), points.max(axis=0)])


def overlapping_solids(scene: Scene) -> list[int]:
    """Indices of dielectric objects whose bounds overlap or touch those of another one, or that may touch a surface
    that is not glass: a ray keeps a bit for each, up to 32 of them, those among glass first."""
    among_glass = _nested(scene)
    on_sheets = {i for pair in contacts(scene) for i in pair if scene.objects[i].material.transmits}
    return among_glass + sorted(on_sheets - set(among_glass))[: max(0, 32 - len(among_glass))]


def contacts(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of objects, at least one of them not glass, whose surfaces may touch: some triangle's bounds meet the
    other's bounds, both ways (of glass, which has an inside, one way)."""
    objects = scene.objects
    bounds = [world_bounds(item) for item in objects]
    chosen = np.array([b for b, o in zip(bounds, objects, strict=True) if o.material.is_specular] or bounds)
    if not len(chosen):
        return []
    slack = 0.5 * _SLACK * float(np.linalg.norm(chosen[:, 1].max(axis=0) - chosen[:, 0].min(axis=0)))

    def reaches(i: int, j: int) -> bool:
        if objects[i].material.transmits:
            return True
        corners = objects[i].mesh.transformed(objects[i].object_to_world).corners()
        return bool(_meet((corners.min(axis=1), corners.max(axis=1)), bounds[j], slack).any())

    pairs = []
    for i in range(len(objects)):
        for j in range(i):
            glass = objects[i].material.transmits and objects[j].material.transmits
            if not glass and _meet(bounds[i], bounds[j], slack).all() and reaches(i, j) and reaches(j, i):
                pairs.append((j, i))
    return pairs


def _nested(scene: Scene) -> list[int]:
    indices = [i for i, o in enumerate(scene.objects) if o.material.transmits]
    if len(indices) < 2:
        return []
    bounds = np.stack([world_bounds(scene.objects[i]) for i in indices])
    slack = _SOLID_SLACK * np.ptp(bounds, axis=(0, 1)).max()
    low, high = bounds[:, 0], bounds[:, 1]
    overlap = _meet((low[:, None], high[:, None]), (low[None], high[None]), 2.0 * slack)
    np.fill_diagonal(overlap, False)
    return [indices[i] for i in np.flatnonzero(overlap.any(axis=1))]


def _meet(a: Box, b: Box, slack: float) -> np.ndarray:
    """Whether boxes overlap or are nearer than `slack`."""
    return np.all((a[0] <= b[1] + slack) & (b[0] <= a[1] + slack), axis=-1)
