"""lib/band.glsl: weights over a band, and where total reflection sets in, against float64."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS
from spectrasplat.gpu.scene_texels import SceneTexels, spectra_texture
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 3000


def test_weights_over_a_band_are_straight_between_its_ends_and_its_anchor(gl) -> None:
    rng = np.random.default_rng(4)
    band = np.sort(rng.random((COUNT, 3)), axis=1)
    band[:200] = band[:200, :1]  # a band without width
    band, weight = as_f32(band), as_f32(rng.random((COUNT, 3)))
    x = as_f32(rng.uniform(-0.2, 1.2, (COUNT, 3)))
    x[200:400] = band[200:400]
    body = "at = band_weights(band, weight, x); near = starts_stay_near(low, high, distance) ? 1u : 0u;"
    low, high = as_f32(0.004 * rng.normal(size=(2, COUNT, 3)))
    distance = as_f32(rng.uniform(0.0, 0.3, COUNT))
    inputs = {"band": band, "weight": weight, "x": x, "low": low, "high": high, "distance": distance}
    got = evaluated(gl, body, inputs, {"at": "vec3", "near": "uint"})
    wide = np.diff(band, axis=1).min(axis=1) > 1e-3
    want = np.array([np.interp(row, b, w) for row, b, w in zip(x[wide], band[wide], weight[wide], strict=True)])
    assert np.abs(got["at"][wide] - want).max() < 1e-6 / 1e-3
    assert np.abs(got["at"][200:400][wide[200:400]] - weight[200:400][wide[200:400]]).max() < 1e-6
    assert np.isfinite(got["at"]).all() and (got["at"] >= 0.0).all() and (got["at"] <= 1.0).all()
    moved = np.maximum(np.linalg.norm(low, axis=1), np.linalg.norm(high, axis=1))
    assert ((got["near"] == 1) == (moved < np.minimum(0.01, 0.1 * distance))).all()
    assert 0.1 < got["near"].mean() < 0.9


SAMPLES = 401


def evaluated(gl, body: str, inputs: dict[str, np.ndarray], outputs: dict[str, str], extra: dict | None = None):
    """In a scene of one glass whose index is the only variable: n of row 0 falls over the spectrum by Cauchy's law."""
    objects = OBJECT.zeros(1)
    objects["stack_bit"] = NONE
    texels, spectra = SceneTexels(gl.ctx, {"OBJECTS": objects}), spectra_texture(gl.ctx, TABLE)
    defines = {**bindings.SCENE_DEFINES, **texels.defines, "SPECTRAL_SAMPLES": SAMPLES, "SPECTRAL_GROUPS": 1}
    defines |= {"INDEX_ROW": 0, "VARIABLE_ROW": 0, "WEIGHT_ROW": 0, "TRIANGLE_COUNT": 0} | (extra or {})
    binders = [texels.bind, lambda: texels.bind_spectra(spectra)]
    try:
        return evaluate(gl.ctx, ["lib/band.glsl"], body, inputs, outputs, defines, SCENE_STRUCTS, binders=binders)
    finally:
        texels.release()
        spectra.release()


_NM = np.linspace(380.0, 780.0, SAMPLES)
TABLE = (1.5 + 5e3 / _NM**2)[None].astype(np.float32)


def row_at(x: np.ndarray) -> np.ndarray:
    return np.interp(x, np.linspace(0.0, 1.0, SAMPLES), TABLE[0])


def test_where_total_reflection_sets_in(gl) -> None:
    """Against the root in float64 of the same table. The cosine squared is known to 1e-7, so x to that over its slope;
    18 halvings of half the spectrum are 2e-6."""
    rng = np.random.default_rng(6)
    band = np.sort(rng.random((COUNT, 3)), axis=1)
    band[: COUNT // 2] = 0.0, 0.5, 1.0
    band = as_f32(band)
    target = as_f32(band[:, 0] + (band[:, 2] - band[:, 0]) * rng.uniform(0.02, 0.98, COUNT))
    n_at = row_at(target)
    theta = as_f32(-np.sqrt(1.0 - 1.0 / n_at**2))  # total from n_at up, were the angle the same for all
    slope = as_f32(rng.uniform(-0.3, 0.3, COUNT))
    straight = as_f32(1e-4 * rng.normal(size=(COUNT, 2)))
    theta = as_f32(theta - slope * (n_at - row_at(band[:, 1])))

    def passing(i: int, x: np.ndarray | float) -> np.ndarray:
        n, n_anchor = (row_at(np.asarray(at)) for at in (x, band[i, 1]))
        low = np.asarray(x) < band[i, 1]
        half = np.where(low, band[i, 1] - band[i, 0], band[i, 2] - band[i, 1])
        reach = (np.asarray(x) - band[i, 1]) / np.maximum(half, 1e-9)
        cosine = theta[i] + slope[i] * (n - n_anchor) + np.abs(reach) * np.where(low, straight[i, 0], straight[i, 1])
        return 1.0 - n**2 * (1.0 - cosine**2)

    passes = np.array([passing(i, band[i]) > 0 for i in range(COUNT)])
    inside = passes.any(axis=1) & ~passes.all(axis=1)
    body = """
    float dtheta[SPECTRAL_GROUPS];
    dtheta[0] = slope;
    MediumInterface boundary = MediumInterface(0u, NONE, MediumStack(0u, NONE), true, false);
    at = total_reflection_onset(band, theta, dtheta, straight, boundary, greaterThan(passes, vec3(0.5)));
    step_ = variable_step(0u, band.x, band.z);
    """
    inputs = {"band": band, "theta": theta, "slope": slope, "straight": straight, "passes": passes.astype(float)}
    got = evaluated(gl, body, inputs, {"at": "float", "step_": "float"})
    steps = row_at(band[:, 0]) - row_at(band[:, 2])
    assert np.abs(got["step_"] - steps).max() < 4e-7
    errors, room = [], []
    for i in np.flatnonzero(inside):
        low, high = band[i, :2] if passes[i, 0] != passes[i, 1] else band[i, 1:]
        if high - low < 1e-3:
            continue
        x = brentq(lambda at, i=i: float(passing(i, at)), low, high, xtol=1e-14)
        errors.append(abs(got["at"][i] - x))
        change = abs(passing(i, min(x + 1e-3, high)) - passing(i, max(x - 1e-3, low))) / 2e-3
        room.append(6e-7 / max(float(change), 1e-3) + 4e-6 * (high - low))
    errors, room = np.array(errors), np.array(room)
    print(f"onset: median error {np.median(errors):.2e}, 95 % {np.quantile(errors, 0.95):.2e}, n {len(errors)}")
    assert len(errors) > 1000 and (errors < 2.0 * room).mean() > 0.99
