"""lib/crystal.glsl against Berreman's matrix in float64, against Fresnel's equations, and its columns against
differences."""

from __future__ import annotations

import numpy as np
import pytest
from reference import crystals
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

LIBRARY = ["lib/optics.glsl", "lib/polarisation.glsl", "lib/crystal.glsl"]
SHARES = """
    vec4 back, onward;
    vec3 wave = vec3(q, 0.0, sqrt((n_1.x - q) * (n_1.x + q)));
    cross_interface(Uniaxial(axis_1, n_1), Uniaxial(axis_2, n_2), wave, n_1.x, light, back, onward);
    reflected = back;
    transmitted = onward;
"""
NAMES = {"reflected": "vec4", "transmitted": "vec4"}


def interfaces(kind: str, count: int) -> dict[str, np.ndarray]:
    """Random interfaces: axes, indices (n_o, n_e), tangential parts of the wave vector."""
    rng = np.random.default_rng(len(kind))
    axes = [optics.unit(rng.normal(size=(count, 3))) for _ in range(2)]
    n = [np.sort(rng.uniform(1.2, 2.6, (count, 2)), axis=1)[:, :: rng.choice([-1, 1])] for _ in range(2)]
    if kind in ("in", "in from glass"):
        axes[0][:] = 0.0, 0.0, -1.0
        n[0][:] = n[0][:, :1] if "glass" in kind else 1.0
    if kind == "out":
        axes[1][:] = 0.0, 0.0, -1.0
        n[1][:] = 1.0
    if kind == "slight":
        n[0][:, 1] = n[0][:, 0] + 1e-4
        n[1][:] = n[0] + 1e-3
    if kind == "axis in the surface":
        axes[1][:, 2] = 0.0
        axes[1] = optics.unit(axes[1])
    if kind == "axis along the normal":
        axes[1][:] = 0.0, 0.0, 1.0
    q = rng.uniform(0.0, 0.999, count) * n[0].min(axis=1)
    if kind.endswith("the axis"):
        turn = optics.unit(np.stack([q, 0.0 * q, np.sqrt(n[0][:, 0] ** 2 - q**2)], 1))
        axes[0] = optics.unit(
            turn
            + rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-4.0 if "along" in kind else -8.0, -2.0, (count, 1))
        )
    arrays = {"axis_1": axes[0], "axis_2": axes[1], "n_1": n[0], "n_2": n[1], "q": q}
    return {name: as_f32(values) for name, values in arrays.items()}


def of_interface(made: dict[str, np.ndarray], i: int) -> tuple[crystals.Waves, crystals.Waves]:
    """Waves before and behind the i-th."""
    q, media = made["q"][i], ((made["axis_1"][i], *made["n_1"][i]), (made["axis_2"][i], *made["n_2"][i]))
    before, behind = (crystals.waves(crystals.permittivity(*medium), q, medium[1]) for medium in media)
    return before, behind


def both_waves(gl, made: dict[str, np.ndarray]) -> np.ndarray:
    """(count, 4, 2): powers of what goes on by what comes in, on the GPU."""
    found = []
    for wave in range(2):
        light = np.tile(np.eye(4)[wave], (len(made["q"]), 1))
        got = evaluate(gl.ctx, LIBRARY, SHARES, {**made, "light": light}, NAMES)
        found.append(np.concatenate([got["reflected"][:, :2], got["transmitted"][:, :2]], axis=1))
    return np.stack(found, axis=2)


KINDS = ("in", "in from glass", "out", "between", "slight", "axis in the surface", "axis along the normal")


@pytest.mark.parametrize("kind", [*KINDS, "along the axis"])
def test_shares_are_those_of_the_continuous_fields(gl, kind: str) -> None:
    """Every wave that comes in, at random axes, angles and indices, also beyond total reflection. Where both coming in
    are almost one, their sum: which of them is which is rounding's."""
    made = interfaces(kind, 1000)
    found, off = both_waves(gl, made), []
    for i in range(len(found)):
        before, behind = of_interface(made, i)
        if not before.passes[:2].all() or made["n_1"][i].min() - made["q"][i] < 1e-3:
            continue
        shares = np.abs(crystals.amplitudes(before, behind, before.fields[:, :2])) ** 2
        difference = found[i] - shares
        off.append(np.abs(difference.sum(axis=1) if kind == "along the axis" else difference).max())
    assert len(off) > 500
    assert np.median(off) < 1e-6
    assert np.quantile(off, 0.99) < 1e-4


