"""The tree of boxes that lets a ray skip most triangles, laid out for a GPU's short stack.

Finished trees are cached on disk, so a scene seen before needs neither the build nor the import of numba.

Traversal in brief: test a node's two children `left` and `left + 1` together, go on with the
nearer, push the farther. Every level pushes at most one, so `MAX_DEPTH` entries suffice. The
root may itself be a leaf (at most `MAX_LEAF` triangles in all). Bounds are the exact minimum
and maximum of float32 corners: multiply the far slab distance by 1 + 2·gamma(3) = 1 + 3.6e-7
(Ize 2013, "Robust BVH Ray Traversal") and compare with <=, so that flat boxes are hit.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from ...base.errors import UserError
from ...base.kept_files import KeptFiles

MAX_DEPTH = 24
"""No leaf lies deeper than this many edges below the root."""
MAX_LEAF = 4
"""No leaf holds more triangles."""
MAX_TRIANGLES = min(MAX_LEAF << MAX_DEPTH, 2**30)

NODE = np.dtype(
    [
        ("bounds_min", "<f4", 3),
        ("left_or_first", "<u4"),
        ("bounds_max", "<f4", 3),
        ("count", "<u4"),
    ]
)
"""32 bytes, std430-compatible. count > 0: a leaf with the triangles [first, first + count) of the
reordered list; count = 0: an inner node with children at left and left + 1."""

_LAYOUT = b"spectrasplat bvh 3\n"
_KEPT = KeptFiles("bvh", 256 << 20, most_files=32, most_bytes=256 << 20, level=0)


@dataclass(frozen=True)
class Bvh:
    """A tree over triangles; `nodes[0]` is the root."""

    nodes: np.ndarray
    """NODE (N,), N odd and at most 2T - 1; an inner node's left subtree comes first."""
    order: np.ndarray
    """int32 (T,): the reordered list's triangle i is triangle order[i] of the input."""
    depth: int
    """Edges from the root to the deepest leaf, at most MAX_DEPTH: the stack a traversal needs."""


def build_bvh(triangles_xyz: np.ndarray, *, use_cache: bool = True) -> Bvh:
    """Tree over float32 `triangles_xyz` (T, 3, 3), T >= 1; the same input gives the same tree.

    Any shape is allowed, slivers and copies of one triangle included. Raises ValueError for a
    wrong shape, no triangles or corners that are not finite, and `UserError` beyond
    MAX_TRIANGLES or without numba. A cache that cannot be read or written is ignored.
    """
    triangles = np.ascontiguousarray(triangles_xyz, dtype=np.float32)
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3) or len(triangles) == 0:
        raise ValueError(f"triangles_xyz must be (T, 3, 3) with T >= 1, got {triangles.shape}")
    if len(triangles) > MAX_TRIANGLES:
        raise UserError(
            f"the scene has {len(triangles)} triangles, more than the {MAX_TRIANGLES} a tree can hold;"
            " simplify its meshes"
        )
    if not np.isfinite(triangles).all():
        raise ValueError("triangles_xyz has corners that are not finite")
    if not use_cache:
        return _build(triangles)
    key = _key(triangles)
    tree = _load(key, len(triangles))
    if tree is None:
        tree = _build(triangles)
        _KEPT.save(key, tree.depth.to_bytes(4, "little") + tree.order.astype("<i4").tobytes() + tree.nodes.tobytes())
    return tree


def _build(triangles: np.ndarray) -> Bvh:
    try:
        from . import bvh_build
    except ImportError as error:
        raise UserError(
            f"building the triangle tree needs numba ({error}); install it with: pip install numba"
        ) from error
    bounds = np.empty((2 * len(triangles) - 1, 6), np.float32)
    links = np.empty((2 * len(triangles) - 1, 2), np.uint32)
    order, node_count, depth = bvh_build.build(triangles, MAX_DEPTH, MAX_LEAF, bounds, links)
    nodes = np.empty(node_count, NODE)
    nodes["bounds_min"] = bounds[:node_count, :3]
    nodes["bounds_max"] = bounds[:node_count, 3:]
    nodes["left_or_first"] = links[:node_count, 0]
    nodes["count"] = links[:node_count, 1]
    return Bvh(nodes, order, int(depth))


def _key(triangles: np.ndarray) -> str:
    """What the tree of these triangles is kept under."""
    key = hashlib.blake2b(_LAYOUT + bytes((MAX_DEPTH, MAX_LEAF)), digest_size=16)
    key.update(triangles.data)
    return key.hexdigest()


def _load(key: str, triangle_count: int) -> Bvh | None:
    """The tree kept under `key`, if any."""
    data = _KEPT.load(key)
    if data is None:
        return None
    depth, order = np.frombuffer(data, "<u4", 1), np.frombuffer(data, "<i4", triangle_count, 4)
    return Bvh(np.frombuffer(data, NODE, offset=4 + order.nbytes), order, int(depth[0]))
