"""Functions of shaders/lib/optics.glsl against their float64 references, on ordinary input. Media that hardly differ,
grazing incidence and the edge of total reflection: the stress cases of `app/stress/cases/optics.py`, in
test_stress_cases.py."""

from __future__ import annotations

import numpy as np
import pytest
from reference.surfaces import shading_normal_column
from reference.textbook_optics import fresnel_reflectance, refract_column_textbook
from spectrasplat.reference import optics
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM, index
from spectrasplat.reference.optics import dot, times
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

OPTICS = ["lib/optics.glsl"]
COUNT = 4096
EPSILON = float(np.finfo(np.float32).eps)

REFRACT = """
    float theta = dot(d, n);
    float cosine2 = transmitted_cosine2(theta, eta);
    float omega = sqrt(cosine2);
    out_d = refract_direction(d, n, theta, eta, omega);
    out_dd = refract_column(d, dd, n, dn, theta, eta, omega, deta);
"""


def events(count: int = COUNT, seed: int = 1, cosine: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Rays meeting surfaces, rounded to float32: unit d and n with d·n < 0, tangent columns."""
    rng = np.random.default_rng(seed)
    n = optics.unit(rng.normal(size=(count, 3)))
    along = optics.unit(np.cross(n, rng.normal(size=(count, 3))))
    cosine = rng.uniform(0.05, 1.0, count) if cosine is None else cosine
    d = times(np.sqrt(1 - cosine**2), along) - times(cosine, n)
    dd = optics.normalised_derivative(d, rng.normal(size=(count, 3)))
    dn = optics.normalised_derivative(n, rng.normal(size=(count, 3)))
    return {name: as_f32(value) for name, value in {"d": d, "n": n, "dd": dd, "dn": dn}.items()}


def relative_error(got: np.ndarray, want: np.ndarray, scale: np.ndarray | float = 0.0) -> np.ndarray:
    """|got - want| over the larger of |want| and `scale`, per row."""
    if want.ndim == 1:
        return np.abs(got - want) / np.maximum(np.abs(want), scale)
    return np.linalg.norm(got - want, axis=-1) / np.maximum(np.linalg.norm(want, axis=-1), scale)


def cpu_reference_refraction(
    e: dict[str, np.ndarray], eta: np.ndarray, deta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What float64 makes of the same float32 numbers. The rounded d and n are not quite unit vectors,
    which every formula treats in its own way: compare with the one that states the same algebra."""
    theta = dot(e["d"], e["n"])
    omega = np.sqrt((1 - eta) * (1 + eta) + (eta * theta) ** 2)
    mu = (1 - eta) * (1 + eta) / (omega - eta * theta)
    column = optics.refract_column_stable(e["d"], e["dd"], e["n"], e["dn"], eta, deta)
    return times(eta, e["d"]) - times(mu, e["n"]), column


@pytest.mark.parametrize(("low", "high"), [(0.4, 1.0), (1.0, 2.4)], ids=["entering", "leaving"])
def test_refraction_away_from_hazards(gl, low: float, high: float) -> None:
    rng = np.random.default_rng(4)
    eta = as_f32(rng.uniform(low, high, COUNT))
    deta = as_f32(rng.normal(size=COUNT))
    cosine = np.sqrt(1 - (rng.uniform(0, 0.95, COUNT) * np.minimum(1, 1 / eta)) ** 2)
    e = events(cosine=cosine)
    got = evaluate(gl.ctx, OPTICS, REFRACT, {**e, "eta": eta, "deta": deta}, {"out_d": "vec3", "out_dd": "vec3"})
    want_d, want_dd = cpu_reference_refraction(e, eta, deta)
    assert relative_error(got["out_d"], want_d).max() < 1e-6
    assert relative_error(got["out_dd"], want_dd, scale=1.0).max() < 5e-6
    # Against the CPU reference that knows neither theta nor mu, unit vectors made exact first.
    exact_d, exact_n = optics.unit(e["d"]), optics.unit(e["n"])
    assert relative_error(got["out_d"], optics.refract(exact_d, exact_n, eta)).max() < 2e-6
    textbook = refract_column_textbook(exact_d, e["dd"], exact_n, e["dn"], eta, deta)
    assert relative_error(got["out_dd"], textbook, scale=1.0).max() < 2e-5


def test_reflection(gl) -> None:
    e = events()
    body = "float t = dot(d, n); out_d = reflect_direction(d, n, t); out_dd = reflect_column(d, dd, n, dn, t);"
    got = evaluate(gl.ctx, OPTICS, body, e, {"out_d": "vec3", "out_dd": "vec3"})
    assert relative_error(got["out_d"], optics.reflect(e["d"], e["n"])).max() < 5e-7
    assert (
        relative_error(got["out_dd"], optics.reflect_column(*(e[k] for k in ("d", "dd", "n", "dn"))), scale=1.0).max()
        < 1e-6
    )


def test_facet_normals_of_slivers_round_like_both_products(gl) -> None:
    """Bit for bit that of float32 products, rounded before their difference: of parallel edges nothing is left."""
    rng = np.random.default_rng(11)
    edge1 = as_f32(rng.normal(size=(COUNT, 3)))
    edge2 = edge1 * as_f32(rng.choice([0.25, 0.5, 2.0], (COUNT, 1)))  # exact multiples
    edge2[::2] += as_f32(1e-6 * rng.normal(size=(COUNT // 2, 3)))
    got = evaluate(gl.ctx, OPTICS, "n = facet_normal(e1, e2);", {"e1": edge1, "e2": edge2}, {"n": "vec3"})["n"]
    a, b = edge1.astype(np.float32), edge2.astype(np.float32)
    want = a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
    assert not got[1::2].any() and want[::2].any()
    np.testing.assert_array_equal(got, want)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_interpolated_normals(gl, scale: float) -> None:
    rng = np.random.default_rng(8)
    triangles = as_f32(scale * rng.normal(size=(512, 3, 3)))
    quality = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=-1)
    triangles = triangles[quality > 0.3 * scale**2]
    normals = as_f32(optics.unit(rng.normal(0, 0.3, (len(triangles), 3, 3)) + [0, 0, 1]))
    weights = rng.dirichlet([1, 1, 1], len(triangles))
    point = np.einsum("tc,tcx->tx", weights, triangles)
    dp = as_f32(np.einsum("tc,tcx->tx", rng.normal(size=(len(triangles), 2)), triangles[:, 1:] - triangles[:, :1]))
    body = """
    vec3 gu, gv;
    barycentric_gradients(e1, e2, gu, gv);
    vec3 summed = weight.x * n0 + weight.y * n1 + weight.z * n2;
    vec3 dsummed = dot(gu, dp) * (n1 - n0) + dot(gv, dp) * (n2 - n0);
    dn = normalised_derivative(summed, dsummed);
    """
    inputs = {
        "e1": as_f32(triangles[:, 1] - triangles[:, 0]),
        "e2": as_f32(triangles[:, 2] - triangles[:, 0]),
        "weight": weights,
        "dp": dp,
        **{f"n{c}": normals[:, c] for c in range(3)},
    }
    got = evaluate(gl.ctx, OPTICS, body, inputs, {"dn": "vec3"})["dn"]
    want = np.array(
        [shading_normal_column(t, n, p, q)[1] for t, n, p, q in zip(triangles, normals, point, dp, strict=True)]
    )
    assert np.median(np.linalg.norm(want, axis=-1)) > 0.1
    assert relative_error(got, want, scale=1.0).max() < 1e-5


def test_fresnel_scalar_and_per_wavelength(gl) -> None:
    rng = np.random.default_rng(9)
    cosine = rng.uniform(0.0, 1.0, COUNT)
    eta = np.stack([index("N-BK7", nm) / np.ones(COUNT) for nm in (F_NM, D_NM, C_NM)], -1)
    eta[::2] = 1 / eta[::2]
    eta, e = as_f32(eta), events(cosine=cosine)
    # Grid points on the edge of total reflection are the other test's.
    clear = np.abs(1 - eta**2 * (1 - dot(e["d"], e["n"])[:, None] ** 2)).min(-1) > 1e-4
    e = {name: value[clear] for name, value in e.items()}
    eta = eta[clear]
    body = """
    float theta = dot(d, n);
    scalar = fresnel_reflectance(theta, eta.y, transmitted_cosine2(theta, eta.y));
    three = fresnel_reflectance(vec3(theta), eta, transmitted_cosine2(vec3(theta), eta));
    """
    got = evaluate(gl.ctx, OPTICS, body, {**e, "eta": eta}, {"scalar": "float", "three": "vec3"})
    want = np.stack([fresnel_reflectance(e["d"], e["n"], eta[:, c]) for c in range(3)], -1)
    assert (want == 1).any() and (want < 0.05).any()
    assert np.abs(got["three"] - want).max() < 3e-5
    assert np.median(np.abs(got["three"] - want)) < 1e-7
    np.testing.assert_allclose(got["scalar"], got["three"][:, 1], atol=1e-6)
    # Known answers (T16).
    angles = np.radians([0, 45, 60, 75])
    d = np.stack([np.sin(angles), -np.cos(angles), 0 * angles], -1)
    n = np.tile([0.0, 1.0, 0.0], (4, 1))
    bk7 = np.full((4, 3), 1 / float(index("N-BK7", D_NM)))
    known = evaluate(gl.ctx, OPTICS, body, {"d": d, "n": n, "eta": bk7}, {"scalar": "float", "three": "vec3"})["scalar"]
    np.testing.assert_allclose(known, [0.042165, 0.052595, 0.091958, 0.256144], atol=1e-6)


def test_numbers_are_told_by_their_bits(gl) -> None:
    bits = np.array(
        [0, 1, 0x7F7FFFFF, 0x7F800000, 0x7F800001, 0x7FC00000, 0x7FFFFFFF, 0x3F800000, 0x3F7FFFFF], np.uint32
    )
    bits = np.concatenate([bits, bits | np.uint32(0x80000000)])
    body = (
        "float v = uintBitsToFloat(b); finite = uint(is_finite(v)); three = uint(is_finite3(vec3(0.0, v, 1.0)));"
        "within = uint(is_within(v, 1.0)); two = uint(is_within2(vec2(0.0, v), 1.0));"
    )
    outputs = dict.fromkeys(("finite", "three", "within", "two"), "uint")
    got = evaluate(gl.ctx, ["lib/finite.glsl"], body, {"b": bits}, outputs)
    with np.errstate(invalid="ignore"):
        values = bits.view(np.float32)
        finite, within = np.isfinite(values), np.abs(values) < 1.0
    for name, expected in (("finite", finite), ("three", finite), ("within", within), ("two", within)):
        np.testing.assert_array_equal(got[name], expected, name)
