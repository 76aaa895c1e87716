"""The order in which a batch's lattice points are emitted: along a Morton curve over the domain.

Neighbours of a Kronecker lattice by number are far apart in space. Rays of one work group that start side by side meet
the same nodes and triangles and take the same branches, which spares a software renderer, which runs eight rays in
step, and a GPU's caches. Shifting the lattice only turns the torus it lies on, so one order serves every pass and every
shift; what a photon is does not depend on it, only its place in the buffer."""

from __future__ import annotations

import math

import numpy as np

GOLDEN = 2654435769
"""2^32 / golden ratio: the lattice's second coordinate (shaders/lib/lattice.glsl)."""
_BITS = 12
"""Bits of each coordinate: 4096² cells are more than a batch has points."""
_LEAST_BLOCK, _MOST_BLOCK = 1 << 7, 1 << 12


def morton_order(points: int, stride: int, lattice_count: int) -> np.ndarray:
    """Permutation uint32 (points,) of 0..points-1: j-th emitted is lattice point `first` + stride · order[j]."""
    index = np.arange(points, dtype=np.uint64) * np.uint64(stride)
    along = (index % np.uint64(lattice_count)) * np.uint64(1 << _BITS) // np.uint64(lattice_count)
    across = (index * np.uint64(GOLDEN) & np.uint64(0xFFFFFFFF)) >> np.uint64(32 - _BITS)
    key = _spread(along.astype(np.uint32)) | _spread(across.astype(np.uint32)) << np.uint32(1)
    return np.argsort(key, kind="stable").astype(np.uint32)


def block_of(points: int) -> int:
    """How many points that follow each other are put in order together: those of a work group then lie in a patch as
    wide as it is high."""
    return min(max(1 << round(0.5 * math.log2(32 * points)), _LEAST_BLOCK), _MOST_BLOCK)


def block_orders(stride: int) -> np.ndarray:
    """`morton_order` within blocks of every size, uint32; that of `block` points begins at its number. A block is a
    narrow strip of the lattice, so its points are ordered along it alone."""
    sizes = [1 << k for k in range(_LEAST_BLOCK.bit_length() - 1, _MOST_BLOCK.bit_length())]
    return np.concatenate([np.zeros(sizes[0], np.uint32), *(morton_order(size, stride, 1 << 32) for size in sizes)])


def _spread(value: np.ndarray) -> np.ndarray:
    """Bits of `value` (uint32, at most 16 of them) moved to the even places."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        value = (value | value << np.uint32(shift)) & np.uint32(mask)
    return value
