"""Stacks of thin films: what they reflect and let through at each wavelength, angle and polarisation.

By the transfer-matrix method (Abelès 1950; Macleod, Thin-Film Optical Filters, 4th ed., 2010, chapter 2), for waves
that go as exp(−iωt). The vector of fields is carried from the back of the stack to its front and kept of size 1, so
that neither thick metals nor a thousand layers overflow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from ..vectors import Vec3, frozen
from .glass import Dispersion, constant

MAX_LAYERS = 1000
MAX_NM = 100_000.0
MAX_VARIED_NM = 20_000.0
"""The same where the thickness varies: one table holds all of the interference, which is finer the thicker it is."""
_SEEN_NM = 550.0
ABOVE, BELOW = 128, 32
"""Steps of a table over the cosine outside, from 0 to 1, and over what lies beyond total reflection."""
_STEPS_OF_RIPPLE, _MOST_FINER = 4.0, 64
"""How finely tables of thick films are summed up; with many layers less."""
_NORMALISED = 16
"""Layers after which the fields are made 1 again."""
AIR = Dispersion("air", "constant", (1.0,))


class Medium(Protocol):
    """What has a refractive index, real or complex."""

    @property
    def name(self) -> str: ...

    def index(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """At wavelengths, of their shape."""
        ...


@dataclass(frozen=True)
class Layer:
    """One film."""

    medium: Medium
    nm: float
    """Its thickness."""


class Amplitudes(NamedTuple):
    """Amplitudes of reflection and transmission for s and p, complex: |a|² is a share of the power. p turns with the
    ray, so that upright r_p = −r_s."""

    r_s: np.ndarray
    r_p: np.ndarray
    t_s: np.ndarray
    t_p: np.ndarray


def amplitudes(
    indices: Sequence[np.ndarray], thickness_nm: Sequence[float], sine: np.ndarray, nm: np.ndarray
) -> Amplitudes:
    """The amplitudes of a stack; `indices` are those of the medium that light comes from, of the layers, and of what is
    behind, `sine` is the tangential part n sin θ of the direction; all broadcast with the wavelengths `nm`."""
    tangential2 = np.asarray(sine, float) ** 2
    first, last = (_normal_part(index, tangential2) for index in (indices[0], indices[-1]))
    layers = {
        (id(index), thick): _layer(index, _normal_part(index, tangential2), thick, nm)
        for index, thick in zip(indices[1:-1], thickness_nm, strict=True)
    }
    found = []
    for is_p in (False, True):
        # The admittance: n cos θ for s, n / cos θ for p.
        eta_first, eta_last = (index**2 / q if is_p else q for index, q in ((indices[0], first), (indices[-1], last)))
        shape = np.broadcast(eta_first, eta_last, nm).shape
        electric, magnetic, decay = np.ones(shape, complex), eta_last + np.zeros(shape), np.zeros(shape)
        for number, layer in enumerate(zip(indices[-2:0:-1], thickness_nm[::-1], strict=True)):
            cosine, over, times, lost = layers[id(layer[0]), layer[1]][is_p]
            electric, magnetic = cosine * electric + over * magnetic, times * electric + cosine * magnetic
            decay -= lost
            if number % _NORMALISED == _NORMALISED - 1:
                size = np.maximum(np.abs(electric), np.abs(magnetic))
                electric, magnetic, decay = electric / size, magnetic / size, decay - np.log(size)
        whole = eta_first * electric + magnetic
        root = np.sqrt(np.maximum(eta_last.real, 0.0) / np.maximum(eta_first.real, 1e-12))
        r, t = (
            (eta_first * electric - magnetic) / whole,
            2.0 * root * eta_first / whole * np.exp(np.maximum(decay, -300.0)),
        )
        found += [-r if is_p else r, t]
    return Amplitudes(found[0], found[2], found[1], found[3])


def _layer(index: np.ndarray, q: np.ndarray, thick: float, nm: np.ndarray) -> tuple[tuple[np.ndarray, ...], ...]:
    """For s and p: elements of a layer's matrix, cos, −i sin / η and −i η sin, times exp(−x), and x."""
    phase = 2.0 * np.pi * thick * q / nm
    onward = 0.5 * np.exp(np.maximum(-2.0 * phase.imag, -300.0) + 1j * phase.real)
    back = 0.5 * np.exp(-1j * phase.real)
    cosine, sine_i = back + onward, back - onward
    return tuple((cosine, sine_i / eta, sine_i * eta, phase.imag) for eta in (q, index**2 / q))


