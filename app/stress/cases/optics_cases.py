"""Single events at their stiffest: the edge of total reflection, grazing rays, and media that hardly differ.

The functions of shaders/lib/optics.glsl run over arrays and are held against float64, which gets the same
float32 numbers. Bounds are running error bounds: every rounding of the formula, worst case, times the condition
number of the step behind it. With u = `EPSILON`, d·n is known to 1.5 u (three products, two sums), and so

    δcos²θt ≤ u [3 |1 − η²| + 5 η² |d·n|]

since (1−η)(1+η) takes three roundings, η²(d·n)² three more, and twice the error of d·n enters. Everything
else follows from |√(c + δ) − √c| ≤ |δ|/√c and from the sizes of a formula's terms.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...gpu.context import Context
from ...reference import optics
from ...reference.glasses import D_NM, index
from ...reference.optics import dot, times
from ..case import Case, Measurement
from ..judging import EPSILON, judged, length, not_finite
from ..rigs import glsl_function
from ..rigs.glsl_function import as_f32

OPTICS = ["lib/optics.glsl"]
REFRACT = """
    float theta = dot(d, n);
    cosine2 = transmitted_cosine2(theta, eta);
    reflectance = fresnel_reflectance(theta, eta, cosine2);
    reflected = reflect_direction(d, n, theta);
    if (cosine2 > 0.0) {
        float omega = sqrt(cosine2);
        refracted = refract_direction(d, n, theta, eta, omega);
        by_n = refract_column(d, vec3(0.0), n, vec3(0.0), theta, eta, omega, deta);
        by_s = refract_column(d, dd, n, dn, theta, eta, omega, 0.0);
    }
"""
OUTPUTS = {
    "cosine2": "float",
    "reflectance": "float",
    "reflected": "vec3",
    "refracted": "vec3",
    "by_n": "vec3",
    "by_s": "vec3",
}
ROWS = 600
Rows = dict[str, tuple[np.ndarray, np.ndarray | float]]
"""Errors and bounds of many rays by quantity, as `judged` takes them."""
INDICES = (
    1.0003,
    float(index("water", D_NM)),
    float(index("N-BK7", D_NM)),
    float(index("N-SF11", D_NM)),
    float(index("diamond", D_NM)),
    4.0,
)
"""Of the denser medium: from a warm gas to germanium."""


def events(cosine: np.ndarray, eta: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Rays meeting surfaces at cosines (N,) in any direction of space, rounded to float32: d, n, their columns, eta and
    ∂eta/∂n."""
    rng = np.random.default_rng(seed)
    n = optics.unit(rng.normal(size=(len(cosine), 3)))
    along = optics.unit(np.cross(n, rng.normal(size=(len(cosine), 3))))
    d = times(np.sqrt(1.0 - cosine**2), along) - times(cosine, n)
    dd = optics.normalised_derivative(d, rng.normal(size=(len(cosine), 3)))
    dn = optics.normalised_derivative(n, rng.normal(size=(len(cosine), 3)))
    # Entering: the transmitting index varies, -eta/n = -eta²; leaving: the incident one, 1.
    deta = np.where(eta < 1.0, -(eta**2), 1.0)
    return {
        name: as_f32(value) for name, value in {"d": d, "n": n, "dd": dd, "dn": dn, "eta": eta, "deta": deta}.items()
    }


def refraction_errors(e: dict[str, np.ndarray], got: dict[str, np.ndarray]) -> Rows:
    """{quantity: (error, bound) of each row} of what lies beyond the surface.

    Columns are judged where cos² is known to better than a half; closer to the edge they only have to be finite.
    """
    passed = (exact_cosine2(e) > 0.0) & (got["cosine2"] > 0.0)
    e, got = ({name: value[passed] for name, value in rows.items()} for rows in (e, got))
    eta, theta, cosine2 = e["eta"], dot(e["d"], e["n"]), exact_cosine2(e)
    omega = np.sqrt(cosine2)
    mu = refraction_mu(theta, eta, omega)
    of_cosine2 = cosine2_bound(eta, theta)
    of_omega = np.minimum(of_cosine2 / omega, np.sqrt(of_cosine2)) + EPSILON * omega
    # mu = (1-eta²) / (omega - eta theta): a quotient's relative error is that of its parts.
    of_mu = np.abs(mu) * ((of_omega + 1.5 * EPSILON * eta) / (omega - eta * theta) + 4.0 * EPSILON)
    direction = times(eta, e["d"]) - times(mu, e["n"])
    # |∂rs/∂omega| = 2 eta c/(eta c + omega)² and |∂rp/∂omega| = 2 eta c/(c + eta omega)², largest at the least omega
    # there may be.
    c, least = -theta, np.sqrt(np.maximum(cosine2 - of_cosine2, 0.0))
    slope = 2.0 * eta * c / (eta * c + least) ** 2 + 2.0 * eta * c / (c + eta * least) ** 2
    slope_c = 2.0 * eta * omega / (eta * c + omega) ** 2 + 2.0 * eta * omega / (c + eta * omega) ** 2
    of_reflectance = np.minimum(slope * of_omega, 1.0) + slope_c * 1.5 * EPSILON + 6.0 * EPSILON

    known = cosine2 > 2.0 * of_cosine2
    return {
        "direction": (length(got["refracted"] - direction), of_mu + EPSILON * (2.0 * eta + 2.0 * np.abs(mu))),
        "Fresnel R, absolute": (np.abs(got["reflectance"] - fresnel_from(c, eta, omega)), of_reflectance),
        "length of d'": (
            np.abs(length(got["refracted"]) - 1.0),
            np.minimum(of_mu, np.sqrt(of_cosine2)) + 8.0 * EPSILON * np.maximum(eta, 1.0),
        ),
        "column n": _chosen(known, *_column_n(e, got["by_n"], omega, of_cosine2 / cosine2)),
        "column s": _chosen(known, *_column_s(e, got["by_s"], omega, of_cosine2 / cosine2, of_mu)),
    }


