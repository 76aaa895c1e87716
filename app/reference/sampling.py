"""Random numbers of the references: a scrambled Sobol sequence, and a hash where its dimensions are used up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .compiling import compiled, inlined
from .crystals import FIELD_SHAPE
from .photon_intersect import STACK_SIZE

DIMENSIONS = 10


class Sequence(NamedTuple):
    """One random scrambling of the Sobol sequence."""

    directions: np.ndarray
    """uint32 (DIMENSIONS, 32): direction numbers."""
    shift: np.ndarray
    """uint32 (DIMENSIONS,): digital shift."""
    key: np.uint64
    """Key of the hash that follows."""


# Primitive polynomials (degree, coefficients) and initial numbers of dimensions 2 to 10: Joe and Kuo 2008.
_JOE_KUO = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
)


def sobol_directions() -> np.ndarray:
    """Direction numbers, uint32 (DIMENSIONS, 32), highest bit first."""
    rows = [[1 << (31 - i) for i in range(32)]]
    for degree, coefficients, initial in _JOE_KUO:
        v = [m << (31 - i) for i, m in enumerate(initial)]
        for i in range(degree, 32):
            value = v[i - degree] ^ (v[i - degree] >> degree)
            for k in range(1, degree):
                if (coefficients >> (degree - 1 - k)) & 1:
                    value ^= v[i - k]
            v.append(value)
        rows.append(v)
    return np.array(rows, np.uint32)


def scrambled(seed: int, *stream: int) -> Sequence:
    """A random linear scrambling with a digital shift (Matoušek 1998): every point uniform, the net kept."""
    rng = np.random.default_rng([seed, *stream])
    plain = sobol_directions()
    bits = ((plain[:, :, None] >> np.arange(31, -1, -1, dtype=np.uint32)) & 1).astype(np.int64)
    mixed = np.empty_like(bits)
    for dimension in range(DIMENSIONS):
        lower = np.tril(rng.integers(0, 2, (32, 32)), -1) + np.eye(32, dtype=np.int64)
        mixed[dimension] = bits[dimension] @ lower.T & 1
    weights = np.uint64(1) << np.arange(31, -1, -1, dtype=np.uint64)
    directions = (mixed.astype(np.uint64) * weights).sum(axis=2).astype(np.uint32)
    shift = rng.integers(0, 2**32, DIMENSIONS, dtype=np.uint32)
    return Sequence(directions, shift, np.uint64(rng.integers(0, 2**64, dtype=np.uint64)))


class Scratch(NamedTuple):
    """Working memory of one thread."""

    stack: np.ndarray
    """int64 (STACK_SIZE,)."""
    stack_distance: np.ndarray
    """float64 (STACK_SIZE,)."""
    beginning: np.ndarray
    state: np.ndarray
    shift: np.ndarray
    """uint32 (DIMENSIONS,): a first point of the sequence, the present one, and what is added to it (all zero at
    first)."""
    xyz: np.ndarray
    """float64 (3,)."""
    field: np.ndarray
    """complex128 `crystals.FIELD_SHAPE`: a path's electric fields (`polarised`), and what crystals need."""


def scratch() -> Scratch:
    """Fresh working memory."""
    beginning, state, shift = np.zeros((3, DIMENSIONS), np.uint32)
    return Scratch(
        np.zeros(STACK_SIZE, np.int64),
        np.zeros(STACK_SIZE),
        beginning,
        state,
        shift,
        np.zeros(3),
        np.zeros(FIELD_SHAPE, complex),
    )


@compiled
def mixed(value):
    """A 64-bit hash (splitmix64, Steele et al. 2014)."""
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@compiled
def unit(word):
    """A word as a number in (0, 1)."""
    return (float(word) + 0.5) * 2.0**-32


@compiled
def word_number(word):
    """A 64-bit word, hashed, as a number in [0, 1)."""
    return float(mixed(word) >> np.uint64(11)) * 2.0**-53


@inlined
def sobol_start(sequence, index, state):
    """Set `state` (DIMENSIONS,) to point `index` of the scrambled sequence."""
    code = index ^ (index >> 1)
    for d in range(DIMENSIONS):
        state[d] = sequence.shift[d]
        for k in range(32):
            if (code >> k) & 1:
                state[d] ^= sequence.directions[d, k]


@inlined
def sobol_next(sequence, index, state):
    """From point index − 1 to point `index` (> 0): the Gray code changes one bit."""
    k = 0
    while not (index >> k) & 1:
        k += 1
    for d in range(DIMENSIONS):
        state[d] ^= sequence.directions[d, k]


FIRST_CHOICE = 5
"""Dimension of the first Fresnel choice; below it are place, wavelength and place on a light."""


@inlined
def choice(state, shift, dimension, noise, turn):
    """Uniform number of a Fresnel choice: of the sequence while it has dimensions, then word `turn` of a hash."""
    if dimension < DIMENSIONS:
        return unit(state[dimension] ^ shift[dimension])
    return word_number(noise + np.uint64(turn) * np.uint64(0x9E3779B97F4A7C15))
