"""The dispersion formulas themselves: n(λ) and dn/dλ together, in float64 and analytic, and written out for people.

Kinds "formula 1" … "formula 9" are those of refractiveindex.info (M. N. Polyanskiy,
"Refractiveindex.info database of optical constants", Sci. Data 11, 94 (2024), file
"Dispersion formulas.pdf"), with its coefficient order, so that a database entry is stored
as it was published. Wavelengths here are vacuum or air wavelengths in micrometres, as the
source of the coefficients has them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Literal

import numpy as np

Kind = Literal[
    "formula 1",
    "formula 2",
    "formula 3",
    "formula 4",
    "formula 5",
    "formula 6",
    "formula 7",
    "formula 8",
    "formula 9",
    "abbe",
    "constant",
    "table",
]
Coefficients = tuple[float, ...]
IndexAndSlope = tuple[np.ndarray, np.ndarray]

KHR_A = 523655.0 * 1e-6
KHR_B = 1.5168
"""KHR_materials_dispersion (Khronos, ratified 2024): n_d + (n_d−1)/V_d (523655/λ² − 1.5168), λ in nm."""


def evaluate(kind: Kind, coefficients: Coefficients, wavelength_um: np.ndarray) -> IndexAndSlope:
    """n and dn/dλ (1/µm) at `wavelength_um`, both float64 of its shape; NaN where n² < 0.

    Nothing is clamped or checked here: `Dispersion` does both.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _FORMULAS[kind](coefficients, wavelength_um)


