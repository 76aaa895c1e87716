"""lib/interface.glsl and lib/band.glsl, which light pass, camera pass and ray queries share, against CPU references."""

from __future__ import annotations

import numpy as np
import pytest
from reference import interface, medium
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS, TRIANGLE
from spectrasplat.gpu.scene_texels import SceneTexels, spectra_texture
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COVERS = {
    "interface.glsl": (
        "shading_frame",
        "summed_change",
        "normal_column",
        "normal_beside",
        "reflect_at",
        "refract_at",
        "reflected_column",
        "refracted_column",
        "surface_point",
    ),
    "band.glsl": ("band_weights", "band_polarisation", "starts_stay_near", "variable_step", "total_reflection_onset"),
    "random.glsl": ("depth_generator",),
}
COUNT = 3000


class Facets:
    """Facets met from both sides, two of three with corners' normals that mislead at grazing incidence."""

    def __init__(self) -> None:
        rng = np.random.default_rng(8)
        self.records = TRIANGLE.zeros(COUNT)
        for name in ("vertex", "edge1", "edge2"):
            self.records[name] = rng.normal(size=(COUNT, 3))
        self.smooth = np.arange(COUNT) % 3 > 0
        self.records["normals"] = np.where(self.smooth, 3 * np.arange(COUNT), NONE)
        self.normal_g = as_f32(
            optics.unit(np.cross(self.records["edge1"].astype(float), self.records["edge2"].astype(float)))
        )
        self.corners = as_f32(optics.unit(self.normal_g[:, None] + 0.4 * rng.normal(size=(COUNT, 3, 3))))
        self.normals = np.zeros((3 * COUNT, 4), np.float32)
        self.normals[:, :3] = self.corners.reshape(-1, 3)
        self.inputs = {
            "d": as_f32(optics.unit(rng.normal(size=(COUNT, 3)))),
            "n_g": self.normal_g,
            "bary": as_f32(rng.uniform(0.05, 0.45, (COUNT, 2))),
            "eta": as_f32(rng.choice([1 / 1.6, 1.6, 1.0], COUNT)),
            "slot": np.arange(COUNT, dtype=np.uint32),
            "dd": as_f32(0.3 * rng.normal(size=(COUNT, 3))),
            # A position derivative lies in the facet's plane.
            "dp": as_f32(
                rng.normal(size=(COUNT, 1)) * self.records["edge1"]
                + rng.normal(size=(COUNT, 1)) * self.records["edge2"]
            ),
        }

    def evaluate(self, gl, body: str, outputs: dict[str, str]) -> dict[str, np.ndarray]:
        texels = SceneTexels(gl.ctx, {"TRIANGLES": self.records, "NORMALS": self.normals, "OBJECTS": OBJECT.zeros(1)})
        defines = {**bindings.SCENE_DEFINES, **texels.defines, "TRIANGLE_COUNT": COUNT, "SPECTRAL_SAMPLES": 2}
        defines |= dict.fromkeys(("LOOSE_TRIANGLES", "SMOOTH_NORMALS", "NORMAL_DERIVATIVES"), 1)
        start = "Hit hit = Hit(1.0, slot, 0u, n_g, bary); Triangle facet = hit_triangle(hit);"
        start += "ShadingFrame frame = shading_frame(hit, facet, vec3(0.0), d);"
        try:
            return evaluate(
                gl.ctx,
                ["lib/interface.glsl"],
                start + body,
                self.inputs,
                outputs,
                defines,
                SCENE_STRUCTS,
                binders=[texels.bind],
            )
        finally:
            texels.release()

    def frames(self) -> list[interface.Frame]:
        rows = zip(self.inputs["d"], self.normal_g, self.corners, self.inputs["bary"], self.smooth, strict=True)
        return [interface.shading_frame(d, n, corners if s else None, bary) for d, n, corners, bary, s in rows]


@pytest.fixture(scope="module")
def facets() -> Facets:
    return Facets()