def _normal_part(index: np.ndarray, tangential2: np.ndarray) -> np.ndarray:
    """n cos θ, of the root that decays or goes onward."""
    q = np.sqrt(np.asarray(index, complex) ** 2 - tangential2)
    return np.where(np.abs(q) < 1e-9, 1e-9, q)


@dataclass(frozen=True)
class Profile:
    """How the thickness of a film of one layer varies from place to place."""

    from_nm: float
    to_nm: float
    along: Vec3 | None
    """Direction, in the object's own coordinates, from one to the other of its ends; None: from the object's origin to
    what is farthest from it, by the square of the distance, as between a lens and a plate."""


@dataclass(frozen=True)
class Film:
    """What lies on a surface, from outside to inside."""

    layers: tuple[Layer, ...]
    """Where the thickness varies, one, as thick as it ever is."""
    share: float | None = None
    """What it reflects at every wavelength and angle, whatever it is made of; None: what its layers do."""
    alone: bool = False
    """What is behind it is what is before it: a soap film."""
    profile: Profile | None = None
    """None: it is even."""

    def of_thickness(self, share: float) -> Film:
        """An even one, of one layer and so much of its thickness."""
        (layer,) = self.layers
        return Film((Layer(layer.medium, share * layer.nm),), alone=self.alone)

    @property
    def absorbs(self) -> bool:
        """Some layer is of metal."""
        return any(not isinstance(layer.medium, Dispersion) for layer in self.layers)


@dataclass(frozen=True)
class Stack:
    """A film between two media."""

    before: Medium
    film: Film
    behind: Medium

    def amplitudes(self, sine: np.ndarray, nm: np.ndarray, from_back: bool = False) -> Amplitudes:
        """For light from outside, or from behind, whose tangential part n sin θ is `sine`, at wavelengths `nm`."""
        if self.film.share is not None:
            r, t = (
                np.full(np.broadcast(sine, nm).shape, x**0.5, complex) for x in (self.film.share, 1.0 - self.film.share)
            )
            return Amplitudes(-r, r, t, t)
        media = [self.before, *(layer.medium for layer in self.film.layers), self.behind]
        known = {medium: np.asarray(medium.index(nm), complex) for medium in media}
        indices = [known[medium] for medium in media]
        order = -1 if from_back else 1
        return amplitudes(indices[::order], [layer.nm for layer in self.film.layers][::order], sine, nm)

    def table(self, nm: np.ndarray, polarised: bool, below: bool) -> np.ndarray:
        """Running integrals over so many even steps of x, float32 (rows, samples), so that a mean over any stretch of
        the spectrum is a difference: what is reflected from outside, reflected from behind, and let through, each for
        BELOW (where asked for) and ABOVE + 1 cosines. Of unpolarised light; or `polarised`, four of each: shares of s
        and of p, real and imaginary part of s times the conjugate of p."""
        if self.film.profile is None:
            return _table(self, nm.tobytes(), polarised, below)
        # Without dispersion all depends on thickness by wavelength alone, which stands for x; but the phase is exact.
        seen = np.array([_SEEN_NM])
        first, (layer,), last = self.before, self.film.layers, self.behind
        even, middle, last = (constant(float(np.real(of.index(seen))[0])) for of in (first, layer.medium, last))
        stack = Stack(even, Film((Layer(middle, layer.nm),), alone=self.film.alone), last)
        waves = np.real(layer.medium.index(nm)) / nm
        at = float(middle.index(seen)[0]) / (waves.max() * np.linspace(1e-9, 1.0, len(nm)))
        return _table(stack, at.tobytes(), polarised, below)

    def waves(self, nm: np.ndarray) -> np.ndarray:
        """Where the thickest place of a film that varies has its place in `table`, in place of x, (1, samples)."""
        waves = np.real(self.film.layers[0].medium.index(nm)) / nm
        return np.asarray(waves / waves.max())[None]


