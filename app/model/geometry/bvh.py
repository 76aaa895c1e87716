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
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base import files, paths
from ...base.atomic import atomic_output
from ...base.errors import UserError

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

_CACHE_VERSION = b"spectrasplat bvh 2\n"
_CACHE_FILES = 32
_CACHE_BYTES = 256 << 20
_DIGEST_BYTES = 16


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
    cached = _cache_path(triangles) if use_cache else None
    if cached is not None:
        tree = _load(cached, len(triangles))
        if tree is not None:
            return tree
    tree = _build(triangles)
    if cached is not None:
        _save(cached, tree)
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


def _cache_path(triangles: np.ndarray) -> Path | None:
    """Where the tree of these triangles is kept, or None where there is no cache folder."""
    try:
        folder = paths.cache_dir() / "bvh"
        folder.mkdir(exist_ok=True)
    except OSError:
        return None
    key = hashlib.blake2b(_CACHE_VERSION + bytes((MAX_DEPTH, MAX_LEAF)), digest_size=_DIGEST_BYTES)
    key.update(triangles.data)
    return folder / f"{key.hexdigest()}.bvh"


def _load(path: Path, triangle_count: int) -> Bvh | None:
    """The tree at `path`; None when it is missing, damaged or another version's."""
    try:
        data = files.read_bytes(path, _CACHE_BYTES + 4096)
    except OSError:
        return None
    start = len(_CACHE_VERSION) + _DIGEST_BYTES
    payload = memoryview(data)[start:]
    if data[:start] != _CACHE_VERSION + _digest(payload) or len(payload) < 4 + 4 * triangle_count:
        return None
    depth = int(np.frombuffer(payload[:4], "<u4")[0])
    order = np.frombuffer(payload[4 : 4 + 4 * triangle_count], "<i4")
    with suppress(OSError):
        os.utime(path)  # the cache forgets the least recently used
    return Bvh(np.frombuffer(payload[4 + 4 * triangle_count :], NODE), order, depth)


def _save(path: Path, tree: Bvh) -> None:
    payload = np.uint32(tree.depth).astype("<u4").tobytes() + tree.order.astype("<i4").tobytes() + tree.nodes.tobytes()
    if len(payload) > _CACHE_BYTES:
        return
    with suppress(OSError, UserError):  # an unwritable or full cache only costs time
        with atomic_output(path, lasting=False) as temporary:
            temporary.write_bytes(_CACHE_VERSION + _digest(payload) + payload)
        paths.forget_oldest(path.parent, ".bvh", files=_CACHE_FILES, size=_CACHE_BYTES)


def _digest(payload: bytes | memoryview) -> bytes:
    return hashlib.blake2b(payload, digest_size=_DIGEST_BYTES).digest()