def index(kind: Kind, coefficients: Coefficients, wavelength_um: np.ndarray) -> np.ndarray:
    """n of `evaluate` alone."""
    if kind not in ("formula 1", "formula 2"):
        return evaluate(kind, coefficients, wavelength_um)[0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        square = wavelength_um * wavelength_um
        n_squared = np.full_like(wavelength_um, 1.0 + coefficients[0])
        for b, c in sellmeier_poles(kind, coefficients):
            n_squared += b * square / (square - c)
        return np.sqrt(n_squared)


def _root(n_squared: np.ndarray, slope_of_square: np.ndarray) -> IndexAndSlope:
    n = np.sqrt(n_squared)
    return n, slope_of_square / (2.0 * n)


def _sellmeier(kind: Kind, coefficients: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """n² = 1 + c0 + Σ B λ²/(λ² − C), C in µm²."""
    square = um * um
    n_squared = np.full_like(um, 1.0 + coefficients[0])
    slope = np.zeros_like(um)
    for b, c in sellmeier_poles(kind, coefficients):
        distance = square - c
        n_squared += b * square / distance
        slope -= 2.0 * b * c * um / (distance * distance)
    return _root(n_squared, slope)


def sellmeier_poles(kind: Kind, coefficients: Coefficients) -> list[tuple[float, float]]:
    """(B, C) pairs with C in µm², for formula 1 (which stores √C) and formula 2; else empty."""
    pairs = zip(coefficients[1::2], coefficients[2::2], strict=True)
    if kind == "formula 1":
        return [(b, c * c) for b, c in pairs]
    return list(pairs) if kind == "formula 2" else []


def _power_series(terms: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Σ c λ^p and its derivative; `terms` is c, p, c, p, …"""
    value, slope = np.zeros_like(um), np.zeros_like(um)
    for c, p in zip(terms[::2], terms[1::2], strict=True):
        value += c * um**p
        slope += c * p * um ** (p - 1.0)
    return value, slope


def _formula_3(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    value, slope = _power_series(c[1:], um)
    return _root(c[0] + value, slope)


def _formula_4(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """n² = c0 + Σ(two) c1 λ^c2/(λ² − c3^c4) + Σ c λ^p."""
    value, slope = _power_series(c[9:], um)
    square = um * um
    for a, p, base, power in (c[1:5], c[5:9]):
        if a == 0.0:
            continue
        distance = square - base**power
        value = value + a * um**p / distance
        slope = slope + a * um ** (p - 1.0) * (p * distance - 2.0 * square) / (distance * distance)
    return _root(c[0] + value, slope)


def _formula_5(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    value, slope = _power_series(c[1:], um)
    return c[0] + value, slope


def _formula_6(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Gases: n − 1 = c0 + Σ b/(d − λ⁻²)."""
    n, slope = np.full_like(um, 1.0 + c[0]), np.zeros_like(um)
    for b, d in zip(c[1::2], c[2::2], strict=True):
        distance = d - um**-2.0
        n += b / distance
        slope -= 2.0 * b * um**-3.0 / (distance * distance)
    return n, slope


def _formula_7(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Herzberger: n = c0 + c1 L + c2 L² + c3 λ² + c4 λ⁴ + c5 λ⁶ with L = 1/(λ² − 0.028)."""
    pole = 1.0 / (um * um - 0.028)
    value, slope = _power_series((c[3], 2.0, c[4], 4.0, c[5], 6.0), um)
    return c[0] + pole * (c[1] + c[2] * pole) + value, slope - 2.0 * um * pole**2 * (c[1] + 2.0 * c[2] * pole)


def _formula_8(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Retro: (n² − 1)/(n² + 2) = c0 + c1 λ²/(λ² − c2) + c3 λ²."""
    distance = um * um - c[2]
    value = c[0] + c[1] * um * um / distance + c[3] * um * um
    slope = 2.0 * um * (c[3] - c[1] * c[2] / distance**2)
    return _root((1.0 + 2.0 * value) / (1.0 - value), 3.0 * slope / (1.0 - value) ** 2)


def _formula_9(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Exotic: n² = c0 + c1/(λ² − c2) + c3 (λ − c4)/((λ − c4)² + c5)."""
    distance, off = um * um - c[2], um - c[4]
    width = off * off + c[5]
    slope = -2.0 * um * c[1] / distance**2 + c[3] * (c[5] - off * off) / width**2
    return _root(c[0] + c[1] / distance + c[3] * off / width, slope)


def _abbe(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """The KHR model; its floor n ≥ 1 holds only where n_d itself is at least 1."""
    n_d, v_d = c
    strength = (n_d - 1.0) / v_d
    n = n_d + strength * (KHR_A / (um * um) - KHR_B)
    slope = -2.0 * strength * KHR_A / um**3
    if n_d < 1.0:
        return n, slope
    return np.maximum(n, 1.0), np.where(n > 1.0, slope, 0.0)


def _constant(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    return np.full_like(um, c[0]), np.zeros_like(um)


def _table(c: Coefficients, um: np.ndarray) -> IndexAndSlope:
    """Monotone piecewise cubic (PCHIP) in u = λ⁻², where every glass is nearly a straight line."""
    knots, values, tangents = _pchip(c)
    u = um**-2.0
    i = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
    h = knots[i + 1] - knots[i]
    t = (u - knots[i]) / h
    y0, y1, m0, m1 = values[i], values[i + 1], h * tangents[i], h * tangents[i + 1]
    n = y0 + t * (m0 + t * (3.0 * (y1 - y0) - 2.0 * m0 - m1 + t * (2.0 * (y0 - y1) + m0 + m1)))
    dn_dt = m0 + t * (2.0 * (3.0 * (y1 - y0) - 2.0 * m0 - m1) + 3.0 * t * (2.0 * (y0 - y1) + m0 + m1))
    return n, dn_dt / h * -2.0 * um**-3.0


@lru_cache(maxsize=256)
def _pchip(c: Coefficients) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Knots in u ascending, values, tangents after F. N. Fritsch and J. Butland, SIAM J. Sci.
    Stat. Comput. 5, 300 (1984): weighted harmonic means, zero at a turning point."""
    u = np.asarray(c[::2])[::-1] ** -2.0
    y = np.asarray(c[1::2])[::-1]
    h, secant = np.diff(u), np.diff(y) / np.diff(u)
    if len(u) == 2:
        return u, y, np.array([secant[0], secant[0]])
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    same_sign = secant[:-1] * secant[1:] > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(same_sign, (w1 + w2) / (w1 / secant[:-1] + w2 / secant[1:]), 0.0)
    first = _end_tangent(h[0], h[1], secant[0], secant[1])
    last = _end_tangent(h[-1], h[-2], secant[-1], secant[-2])
    return u, y, np.concatenate([[first], inner, [last]])


def _end_tangent(h0: float, h1: float, s0: float, s1: float) -> float:
    """One-sided three-point tangent, limited so that the end piece stays monotone."""
    tangent = ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if tangent * s0 <= 0.0:
        return 0.0
    if s0 * s1 <= 0.0 and abs(tangent) > 3.0 * abs(s0):
        return 3.0 * s0
    return tangent


_FORMULAS: dict[str, Callable[[Coefficients, np.ndarray], IndexAndSlope]] = {
    "formula 1": partial(_sellmeier, "formula 1"),
    "formula 2": partial(_sellmeier, "formula 2"),
    "formula 3": _formula_3,
    "formula 4": _formula_4,
    "formula 5": _formula_5,
    "formula 6": _formula_6,
    "formula 7": _formula_7,
    "formula 8": _formula_8,
    "formula 9": _formula_9,
    "abbe": _abbe,
    "constant": _constant,
    "table": _table,
}


_SUPERSCRIPT = str.maketrans("-0123456789.", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹·")


def formula_text(kind: Kind, c: Coefficients) -> str:
    """One or a few lines; λ in µm. Coefficients have all the digits they are stored with."""
    match kind:
        case "constant":
            return f"n = {c[0]:.10g}"
        case "abbe":
            strength = (c[0] - 1.0) / c[1]
            return (
                f"n = max(n_d + (n_d − 1)/V_d · ({KHR_A:g}/λ² − {KHR_B:g}), 1)"
                f"\n  n_d = {c[0]:.10g}, V_d = {c[1]:.10g}, (n_d − 1)/V_d = {strength:.6g}"
            )
        case "table":
            return f"{len(c) // 2} measured values, monotone cubic (PCHIP) in λ⁻²"
        case "formula 1" | "formula 2":
            lines = [f"  + {b:.12g} λ²/(λ² − {s:.12g})" for b, s in sellmeier_poles(kind, c)]
            return "\n".join([f"n² = {1.0 + c[0]:.10g}", *lines])
        case "formula 3":
            return "n² = " + _series(c[0], c[1:])
        case "formula 4":
            fractions = [
                f"  + {a:.12g}{_power(p)}/(λ² − {base**power:.12g})"
                for a, p, base, power in (c[1:5], c[5:9])
                if a != 0.0
            ]
            return "\n".join([f"n² = {_series(c[0], c[9:])}", *fractions])
        case "formula 5":
            return "n = " + _series(c[0], c[1:])
        case "formula 6":
            lines = [f"  + {b:.12g}/({d:.12g} − λ⁻²)" for b, d in zip(c[1::2], c[2::2], strict=True)]
            return "\n".join([f"n = {1.0 + c[0]:.10g}", *lines])
        case "formula 7":
            poles = f"  + {c[1]:.12g} L + {c[2]:.12g} L², L = 1/(λ² − 0.028)"
            return f"n = {_series(c[0], (c[3], 2.0, c[4], 4.0, c[5], 6.0))}\n{poles}"
        case "formula 8":
            return f"(n² − 1)/(n² + 2) = {_series(c[0], (c[3], 2.0))}\n  + {c[1]:.12g} λ²/(λ² − {c[2]:.12g})"
        case "formula 9":
            resonance = f"(λ − {c[4]:.12g})/((λ − {c[4]:.12g})² + {c[5]:.12g})"
            return f"n² = {c[0]:.12g}\n  + {c[1]:.12g}/(λ² − {c[2]:.12g})\n  + {c[3]:.12g} {resonance}"


def _power(p: float) -> str:
    if p == 0.0:
        return ""
    return " λ" if p == 1.0 else " λ" + f"{p:g}".translate(_SUPERSCRIPT)


def _series(first: float, terms: Coefficients) -> str:
    text = f"{first:.12g}"
    for value, p in zip(terms[::2], terms[1::2], strict=True):
        if value != 0.0:
            text += f" {'−' if value < 0.0 else '+'} {abs(value):.12g}{_power(p)}"
    return text
