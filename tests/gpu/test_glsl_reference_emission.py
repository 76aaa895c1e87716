"""Random numbers, emission and the spot's edge of shaders/lib against their CPU references in app/reference."""

from __future__ import annotations

import numpy as np
import pytest
from reference.lamps import cosine, isotropic, lamp, lopsided
from reference.samplers import drawn_wavelengths, mirrored_lattice_point, radical_inverse
from spectrasplat.gpu import bindings
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.gpu.scene_texels import spectra_texture
from spectrasplat.gpu.spectral_groups import SAMPLES
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.spectral_tables import SpectralAxis, cumulative, wavelength_cdf
from spectrasplat.model.optics.spectrum import Spectrum, constant, illuminant
from spectrasplat.reference import emission, random_numbers
from spectrasplat.reference.optics import unit
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 4096
WORD = 2**32


def words(seed: int) -> np.ndarray:
    values = np.random.default_rng(seed).integers(0, WORD, COUNT, dtype=np.uint32)
    values[:4] = 0, 1, 2**31, WORD - 1
    return values


def test_random_numbers_are_the_same_to_the_bit(gl) -> None:
    a, b, c = (words(seed) for seed in (1, 2, 3))
    body = "h = hash_pcg(a); hc = hash_combine(a, b); u = unit_float(a); k = kronecker(a, b, c);"
    body += "r = radical_inverse(a, b);"
    got = evaluate(
        gl.ctx,
        ["lib/random.glsl"],
        body,
        {"a": a, "b": b, "c": c},
        {"h": "uint", "hc": "uint", "u": "float", "k": "float", "r": "float"},
    )
    np.testing.assert_array_equal(got["h"], random_numbers.hash_pcg(a))
    np.testing.assert_array_equal(got["hc"], random_numbers.hash_combine(a, b))
    np.testing.assert_array_equal(got["u"], random_numbers.unit_float(a))
    np.testing.assert_array_equal(got["k"], random_numbers.kronecker(a, b, c))
    np.testing.assert_array_equal(got["r"], radical_inverse(a, b))
    assert (random_numbers.hash_combine(a, b) != random_numbers.hash_combine(b, a)).mean() > 0.99


@pytest.mark.parametrize("function", ["lattice_point", "mirrored_lattice_point"])
@pytest.mark.parametrize("count", [1, 17, 65_536, 4_000_037])
def test_lattice_points(gl, count: int, function: str) -> None:
    i = words(4) % np.uint32(count)
    shift = np.column_stack([words(5), words(6)])
    call = f"p = mirrored_lattice_point(i, {count}u, s);"
    if function == "lattice_point":
        call = f"p = lattice_point(i, {count}u, s);"
    got = evaluate(gl.ctx, ["lib/emission.glsl"], call, {"i": i, "s": shift}, {"p": "vec2"})["p"]
    reference = emission.lattice_point if function == "lattice_point" else mirrored_lattice_point
    want = reference(i, count, (shift[:, 0], shift[:, 1]))
    # float(i) + a fraction keeps 24 bits: an eps of the whole axis.
    assert np.abs(got[:, 0] - want[:, 0]).max() < 1.5e-7
    np.testing.assert_array_equal(got[:, 1], want[:, 1])
    assert (got[:, 0] <= 1.0).all() and (got[:, 1] <= 1.0).all()


