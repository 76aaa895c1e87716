"""Which surfaces may touch, by their bounds: only scenes that have such pay for looking at contacts, ray by ray."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .scene import Scene, SceneObject

Box = np.ndarray | Sequence[np.ndarray]
"""Low and high corner (..., 3)."""
_SLACK = 1e-4
"""Share of the specular objects' half diagonal: above what the shaders take for contact (`NEAR_DISTANCE` of
shaders/lib/intersect.glsl)."""
_SOLID_SLACK = 1e-5
"""The same between two solids, as a share of the glass's longest side."""
_STANDING_SLACK = 1e-2
"""Gap up to which one object stands on another, as a share of its longest side. Shipped scenes keep a thousandth
between a glass and its table."""
_PAIRS_AT_ONCE = 1 << 20


def overlapping_solids(scene: Scene) -> list[int]:
    """Indices of dielectric objects whose bounds overlap or touch those of another one, or that may touch a surface
    that is not glass: a ray keeps a bit for each, up to 32 of them, those among glass first."""
    among_glass = _nested(scene)
    on_sheets = {i for pair in contacts(scene) for i in pair if scene.objects[i].material.is_solid}
    return among_glass + sorted(on_sheets - set(among_glass))[: max(0, 32 - len(among_glass))]


def contacts(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of objects, at least one of them not glass, whose surfaces may touch: some triangle's bounds meet the
    other's bounds, both ways (of glass, which has an inside, one way). Faces of one object (`flat_faces`) are none."""
    objects = scene.objects
    if not objects:
        return []
    bounds = np.stack([item.world_bounds for item in objects])
    specular = np.array([item.material.is_specular for item in objects])
    chosen = bounds[specular] if specular.any() else bounds
    slack = 0.5 * _SLACK * float(np.linalg.norm(chosen[:, 1].max(axis=0) - chosen[:, 0].min(axis=0)))
    glass = np.array([item.material.is_solid for item in objects])

    def reaches(i: int, j: int) -> bool:
        if glass[i]:
            return True
        corners = objects[i].mesh.transformed(objects[i].object_to_world).corners()
        return bool(_meet((corners.min(axis=1), corners.max(axis=1)), bounds[j], slack).any())

    return sorted(
        (int(i), int(j))
        for pairs in _meeting(bounds, slack)
        for i, j in pairs[~glass[pairs].all(axis=1)]
        if not _are_faces(objects[i], objects[j]) and reaches(i, j) and reaches(j, i)
    )


def _are_faces(a: SceneObject, b: SceneObject) -> bool:
    """Whether both are faces of one object."""
    whole = a.mesh.whole
    return whole is not None and whole is b.mesh.whole and a.object_to_world is b.object_to_world


def standing(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of a diffuse object and another one that stands on it, or is sunk into it, by their bounds."""
    receivers = [i for i, item in enumerate(scene.objects) if item.material.receives]
    if not receivers:
        return []
    bounds = np.stack([item.world_bounds for item in scene.objects], axis=1)
    slack = _STANDING_SLACK * np.ptp(bounds, axis=0).max(axis=1, keepdims=True)
    return [(i, int(j)) for i in receivers for j in np.flatnonzero(_meet(bounds[:, i], bounds, slack)) if i != j]


def nested_pairs(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of dielectric objects whose bounds overlap or touch."""
    indices = [i for i, o in enumerate(scene.objects) if o.material.is_solid]
    return [(indices[i], indices[j]) for pairs in _meeting_solids(scene, indices) for i, j in pairs.tolist()]


def _nested(scene: Scene) -> list[int]:
    indices = [i for i, o in enumerate(scene.objects) if o.material.is_solid]
    found = np.zeros(len(indices), bool)
    for pairs in _meeting_solids(scene, indices):
        found[pairs] = True
    return [indices[i] for i in np.flatnonzero(found)]


def _meeting_solids(scene: Scene, indices: list[int]) -> Iterator[np.ndarray]:
    """Pairs (P, 2) among `indices`."""
    if len(indices) < 2:
        return
    bounds = np.stack([scene.objects[i].world_bounds for i in indices])
    slack = _SOLID_SLACK * np.ptp(bounds, axis=(0, 1)).max()
    yield from _meeting(bounds, 2.0 * slack)


def _meeting(bounds: np.ndarray, slack: float) -> Iterator[np.ndarray]:
    """Pairs i < j (P, 2) of boxes (N, 2, 3) that overlap or are nearer than `slack`, a part at a time: swept along the
    axis over which they are spread the most."""
    axis = int(np.argmax(np.ptp(bounds[:, 0], axis=0)))
    order = np.argsort(bounds[:, 0, axis], kind="stable")
    low, high = bounds[order, 0], bounds[order, 1]
    ends = np.searchsorted(low[:, axis], high[:, axis] + slack, side="right")
    later = np.maximum(ends - np.arange(1, len(order) + 1), 0)
    first = 0
    while first < len(order):
        last = max(first + 1, int(np.searchsorted(np.cumsum(later[first:]), _PAIRS_AT_ONCE, side="right")) + first)
        count = later[first:last]
        a = np.repeat(np.arange(first, last), count)
        b = a + 1 + np.arange(len(a)) - np.repeat(np.cumsum(count) - count, count)
        meet = _meet((low[a], high[a]), (low[b], high[b]), slack)
        yield np.sort(np.column_stack([order[a[meet]], order[b[meet]]]), axis=1)
        first = last


def _meet(a: Box, b: Box, slack: float) -> np.ndarray:
    """Whether boxes overlap or are nearer than `slack`."""
    return np.all((a[0] <= b[1] + slack) & (b[0] <= a[1] + slack), axis=-1)
