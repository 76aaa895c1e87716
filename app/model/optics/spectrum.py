"""What a light emits at each wavelength: a density on the visible grid plus exact lines.

Lines (lasers) keep their own wavelength instead of being snapped to the grid, because a
prism tells 589.0 from 589.6 nm apart. Units are the caller's: density per nanometre of
whatever the light kind is measured in. Only 380–780 nm exist here.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import UserError, suggestion
from ..io.curve_file import clipped, note_ends, read_curve
from ..vectors import frozen, vec3
from .colorimetry import K_M, VISIBLE_NM, cmf_xyz, illuminant_table, xyz_to_rgb709

_PLANCK_2HC2 = 1.191042972e-16
"""First radiation constant for radiance, 2hc², W m² (CODATA 2018)."""
_PLANCK_C2 = 1.438776877e-2
"""Second radiation constant hc/k, m K (CODATA 2018)."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectral density and lines; equal by value, hashable, arrays read-only."""

    density: np.ndarray = field(default_factory=lambda: np.zeros(401))
    """float64 (401,) on `VISIBLE_NM`, per nm; each value is that of the nanometre around it."""
    lines: tuple[tuple[float, float], ...] = ()
    """(wavelength_nm, power) with 380 <= wavelength_nm <= 780, ascending."""

    def __post_init__(self) -> None:
        density = np.array(self.density, dtype=np.float64)
        if density.shape != (401,):
            raise UserError(f"a spectrum needs 401 values, one for each nm from 380 to 780, not {density.shape}")
        if not np.all(np.isfinite(density)) or np.any(density < 0.0):
            at = int(np.argmin(np.where(np.isfinite(density), density, -np.inf)))
            raise UserError(
                f"the spectrum is {density[at]:g} at {VISIBLE_NM[at]:g} nm; power must be a number of 0 or more"
            )
        for wavelength, power in self.lines:
            if not 380.0 <= wavelength <= 780.0:
                raise UserError(f"the line at {wavelength:g} nm is not visible; choose one from 380 to 780 nm")
            if not (math.isfinite(power) and power >= 0.0):
                raise UserError(f"the line at {wavelength:g} nm has power {power:g}; give a number of 0 or more")
        object.__setattr__(self, "density", frozen(density))
        object.__setattr__(self, "lines", tuple(sorted((float(w), float(p)) for w, p in self.lines)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Spectrum):
            return NotImplemented
        return self.lines == other.lines and np.array_equal(self.density, other.density)

    def __hash__(self) -> int:
        return hash((self.density.tobytes(), self.lines))

    def __add__(self, other: Spectrum) -> Spectrum:
        return Spectrum(self.density + other.density, self.lines + other.lines)

    def scaled(self, factor: float) -> Spectrum:
        """Every value times `factor` (finite, >= 0)."""
        return Spectrum(self.density * factor, tuple((w, p * factor) for w, p in self.lines))

    def power_w(self) -> float:
        """Integral over 380–780 nm (sum over the 1 nm cells plus lines), in the density's unit times nm."""
        return float(self.density.sum()) + sum(power for _, power in self.lines)

    def binned(self, edges_nm: np.ndarray, with_lines: bool = True) -> np.ndarray:
        """Mean density in each bin between `edges_nm` (bins + 1,), ascending; lines are spread over their bin, and the
        first and last bin hold what lies beyond them within half a nanometre."""
        summed = np.concatenate([[0.0], np.cumsum(self.density)])
        cells = np.append(VISIBLE_NM - 0.5, VISIBLE_NM[-1] + 0.5)
        ends = np.array(edges_nm, float)
        ends[0], ends[-1] = ends[0] - 0.5, ends[-1] + 0.5
        power = np.diff(np.interp(ends, cells, summed))
        for wavelength, line in self.lines if with_lines else ():
            at = int(np.searchsorted(ends, wavelength, side="right")) - 1
            if 0 <= at < len(power):
                power[at] += line
        return power / np.diff(edges_nm)

    def xyz(self) -> np.ndarray:
        """K_m Σ S(λ) (x̄, ȳ, z̄), float64 (3,); Y is in lumens where S is in W/nm."""
        total = self.density @ cmf_xyz()
        for wavelength, power in self.lines:
            total = total + power * cmf_at(wavelength)
        return K_M * total

    def luminous(self) -> float:
        """Y of `xyz()`: the photometric quantity that goes with the radiometric one."""
        return float(self.xyz()[1])

    def support_nm(self) -> tuple[float, float]:
        """The narrowest (lo, hi) within 380–780 nm outside of which nothing is emitted.

        A single line gives lo == hi; a spectrum that emits nothing gives the whole range.
        """
        lit = np.flatnonzero(self.density)
        edges = [w for w, p in self.lines if p > 0.0]
        if lit.size:
            edges += [max(VISIBLE_NM[lit[0]] - 0.5, 380.0), min(VISIBLE_NM[lit[-1]] + 0.5, 780.0)]
        return (float(min(edges)), float(max(edges))) if edges else (380.0, 780.0)

    def scaled_to_luminous(self, value: float) -> Spectrum:
        """The same colour with K_m Σ S ȳ = `value` (lm, cd, lx … as the density's unit has it)."""
        return self._scaled_to(value, self.luminous(), "no light that the eye sees")

    def scaled_to_power(self, value_w: float) -> Spectrum:
        """The same shape with Σ S = `value_w`."""
        return self._scaled_to(value_w, self.power_w(), "nothing between 380 and 780 nm")

    def _scaled_to(self, target: float, present: float, lacking: str) -> Spectrum:
        if not (math.isfinite(target) and target >= 0.0):
            raise UserError(f"a light's power is {target:g}; give a number of 0 or more")
        if present <= 0.0:
            raise UserError(
                f"a spectrum that holds {lacking} cannot be brought to a given power; choose another spectrum"
            )
        return self.scaled(target / present)


def cmf_at(wavelength_nm: np.ndarray | float) -> np.ndarray:
    """Colour matching functions at any wavelength, linear between the 1 nm values: (..., 3)."""
    wavelength = np.asarray(wavelength_nm, dtype=np.float64)
    return np.stack([np.interp(wavelength, VISIBLE_NM, column) for column in cmf_xyz().T], axis=-1)


# ---- constructors -------------------------------------------------------------------------


def illuminant(name: str) -> Spectrum:
    """A CIE illuminant by name, relative as CIE tabulates it (D65 is 100 at 560 nm).

    Case, spaces, a leading "CIE" and the choice between "F2" and "FL2" do not matter.
    Raises `UserError` with the nearest names.
    """
    table = illuminant_table()
    by_key = {_key(known): known for known in table}
    by_key.update({f"f{known[2:].casefold()}": known for known in table if known.startswith("FL")})
    key = _key(name).removeprefix("cie")
    if key not in by_key:
        hint = suggestion(name, table) or f"; known are {', '.join(illuminant_names())}"
        raise UserError(f"unknown illuminant '{name}'{hint}")
    return Spectrum(table[by_key[key]])


def illuminant_names() -> list[str]:
    """Every name `illuminant` knows, daylights first as CIE lists them."""
    return sorted(illuminant_table(), key=lambda n: (len(n) > 3, n))


def _key(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum() or c == ".")


def blackbody(kelvin: float) -> Spectrum:
    """Planck's spectral radiance of a black body, W/(sr m² nm) in vacuum wavelengths."""
    if not (math.isfinite(kelvin) and 500.0 <= kelvin <= 1e7):
        raise UserError(
            f"a black body of {kelvin:g} K is out of range; give 500 to 1e7 K (a candle has 1900, the sun 5800)"
        )
    metres = VISIBLE_NM * 1e-9
    per_metre = _PLANCK_2HC2 / metres**5 / np.expm1(_PLANCK_C2 / (metres * kelvin))
    return Spectrum(per_metre * 1e-9)


def laser(wavelength_nm: float, power: float = 1.0) -> Spectrum:
    """One line of no width."""
    if not math.isfinite(wavelength_nm):
        raise UserError(f"a laser's wavelength is {wavelength_nm:g}; give nanometres from 380 to 780")
    return Spectrum(lines=((wavelength_nm, power),))


def constant(value: float) -> Spectrum:
    """The same density at every wavelength."""
    return Spectrum(np.full(401, float(value)))


def from_table(wavelengths_nm: np.ndarray, values: np.ndarray, where: str = "") -> Spectrum:
    """Density given at ascending wavelengths, linear between them, zero outside them."""
    x, y = np.asarray(wavelengths_nm, dtype=np.float64), np.asarray(values, dtype=np.float64)
    who = f"{where}: " if where else ""
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise UserError(f"{who}a spectrum needs two or more wavelengths and as many values (got {x.size} and {y.size})")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise UserError(f"{who}the spectrum holds a value that is not a finite number; remove that row")
    if x.max() < 100.0:
        raise UserError(f"{who}the wavelengths {x.min():g} to {x.max():g} look like µm; give nm, 1000 times as much")
    if np.any(np.diff(x) <= 0.0):
        at = int(np.argmax(np.diff(x) <= 0.0))
        raise UserError(f"{who}wavelengths must ascend, but {x[at + 1]:g} follows {x[at]:g}; sort the rows")
    if np.any(y < 0.0):
        at = int(np.argmax(y < 0.0))
        raise UserError(f"{who}the spectrum is negative ({y[at]:g}) at {x[at]:g} nm; power must be 0 or more")
    return Spectrum(np.interp(VISIBLE_NM, x, y, left=0.0, right=0.0))


def from_csv(path: str | os.PathLike[str], notes: list[str] | None = None) -> Spectrum:
    """A spectrum measured by the user: a table's column or a TM-27 file (`curve_file`).

    Linear between the rows, zero outside them. What was assumed goes to `notes`. Raises `UserError` naming the file.
    """
    notes = [] if notes is None else notes
    curve = read_curve(path, notes)
    spectrum = from_table(curve.nm, clipped(path, curve, "power", notes), where=os.fspath(path))
    note_ends(path, curve, "it is taken as dark", notes)
    if spectrum.power_w() == 0.0:
        raise UserError(f"{os.fspath(path)}: the spectrum is zero from 380 to 780 nm; choose another")
    return spectrum


def rgb_under_white(reflectance: np.ndarray) -> tuple[float, float, float]:
    """Linear Rec.709 of a reflectance (401,) under D65, clipped to [0, 1]."""
    white = illuminant("D65")
    seen = Spectrum(white.density * reflectance).xyz() / white.luminous()
    return vec3(np.clip(xyz_to_rgb709(seen), 0.0, 1.0))