def power(stack: Stack, cosine: float, nm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares of unpolarised light from outside that are reflected and let through, float64 of the shape of `nm`."""
    sine = np.real(stack.before.index(nm)) * (1.0 - cosine**2) ** 0.5
    a = stack.amplitudes(sine, nm)
    return 0.5 * (abs(a.r_s) ** 2 + abs(a.r_p) ** 2), 0.5 * (abs(a.t_s) ** 2 + abs(a.t_p) ** 2)


@lru_cache(maxsize=32)
def _table(stack: Stack, wavelengths: bytes, polarised: bool, below: bool) -> np.ndarray:
    nm = np.frombuffer(wavelengths, np.float64)
    finer = _finer(stack.film, nm)
    if finer > 1:
        nm = np.interp(np.arange(finer * (len(nm) - 1) + 1) / finer, np.arange(len(nm)), nm)
    before2, behind2 = (np.real(medium.index(nm)) ** 2 for medium in (stack.before, stack.behind))
    cosine = np.linspace(0.0, 1.0, ABOVE + 1)[:, None]
    parts = [(1.0 - cosine**2) * before2]
    if below:
        # Until light comes from behind and grazes.
        t = np.linspace(1.0, 0.0, BELOW, endpoint=False)[:, None]
        parts.insert(0, before2 + t * t * np.maximum(behind2 - before2, 0.0))
    sine = np.sqrt(np.concatenate(parts))
    with np.errstate(under="ignore"):
        return _running_means(stack, sine, nm, polarised, finer)


def _finer(film: Film, nm: np.ndarray) -> int:
    """Into how many even steps a table's are divided: four for each ripple of the whole stack."""
    way = 2.0 * sum(float(np.real(layer.medium.index(nm)).max()) * layer.nm for layer in film.layers)
    wanted = np.ceil(_STEPS_OF_RIPPLE * way * np.abs(np.diff(1.0 / nm)).max())
    return int(np.clip(wanted, 1, max(1, _MOST_FINER // max(1, len(film.layers)))))


def _running_means(stack: Stack, sine: np.ndarray, nm: np.ndarray, polarised: bool, finer: int) -> np.ndarray:
    """`Stack.table` at `sine`, (angles, samples), of which every one in so many is kept."""
    front = stack.amplitudes(sine, nm)
    # What absorbs nothing reflects as much from behind.
    back = stack.amplitudes(sine, nm, from_back=True) if polarised or stack.film.absorbs else front
    found = []
    passes = sine <= np.real(stack.before.index(nm)) * (1.0 + 1e-12)
    passed = np.where(passes, front.t_s, 0.0), np.where(passes, front.t_p, 0.0)
    for s, p in (front[:2], back[:2], passed):
        mean = 0.5 * (abs(s) ** 2 + abs(p) ** 2)
        found += [abs(s) ** 2, abs(p) ** 2, (s * p.conj()).real, (s * p.conj()).imag] if polarised else [mean]
    values = np.concatenate(found)
    sums = np.cumsum(0.5 * (values[:, 1:] + values[:, :-1]), axis=1) / (len(nm) - 1)
    return frozen(np.pad(sums[:, finer - 1 :: finer], ((0, 0), (1, 0))).astype(np.float32))
