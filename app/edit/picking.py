"""What is under a point of the picture, found at once on the processor: the scene's own triangles in float64.

A mesh has its triangles in blocks of neighbours with boxes about them, made at its first ray and kept as long as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..model.geometry.mesh import Mesh, cross
from ..model.scene import Scene, Vec3
from ..model.vectors import vec3
from .drawn import Drawn
from .projection import View
from .state import State

_BLOCK, _SLACK = 64, 1e-9
"""Triangles of a block; barycentric overlap of triangles that share an edge."""
_CONTACT = 1e-5
"""Share of the distance within which what is no glass (paint, silver) is met before the glass that it touches."""
_SPREAD = ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249))
"""Shifts and masks that put two zeros between the bits of a 10-bit number."""


@dataclass(frozen=True)
class PickHit:
    """A surface under the cursor."""

    object_index: int
    position: Vec3
    """World."""
    normal: Vec3
    """Unit, geometric, towards where the ray came from."""
    distance: float
    """From the ray's start, scene units."""
    is_receiver: bool


class _Blocks(NamedTuple):
    order: np.ndarray
    """int (T,): triangles of the mesh, block by block along a Morton curve."""
    low: np.ndarray
    """float64 (B, 3)."""
    high: np.ndarray


_BLOCKS: WeakKeyDictionary[Mesh, _Blocks] = WeakKeyDictionary()


def pick_in(state: State, x: float, y: float) -> PickHit | None:
    """The first surface at (x, y), 0..1 from the picture's top left, of the scene as `state` wants it drawn; None where
    there is nothing but background. Its object is one of `state.scene`."""
    view = state.view
    return pick(Drawn().staged(state).scene, view, x, y, state.hidden)


def pick(
    scene: Scene, view: View, x: float, y: float, hidden: frozenset[tuple[str, str]] = frozenset()
) -> PickHit | None:
    """The first surface of `scene` at (x, y) of `view`'s picture; glass is opaque to it. `hidden`: what is left
    out, unless nothing else is there."""
    objects = [i for i, item in enumerate(scene.objects) if ("object", item.name) not in hidden]
    objects = objects or list(range(len(scene.objects)))
    if not objects:
        return None
    origin, direction = view.ray(x, y)
    inverse = np.linalg.inv(np.stack([scene.objects[i].object_to_world for i in objects]))
    starts, ways = inverse[:, :3, :3] @ origin + inverse[:, :3, 3], inverse[:, :3, :3] @ direction
    blocks = [_blocks_of(scene.objects[i].mesh) for i in objects]
    low, high = np.stack([b.low.min(axis=0) for b in blocks]), np.stack([b.high.max(axis=0) for b in blocks])
    enters = _enters(low, high, starts, ways)
    best_key, best, index, triangle = np.inf, np.inf, -1, -1
    for k in np.argsort(enters):
        if enters[k] > best * (1.0 + _CONTACT):
            break
        item = scene.objects[objects[k]]
        distance, nearest = _nearest(item.mesh, blocks[k], starts[k], ways[k])
        key = distance if item.material.transmits else distance * (1.0 - _CONTACT)
        if key < best_key:
            best_key, best, index, triangle = key, distance, objects[k], nearest
    if index < 0:
        return None
    item = scene.objects[index]
    a, b, c = item.mesh.vertices[item.mesh.triangles[triangle]] @ item.object_to_world[:3, :3].T
    normal = np.cross(b - a, c - a)
    normal *= -np.sign(normal @ direction) / np.linalg.norm(normal)
    return PickHit(index, vec3(origin + best * direction), vec3(normal), float(best), item.material.receives)


def _enters(low: np.ndarray, high: np.ndarray, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Distances at which a ray, or one a box, enters boxes (n, 3); infinity where it misses one."""
    inverse = 1.0 / np.where(np.abs(way) < 1e-200, 1e-200, way)
    a, b = (low - start) * inverse, (high - start) * inverse
    first, last = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    slack = _SLACK * (np.abs(first) + np.abs(last))
    return np.where((first <= last + slack) & (last >= 0.0), np.maximum(first - slack, 0.0), np.inf)


def _nearest(mesh: Mesh, blocks: _Blocks, start: np.ndarray, way: np.ndarray) -> tuple[float, int]:
    """(distance, triangle) of the first triangle ahead; infinity where there is none (Möller and Trumbore 1997)."""
    met = np.flatnonzero(np.isfinite(_enters(blocks.low, blocks.high, start, way)))
    near = (met[:, None] * _BLOCK + np.arange(_BLOCK)).ravel()
    chosen = blocks.order[near[near < len(blocks.order)]]
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles[chosen]], 1, 0)
    first, second, from_a = b - a, c - a, start - a
    p, q = cross(np.broadcast_to(way, second.shape), second), cross(from_a, first)
    determinant = (first * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (from_a * p).sum(axis=1) / determinant, q @ way / determinant
        distance = (second * q).sum(axis=1) / determinant
        inside = (u >= -_SLACK) & (v >= -_SLACK) & (u + v <= 1.0 + _SLACK) & (distance > 0.0)
    distance = np.where(inside, distance, np.inf)
    best = int(distance.argmin()) if len(distance) else -1
    return (float(distance[best]), int(chosen[best])) if best >= 0 else (np.inf, -1)


def _blocks_of(mesh: Mesh) -> _Blocks:
    if (known := _BLOCKS.get(mesh)) is not None:
        return known
    corners = mesh.corners()
    low, high = corners.min(axis=1), corners.max(axis=1)
    middle = low + high - (low + high).min(axis=0)
    cells = (middle / np.maximum(middle.max(axis=0), 1e-300) * 1023.0).astype(np.uint32)
    for shift, mask in _SPREAD:
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    order = np.argsort(cells @ np.array([1, 2, 4], np.uint32))
    starts = np.arange(0, len(order), _BLOCK)
    low, high = np.minimum.reduceat(low[order], starts), np.maximum.reduceat(high[order], starts)
    _BLOCKS[mesh] = made = _Blocks(order, low, high)
    return made