@pytest.mark.parametrize("kind", [*KINDS, "on the axis"])
def test_energy_is_kept(gl, kind: str) -> None:
    """To 1e-5 where no wave before the interface grazes it; what rounding leaves, above all where both evanescent waves
    behind are almost one, an event shares out."""
    made = interfaces(kind, 20000)
    off = np.abs(both_waves(gl, made).sum(axis=1) - 1.0)
    steep = made["n_1"].min(axis=1) - made["q"] > 0.02
    assert np.quantile(off[steep], 0.995) < 1e-5
    assert np.quantile(off[steep], 0.9998) < 1e-3


@pytest.mark.parametrize("kind", ["in", "in from glass"])
def test_polarised_light_is_parted_with_its_phase(gl, kind: str) -> None:
    """Any elliptic state that comes in, and the state that is reflected."""
    rng = np.random.default_rng(8)
    made = interfaces(kind, 1000)
    field = rng.normal(size=(1000, 2)) + 1j * rng.normal(size=(1000, 2))
    field /= np.linalg.norm(field, axis=1, keepdims=True)
    both = field[:, 0] * field[:, 1].conj()
    light = np.stack([np.abs(field[:, 0]) ** 2, np.abs(field[:, 1]) ** 2, both.real, both.imag], axis=1)
    got = evaluate(gl.ctx, LIBRARY, SHARES, {**made, "light": light}, NAMES)
    for i in range(1000):
        before, behind = of_interface(made, i)
        n, q = made["n_1"][i, 0], made["q"][i]
        incident = crystals.plane_polarised(n, q) @ field[i]
        solved = crystals.amplitudes(before, behind, incident[:, None])[:, 0]
        np.testing.assert_allclose(got["transmitted"][i, :2], np.abs(solved[2:]) ** 2, atol=2e-5)
        root = np.sqrt(np.sqrt(n**2 - q**2))
        fields = before.fields[:, 2:] @ solved[:2]
        s, p = fields[1] * root, -fields[3] * root / n
        product = s * np.conj(p)
        wanted = [abs(s) ** 2, abs(p) ** 2, product.real, product.imag]
        np.testing.assert_allclose(got["reflected"][i], wanted, atol=2e-5)


def test_without_birefringence_an_interface_is_fresnels(gl) -> None:
    """n_o = n_e, any axis: to rounding what `fresnel_reflection` has, at every angle, total reflection included."""
    rng = np.random.default_rng(3)
    count = 4000
    n = rng.uniform(1.0, 2.2, (count, 2))
    theta = -(rng.uniform(1e-3, 1.0, count) ** 2)
    field = rng.normal(size=(count, 4))
    made = {"axis_2": optics.unit(rng.normal(size=(count, 3))), "n": n, "theta": theta, "stokes": field[:, :3]}
    made["stokes"] = optics.unit(made["stokes"]) * rng.uniform(0.0, 1.0, (count, 1))
    body = """
        vec3 wave = n.x * vec3(sqrt(1.0 - theta * theta), 0.0, -theta);
        vec4 light = vec4(0.5 + 0.5 * stokes.x, 0.5 - 0.5 * stokes.x, 0.5 * stokes.y, 0.5 * stokes.z), back, onward;
        cross_interface(
            Uniaxial(vec3(0.0, 0.0, -1.0), n.xx), Uniaxial(axis_2, n.yy), wave, n.x, light, back, onward);
        vec3 eta = vec3(n.x / n.y);
        FresnelPair pair = fresnel_reflection(vec3(theta), eta, transmitted_cosine2(vec3(theta), eta));
        Polarisation state = Polarisation(vec3(0.0), stokes.xxx, stokes.yyy, stokes.zzz);
        float share = polarised_share(state, pair).x;
        state = behind_interface(state, pair);
        wanted = vec4(0.5 * share * (1.0 + state.q.x), 0.5 * share * (1.0 - state.q.x), 0.5 * share * state.u.x,
            0.5 * share * state.v.x);
        found = back;
        all = onward.x + onward.y;
    """
    names = {"wanted": "vec4", "found": "vec4", "all": "float"}
    got = evaluate(gl.ctx, LIBRARY, body, {name: as_f32(v) for name, v in made.items()}, names)
    for off in (got["found"] - got["wanted"], got["all"] - (1.0 - got["wanted"][:, :2].sum(axis=1))):
        assert np.abs(off).max() < 2e-5  # next to total reflection
        assert np.quantile(np.abs(off), 0.99) < 1e-6


