"""Single events at their stiffest: the edge of total reflection, grazing rays, media that hardly differ, and polarised
light over many surfaces.

The functions of shaders/lib run over arrays and are compared with float64, which gets the same float32 numbers. Bounds
are running error bounds: every rounding of the formula, worst case, times the condition number of the step behind it.
With u = `EPSILON`, d·n is known to 1.5 u (three products, two sums), and so

    δcos²θt ≤ u [3 |1 − η²| + 5 η² |d·n|]

since (1−η)(1+η) takes three roundings, η²(d·n)² three more, and twice the error of d·n enters. Everything
else follows from |√(c + δ) − √c| ≤ |δ|/√c and from the sizes of a formula's terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...gpu.context import Context
from ...reference import optics, polarised
from ...reference.glasses import D_NM, index
from ...reference.optics import dot, times, unit
from ..case import EPSILON, Held, Measured, case, length, measured
from ..rigs.glsl_function import as_f32, evaluate

Arrays = Mapping[str, np.ndarray]
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
OUTPUTS = {"cosine2": "float", "reflectance": "float"} | dict.fromkeys(
    ("reflected", "refracted", "by_n", "by_s"), "vec3"
)
ROWS = 600
INDICES = (1.0003, *(float(index(name, D_NM)) for name in ("water", "N-BK7", "N-SF11", "diamond")), 4.0)
"""Of the denser medium: from a warm gas to germanium."""


def events(cosine: np.ndarray, eta: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Rays meeting surfaces at cosines (N,) in any direction of space, rounded to float32: d, n, their columns, eta and
    ∂eta/∂n."""
    rng = np.random.default_rng(seed)
    n = unit(rng.normal(size=(len(cosine), 3)))
    along = unit(np.cross(n, rng.normal(size=(len(cosine), 3))))
    d = times(np.sqrt(1.0 - cosine**2), along) - times(cosine, n)
    dd = optics.normalised_derivative(d, rng.normal(size=(len(cosine), 3)))
    dn = optics.normalised_derivative(n, rng.normal(size=(len(cosine), 3)))
    # Entering: the transmitting index varies, -eta/n = -eta²; leaving: the incident one, 1.
    rays = {"d": d, "n": n, "dd": dd, "dn": dn, "eta": eta, "deta": np.where(eta < 1.0, -(eta**2), 1.0)}
    return {name: as_f32(value) for name, value in rays.items()}


