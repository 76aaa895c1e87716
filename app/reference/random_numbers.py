"""The shaders' random numbers in numpy, bit for bit: the output of PCG-RXS-M-XS (O'Neill 2014) used as a
hash (Jarzynski and Olano 2020), and Kronecker sequences in 32-bit integers.

All arguments are integers or integer arrays that broadcast; results are uint32 arrays, or float64 in [0, 1).
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
_MASK = np.uint64(0xFFFFFFFF)


def hash_pcg(value: Array | int) -> Array:
    """One step of PCG's generator from the state `value`, and its output permutation."""
    state = (_wide(value) * np.uint64(747796405) + np.uint64(2891336453)) & _MASK
    word = ((state >> ((state >> np.uint64(28)) + np.uint64(4))) ^ state) * np.uint64(277803737) & _MASK
    return ((word >> np.uint64(22)) ^ word).astype(np.uint32)


def hash_combine(a: Array | int, b: Array | int) -> Array:
    """A hash of two words in which their order counts."""
    mixed = (hash_pcg(b).astype(np.uint64) + np.uint64(0x9E3779B9)) & _MASK
    return hash_pcg(_wide(a) ^ mixed)


def unit_float(bits: Array | int) -> Array:
    """The upper 24 bits as a number in [0, 1)."""
    return (_wide(bits) >> np.uint64(8)).astype(np.float64) / 2.0**24


def kronecker(i: Array | int, generator: Array | int, shift: Array | int) -> Array:
    """Fraction of i·α + shift with α = generator / 2³²."""
    return unit_float((_wide(i) * _wide(generator) + _wide(shift)) & _MASK)


def _wide(value: Array | int) -> Array:
    return np.asarray(value).astype(np.uint64) & _MASK