def test_frames_and_directions(gl, facets: Facets) -> None:
    body = """
    facing = frame.normal_g;
    shading = frame.normal;
    is_ = frame.interpolated + 2u * frame.refused;
    Deflection back = reflect_at(frame, d), on = refract_at(frame, d, eta);
    mirrored = back.direction;
    bent = on.direction;
    judged = (back.geometric ? 1u : 0u) + (on.geometric ? 2u : 0u) + (on.exists ? 4u : 0u);
    place = surface_point(hit, facet, vec3(0.0), d);
    """
    vectors = ("facing", "shading", "mirrored", "bent", "place")
    got = facets.evaluate(gl, body, dict.fromkeys(vectors, "vec3") | {"is_": "uint", "judged": "uint"})
    frames, d, eta = facets.frames(), facets.inputs["d"], facets.inputs["eta"]
    np.testing.assert_array_equal(got["is_"], [f.interpolated + 2 * f.refused for f in frames])
    assert got["facing"] == pytest.approx(np.array([f.normal_g for f in frames]), abs=1e-6)
    assert got["shading"] == pytest.approx(np.array([f.normal for f in frames]), abs=1e-5)
    back = [interface.reflected(f, row) for f, row in zip(frames, d, strict=True)]
    on = [interface.refracted(f, row, float(e)) for f, row, e in zip(frames, d, eta, strict=True)]
    by_facet = np.array([n is f.normal_g for (_, n), f in zip(back, frames, strict=True)])
    seam = np.abs([optics.reflect(row, f.normal) @ f.normal_g for f, row in zip(frames, d, strict=True)]) < 1e-3
    assert got["mirrored"][~seam] == pytest.approx(np.array([t for t, _ in back])[~seam], abs=1e-5)
    np.testing.assert_array_equal((got["judged"] & 1)[~seam] == 1, by_facet[~seam])
    exists = np.array([t is not None for t in on])
    cosine2 = [
        min(abs(float(optics.transmitted_cosine2(row, n, e))) for n in (f.normal, f.normal_g))
        for f, row, e in zip(frames, d, eta, strict=True)
    ]
    clear = np.array(cosine2) > 1e-3
    np.testing.assert_array_equal((got["judged"] & 4)[clear] == 4, exists[clear])
    want = np.array([np.zeros(3) if t is None else t[0] for t in on])
    close = np.linalg.norm(got["bent"] - want, axis=1) < 2e-4
    assert close[clear & exists].mean() > 0.998  # at the seam between the two normals either may win
    refused = sum(f.refused for f in frames)
    assert by_facet.sum() > 50 and (~exists).sum() > 100 and refused > 50
    at = facets.records["vertex"] + facets.inputs["bary"][:, :1] * facets.records["edge1"]
    assert got["place"] == pytest.approx(at + facets.inputs["bary"][:, 1:] * facets.records["edge2"], abs=1e-5)


def test_columns_of_a_turned_ray(gl, facets: Facets) -> None:
    body = """
    dnormal = normal_column(frame, dp);
    moved = normal_beside(frame, 0.1 * dp);
    changed = summed_change(frame, dp);
    Deflection back = reflect_at(frame, d), on = refract_at(frame, d, eta);
    mirrored = reflected_column(back, d, dd, dnormal);
    bent = refracted_column(on, d, dd, dnormal, eta, 0.7);
    by_facet = (back.geometric ? 1u : 0u) + (on.geometric ? 2u : 0u) + (on.exists ? 4u : 0u);
    """
    vectors = ("dnormal", "moved", "changed", "mirrored", "bent")
    got = facets.evaluate(gl, body, dict.fromkeys(vectors, "vec3") | {"by_facet": "uint"})
    frames, checked, bent = facets.frames(), 0, 0
    for i, frame in enumerate(frames[:1500]):
        row = {name: values[i] for name, values in facets.inputs.items()}
        dnormal = np.zeros(3)
        triangle = facets.records[i]
        corners = np.array([triangle["vertex"]] * 3, float)
        corners[1] += triangle["edge1"]
        corners[2] += triangle["edge2"]
        if frame.interpolated:
            side = 1.0 if row["d"] @ row["n_g"] < 0 else -1.0
            point = corners[0] + row["bary"] @ (corners[1:] - corners[0])
            normals = side * facets.corners[i]
            _, dnormal = optics.shading_normal_column(corners, normals, point, row["dp"])
            beside, _ = optics.shading_normal_column(corners, normals, point + 0.1 * row["dp"], row["dp"])
            scale = 1.0 + np.linalg.norm(dnormal)
            flat = np.linalg.norm(np.cross(triangle["edge1"], triangle["edge2"])) < 0.3
            assert flat or np.abs(got["dnormal"][i] - dnormal).max() < 1e-4 * scale
            assert flat or np.abs(got["moved"][i] - beside).max() < 1e-4 * scale
            checked += 1
        else:
            assert (got["dnormal"][i] == 0).all() and np.abs(got["moved"][i] - frame.normal).max() < 1e-6
        # Given the normal's derivative that the shader found: its error is judged above.
        dnormal = got["dnormal"][i]
        _, normal = interface.reflected(frame, row["d"])
        judged = normal is frame.normal_g and frame.interpolated
        if frame.interpolated and judged != bool(got["by_facet"][i] & 1):
            continue
        used = np.zeros(3) if normal is frame.normal_g else dnormal
        want = optics.reflect_column(row["d"], row["dd"], normal, used)
        assert np.abs(got["mirrored"][i] - want).max() < 1e-5 * (1.0 + np.linalg.norm(want))
        found = interface.refracted(frame, row["d"], float(row["eta"]))
        if found is None or not got["by_facet"][i] & 4:
            continue
        normal = found[1]
        if frame.interpolated and (normal is frame.normal_g) != bool(got["by_facet"][i] & 2):
            continue
        if optics.transmitted_cosine2(row["d"], normal, row["eta"]) < 0.01:
            continue
        used = np.zeros(3) if normal is frame.normal_g else dnormal
        want = optics.refract_column_textbook(row["d"], row["dd"], normal, used, row["eta"], 0.7)
        assert np.abs(got["bent"][i] - want).max() < 1e-4 * (1.0 + np.linalg.norm(want))
        bent += 1
    assert checked > 500 and bent > 800


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