def _column_n(
    e: dict[str, np.ndarray], got: np.ndarray, omega: np.ndarray, relative: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Both terms lose the relative error of 1/omega; d - theta n and (1-theta)(1+theta) cancel at normal incidence."""
    eta, theta, zero = e["eta"], dot(e["d"], e["n"]), np.zeros_like(e["d"])
    want = optics.refract_column_stable(e["d"], zero, e["n"], zero, eta, e["deta"])
    size = length(e["d"] - times(theta, e["n"])) + eta * (1.0 - theta) * (1.0 + theta) / omega
    bound = np.abs(e["deta"]) * (size * (relative + 8.0 * EPSILON) + EPSILON * (2.5 + 3.0 * eta / omega))
    scale = np.maximum(length(want), 1.0)
    return length(got - want) / scale, bound / scale


def _column_s(
    e: dict[str, np.ndarray], got: np.ndarray, omega: np.ndarray, relative: np.ndarray, of_mu: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """omega is twice in eta mu/omega, by mu too; the other terms lose a few roundings of their size."""
    eta, theta = e["eta"], dot(e["d"], e["n"])
    want = optics.refract_column_stable(e["d"], e["dd"], e["n"], e["dn"], eta, np.zeros_like(eta))
    mu = np.abs(refraction_mu(theta, eta, omega))
    turn = eta * mu / omega * (length(e["dd"]) + length(e["dn"]))
    rest = 4.0 * EPSILON * (eta * length(e["dd"]) + mu * length(e["dn"]))
    bound = turn * (2.0 * relative + 12.0 * EPSILON) + of_mu * length(e["dn"]) + rest
    scale = np.maximum(length(want), 1.0)
    return length(got - want) / scale, bound / scale


def _chosen(rows: np.ndarray, error: np.ndarray, bound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return error[rows], bound[rows]


def refraction_mu(theta: np.ndarray, eta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """mu of d' = eta d - mu n."""
    return (1.0 - eta) * (1.0 + eta) / (omega - eta * theta)


def exact_cosine2(e: dict[str, np.ndarray]) -> np.ndarray:
    """cos² of the transmitted angle in float64, of d and n as they are: after rounding they are not quite unit
    vectors."""
    return (1.0 - e["eta"]) * (1.0 + e["eta"]) + (e["eta"] * dot(e["d"], e["n"])) ** 2


def cosine2_bound(eta: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Largest float32 error of cos²θt (see the head of this file)."""
    return EPSILON * (3.0 * np.abs((1.0 - eta) * (1.0 + eta)) + 5.0 * eta**2 * np.abs(theta))


def fresnel_from(c: np.ndarray, eta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Unpolarised reflectance from both cosines."""
    senkrecht = (eta * c - omega) / (eta * c + omega)
    parallel = (c - eta * omega) / (c + eta * omega)
    return 0.5 * (senkrecht**2 + parallel**2)


def run(context: Context, e: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return glsl_function.evaluate(context.ctx, OPTICS, REFRACT, e, OUTPUTS)


def measure_tir_margin(context: Context) -> Iterator[Measurement]:
    for margin in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        n = np.repeat(INDICES, ROWS)
        critical = np.arcsin(1.0 / n)
        # A gas has its critical angle at 88.6°: beyond 90° there is nothing.
        sides = [critical - margin, np.minimum(critical + margin, 0.5 * np.pi - 1e-6)]
        e = events(np.cos(np.concatenate(sides)), np.tile(n, 2), seed=1)
        got = run(context, e)
        cosine2, known_to = exact_cosine2(e), cosine2_bound(e["eta"], dot(e["d"], e["n"]))
        # Within its own error the sign of cos² is anyone's; beyond it the side must be right.
        turned_back = (cosine2 > known_to) & (got["cosine2"] <= 0.0)
        let_through = (cosine2 < -known_to) & ((got["cosine2"] > 0.0) | (got["reflectance"] != 1.0))
        rows = refraction_errors(e, got) | {
            "cos² of the refracted ray": (np.abs(got["cosine2"] - cosine2), known_to),
            "rays on the wrong side": ((turned_back | let_through).astype(float), 0.0),
            "mirrored direction": (length(got["reflected"] - optics.reflect(e["d"], e["n"])), 6.0 * EPSILON),
        }
        errors, bounds = judged(rows)
        hidden = int(np.count_nonzero(np.abs(cosine2) <= 2.0 * known_to))
        note = f"{hidden} of {len(cosine2)} rays lie within rounding of the edge" if hidden else ""
        yield Measurement(margin, f"{margin:g} rad", not_finite(got.values()), errors, bounds, note=note)


def measure_grazing(context: Context) -> Iterator[Measurement]:
    for angle_deg in (89.0, 89.9, 89.99, 89.999):
        n = np.repeat(INDICES, ROWS)
        e = events(np.full(len(n), np.cos(np.radians(angle_deg))), 1.0 / n, seed=2)
        got = run(context, e)
        rows = refraction_errors(e, got)
        rng = np.random.default_rng(3)
        q = {"dp": as_f32(rng.normal(size=e["d"].shape)), "t": as_f32(rng.uniform(0.0, 3.0, len(n)))}
        body = "moved = transfer_column(dp, dd, d, n, t);"
        moved = glsl_function.evaluate(
            context.ctx, OPTICS, body, {**q, "dd": e["dd"], "d": e["d"], "n": e["n"]}, {"moved": "vec3"}
        )["moved"]
        want = optics.transfer_column(q["dp"], e["dd"], e["d"], e["n"], q["t"])
        # (q·N)/(d·N) d: the quotient loses the 1.5 u of d·N over cos, its numerator 2 u over cos.
        cosine = np.abs(dot(e["d"], e["n"]))
        size = length(q["dp"]) + q["t"] * length(e["dd"])
        bound = (
            EPSILON
            * size
            * (
                np.abs(dot(q["dp"] + times(q["t"], e["dd"]), e["n"]))
                / size
                * 1.5
                / cosine**2
                / (1.0 - 1.5 * EPSILON / cosine)
                + 4.0 / cosine
                + 2.0
            )
        )
        scale = np.maximum(length(want), 1.0)
        rows["column on a receiver"] = (length(moved - want) / scale, bound / scale)
        errors, bounds = judged(rows)
        yield Measurement(90.0 - angle_deg, f"{angle_deg:g}°", not_finite([*got.values(), moved]), errors, bounds)


def measure_index_matched(context: Context) -> Iterator[Measurement]:
    for difference in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0):
        count = 4 * ROWS
        eta = np.repeat([1.0 - difference, 1.0 + difference], count)
        # Incidence at up to 70°: at 1 + 1e-2 the critical angle is 81.9°.
        cosine = np.random.default_rng(4).uniform(np.cos(np.radians(70.0)), 1.0, len(eta))
        e = events(cosine, eta, seed=5)
        got = run(context, e)
        rows = refraction_errors(e, got)
        if difference:
            # The bend itself is only eta - 1 large; it must not drown, so mu's bound is relative to mu.
            theta = as_f32(dot(e["d"], e["n"]))
            body = "mu = refraction_mu(t, eta, sqrt(transmitted_cosine2(t, eta)));"
            mu = glsl_function.evaluate(context.ctx, OPTICS, body, {"t": theta, "eta": e["eta"]}, {"mu": "float"})["mu"]
            omega = np.sqrt((1.0 - e["eta"]) * (1.0 + e["eta"]) + (e["eta"] * theta) ** 2)
            rows["bend mu, relative"] = (np.abs(mu / refraction_mu(theta, e["eta"], omega) - 1.0), 6.0 * EPSILON)
        else:
            rows["change of the ray"] = (
                np.maximum(length(got["refracted"] - e["d"]), length(got["by_s"] - e["dd"])),
                0.0,
            )
        errors, bounds = judged(rows)
        label = f"1 ± {difference:g}" if difference else "1 exactly"
        yield Measurement(difference or 1e-8, label, not_finite(got.values()), errors, bounds)


CASES = (
    Case(
        "tir-margin",
        "The edge of total internal reflection, from both sides",
        "Columns grow as 1/cos² of the refracted ray, and float32 knows cos² to about 10 roundings only. The stable "
        "forms lose no more than that; "
        "where cos² lies within its own rounding the ray may go either way, but stays finite and of unit length, and "
        "hardly any light passes there.",
        "margin to the critical angle (rad)",
        measure_tir_margin,
        steps=5,
    ),
    Case(
        "grazing",
        "Grazing incidence, and receivers seen edge-on",
        "A column lands as 1/cos of the angle on a receiver, and float32 knows that cosine to 1.5 roundings of 1: the "
        "error grows as 1/cos². "
        "Refraction itself is well conditioned when entering.",
        "degrees from grazing",
        measure_grazing,
        steps=4,
    ),
    Case(
        "index-matched",
        "Two media that hardly differ",
        "The textbook's mu = eta (d·n) + cos θt cancels to nothing when eta is near 1; (1−eta)(1+eta)/(cos θt − eta "
        "(d·n)) keeps all digits, "
        "and equal media change nothing, to the last bit.",
        "|eta − 1|",
        measure_index_matched,
        steps=7,
    ),
)
