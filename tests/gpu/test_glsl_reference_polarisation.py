"""lib/polarisation.glsl against coherency matrices in float64: bands' ends and gratings. Chains of interfaces are the
stress case "polarised-chain", in test_stress_cases.py."""

from __future__ import annotations

import numpy as np
import pytest
from reference import polarisation
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

LIBRARY = ["lib/optics.glsl", "lib/polarisation.glsl"]
COUNT = 2000
ROTATE = """
    Polarisation state = Polarisation(across_direction(d), q, u, v);
    vec3 other = cross(d, state.axis);
    vec3 s[3];
    for (int place = 0; place < 3; ++place) s[place] = cos(angle[place]) * state.axis + sin(angle[place]) * other;
    Polarisation seen = in_plane(state, d, s);
"""


def states(rng: np.random.Generator, count: int) -> np.ndarray:
    """Stokes parameters (count, 3) of every degree of polarisation."""
    return as_f32(optics.unit(rng.normal(size=(count, 3))) * rng.uniform(0.0, 0.999, (count, 1)))


def test_axes_are_across(gl) -> None:
    rng = np.random.default_rng(2)
    d = as_f32(optics.unit(np.concatenate([rng.normal(size=(COUNT, 3)), np.eye(3), -np.eye(3)])))
    n = as_f32(optics.unit(rng.normal(size=d.shape)))
    n[:10] = -d[:10]
    body = """
        Polarisation state = unpolarised(d);
        a = state.axis;
        s = incidence_axis(d, n, a);
        q = state.q + state.u + state.v;
    """
    got = evaluate(gl.ctx, LIBRARY, body, {"d": d, "n": n}, {"a": "vec3", "s": "vec3", "q": "vec3"})
    for axis in (got["a"], got["s"]):
        assert np.abs(np.einsum("ij,ij->i", axis, d)).max() < 1e-5
        np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(got["s"][:10], got["a"][:10])
    assert np.abs(np.einsum("ij,ij->i", got["s"], n)).max() < 1e-4
    assert not got["q"].any()


def test_ends_of_a_band_are_counted_from_their_own_planes(gl) -> None:
    """Into three planes and back is nothing; along another direction the angle between them counts about that."""
    rng = np.random.default_rng(8)
    d = as_f32(optics.unit(rng.normal(size=(COUNT, 3))))
    angle = as_f32(rng.uniform(-0.4, 0.4, (COUNT, 3)))
    each = np.stack([states(rng, COUNT) for _ in range(3)], axis=2)
    inputs = {"d": d, "angle": angle} | {name: each[:, i] for i, name in enumerate("quv")}
    body = (
        ROTATE
        + """
        Polarisation back = out_of_plane(seen, d, s), mirrored = out_of_plane(seen, -d, s);
        bq = back.q; bu = back.u; bv = back.v; axis = back.axis; wanted = s[1]; mu = mirrored.u; mq = mirrored.q;
    """
    )
    names = ("bq", "bu", "bv", "axis", "wanted", "mq", "mu")
    got = evaluate(gl.ctx, LIBRARY, body, inputs, dict.fromkeys(names, "vec3"))
    # The anchor's axis, all over the band.
    matrix = polarisation.seen_from(polarisation.coherency(np.moveaxis(each, 1, 2)), angle[:, 1:2])
    _, stokes = polarisation.stokes_of(matrix)
    for i, name in enumerate(("bq", "bu", "bv")):
        np.testing.assert_allclose(got[name], stokes[..., i], atol=2e-6)
    np.testing.assert_allclose(got["axis"], got["wanted"], atol=1e-6)
    apart = angle - angle[:, 1:2]
    matrix = polarisation.seen_from(polarisation.coherency(np.moveaxis(each, 1, 2)), angle)
    _, stokes = polarisation.stokes_of(polarisation.seen_from(matrix, apart))
    np.testing.assert_allclose(got["mq"], stokes[..., 0], atol=2e-6)
    np.testing.assert_allclose(got["mu"], stokes[..., 1], atol=2e-6)


@pytest.mark.parametrize("reflects", [False, True])
def test_a_grating_turns_the_field_with_the_ray(gl, reflects: bool) -> None:
    """About the direction across both rays: what is along that stays, what is across it turns; a mirror's order takes
    the sign of one of them."""
    rng = np.random.default_rng(11)
    d, turned = (as_f32(optics.unit(rng.normal(size=(COUNT, 3)))) for _ in range(2))
    axis = as_f32(optics.unit(np.cross(d, rng.normal(size=d.shape))))
    each = np.stack([states(rng, COUNT) for _ in range(3)], axis=2)
    body = f"""
        Polarisation left = behind_grating(Polarisation(axis, q, u, v), d, turned, {str(reflects).lower()});
        lq = left.q; lu = left.u; lv = left.v; la = left.axis;
    """
    inputs = {"d": d, "turned": turned, "axis": axis} | {name: each[:, i] for i, name in enumerate("quv")}
    got = evaluate(gl.ctx, LIBRARY, body, inputs, dict.fromkeys(("lq", "lu", "lv", "la"), "vec3"))
    s = optics.unit(np.cross(d, turned))
    angle = np.arctan2(np.sum(np.cross(d, axis) * s, axis=1), np.sum(axis * s, axis=1))
    matrix = polarisation.seen_from(polarisation.coherency(np.moveaxis(each, 1, 2)), angle[:, None])
    _, stokes = polarisation.stokes_of(polarisation.after(matrix, -1.0 if reflects else 1.0, 1.0))
    # Rays that are hardly turned have no such direction.
    plain = np.linalg.norm(np.cross(d, turned), axis=1) > 0.01
    for i, name in enumerate(("lq", "lu", "lv")):
        np.testing.assert_allclose(got[name][plain], stokes[plain][..., i], atol=3e-4)
    np.testing.assert_allclose(got["la"][plain], s[plain], atol=1e-4)
