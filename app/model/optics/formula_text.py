"""Dispersion formulas written out for people: kept apart from their evaluation."""

from __future__ import annotations

from .dispersion_formulas import KHR_A, KHR_B, Coefficients, Kind, sellmeier_poles

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
