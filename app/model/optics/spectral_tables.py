"""The spectral coordinate x in [0, 1] that the shaders work in, and the tables over it.

A photon's path is nearly linear in the refractive index, not in wavelength (physics: about
40 times smaller error for N-BK7). So wavelengths are spread along x in proportion to how much
the indices change: x(λ) is the summed variation of all dispersive indices from 380 nm to λ.
With one dispersive glass x is affine in its n, and "linear in x" is "linear in n" exactly.
x grows with λ. With no dispersive glass it is linear in λ.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from ..vectors import frozen
from .colorimetry import K_M, VISIBLE_NM, cmf_xyz
from .glass import Dispersion
from .spectrum import Spectrum

_LO_NM, _HI_NM = float(VISIBLE_NM[0]), float(VISIBLE_NM[-1])
_FINE_NM = np.linspace(_LO_NM, _HI_NM, 4001)
CELL_EDGES_NM = np.concatenate([[_LO_NM], VISIBLE_NM[:-1] + 0.5, [_HI_NM]])
"""Ends of the nanometre cells of a spectrum, (402,)."""

FILL = 1e-6
"""Least share of x given to plain wavelength where no index changes (outside the fits' ranges). More is given where
more is seen of the light there: tables of so many samples over x have to tell its power, and float32 its
wavelengths."""
MOST_FILL = 0.25
"""What is left is for the indices: of a glass whose index takes one step, bands have to divide that."""


_MAX_STEPS = 60
_FEW = 64
_FIRST_LINE_X = 1e-12


@dataclass(frozen=True)
class SpectralAxis:
    """A strictly increasing map between wavelength (380–780 nm) and x (0–1)."""

    glasses: tuple[Dispersion, ...]
    """The dispersive ones, each once."""
    turning_nm: tuple[np.ndarray, ...]
    """Per glass: 380, wavelengths where n turns, 780; n is monotone in between."""
    total: float
    """Summed variation over 380–780 nm (nm where there is no dispersion)."""
    fill: float
    """x given to λ itself: 0, or where otherwise x would stand still at least `FILL`, or 1."""
    affine_in_n: bool
    """Whether x = a + b n exactly, for the one dispersive glass there is."""

    @classmethod
    def build(cls, dispersions: Sequence[Dispersion]) -> SpectralAxis:
        """The axis for all materials of a scene; non-dispersive and repeated ones do not count."""
        seen = {(d.kind, d.coefficients, d.range_nm, d.gain): d for d in dispersions if d.is_dispersive}
        return _axis_of(tuple(seen.values()))

    @cached_property
    def cell_edges_x(self) -> np.ndarray:
        """x of the ends of the cells λ ± ½ nm, (402,), read-only: every spectrum of a scene uses them."""
        return frozen(self.x_of_nm(CELL_EDGES_NM))

    def x_of_nm(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """x of wavelengths (clamped to 380–780 nm), float64, same shape."""
        wavelength = np.clip(np.asarray(wavelength_nm, dtype=np.float64), _LO_NM, _HI_NM)
        linear = (wavelength - _LO_NM) / (_HI_NM - _LO_NM)
        if not self.glasses:
            return linear
        ends = zip(self.glasses, self.turning_nm, self._turning_index, strict=True)
        path = sum(_variation(*of_glass, wavelength) for of_glass in ends)
        share = path / self.total
        return np.clip(share + self.fill * (linear - share), 0.0, 1.0)

    def nm_of_x(self, x: np.ndarray | float) -> np.ndarray:
        """Wavelength of x (clamped to 0–1): the inverse of `x_of_nm` to 1e-9 nm, or to rounding
        of n where x hardly moves (`FILL`: 1e-7 nm)."""
        target = np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)
        if not self.glasses:
            return _LO_NM + target * (_HI_NM - _LO_NM)
        key = target.tobytes()
        if key in self._inverted:
            return self._inverted[key].reshape(target.shape)
        fine_x = self._fine_x
        i = np.clip(np.searchsorted(fine_x, target, side="right") - 1, 0, len(fine_x) - 2)
        lo, hi = _FINE_NM[i], _FINE_NM[i + 1]
        wavelength = np.interp(target, fine_x, _FINE_NM)
        for _ in range(_MAX_STEPS):  # Newton inside a bracket; bisection where a step leaves it
            excess = self.x_of_nm(wavelength) - target
            lo, hi = np.where(excess < 0.0, wavelength, lo), np.where(excess > 0.0, wavelength, hi)
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = wavelength - excess / self._slope(wavelength)
            inside = (newton >= lo) & (newton <= hi)
            following = np.where(excess == 0.0, wavelength, np.where(inside, newton, 0.5 * (lo + hi)))
            moved = float(np.max(np.abs(following - wavelength), initial=0.0))
            wavelength = following
            if moved < 1e-11:
                break
        if target.size <= _FEW:  # ends of bands, which every edit asks for
            if len(self._inverted) > _FEW:
                self._inverted.clear()
            self._inverted[key] = np.array(wavelength)
        return wavelength

    def x_of_lines(self, line_nm: np.ndarray) -> np.ndarray:
        """x of emission lines, (n,): that of one at 380 nm lies inside (0, 1] too, or no band would hold it."""
        return np.maximum(self.x_of_nm(line_nm), _FIRST_LINE_X)

    def nm_of_samples(self, count: int) -> np.ndarray:
        """Wavelengths of `count` equally spaced x from 0 to 1, float64 (count,); kept, so not to be written to."""
        if count not in self._sampled:
            self._sampled[count] = frozen(self.nm_of_x(np.linspace(0.0, 1.0, count)))
        return self._sampled[count]

    @cached_property
    def _turning_index(self) -> list[list[np.ndarray]]:
        """n of each glass where it turns."""
        return [[glass.index(nm) for nm in turns] for glass, turns in zip(self.glasses, self.turning_nm, strict=True)]

    @cached_property
    def _fine_x(self) -> np.ndarray:
        return self.x_of_nm(_FINE_NM)

    @cached_property
    def _inverted(self) -> dict[bytes, np.ndarray]:
        """Wavelengths that were asked for, by the bytes of x."""
        return {}

    @cached_property
    def _sampled(self) -> dict[int, np.ndarray]:
        return {}

    def _slope(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """dx/dλ, per nm."""
        speed = sum(np.abs(glass.derivative(wavelength_nm)) for glass in self.glasses) * 1e-3
        return self.fill / (_HI_NM - _LO_NM) + (1.0 - self.fill) * speed / self.total


@lru_cache(maxsize=16)
def _axis_of(glasses: tuple[Dispersion, ...]) -> SpectralAxis:
    """Kept, as every edit of a glass needs it several times."""
    if not glasses:
        return SpectralAxis((), (), _HI_NM - _LO_NM, 1.0, False)
    turning = tuple(_turning_points(glass.natural) for glass in glasses)
    still = np.logical_and.reduce([_fine_slope(glass.natural) == 0.0 for glass in glasses])
    stands_still = bool(still.any()) or any(len(t) > 2 for t in turning)
    total = sum(_whole_variation(glass) for glass in glasses)
    monotone = len(glasses) == 1 and not stands_still
    fill = 0.0
    if stands_still:
        seen = np.interp(_FINE_NM, VISIBLE_NM, cmf_xyz().sum(axis=1))
        fill = min(max(FILL, float(seen[still].sum() / seen.sum())), MOST_FILL)
    return SpectralAxis(glasses, turning, total, fill, monotone)


@lru_cache(maxsize=16)
def _turning_points(glass: Dispersion) -> np.ndarray:
    """380, the wavelengths where n(λ) turns (bisected to rounding), 780."""
    sign = np.sign(_fine_slope(glass))
    moving = np.flatnonzero(sign)
    turns = []
    turned = np.flatnonzero(sign[moving[:-1]] != sign[moving[1:]])
    for left, right in zip(moving[turned], moving[turned + 1], strict=True):
        lo, hi = _FINE_NM[left], _FINE_NM[right]
        for _ in range(50):
            middle = 0.5 * (lo + hi)
            same = np.sign(glass.derivative(middle)) == sign[left]
            lo, hi = (middle, hi) if same else (lo, middle)
        turns.append(hi)
    return np.array([_LO_NM, *turns, _HI_NM])


@lru_cache(maxsize=16)
def _fine_slope(glass: Dispersion) -> np.ndarray:
    return glass.derivative(_FINE_NM)


@lru_cache(maxsize=16)
def _whole_variation(glass: Dispersion) -> float:
    turning = _turning_points(glass.natural)
    return float(_variation(glass, turning, [glass.index(nm) for nm in turning], np.array(_HI_NM)))


def _variation(
    glass: Dispersion, turning_nm: np.ndarray, turning_index: Sequence[np.ndarray], wavelength_nm: np.ndarray
) -> np.ndarray:
    """Total variation of n between 380 nm and each wavelength: exact, no quadrature. `turning_index`: n where it
    turns."""
    total = np.zeros_like(wavelength_nm)
    for (start, end), n in zip(itertools.pairwise(turning_nm), turning_index, strict=False):
        total = total + np.abs(glass.index(np.clip(wavelength_nm, start, end)) - n)
    return total


class CumulativeSpectrum(NamedTuple):
    """Integrals of a spectrum from x = 0 on: a polyline, with a step at each emission line."""

    x: np.ndarray
    """float64 (n,), ascending from 0 to 1; twice the same value at a line."""
    values: np.ndarray
    """float64 (n, columns), from 0; its columns are those of `cumulative`."""

    def at(self, x: np.ndarray | float) -> np.ndarray:
        """Integral over (0, x], a line at x included: (..., columns)."""
        position = np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)
        i = np.clip(np.searchsorted(self.x, position, side="right") - 1, 0, len(self.x) - 2)
        span = self.x[i + 1] - self.x[i]
        share = np.where(span > 0.0, (position - self.x[i]) / np.where(span > 0.0, span, 1.0), 1.0)
        return self.values[i] + share[..., None] * (self.values[i + 1] - self.values[i])

    def band(self, lo: np.ndarray | float, hi: np.ndarray | float) -> np.ndarray:
        """Integral over (lo, hi]; bands that share their ends lose and double nothing."""
        return self.at(hi) - self.at(lo)


def cumulative(axis: SpectralAxis, spectrum: Spectrum, weights: np.ndarray | None = None) -> CumulativeSpectrum:
    """Running integrals over x of the spectrum times `weights` (401, k), float64.

    By default the columns are X, Y, Z (K_m S times the colour matching functions) and W (S
    itself). Each nanometre value fills its cell λ ± ½ nm; the cells of 380 and 780 nm are
    squeezed into the half of them inside the range, so the end value is `Spectrum.xyz()` and
    `Spectrum.power_w()` to rounding.
    Inside a cell the density is constant in x.
    """
    edges_x = axis.cell_edges_x
    table = np.column_stack([K_M * cmf_xyz(), np.ones(401)]) if weights is None else weights
    running = np.vstack([np.zeros(table.shape[1]), np.cumsum(spectrum.density[:, None] * table, axis=0)])
    if not spectrum.lines:
        return CumulativeSpectrum(edges_x, running)
    line_nm, power = np.array(spectrum.lines).T
    line_weights = np.column_stack([np.interp(line_nm, VISIBLE_NM, column) for column in table.T])
    steps = np.cumsum(power[:, None] * line_weights, axis=0)
    line_x = axis.x_of_lines(line_nm)
    below = np.column_stack([np.interp(line_x, edges_x, column) for column in running.T])
    steps = np.vstack([np.zeros(table.shape[1]), steps])
    running = running + steps[np.searchsorted(line_x, edges_x, side="left")]
    before_after = np.stack([below + steps[:-1], below + steps[1:]], axis=1).reshape(-1, table.shape[1])
    x = np.concatenate([edges_x, np.repeat(line_x, 2)])
    order = np.argsort(x, kind="stable")
    return CumulativeSpectrum(x[order], np.concatenate([running, before_after])[order])


BRIGHT_SHARE, POWER_SHARE = 0.6, 0.2
"""Shares of random wavelengths drawn by X + Y + Z and by radiant power. The rest is even over the light's support in
x: no wavelength is impossible (a light whose spectrum is edited may be bright where it was dark), and where a prism
has spread the spectrum its dim ends have pixels of their own."""


def wavelength_cdf(
    power: CumulativeSpectrum, samples: int, support: tuple[float, float], by_power: bool = False
) -> np.ndarray:
    """Share of a light's random wavelengths below each of `samples` equally spaced x: float64 (samples,), from 0 to 1.

    `power`: running X, Y, Z and W; `support`: the light's, in x; `by_power`: all but the even rest by radiant power,
    for maps of spectral bins. What is bright is mixed with what is possible (defensive importance sampling,
    Hesterberg 1995)."""
    x = np.linspace(0.0, 1.0, samples)
    running = power.at(x) - power.at(0.0)
    running[0] = 0.0
    lo, hi = support
    even = np.clip((x - lo) / max(hi - lo, 1e-12), 0.0, 1.0)
    bright, watt = running[:, :3].sum(axis=1), running[:, 3]
    watt = watt / watt[-1] if watt[-1] > 0.0 else even
    bright = bright / bright[-1] if bright[-1] > 0.0 and not by_power else watt
    cdf = BRIGHT_SHARE * bright + POWER_SHARE * watt + (1.0 - BRIGHT_SHARE - POWER_SHARE) * even
    cdf[-1] = 1.0
    return cdf
