"""lib/microfacet.glsl, lib/rough_surface.glsl and lib/footprint.glsl against float64: shadowing by the area that is
seen, visible normals by Heitz's listing, derivatives by moved normals, numbers bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from reference import microfacet
from spectrasplat.gpu import bindings
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.gpu.scene_texels import spectra_texture
from spectrasplat.gpu.spectral_groups import SAMPLES
from spectrasplat.model.optics import rough_surfaces
from spectrasplat.passes import pilot
from spectrasplat.reference import optics, rough_albedo
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

LIBRARY = ["lib/rough_surface.glsl"]
COUNT = 4000


def surfaces(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals, directions back along rays on their side, widths."""
    normal = as_f32(optics.unit(rng.normal(size=(count, 3))))
    direction = optics.unit(rng.normal(size=(count, 3)))
    direction *= np.sign(optics.dot(direction, normal))[:, None]
    return normal, as_f32(direction), as_f32(10.0 ** rng.uniform(-4.0, 0.0, count))


@pytest.mark.parametrize("width", [0.01, 0.09, 0.36, 1.0])
def test_what_is_not_hidden_covers_the_surface_as_it_is_seen(gl, width: float) -> None:
    angle = np.radians([0.0, 10.0, 30.0, 50.0, 70.0, 82.0, 120.0])
    cosine = as_f32(np.repeat(np.cos(angle)[:, None], 3, axis=1))
    body = "share = smith_share(cosine, width);"
    inputs = {"cosine": cosine, "width": as_f32(np.full(len(angle), width))}
    got = evaluate(gl.ctx, LIBRARY, body, inputs, {"share": "vec3"})["share"]
    wanted = [microfacet.unhidden(a, width) for a in angle[:-1]]
    np.testing.assert_allclose(got[:-1], np.repeat(np.array(wanted)[:, None], 3, axis=1), rtol=2e-4)
    assert not got[-1].any()


@pytest.mark.parametrize("width", [0.01, 0.09, 0.36, 1.0])
def test_slope_of_what_is_not_hidden(gl, width: float) -> None:
    cosine = np.array([1e-3, 0.02, 0.1, 0.5, 0.9, 0.999])
    inputs = {"cosine": as_f32(cosine), "width": as_f32(np.full(len(cosine), width))}
    got = evaluate(gl.ctx, LIBRARY, "slope = smith_slope(cosine, width);", inputs, {"slope": "float"})["slope"]
    step = 1e-6 * cosine
    ends = [
        np.log([microfacet.unhidden(np.arccos(c + s), width) for c, s in zip(cosine, side * step, strict=True)])
        for side in (-1, 1)
    ]
    np.testing.assert_allclose(got, (ends[1] - ends[0]) / (2.0 * step), rtol=2e-3, atol=1e-5)


def test_what_microfacets_throw_at_each_other_is_given_back(gl) -> None:
    """The table that shaders read, the reference's and the quadrature of both over all microfacets, to one per cent:
    as much as the edge of total reflection makes of a table's steps where surfaces are roughest."""
    widths, ratios, angles = [1.0, 0.16], [1.0 / 1.52, 1.52, 1.0 / 1.333], [0.0, 30.0, 60.0, 80.0]
    width, ratio, angle = (part.ravel() for part in np.meshgrid(widths, ratios, np.radians(angles), indexing="ij"))
    texture = spectra_texture(
        gl.ctx, np.concatenate([np.ones((3, SAMPLES)), rough_surfaces.glass_tables(widths, SAMPLES)])
    )
    first = np.array([rough_surfaces.first_row_of(w, rough_surfaces.distinct_widths(widths), False) for w in width])
    got = evaluate(
        gl.ctx,
        ["lib/rough_energy.glsl"],
        "factor = regained(first, cosine, vec3(1.0, ratio, 2.0)).y;",
        {"first": as_f32(first), "cosine": as_f32(np.cos(angle)), "ratio": as_f32(ratio)},
        {"factor": "float"},
        {
            **bindings.SCENE_DEFINES,
            **dict.fromkeys(("TRIANGLES_AT", "NORMALS_AT", "OBJECTS_AT"), 0),
            **rough_surfaces.glass_defines(3),
            "SPECTRAL_SAMPLES": SAMPLES,
        },
        SCENE_STRUCTS,
        binders=[lambda: texture.use(bindings.UNIT_SPECTRA)],
    )["factor"]
    texture.release()
    own = rough_albedo.albedo_tables(np.array(widths), np.zeros(2, bool))
    cases = list(zip(width, ratio, angle, strict=True))
    kept = np.array([rough_albedo.sent_on(own, widths.index(w), np.cos(a), eta) for w, eta, a in cases])
    np.testing.assert_allclose(got, 1.0 / kept, rtol=1e-2)
    for case in (1, 6):
        w, eta, a = cases[case]
        assert kept[case] == pytest.approx(sum(microfacet.shares(a, w, eta)), rel=5e-3)
    assert got.max() > 2.0 and got.min() < 1.003


