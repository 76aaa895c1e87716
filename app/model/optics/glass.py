"""How strongly a transparent material bends light of each wavelength.

A `Dispersion` is one n(λ): a catalogue fit, n_d with an Abbe number, coefficients, a table
or a constant. Wavelengths go in as nanometres and are clamped to the range the fit was
made for, because a Sellmeier fit outside its range may have a pole; `clamps_visible()` says
where that happens. Make one with the constructors below: they refuse data that
would give n ≤ 0, an imaginary or an infinite index anywhere in the visible range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.errors import UserError
from . import dispersion_formulas as formulas
from .colorimetry import VISIBLE_NM
from .dispersion_formulas import Kind

VISIBLE_RANGE_NM = (380.0, 780.0)
LINE_F_NM, LINE_D_NM, LINE_C_NM = 486.1327, 587.5618, 656.2725
"""Fraunhofer F and C (hydrogen) and d (helium), air wavelengths, as glass catalogues use them."""

_FLAT = 1e-7
_ALL_WAVELENGTHS = (0.0, math.inf)


@dataclass(frozen=True)
class Dispersion:
    """n(λ) of one material. Two values are equal when name and data are."""

    name: str
    kind: Kind
    coefficients: tuple[float, ...]
    """In the order of `dispersion_formulas`; a table is λ (µm), n, λ, n, …, λ ascending."""
    range_nm: tuple[float, float] = _ALL_WAVELENGTHS
    """Where the fit holds; wavelengths outside are clamped to it."""
    gain: float = 1.0
    """Factor on n(λ) − n_d: 1 is the material itself, 0 has no dispersion, more is stronger than nature. n_d stays."""

    def index(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """Refractive index, float64 of the shape of `wavelength_nm`."""
        clamped = np.clip(np.asarray(wavelength_nm, dtype=np.float64), *self.range_nm)
        n = formulas.index(self.kind, self.coefficients, clamped * 1e-3)
        return n if self.gain == 1.0 else self.n_d + self.gain * (n - self.n_d)

    def derivative(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """dn/dλ in 1/µm, analytic, float64; zero outside the fit's range, where n is clamped."""
        wavelength = np.asarray(wavelength_nm, dtype=np.float64)
        lo, hi = self.range_nm
        inside = (wavelength >= lo) & (wavelength <= hi)
        return np.where(inside, self._evaluate(wavelength)[1], 0.0)

    def _evaluate(self, wavelength_nm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        clamped = np.clip(np.asarray(wavelength_nm, dtype=np.float64), *self.range_nm)
        n, slope = formulas.evaluate(self.kind, self.coefficients, clamped * 1e-3)
        if self.gain == 1.0:
            return n, slope
        return self.n_d + self.gain * (n - self.n_d), self.gain * slope

    @cached_property
    def n_d(self) -> float:
        """Index at the helium line d, 587.56 nm."""
        d_um = min(max(LINE_D_NM, self.range_nm[0]), self.range_nm[1]) * 1e-3
        return float(formulas.evaluate(self.kind, self.coefficients, np.asarray(d_um))[0])

    @cached_property
    def V_d(self) -> float:
        """Abbe number (n_d − 1)/(n_F − n_C): small = dispersive, inf = flat, < 0 = anomalous."""
        spread = float(self.index(LINE_F_NM) - self.index(LINE_C_NM))
        return math.inf if abs(spread) < 1e-12 else (self.n_d - 1.0) / spread

    @cached_property
    def natural(self) -> Dispersion:
        """The material itself, without a gain: its V_d is the one that people know it by."""
        return self if self.gain == 1.0 else replace(self, gain=1.0)

    @cached_property
    def is_dispersive(self) -> bool:
        """Whether n differs by more than 1e-7 anywhere between 380 and 780 nm."""
        n = self.index(VISIBLE_NM)
        return bool(n.max() - n.min() > _FLAT)

    def clamps_visible(self) -> str | None:
        """A sentence naming the part of 380–780 nm outside the fit's range, or None."""
        lo, hi = self.range_nm
        below = f"below {lo:g} nm" if lo > VISIBLE_RANGE_NM[0] else ""
        above = f"above {hi:g} nm" if hi < VISIBLE_RANGE_NM[1] else ""
        if not below and not above:
            return None
        return (
            f"{self.name or 'the index'}: data reach from {lo:g} to {hi:g} nm; "
            f"{' and '.join(filter(None, (below, above)))} the nearest value is used."
        )

    def notes(self) -> list[str]:
        """What a user should know about these data, one sentence each (often none)."""
        clamped = self.clamps_visible()
        notes = [clamped] if clamped else []
        label = self.name or "the index"
        n = self.index(VISIBLE_NM)
        if self.gain != 1.0:
            notes.append(
                f"{label}: its dispersion is {self.gain:g} times that of the material (dispersion_gain), which "
                "nature does not offer."
            )
        if n.min() < 1.0:
            at = VISIBLE_NM[int(n.argmin())]
            notes.append(f"{label}: the index falls below 1 (n = {n.min():.6g} at {at:g} nm), which is legal but rare.")
        if self.kind == "abbe" and self.coefficients[0] > 1.0 and n.min() == 1.0:
            notes.append(
                f"{label}: V_d = {self.coefficients[1]:g} is so small that the index is held at 1 in part of the range."
            )
        if self.is_dispersive and np.any(np.diff(n) > 0.0):
            notes.append(
                f"{label}: the index rises with wavelength in part of the visible range (anomalous dispersion)."
            )
        return notes

    def formula_text(self) -> str:
        """The formula with its coefficients, for people (λ in µm)."""
        from .dispersion_formulas import formula_text

        text = formula_text(self.kind, self.coefficients)
        if self.gain == 1.0:
            return text
        return f"{text}\nand from it n_d + {self.gain:.10g} (n − n_d), n_d = {self.n_d:.10g}"


_MOST_INDEX = 100.0
"""Coefficients and tables that give more have other units than they should."""


# ---- constructors; `where` opens an error's sentence ("scene.toml: materials.glass") --------


def constant(n: float, name: str = "", where: str = "") -> Dispersion:
    """The same n for every wavelength."""
    return _checked(Dispersion(name, "constant", (float(n),)), where)


def from_abbe(n_d: float, v_d: float = math.inf, name: str = "", where: str = "") -> Dispersion:
    """n_d with an Abbe number, by the model of KHR_materials_dispersion.

    `v_d` = inf gives a constant, a negative one anomalous dispersion; 0 raises `UserError`.
    """
    if v_d == 0.0 or math.isnan(v_d):
        raise UserError(
            f"{_prefix(where)}V_d is {v_d:g}; give a number other than 0 (20 to 90 for glass), or leave it out "
            "for no dispersion"
        )
    if math.isinf(v_d):
        return constant(n_d, name, where)
    return _checked(Dispersion(name, "abbe", (float(n_d), float(v_d))), where)


def sellmeier(
    b: Sequence[float],
    c_um2: Sequence[float],
    name: str = "",
    range_nm: tuple[float, float] | None = None,
    where: str = "",
) -> Dispersion:
    """n² = 1 + Σ B λ²/(λ² − C), C in µm² (as glass makers print it)."""
    if len(b) != len(c_um2) or not b:
        raise UserError(
            f"{_prefix(where)}Sellmeier needs as many C as B, at least one (got {len(b)} B and {len(c_um2)} C)"
        )
    flat = [0.0] + [float(x) for pair in zip(b, c_um2, strict=True) for x in pair]
    return _checked(Dispersion(name, "formula 2", tuple(flat), range_nm or _ALL_WAVELENGTHS), where)


def cauchy(
    coefficients: Sequence[float],
    name: str = "",
    range_nm: tuple[float, float] | None = None,
    where: str = "",
) -> Dispersion:
    """n = A + B/λ² + C/λ⁴ + …, λ in µm."""
    if len(coefficients) == 0:
        raise UserError(f"{_prefix(where)}Cauchy needs at least the coefficient A")
    flat = [float(coefficients[0])]
    for i, value in enumerate(coefficients[1:], start=1):
        flat += [float(value), -2.0 * i]
    return _checked(Dispersion(name, "formula 5", tuple(flat), range_nm or _ALL_WAVELENGTHS), where)


def from_formula(
    kind: Kind,
    coefficients: Sequence[float],
    name: str = "",
    range_nm: tuple[float, float] | None = None,
    where: str = "",
) -> Dispersion:
    """A refractiveindex.info formula ("formula 1" … "formula 9") with its own coefficient order."""
    values = tuple(float(x) for x in coefficients)
    known = [f"formula {i}" for i in range(1, 10)]
    if kind not in known:
        raise UserError(f"{_prefix(where)}unknown dispersion formula '{kind}'; known are {', '.join(known)}")
    fixed = {"formula 7": 6, "formula 8": 4, "formula 9": 6}.get(kind)
    if fixed is not None:
        values += (0.0,) * (fixed - len(values))
    least = 9 if kind == "formula 4" else fixed or 1
    if len(values) < least or (len(values) % 2 == 0 if fixed is None else len(values) > fixed):
        raise UserError(
            f"{_prefix(where)}{kind} does not take {len(values)} coefficients; see 'Dispersion formulas' of "
            "refractiveindex.info"
        )
    return _checked(Dispersion(name, kind, values, range_nm or _ALL_WAVELENGTHS), where)


def table(
    wavelength_nm: Sequence[float] | np.ndarray, n: Sequence[float] | np.ndarray, name: str = "", where: str = ""
) -> Dispersion:
    """Measured n at given wavelengths (nm), two or more and ascending.

    Interpolated by a monotone cubic (PCHIP) in λ⁻², clamped at both ends.
    """
    if len(wavelength_nm) != len(n) or len(n) < 2:
        raise UserError(
            f"{_prefix(where)}a table of n needs two or more wavelengths and as many indices (got "
            f"{len(wavelength_nm)} and {len(n)})"
        )
    lam = np.asarray(wavelength_nm, dtype=np.float64)
    if not np.all(np.isfinite(lam)) or lam[0] <= 0.0:
        raise UserError(
            f"{_prefix(where)}a wavelength of the table is not a positive number; give nanometres, such as 587.56"
        )
    if np.any(np.diff(lam) <= 0.0):
        at = int(np.argmax(np.diff(lam) <= 0.0))
        raise UserError(
            f"{_prefix(where)}the wavelengths of the table must ascend, but {lam[at + 1]:g} follows {lam[at]:g}; "
            "sort the rows"
        )
    values = [float(x) for x in n]
    for wavelength, value in zip(lam, values, strict=True):
        if not (math.isfinite(value) and value > 0.0):
            raise UserError(
                f"{_prefix(where)}the table has n = {value:g} at {wavelength:g} nm; an index must be a positive number"
            )
    flat = tuple(float(x) for pair in zip(lam * 1e-3, values, strict=True) for x in pair)
    return _checked(Dispersion(name, "table", flat, (float(lam[0]), float(lam[-1]))), where)


def with_gain(dispersion: Dispersion, gain: float, where: str = "") -> Dispersion:
    """The same material with its dispersion `gain` times as strong about n_d.

    Raises `UserError` for a gain that is not finite or negative, or that makes an index ≤ 0 in the visible range.
    """
    if not (math.isfinite(gain) and gain >= 0.0):
        raise UserError(
            f"{_prefix(where)}dispersion_gain is {gain:g}; give a number from 0 (none) over 1 (as in nature) upwards"
        )
    return _checked(replace(dispersion, gain=float(gain)), where)


def abbe_to_gltf_dispersion(v_d: float) -> float:
    """KHR_materials_dispersion's `dispersion` = 20/V_d; 0 where there is none."""
    return 0.0 if math.isinf(v_d) else 20.0 / v_d


def gltf_dispersion_to_abbe(dispersion: float) -> float:
    """V_d of KHR_materials_dispersion's `dispersion`; inf for 0."""
    return math.inf if dispersion == 0.0 else 20.0 / dispersion


# ---- validation ---------------------------------------------------------------------------


def _prefix(where: str) -> str:
    return f"{where}: " if where else ""


def _checked(dispersion: Dispersion, where: str) -> Dispersion:
    """`dispersion` itself, or a `UserError` saying what is wrong with its data."""
    who = _prefix(where)
    if not all(math.isfinite(c) for c in dispersion.coefficients):
        raise UserError(f"{who}a coefficient of the refractive index is not a finite number; check the coefficients")
    lo, hi = dispersion.range_nm
    if not (0.0 <= lo < hi):
        raise UserError(f"{who}the wavelength range {lo:g} to {hi:g} nm is empty; give the lower end first")
    first, last = max(lo, VISIBLE_RANGE_NM[0]), min(hi, VISIBLE_RANGE_NM[1])
    if first >= last:
        remedy = "these look like µm: give nm, 1000 times as much" if hi < 100.0 else "choose another material"
        raise UserError(
            f"{who}the data hold from {lo:g} to {hi:g} nm, outside the visible range 380 to 780 nm; {remedy}"
        )
    for b, c in formulas.sellmeier_poles(dispersion.kind, dispersion.coefficients):
        if b != 0.0 and (first * 1e-3) ** 2 <= c <= (last * 1e-3) ** 2:
            raise UserError(
                f"{who}the Sellmeier term with C = {c:g} µm² has its pole at {1e3 * math.sqrt(c):.4g} nm, inside "
                "the visible range; check B and C (C is in µm²)"
            )
    n = dispersion.index(VISIBLE_NM)
    most = math.inf if dispersion.kind in ("abbe", "constant") else _MOST_INDEX
    bad = ~(np.isfinite(n) & (n > 0.0) & (n < most))
    if np.any(bad):
        at = int(np.argmax(bad))
        state = "imaginary or infinite" if not np.isfinite(n[at]) else f"{n[at]:.6g}"
        remedy = f"lie below {_MOST_INDEX:g}; check the units (λ in µm)" if n[at] > 0.0 else "be a positive number"
        raise UserError(
            f"{who}the refractive index is {state} at {VISIBLE_NM[at]:g} nm; from 380 to 780 nm it must {remedy}"
        )
    return dispersion