def refraction_mu(theta: np.ndarray, eta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """mu of d' = eta d - mu n."""
    return (1.0 - eta) * (1.0 + eta) / (omega - eta * theta)


def exact_cosine2(e: Arrays) -> np.ndarray:
    """cos² of the transmitted angle in float64, of d and n as they are: after rounding they are not quite unit
    vectors."""
    return (1.0 - e["eta"]) * (1.0 + e["eta"]) + (e["eta"] * dot(e["d"], e["n"])) ** 2


def cosine2_bound(e: Arrays) -> np.ndarray:
    """Largest float32 error of cos²θt (see the head of this file)."""
    eta = e["eta"]
    return EPSILON * (3.0 * np.abs((1.0 - eta) * (1.0 + eta)) + 5.0 * eta**2 * np.abs(dot(e["d"], e["n"])))


def refraction_errors(e: Arrays, got: Arrays) -> dict[str, tuple]:
    """Errors beyond the surface.

    Columns are judged where cos² is known to better than a half; closer to the edge they only have to be finite.
    """
    passed = (exact_cosine2(e) > 0.0) & (got["cosine2"] > 0.0)
    e, got = ({name: value[passed] for name, value in rows.items()} for rows in (e, got))
    eta, c, cosine2, of_cosine2 = e["eta"], -dot(e["d"], e["n"]), exact_cosine2(e), cosine2_bound(e)
    omega, least = np.sqrt(cosine2), np.sqrt(np.maximum(cosine2 - of_cosine2, 0.0))
    mu = refraction_mu(-c, eta, omega)
    of_omega = np.minimum(of_cosine2 / omega, np.sqrt(of_cosine2)) + EPSILON * omega
    # mu = (1-eta²) / (omega - eta theta): a quotient's relative error is that of its parts.
    of_mu = np.abs(mu) * ((of_omega + 1.5 * EPSILON * eta) / (omega + eta * c) + 4.0 * EPSILON)
    direction = times(eta, e["d"]) - times(mu, e["n"])
    across, along = (eta * c - omega) / (eta * c + omega), (c - eta * omega) / (c + eta * omega)
    # |∂rs/∂omega| = 2 eta c/(eta c + omega)² and |∂rp/∂omega| = 2 eta c/(c + eta omega)², largest at the least omega
    # there may be.
    slope = 2.0 * eta * c / (eta * c + least) ** 2 + 2.0 * eta * c / (c + eta * least) ** 2
    slope_c = 2.0 * eta * omega / (eta * c + omega) ** 2 + 2.0 * eta * omega / (c + eta * omega) ** 2
    of_reflectance = np.minimum(slope * of_omega, 1.0) + slope_c * 1.5 * EPSILON + 6.0 * EPSILON
    of_length = np.minimum(of_mu, np.sqrt(of_cosine2)) + 8.0 * EPSILON * np.maximum(eta, 1.0)
    known = cosine2 > 2.0 * of_cosine2
    columns = (
        _column_n(e, got["by_n"], omega, of_cosine2 / cosine2),
        _column_s(e, got["by_s"], omega, of_cosine2 / cosine2, of_mu),
    )
    return {
        "direction": (length(got["refracted"] - direction), of_mu + EPSILON * (2.0 * eta + 2.0 * np.abs(mu))),
        "Fresnel R, absolute": (np.abs(got["reflectance"] - 0.5 * (across**2 + along**2)), of_reflectance),
        "length of d'": (np.abs(length(got["refracted"]) - 1.0), of_length),
        **{f"column {name}": (error[known], bound[known]) for name, (error, bound) in zip("ns", columns, strict=True)},
    }


def _column_n(e: Arrays, got: np.ndarray, omega: np.ndarray, relative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both terms lose the relative error of 1/omega; d - theta n and (1-theta)(1+theta) cancel at normal incidence."""
    eta, theta, zero = e["eta"], dot(e["d"], e["n"]), np.zeros_like(e["d"])
    want = optics.refract_column_stable(e["d"], zero, e["n"], zero, eta, e["deta"])
    size = length(e["d"] - times(theta, e["n"])) + eta * (1.0 - theta) * (1.0 + theta) / omega
    bound = np.abs(e["deta"]) * (size * (relative + 8.0 * EPSILON) + EPSILON * (2.5 + 3.0 * eta / omega))
    scale = np.maximum(length(want), 1.0)
    return length(got - want) / scale, bound / scale


def _column_s(
    e: Arrays, got: np.ndarray, omega: np.ndarray, relative: np.ndarray, of_mu: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """omega is twice in eta mu/omega, by mu too; the other terms lose a few roundings of their size."""
    eta, of_d, of_n = e["eta"], length(e["dd"]), length(e["dn"])
    want = optics.refract_column_stable(e["d"], e["dd"], e["n"], e["dn"], eta, np.zeros_like(eta))
    mu = np.abs(refraction_mu(dot(e["d"], e["n"]), eta, omega))
    rest = of_mu * of_n + 4.0 * EPSILON * (eta * of_d + mu * of_n)
    bound = eta * mu / omega * (of_d + of_n) * (2.0 * relative + 12.0 * EPSILON) + rest
    scale = np.maximum(length(want), 1.0)
    return length(got - want) / scale, bound / scale


@case("tir-margin", "margin to the critical angle (rad)", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6))
def tir_margin(context: Context, margins: Sequence[float]) -> Measured:
    """The edge of total internal reflection, from both sides

    Columns grow as 1/cos² of the refracted ray, and float32 knows cos² to about 10 roundings only. The stable forms
    lose no more than that; where cos² is within its own rounding the ray may take either way, but stays finite and of
    unit length, and hardly any light passes there."""
    n = np.repeat(INDICES, ROWS)
    for margin in margins:
        critical = np.arcsin(1.0 / n)
        # A gas has its critical angle at 88.6°: beyond 90° there is nothing.
        sides = [critical - margin, np.minimum(critical + margin, 0.5 * np.pi - 1e-6)]
        e = events(np.cos(np.concatenate(sides)), np.tile(n, 2), seed=1)
        got = evaluate(context.ctx, OPTICS, REFRACT, e, OUTPUTS)
        cosine2, known_to = exact_cosine2(e), cosine2_bound(e)
        # Within its own error the sign of cos² is anyone's; beyond it the side must be right.
        turned_back = (cosine2 > known_to) & (got["cosine2"] <= 0.0)
        let_through = (cosine2 < -known_to) & ((got["cosine2"] > 0.0) | (got["reflectance"] != 1.0))
        held = refraction_errors(e, got) | {
            "cos² of the refracted ray": (np.abs(got["cosine2"] - cosine2), known_to),
            "rays on the wrong side": (turned_back | let_through, 0.0),
            "mirrored direction": (length(got["reflected"] - optics.reflect(e["d"], e["n"])), 6.0 * EPSILON),
        }
        hidden = int(np.count_nonzero(np.abs(cosine2) <= 2.0 * known_to))
        note = f"{hidden} of {len(cosine2)} rays lie within rounding of the edge" if hidden else ""
        yield measured(margin, f"{margin:g} rad", held, got.values(), note)


@case("grazing", "degrees from grazing", (89.0, 89.9, 89.99, 89.999))
def grazing(context: Context, angles_deg: Sequence[float]) -> Measured:
    """Grazing incidence, and receivers seen edge-on

    A column lands as 1/cos of the angle on a receiver, and float32 knows that cosine to 1.5 roundings of 1: the error
    grows as 1/cos². Refraction itself is well conditioned when entering."""
    n = np.repeat(INDICES, ROWS)
    for angle_deg in angles_deg:
        e = events(np.full(len(n), np.cos(np.radians(angle_deg))), 1.0 / n, seed=2)
        got = evaluate(context.ctx, OPTICS, REFRACT, e, OUTPUTS)
        rng = np.random.default_rng(3)
        dp, t = as_f32(rng.normal(size=e["d"].shape)), as_f32(rng.uniform(0.0, 3.0, len(n)))
        body, rays = "moved = transfer_column(dp, dd, d, n, t);", {name: e[name] for name in ("dd", "d", "n")}
        moved = evaluate(context.ctx, OPTICS, body, {"dp": dp, "t": t, **rays}, {"moved": "vec3"})["moved"]
        want = optics.transfer_column(dp, e["dd"], e["d"], e["n"], t)
        # (q·N)/(d·N) d: the quotient loses the 1.5 u of d·N over cos, its numerator 2 u over cos.
        cosine, size = np.abs(dot(e["d"], e["n"])), length(dp) + t * length(e["dd"])
        quotient = 1.5 * np.abs(dot(dp + times(t, e["dd"]), e["n"])) / cosine**2 / (1.0 - 1.5 * EPSILON / cosine)
        bound, scale = EPSILON * (quotient + size * (4.0 / cosine + 2.0)), np.maximum(length(want), 1.0)
        held = refraction_errors(e, got) | {"column on a receiver": (length(moved - want) / scale, bound / scale)}
        yield measured(90.0 - angle_deg, f"{angle_deg:g}°", held, [*got.values(), moved])


@case("index-matched", "|eta − 1|", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0))
def index_matched(context: Context, differences: Sequence[float]) -> Measured:
    """Two media that hardly differ

    The textbook's mu = eta (d·n) + cos θt cancels to nothing when eta is near 1; (1−eta)(1+eta)/(cos θt − eta (d·n))
    keeps all digits, and equal media change nothing, to the last bit."""
    for difference in differences:
        eta = np.repeat([1.0 - difference, 1.0 + difference], 4 * ROWS)
        # Incidence at up to 70°: at 1 + 1e-2 the critical angle is 81.9°.
        cosine = np.random.default_rng(4).uniform(np.cos(np.radians(70.0)), 1.0, len(eta))
        e = events(cosine, eta, seed=5)
        got = evaluate(context.ctx, OPTICS, REFRACT, e, OUTPUTS)
        held = refraction_errors(e, got)
        if difference:
            # The bend itself is only eta - 1 large; it must not drown, so mu's bound is relative to mu.
            theta, eta = as_f32(dot(e["d"], e["n"])), e["eta"]
            body = "mu = refraction_mu(t, eta, sqrt(transmitted_cosine2(t, eta)));"
            mu = evaluate(context.ctx, OPTICS, body, {"t": theta, "eta": eta}, {"mu": "float"})["mu"]
            omega = np.sqrt((1.0 - eta) * (1.0 + eta) + (eta * theta) ** 2)
            held["bend mu, relative"] = (np.abs(mu / refraction_mu(theta, eta, omega) - 1.0), 6.0 * EPSILON)
        else:
            changes = length(got["refracted"] - e["d"]), length(got["by_s"] - e["dd"])
            held["change of the ray"] = (np.maximum(*changes), 0.0)
        label = f"1 ± {difference:g}" if difference else "1 exactly"
        yield measured(difference or 1e-8, label, held, got.values())


# ---- polarised light -------------------------------------------------------------------------

CHAINS = 100
CHAIN_N = 1.7
BINDING = 0
FOLLOW_CHAIN = """
    Polarisation state = unpolarised(chain[row * EVENTS * 3u].xyz);
    float power = scale;
    for (uint k = 0u; k < EVENTS; ++k) {
        uint at = (row * EVENTS + k) * 3u;
        vec3 d = chain[at].xyz, n = chain[at + 1u].xyz, turned = chain[at + 2u].xyz;
        vec3 theta = vec3(chain[at].w), eta = vec3(chain[at + 1u].w);
        FresnelPair pair = fresnel_reflection(theta, eta, transmitted_cosine2(theta, eta));
        if (chain[at + 2u].w == 0.0) pair = fresnel_transmission(pair);
        vec3 axis = incidence_axis(d, n, state.axis), s[3] = vec3[](axis, axis, axis);
        Polarisation seen = in_plane(state, d, s);
        power *= polarised_share(seen, pair).y;
        state = out_of_plane(behind_interface(seen, pair), turned, s);
    }
    left = power;
    stokes = vec3(state.q.y, state.u.y, state.v.y);
    axis_left = state.axis;
"""


def chains(events: int, seed: int) -> np.ndarray:
    """(CHAINS, events, 3, 4): direction and d·n, normal and eta, direction after and whether it is a reflection."""
    rng = np.random.default_rng(seed)
    found = np.zeros((CHAINS, events, 3, 4))
    for row in range(CHAINS):
        d = unit(rng.normal(size=3))
        for k in range(events):
            cosine = rng.uniform(0.08, 0.98)
            n = np.sqrt(1.0 - cosine**2) * unit(np.cross(d, rng.normal(size=3))) - cosine * d
            eta = rng.choice([1.0 / CHAIN_N, CHAIN_N])
            cosine2 = 1.0 - eta**2 * (1.0 - cosine**2)
            reflects = cosine2 <= 1e-3 or rng.random() < 0.3
            turned = d + 2.0 * cosine * n if reflects else eta * d + (eta * cosine - np.sqrt(cosine2)) * n
            found[row, k, 0], found[row, k, 1] = (*d, -cosine), (*n, eta)
            d = unit(turned)
            found[row, k, 2] = (*d, float(reflects))
    return as_f32(found)


def exact_polarisation(chain: np.ndarray) -> tuple[float, np.ndarray, float, float]:
    """(share that is left, fields (2, 3), bounds of the state's error and of the share's, relative) of one chain
    (events, 3, 4).

    With m the larger of an event's shares of s and p and w the share that goes on, an error of the state grows by m / w
    at each event (what is left of it is made 1 again), and an event adds u (4 m / w + 2 / sin² θ): its own roundings,
    and those of the plane of incidence, whose s is d × n over its length.
    """
    field = np.zeros((2, 3), complex)
    polarised.begin_unpolarised(field, tuple(unit(chain[0, 0, :3])))
    left, of_state, of_share = 1.0, 0.0, 0.0
    for (*d, theta), (*n, eta), (*after, reflects) in chain:
        d, after = unit(np.array(d)), unit(np.array(after))
        r_s, r_p, t_s, t_p = polarised.amplitudes(-theta, eta)
        a_s, a_p = (complex(r_s), complex(r_p)) if reflects else (complex(t_s), complex(t_p))
        s = polarised.senkrecht(tuple(d), tuple(n))
        share = polarised.share_of(field, tuple(d), s, a_s, a_p)
        polarised.turn_fields(field, tuple(d), tuple(after), s, a_s, a_p)
        left *= share
        sizes = abs(a_s) ** 2, abs(a_p) ** 2
        of_state += 2.0 * EPSILON / (1.0 - theta**2)
        of_share += (abs(sizes[0] - sizes[1]) * of_state + 4.0 * EPSILON * max(sizes)) / share
        of_state = (of_state + 4.0 * EPSILON) * max(sizes) / share
    return left, field, of_state, of_share


def stokes_of(field: np.ndarray, direction: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """q, u, v of fields (2, 3) from an axis."""
    along, across = field @ axis, field @ np.cross(direction, axis)
    product = 2.0 * np.sum(along * across.conj())
    return np.array([np.sum(np.abs(along) ** 2 - np.abs(across) ** 2), product.real, product.imag])


@case("polarised-chain", "surfaces met", (1, 4, 16, 64))
def polarised_chain(context: Context, counts: Sequence[int]) -> Measured:
    """Polarised light that meets many surfaces, whose planes of incidence turn at random

    A state is made 1 again after every event, so rounding's error grows where little light remains: reflection near
    Brewster's angle of light that swings in the plane of incidence. Rotations into planes of incidence, total
    reflection's phases and the axis that states count from must not drift over many events."""
    includes = ["lib/optics.glsl", "lib/polarisation.glsl"]
    outputs = {"left": "float", "stokes": "vec3", "axis_left": "vec3"}
    buffer = f"layout(std430, binding = {BINDING}) readonly buffer Chains {{ vec4 chain[]; }};"
    for count in counts:
        chain = chains(count, seed=count)
        left, fields, of_state, of_share = (
            np.array(values) for values in zip(*(exact_polarisation(one) for one in chain), strict=True)
        )
        got = evaluate(
            context.ctx,
            includes,
            FOLLOW_CHAIN,
            {"scale": 1.0 / left},
            outputs,
            {"EVENTS": f"{count}u"},
            buffers={BINDING: chain.astype(np.float32)},
            declarations=buffer,
        )
        ends = zip(fields, chain[:, -1, 2, :3], got["axis_left"], strict=True)
        stokes = np.array([stokes_of(field, direction, axis) for field, direction, axis in ends])
        held: Held = {
            # No state is off by more than all of it.
            "state": (np.abs(got["stokes"] - stokes).max(axis=1), np.minimum(of_state, 2.0)),
            "share": (np.abs(got["left"] - 1.0), of_share),
        }
        yield measured(count, f"{count} surfaces", held, got.values())