def test_microfacets_turn_with_their_surface(gl) -> None:
    rng = np.random.default_rng(5)
    normal, direction, width = surfaces(rng, COUNT)
    met = as_f32(optics.unit(normal + 0.4 * direction))
    axis = optics.cross(normal, direction)
    step = 1e-4
    turn = np.cos(step) * normal + np.sin(step) * optics.cross(axis, normal)  # about `axis`, which is across the normal
    length = np.linalg.norm(axis, axis=1)
    body = """
        turned = turned_with(m, n, dn);
        vec3 a, b;
        lobe_axes(m, n, width, a, b);
        first = a; second = b; part = lobe_part(count);
    """
    count = as_f32(10.0 ** rng.uniform(0.0, 8.0, COUNT))
    inputs = {"m": met, "n": normal, "dn": as_f32((turn - normal) / step), "width": width, "count": count}
    outputs = {"turned": "vec3", "first": "vec3", "second": "vec3", "part": "float"}
    got = evaluate(gl.ctx, LIBRARY, body, inputs, outputs)
    wanted = optics.cross(axis, met)
    wide = length > 0.1
    assert np.abs(got["turned"] - wanted)[wide].max() < 2e-3
    for one, other in (("first", "second"), ("second", "first")):
        assert np.abs(optics.dot(got[one], met)).max() < 1e-5
        assert np.abs(optics.dot(got[one], got[other])).max() < 1e-5
        tilt = np.arccos(np.clip(optics.dot(met, normal), -1.0, 1.0))
        spread = 0.5 * np.hypot(width * np.cos(tilt), np.sin(tilt))
        np.testing.assert_allclose(np.linalg.norm(got[one], axis=1), spread, rtol=2e-3, atol=2e-4)
    np.testing.assert_allclose(got["part"], np.minimum(4.4 * count ** (-1.0 / 6.0), 1.1), rtol=1e-4)
    np.testing.assert_allclose(got["part"], [pilot.lobe_part(paths) for paths in count], rtol=1e-4)


def test_joined_sides_have_both_covariances(gl) -> None:
    rng = np.random.default_rng(7)
    normal = as_f32(optics.unit(rng.normal(size=(COUNT, 3))))
    sides = rng.normal(size=(4, COUNT, 3)) * 10.0 ** rng.uniform(-2.0, 0.0, (4, COUNT, 1))
    sides = as_f32(sides - optics.times(np.einsum("knc,nc->kn", sides, normal), normal))
    body = "vec3 first = a, second = b; join_sides(n, first, second, c, d); u = first; v = second;"
    inputs = {"n": normal} | dict(zip("abcd", sides, strict=True))
    got = evaluate(gl.ctx, ["lib/footprint.glsl"], body, inputs, {"u": "vec3", "v": "vec3"})
    wanted = np.einsum("kni,knj->nij", sides, sides)
    made = sum(np.einsum("ni,nj->nij", got[name], got[name]) for name in "uv")
    assert np.abs(made - wanted).max(axis=(1, 2)).max() < 1e-5 * np.trace(wanted, axis1=1, axis2=2).max()
    assert np.abs(optics.dot(got["u"], normal)).max() < 1e-4


def test_covered_sides_are_as_broad_as_either_footprint(gl) -> None:
    rng = np.random.default_rng(8)
    normal = as_f32(optics.unit(rng.normal(size=(COUNT, 3))))
    sides = rng.normal(size=(4, COUNT, 3)) * 10.0 ** rng.uniform(-1.0, 0.0, (4, COUNT, 1))
    sides = as_f32(sides - optics.times(np.einsum("knc,nc->kn", sides, normal), normal))
    fan = as_f32(rng.normal(size=(COUNT, 2)))
    body = "u = a; v = b; f = fan; grew = cover_sides(n, u, v, f, c, d) ? 1.0 : 0.0;"
    inputs = {"n": normal, "fan": fan} | dict(zip("abcd", sides, strict=True))
    outputs = {"u": "vec3", "v": "vec3", "f": "vec2", "grew": "float"}
    got = evaluate(gl.ctx, ["lib/footprint.glsl"], body, inputs, outputs, {"LAMP_COLUMNS": 1})
    s = optics.unit(np.cross(normal, np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])))
    frame = np.stack([s, np.cross(normal, s)], axis=1)
    flat = np.einsum("nfc,knc->nfk", frame, sides.astype(float))
    own, other = flat[..., :2], flat[..., 2:]
    area = np.abs(np.linalg.det(own)) / np.square(own).sum(axis=(1, 2))
    # Where the other, told by the own sides, is longer than one along an axis, it is kept along that axis.
    told = np.linalg.solve(own, other)
    values, vectors = np.linalg.eigh(told @ told.transpose(0, 2, 1))
    grown = own @ vectors * np.sqrt(np.maximum(values, 1.0))[:, None, :]
    wanted = grown @ grown.transpose(0, 2, 1)
    made = np.einsum("nfc,knc->nfk", frame, np.stack([got["u"], got["v"]]).astype(float))
    covered = made @ made.transpose(0, 2, 1)
    broad = area > 0.02
    size = np.trace(wanted, axis1=1, axis2=2)
    assert broad.sum() > COUNT // 2
    assert np.abs(covered - wanted)[broad].max(axis=(1, 2)).max() / size[broad].max() < 1e-4
    grew = got["grew"] > 0.0
    assert np.array_equal(grew[broad], values[broad, 1] > 1.0)
    assert np.array_equal(got["u"][~grew], sides[0][~grew])
    assert (values[broad, 1] < 1.0).any()
    # The change per unit of length in the plane is what it was.
    gradient = np.linalg.solve(own.transpose(0, 2, 1), fan[..., None].astype(float))
    kept = (made.transpose(0, 2, 1) @ gradient)[..., 0]
    np.testing.assert_allclose(got["f"][broad], kept[broad], atol=2e-3 * np.abs(kept[broad]).max())
    thin = area < 5e-5
    assert thin.any()
    both = own @ own.transpose(0, 2, 1) + other @ other.transpose(0, 2, 1)
    assert np.abs(covered - both)[thin].max() < 1e-4 * both.max()
    assert not got["f"][thin].any()