def test_polarisation_over_a_band_goes_with_its_power(gl) -> None:
    rng = np.random.default_rng(9)
    band = as_f32(0.3 * np.sort(rng.random((COUNT, 3)), axis=1) + np.array([0.0, 0.1, 0.2]))
    x = as_f32(band[:, :1] + (band[:, 2:] - band[:, :1]) * rng.random((COUNT, 3)))
    weight, q, u, v = as_f32(rng.uniform(0.1, 1.0, (4, COUNT, 3)))
    body = """
        Polarisation part = band_polarisation(Polarisation(vec3(1.0, 0.0, 0.0), q, u, v), band, weight, x);
        pq = part.q; pu = part.u; pv = part.v;
    """
    inputs = {"band": band, "x": x, "weight": weight, "q": q, "u": u, "v": v}
    got = evaluated(gl, body, inputs, {"pq": "vec3", "pu": "vec3", "pv": "vec3"}, {"POLARISED": 1})
    for name, each in (("pq", q), ("pu", u), ("pv", v)):
        rows = zip(x, band, weight, each, strict=True)
        want = np.array([np.interp(at, b, w * e) / np.interp(at, b, w) for at, b, w, e in rows])
        assert np.abs(got[name] - want).max() < 5e-5


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


def test_where_total_reflection_sets_in(gl) -> None:
    """Against the root in float64 of the same table. The cosine squared is known to 1e-7, so x to that over its slope;
    18 halvings of half the spectrum are 2e-6."""
    rng = np.random.default_rng(6)
    band = np.sort(rng.random((COUNT, 3)), axis=1)
    band[: COUNT // 2] = 0.0, 0.5, 1.0
    band = as_f32(band)
    target = as_f32(band[:, 0] + (band[:, 2] - band[:, 0]) * rng.uniform(0.02, 0.98, COUNT))
    n_at = medium.linear_row(TABLE[0], target)
    theta = as_f32(-np.sqrt(1.0 - 1.0 / n_at**2))  # total from n_at up, were the angle the same for all
    slope = as_f32(rng.uniform(-0.3, 0.3, COUNT))
    straight = as_f32(1e-4 * rng.normal(size=(COUNT, 2)))
    theta = as_f32(theta - slope * (n_at - medium.linear_row(TABLE[0], band[:, 1])))

    def passing(i: int, x: np.ndarray | float) -> np.ndarray:
        n, n_anchor = (medium.linear_row(TABLE[0], np.asarray(at)) for at in (x, band[i, 1]))
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
    MediumInterface boundary = MediumInterface(0u, NONE, MediumStack(0u, NONE), true);
    at = total_reflection_onset(band, theta, dtheta, straight, boundary, greaterThan(passes, vec3(0.5)));
    step_ = variable_step(0u, band.x, band.z);
    """
    inputs = {"band": band, "theta": theta, "slope": slope, "straight": straight, "passes": passes.astype(float)}
    got = evaluated(gl, body, inputs, {"at": "float", "step_": "float"})
    steps = medium.linear_row(TABLE[0], band[:, 0]) - medium.linear_row(TABLE[0], band[:, 2])
    assert np.abs(got["step_"] - steps).max() < 4e-7
    errors, room = [], []
    for i in np.flatnonzero(inside):
        low, high = band[i, :2] if passes[i, 0] != passes[i, 1] else band[i, 1:]
        if high - low < 1e-3:
            continue
        x = interface.onset(lambda at, i=i: float(passing(i, at)), low, high)
        errors.append(abs(got["at"][i] - x))
        change = abs(passing(i, min(x + 1e-3, high)) - passing(i, max(x - 1e-3, low))) / 2e-3
        room.append(6e-7 / max(float(change), 1e-3) + 4e-6 * (high - low))
    errors, room = np.array(errors), np.array(room)
    print(f"onset: median error {np.median(errors):.2e}, 95 % {np.quantile(errors, 0.95):.2e}, n {len(errors)}")
    assert len(errors) > 1000 and (errors < 2.0 * room).mean() > 0.99


def test_irrationals_of_the_depths(gl) -> None:
    """The first eight are the fractional parts of square roots of primes, the rest are odd."""
    depth = np.arange(64, dtype=np.uint32)
    got = evaluate(gl.ctx, ["lib/random.glsl"], "g = depth_generator(depth);", {"depth": depth}, {"g": "uint"})["g"]
    roots = np.sqrt(np.arange(2.0, 400.0)) % 1.0
    nearest = np.abs(got[:8, None] / 2.0**32 - roots).min(axis=1)
    assert (nearest < 1e-9).all() and (got[8:] % 2 == 1).all() and len(set(got.tolist())) == 64