COLUMN = """
    bool first = modes.x > 0.0, second = modes.y > 0.0;
    Uniaxial before = of_kind(Uniaxial(normalize(axis_1), n_1), first),
             behind = of_kind(Uniaxial(normalize(axis_2), n_2), second);
    vec3 unit = normalize(ray), up = normalize(normal), wave = wave_of_ray(before, unit);
    vec2 part = forward_part(behind, false, wave, length(wave), -up);
    passes = float(part.y == 0.0);
    vec3 turned_wave = wave - (dot(wave, up) + part.x) * up;
    turned = normalize(energy_of_wave(behind, turned_wave));
    vec3 dwave = wave_column(before, of_kind(slopes_1, first), unit, dray);
    dturned = turned_column(behind, of_kind(slopes_2, second), wave, dwave, turned_wave, up, dnormal);
"""


def test_columns_are_derivatives(gl) -> None:
    """Of the ray that goes on, by the ray that comes in, by the normal and by all four indices, against differences of
    the function in float64 that the same ellipsoids give."""
    rng = np.random.default_rng(7)
    count = 4000
    normal = optics.unit(rng.normal(size=(count, 3)))
    ray = optics.unit(-normal + 0.8 * optics.unit(rng.normal(size=(count, 3))))
    dray, dnormal = rng.normal(size=(2, count, 3))
    made = {
        "axis_1": optics.unit(rng.normal(size=(count, 3))),
        "axis_2": optics.unit(rng.normal(size=(count, 3))),
        "n_1": rng.uniform(1.4, 1.8, (count, 2)),
        "n_2": rng.uniform(1.5, 1.9, (count, 2)),
        "ray": ray,
        "normal": normal,
        "dray": dray - ray * np.sum(ray * dray, axis=1, keepdims=True),
        "dnormal": dnormal - normal * np.sum(normal * dnormal, axis=1, keepdims=True),
        "slopes_1": rng.normal(size=(count, 2)),
        "slopes_2": rng.normal(size=(count, 2)),
        "modes": rng.choice([-1.0, 1.0], (count, 2)),
    }
    made = {name: as_f32(values) for name, values in made.items()}
    got = evaluate(gl.ctx, LIBRARY, COLUMN, made, {"passes": "float", "turned": "vec3", "dturned": "vec3"})

    def turned(step: float, i: int) -> np.ndarray:
        media = []
        for side in "12":
            n_o, n_e = made[f"n_{side}"][i] + step * made[f"slopes_{side}"][i]
            media.append(crystals.permittivity(made[f"axis_{side}"][i], n_o, n_e))
        moved = made["ray"][i] + step * made["dray"][i]
        up = optics.unit(made["normal"][i] + step * made["dnormal"][i])
        first, second = made["modes"][i] > 0.0
        return crystals.refracted(media, (first, second), moved / np.linalg.norm(moved), -up)

    off, step = [], 1e-4
    for i in np.flatnonzero(got["passes"])[:400]:
        np.testing.assert_allclose(got["turned"][i], turned(0.0, i), atol=2e-6)
        ahead, back = turned(step, i), turned(-step, i)
        difference = (ahead - back) / (2.0 * step)
        off.append(np.abs(got["dturned"][i] - difference).max() / (1.0 + np.abs(difference).max()))
    assert np.median(off) < 1e-5
    assert np.quantile(off, 0.98) < 1e-3
