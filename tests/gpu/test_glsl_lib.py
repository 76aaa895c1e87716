"""Random numbers, emission, spots, spectral tables, Gaussians and media of shaders/lib against their float64
references."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS
from spectrasplat.gpu.scene_texels import SceneTexels, spectra_texture
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COVERS = {"finite.glsl": ("magnitude_bits", "is_finite", "is_finite3", "is_within", "is_within2")}

COUNT = 4096
WORD = 2**32
GOLDEN = 2654435769


def cpu_reference_hash(value: int) -> int:
    """PCG-RXS-M-XS 32/32 output of one step of its generator (O'Neill 2014), in Python's integers."""
    state = (value * 747796405 + 2891336453) % WORD
    word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737 % WORD
    return (word >> 22) ^ word


def test_hashes_are_the_published_generator(gl) -> None:
    values = np.random.default_rng(1).integers(0, WORD, 1000, dtype=np.uint32)
    values[:3] = 0, 1, WORD - 1
    got = evaluate(
        gl.ctx, ["lib/random.glsl"], "h = hash_pcg(v); u = unit_float(h);", {"v": values}, {"h": "uint", "u": "float"}
    )
    want = np.array([cpu_reference_hash(int(v)) for v in values], np.uint32)
    np.testing.assert_array_equal(got["h"], want)
    np.testing.assert_array_equal(got["u"], (want >> 8) / 2**24)
    assert got["u"].max() < 1


def test_combined_hashes_depend_on_order_and_both_parts(gl) -> None:
    a, b = (np.random.default_rng(s).integers(0, 50, COUNT, dtype=np.uint32) for s in (1, 2))
    body = "ab = hash_combine(a, b); ba = hash_combine(b, a);"
    got = evaluate(gl.ctx, ["lib/random.glsl"], body, {"a": a, "b": b}, {"ab": "uint", "ba": "uint"})
    pairs = len(np.unique(np.stack([a, b]), axis=1)[0])
    assert len(np.unique(got["ab"])) == pairs  # no collision among so few
    assert (got["ab"] == got["ba"]).sum() == (a == b).sum()


def test_lattice_is_the_shifted_golden_kronecker_lattice(gl) -> None:
    count = 100_003
    i = np.random.default_rng(3).integers(0, count, COUNT, dtype=np.uint32)
    shift = np.array([123456789, 3987654321], np.uint32)
    inputs = {"i": i, "s": np.tile(shift, (COUNT, 1))}
    got = evaluate(gl.ctx, ["lib/emission.glsl"], f"p = lattice_point(i, {count}u, s);", inputs, {"p": "vec2"})["p"]
    along = (i + (int(shift[0]) >> 8) / 2**24) / count
    across = np.array([((int(k) * GOLDEN + int(shift[1])) % WORD >> 8) / 2**24 for k in i])
    assert np.abs(got[:, 0] - along).max() < 1e-7
    np.testing.assert_array_equal(got[:, 1], across)


def equal_area_direction(q: np.ndarray) -> np.ndarray:
    """Lambert's azimuthal equal-area plane to the sphere, by its definition: |q| is the chord, 2 sin(angle/2)."""
    radius = np.linalg.norm(q, axis=-1)
    angle = 2 * np.arcsin(radius / 2)
    return np.column_stack([q * (np.sin(angle) / radius)[:, None], np.cos(angle)])


def test_azimuthal_directions_and_their_columns(gl) -> None:
    rng = np.random.default_rng(4)
    radius, turn = rng.uniform(1e-3, 1.99, COUNT), rng.uniform(0, 2 * np.pi, COUNT)
    q = as_f32(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    got = evaluate(
        gl.ctx,
        ["lib/emission.glsl"],
        "d = azimuthal_direction(q, dx, dy);",
        {"q": q},
        {"d": "vec3", "dx": "vec3", "dy": "vec3"},
    )
    assert np.abs(got["d"] - equal_area_direction(q)).max() < 1e-6
    step = 1e-6
    size = 1 / np.sqrt(1 - 0.25 * np.sum(q**2, -1))  # columns grow towards the antipode
    for axis, name in ((np.array([step, 0]), "dx"), (np.array([0, step]), "dy")):
        difference = (equal_area_direction(q + axis) - equal_area_direction(q - axis)) / (2 * step)
        assert (np.abs(got[name] - difference).max(-1) / size**2).max() < 3e-6
    # Equal area: the two columns span one unit of solid angle per unit of plane.
    assert np.abs(optics.dot(np.cross(got["dx"], got["dy"]), got["d"]) - 1).max() < 2e-5


def test_concentric_disc_keeps_area_and_rings(gl) -> None:
    grid = (np.arange(64) + 0.5) / 64
    unit = as_f32(np.stack(np.meshgrid(grid, grid), -1).reshape(-1, 2))
    step = 1 / 1024
    body = (
        f"p = concentric_disc(u); px = concentric_disc(u + vec2({step}, 0)); py = concentric_disc(u + vec2(0, {step}));"
    )
    got = evaluate(gl.ctx, ["lib/emission.glsl"], body, {"u": unit}, {"p": "vec2", "px": "vec2", "py": "vec2"})
    p = 2 * unit - 1
    ring = np.abs(p).max(-1)
    np.testing.assert_allclose(np.linalg.norm(got["p"], axis=-1), ring, atol=3e-7)  # squares go to circles
    ax, ay = (got["px"] - got["p"]) / step, (got["py"] - got["p"]) / step
    area = ax[:, 0] * ay[:, 1] - ax[:, 1] * ay[:, 0]
    away_from_seams = (np.abs(np.abs(p[:, 0]) - np.abs(p[:, 1])) > 0.05) & (ring > 0.2)
    np.testing.assert_allclose(area[away_from_seams], np.pi, rtol=2e-2)
    centre = evaluate(
        gl.ctx, ["lib/emission.glsl"], "p = concentric_disc(u);", {"u": np.array([[0.5, 0.5]])}, {"p": "vec2"}
    )["p"]
    np.testing.assert_array_equal(centre, 0)


def cpu_reference_falloff(angle: np.ndarray, inner: float, outer: float) -> np.ndarray:
    if inner == outer:
        return (angle <= outer).astype(float)
    t = np.clip((outer - angle) / (outer - inner), 0, 1)
    return t * t * (3 - 2 * t)


@pytest.mark.parametrize(("inner_deg", "outer_deg"), [(10.0, 30.0), (0.01, 0.02), (25.0, 25.0), (0.0, 120.0)])
def test_spot_edges(gl, inner_deg: float, outer_deg: float) -> None:
    inner, outer = np.radians([inner_deg, outer_deg])
    rng = np.random.default_rng(5)
    axis = optics.unit(rng.normal(size=(COUNT, 3)))
    side = optics.unit(np.cross(axis, rng.normal(size=(COUNT, 3))))
    angle = np.minimum(rng.uniform(0, 1.5 * outer, COUNT), 3.1)
    direction = np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * side
    a, d = as_f32(axis), as_f32(direction)
    angle = np.arctan2(np.linalg.norm(np.cross(d, a), axis=-1), optics.dot(d, a))
    cone = np.tile([inner, outer], (COUNT, 1))
    got = evaluate(
        gl.ctx, ["lib/spot.glsl"], "f = spot_falloff(d, a, cone);", {"d": d, "a": a, "cone": cone}, {"f": "float"}
    )["f"]
    want = cpu_reference_falloff(angle, inner, outer)
    clear = np.abs(angle - outer) > 1e-6
    # Unit vectors in float32 know an angle to 1e-7, a larger share of a narrow edge; llvmpipe's atan
    # errs by 2e-6 of the angle.
    room = 1e-5 + (3e-7 / (outer - inner) if outer > inner else 0.0)
    assert clear.mean() > 0.9
    assert np.abs(got - want)[clear].max() < room


def test_a_point_light_has_no_edge(gl) -> None:
    directions = optics.unit(np.random.default_rng(6).normal(size=(256, 3)))
    directions[:2] = [0, 0, 1], [0, 0, -1]
    got = evaluate(
        gl.ctx, ["lib/spot.glsl"], "f = spot_falloff(d, vec3(0, 0, 1), vec2(4.0));", {"d": directions}, {"f": "float"}
    )["f"]
    np.testing.assert_array_equal(got, 1)


def test_spectral_rows_are_linear_between_samples(gl) -> None:
    samples, rows = 33, 3
    table = np.random.default_rng(7).random((rows, samples)).astype(np.float32)
    x = as_f32(np.concatenate([np.random.default_rng(8).uniform(-0.1, 1.1, 500), [0, 1, 0.5, 1 / 32]]))
    texture = spectra_texture(gl.ctx, table)
    got = evaluate(
        gl.ctx,
        ["lib/scene.glsl"],
        "a = spectral_row(0u, x); c = spectral_row(2u, x);",
        {"x": x},
        {"a": "float", "c": "float"},
        {
            **bindings.SCENE_DEFINES,
            **dict.fromkeys(("TRIANGLES_AT", "NORMALS_AT", "OBJECTS_AT"), 0),
            "SPECTRAL_SAMPLES": samples,
        },
        SCENE_STRUCTS,
        binders=[lambda: texture.use(bindings.UNIT_SPECTRA)],
    )
    texture.release()
    at = np.linspace(0, 1, samples)
    np.testing.assert_allclose(got["a"], np.interp(x, at, table[0]), atol=3e-6)
    np.testing.assert_allclose(got["c"], np.interp(x, at, table[2]), atol=3e-6)


def test_gaussian_integrals(gl) -> None:
    from scipy.special import erf

    x = as_f32(np.concatenate([np.linspace(-6, 6, 2001), [0, 1e-6, 50, -50, 1e6]]))
    width = as_f32(np.full(len(x), 0.37))
    body = "e = erf_approx(x); box = gaussian_box(x, w); excess = normal_excess(x); s = sinc_pi(x);"
    outputs = {"e": "float", "box": "float", "excess": "float", "s": "float"}
    got = evaluate(gl.ctx, ["lib/gaussian.glsl"], body, {"x": x, "w": width}, outputs)
    # The polynomial is good to 3e-7; its sixteenth power multiplies float32's own rounding.
    assert np.abs(got["e"] - erf(x)).max() < 2e-6
    assert np.abs(got["box"] - 0.5 * (erf(x + width) - erf(x - width))).max() < 2e-6
    near = np.abs(x) < 10
    z = x[near]
    # E[max(Z - z, 0)]: z weighs the error of erf.
    excess = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi) - 0.5 * z * (1 - erf(z / np.sqrt(2)))
    assert (np.abs(got["excess"][near] - excess) / (1 + np.abs(z))).max() < 2e-6
    assert np.abs(got["s"][near] - np.sinc(z)).max() < 2e-6


NESTED = {
    "MEDIUM_STACK": 1,
    "STACK_SIZE": 3,
    "STACK_OBJECTS": "uint[](4u, 0u, 2u)",
    "INDEX_ROW": 0,
    "SPECTRAL_GROUPS": 0,
}


def test_the_highest_solid_around_a_ray_is_its_medium(gl) -> None:
    # Bits by priority: object 4 below object 0 below object 2; every mask, every object, both ways.
    order = [4, 0, 2]
    cases = [(mask, bit, enter) for mask in range(8) for bit in range(3) for enter in (0, 1)]
    mask, bit, enter = np.array(cases, np.uint32).T
    objects = OBJECT.zeros(5)
    objects["stack_bit"] = NONE
    objects["stack_bit"][order] = range(3)
    body = """
    MediumInterface c = cross_boundary(MediumStack(mask, NONE), object, enter != 0u);
    before = c.before; after = c.after; mask_after = c.behind.mask; changes = c.changes ? 1u : 0u;
    """
    outputs = dict.fromkeys(("before", "after", "mask_after", "changes"), "uint")
    inputs = {"mask": mask, "object": np.array(order, np.uint32)[bit], "enter": enter}
    texels = SceneTexels(gl.ctx, {"OBJECTS": objects})
    defines = {**bindings.SCENE_DEFINES, **texels.defines, "SPECTRAL_SAMPLES": 2, **NESTED}
    got = evaluate(gl.ctx, ["lib/medium.glsl"], body, inputs, outputs, defines, SCENE_STRUCTS, binders=[texels.bind])
    texels.release()

    def medium(held: int) -> int:
        return order[held.bit_length() - 1] if held else NONE

    for row, (held, own, entering) in enumerate(cases):
        outside, inside = held & ~(1 << own), held | (1 << own)
        before, after = (outside, inside) if entering else (inside, outside)
        want = (medium(before), medium(after), after, int(medium(before) != medium(after)))
        assert tuple(int(got[name][row]) for name in outputs) == want, cases[row]


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