@pytest.mark.parametrize("text", [isotropic(), cosine(), lopsided()], ids=["isotropic", "cosine", "lopsided"])
def test_profiles_are_looked_up(gl, tmp_path, text: str) -> None:
    rng = np.random.default_rng(11)
    light = lamp(tmp_path, constant(1.0), text, direction=(0.6, 0.0, -0.8), rotation_deg=20.0)
    axis, (u, v) = np.asarray(light.direction), light.across
    direction = as_f32(np.concatenate([unit(rng.normal(size=(COUNT - 2, 3))), [axis, -axis]]))
    table = light.profile.packed()
    axes = {name: as_f32(np.tile(value, (COUNT, 1))) for name, value in (("axis", axis), ("u", u), ("v", v))}
    got = evaluate(
        gl.ctx,
        ["lib/profile.glsl"],
        "f = profile_intensity(1u, d, axis, u, v); cell = profile_stretch(3u, uint(profiles[1]), angle, along);",
        {"d": direction, **axes, "angle": as_f32(rng.uniform(0.0, np.pi, COUNT))},
        {"f": "float", "cell": "uint", "along": "float"},
        {"BIND_PROFILES": 8},
        buffers={8: np.concatenate([[0.0], table]).astype("f4")},
    )
    theta = emission.angle_between(unit(direction), np.tile(axis, (COUNT, 1)))
    want = light.profile.at(theta, np.arctan2(direction @ v, direction @ u))
    # Beyond the last angle the cone ends the light, not the table; on the axis the turn about it is of no account.
    clear = (theta < light.profile.cone_rad - 1e-4) & (theta > 1e-5) & (theta < np.pi - 1e-5)
    # llvmpipe's atan is good to 2e-5.
    assert np.abs(got["f"] - want)[clear].max() < 1e-4
    assert (got["along"] >= 0.0).all() and (got["along"] <= 1.0).all()


SODIUM = Spectrum(np.where(np.arange(380, 781) > 500, 0.01, 0.0), ((589.0, 1.0), (589.6, 0.5)))
SPECTRA = {"flat": constant(1.0), "D65": illuminant("D65"), "sodium": SODIUM}


@pytest.mark.parametrize("by_power", [False, True], ids=["brightness", "power"])
@pytest.mark.parametrize("glass", [None, "N-SF11"])
@pytest.mark.parametrize("spectrum", SPECTRA.values(), ids=SPECTRA)
def test_wavelengths_are_drawn_by_brightness(gl, spectrum: Spectrum, glass: str | None, by_power: bool) -> None:
    axis = SpectralAxis.build([find(glass)] if glass else [])
    lo_nm, hi_nm = spectrum.support_nm()
    support = tuple(axis.x_of_nm(np.array([lo_nm - 0.5, hi_nm + 0.5])).tolist())
    row = wavelength_cdf(cumulative(axis, spectrum), SAMPLES, support, by_power)
    texture = spectra_texture(gl.ctx, row[None])
    place = random_numbers.unit_float(words(7))
    for band in (support, (support[0] + 0.2 * (support[1] - support[0]), support[0] + 0.7 * (support[1] - support[0]))):
        got = evaluate(
            gl.ctx,
            ["lib/wavelength.glsl"],
            "float per = 0.0; x = drawn_wavelength(0u, band, place, per); d = per;",
            {"place": as_f32(place), "band": as_f32(np.tile(band, (COUNT, 1)))},
            {"x": "float", "d": "float"},
            {
                **bindings.SCENE_DEFINES,
                **dict.fromkeys(("TRIANGLES_AT", "NORMALS_AT", "OBJECTS_AT"), 0),
                "SPECTRAL_SAMPLES": SAMPLES,
            },
            SCENE_STRUCTS,
            binders=[lambda: texture.use(bindings.UNIT_SPECTRA)],
        )
        x, per_density = drawn_wavelengths(spectrum, axis, band, place, by_power=by_power)
        # Where hardly anything is drawn, 2e-5 of all in a cell, the row's own rounding moves x most: 6e-8 / 2e-5 cells.
        assert np.abs(got["x"] - x).max() < 2e-2 / (SAMPLES - 1)
        same = np.floor(got["x"] * (SAMPLES - 1)) == np.floor(x * (SAMPLES - 1))
        assert same.mean() > 0.99
        np.testing.assert_allclose(got["d"][same], per_density[same], rtol=1e-2)
        assert np.abs(got["d"][same] / per_density[same] - 1.0).mean() < 1e-3
    texture.release()
