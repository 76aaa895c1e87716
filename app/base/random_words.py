"""Where the random numbers of a rendering begin: every shift and key of the light pass, by seed, light, pass and
dimension.

A lattice looks the same after a step by one of its own vectors, so shifts that follow from the seed by a product may be
all but such steps, and other seeds then give nearly the same picture again. Hence a hash: any two seeds are two
independent random shifts [Cranley and Patterson 1976]. Passes of one seed are no repeats but parts of one whole: their
shifts follow a Kronecker sequence from the hashed start, so their union is again even.

The camera's numbers begin in the shaders, at a hash of seed and pixel. Pilots have neither shift nor seed: what they
decide must not differ from seed to seed.
"""

from __future__ import annotations

from enum import IntEnum

_WORD = (1 << 32) - 1
_LONG = (1 << 64) - 1
_GOLDEN_64 = 0x9E3779B97F4A7C15


class Dimension(IntEnum):
    """What a word is for."""

    LATTICE_U = 0
    """Emission lattice, along the step from point to point."""
    LATTICE_V = 1
    """Emission lattice, across it."""
    LIGHT_U = 2
    """Place on an extended light."""
    LIGHT_V = 3
    SPECTRAL = 4
    """Wavelength within a band."""
    BRANCH = 5
    """Key of roulette's draws."""


PASS_GENERATORS = {
    Dimension.LATTICE_U: 1116352409,
    Dimension.LATTICE_V: 1899447441,
    Dimension.LIGHT_U: 3141592653,
    Dimension.LIGHT_V: 1640531527,
    Dimension.SPECTRAL: 1359893119,
}
"""Step of each shift from pass to pass, in 2⁻³²."""


def shift(seed: int, light: int, number: int, dimension: Dimension) -> int:
    """Shift of pass `number`, in 2⁻³²: random from seed to seed, light to light and dimension to dimension, even over
    passes."""
    return (random_word(seed, light, 0, dimension) + number * PASS_GENERATORS[dimension]) & _WORD


def random_word(seed: int, light: int, number: int, dimension: int) -> int:
    """32 bits, independent of those of any other four numbers: each is added to SplitMix64's state before a step of it
    [Steele, Lea and Flood 2014], whose output is the next state."""
    state = 0
    for word in (seed, light, number, dimension):
        state = _mixed((state + word + _GOLDEN_64) & _LONG)
    return state >> 32


def _mixed(state: int) -> int:
    """SplitMix64's output function, a bijection ("Mix13" of Stafford 2011)."""
    state = (state ^ state >> 30) * 0xBF58476D1CE4E5B9 & _LONG
    state = (state ^ state >> 27) * 0x94D049BB133111EB & _LONG
    return state ^ state >> 31
