"""Surfaces in contact are one interface: silver, black and paint on glass, sheets upon sheets, boxes in one place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS, TRIANGLE
from spectrasplat.gpu.scene_texels import SceneTexels
from spectrasplat.model.contacts import contacts, overlapping_solids
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.scene import Black, Camera, Diffuse, Material, Mirror, Scene, SceneObject
from spectrasplat.reference.photon_reference import ReferenceRun
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate
from spectrasplat.stress.rigs.probe import SMALL, Probe, picture_error, probe
from spectrasplat.stress.rigs.scene_parts import BEAM, SUN, solid, stage, turn

GAPS = (0.0, 1e-7, 1e-6, 1e-5, 1e-4, -1e-6)
"""Negative: the sheet lies in the glass."""
CAUSTIC = replace(SMALL, layer="caustic", method="srd")
PHOTONS = replace(CAUSTIC, method="srd-photons")
ROUNDING = 2e-3
"""Share of the light: rays at the rim of a sheet, and roulette."""


def coated(material: Material, gap: float, degrees: float = 28.0) -> Scene:
    """A block, turned, with a sheet on one face."""
    matrix, face = np.eye(4), np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn((1.0, 0.4, 0.2), degrees), (0.0, 0.0, 1.2)
    face[:3, :3], face[0, 3] = turn((0.0, 1.0, 0.0), 90.0), 0.5 + gap
    block = solid("block", box(), constant(1.5, "n"))
    items = (block, SceneObject("sheet", plane(1.0, 1.0), material, face))
    return stage(*(replace(o, object_to_world=matrix @ o.object_to_world) for o in items), lights=[SUN])


def shares(found: Probe) -> dict[str, float]:
    """Where light ended that met glass or a sheet."""
    return {name: share for name, share in found.shares.items() if name != "direct"}


@pytest.mark.slow
@pytest.mark.parametrize("material", [Mirror(), Black(), Diffuse()], ids=["silver", "black", "paint"])
def test_a_coat_on_glass_loses_nothing_and_is_what_the_reference_says(gl, material: Material) -> None:
    for gap in GAPS:
        beams, photons = (probe(gl, coated(material, gap), settings) for settings in (CAUSTIC, PHOTONS))
        for name in ("deposited", "absorbed", "lost_depth", "lost_numeric"):
            by_beams, by_photons = (p.stats.tally.ended[name] / beams.stats.tally.emitted for p in (beams, photons))
            assert by_beams == pytest.approx(by_photons, abs=0.01), (gap, name)
        found = shares(photons)
        assert found["lost_depth"] + found["lost_numeric"] < ROUNDING, (gap, found)
        run = ReferenceRun(coated(material, gap), 16, 9)
        run.advance(200_000)
        flux = run.picture().fates
        assert flux["lost_depth"] + flux["lost_numeric"] < ROUNDING * flux["emitted"], (gap, flux)
        for name, share in found.items():
            # The reference sends a little less light past the glass: 0.4 % of it.
            assert share == pytest.approx(flux.get(name, 0.0) / flux["emitted"], abs=0.01), (gap, name)


def test_silver_reflects_all_whether_or_not_air_is_below(gl) -> None:
    deposited = [probe(gl, coated(Mirror(), gap), CAUSTIC).shares["deposited"] for gap in GAPS]
    np.testing.assert_allclose(deposited, deposited[0], atol=1e-3)


@pytest.mark.slow
def test_the_camera_sees_the_same_silver(gl) -> None:
    camera = Camera((-4.0, -3.0, 3.0), (0.0, 0.0, 1.0), vertical_fov_deg=30.0)
    pictures = [
        probe(gl, replace(coated(Mirror(), gap), camera=camera), replace(SMALL, layer="beauty")).picture
        for gap in (0.0, 1e-5, 1e-4)
    ]
    again = probe(gl, replace(coated(Mirror(), 0.0), camera=camera), replace(SMALL, layer="beauty", seed=2)).picture
    for picture in pictures[1:]:
        assert picture_error(picture, pictures[0]) < max(0.02, 2.0 * picture_error(again, pictures[0]))


@pytest.mark.parametrize("gap", [0.0, 1e-8])
def test_of_two_sheets_in_one_place_everybody_meets_the_first(gl, gap: float) -> None:
    def scene(*sheets: SceneObject) -> Scene:
        matrix = np.eye(4)
        matrix[:3, :3] = turn((1.0, 0.4, 0.2), 13.0)
        block = solid("block", box((0.6, 0.6, 0.6)), constant(1.5, "n"), (0.3, 0.0, 2.0))
        turned = [replace(s, object_to_world=matrix @ s.object_to_world) for s in sheets]
        camera = Camera((0.0, 0.0, 6.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=40.0)
        return Scene("sheets", camera, (BEAM, SUN), (block, *turned))

    below = np.eye(4)
    below[2, 3] = -gap
    first = SceneObject("first", plane(8.0, 8.0), Diffuse((0.9, 0.6, 0.2)))
    second = SceneObject("second", plane(6.0, 6.0), Diffuse((0.1, 0.2, 0.9)), below)
    settings = replace(SMALL, layer="beauty")
    want, found = probe(gl, scene(first), settings), probe(gl, scene(first, second), settings)
    assert not contacts(scene(first)) and contacts(scene(first, second)) == [(1, 2)]
    assert picture_error(found.picture, want.picture) < 0.01
    assert found.shares["deposited"] == pytest.approx(want.shares["deposited"], abs=ROUNDING)


@pytest.mark.parametrize("material", [Mirror((0.5, 0.5, 0.5)), Diffuse()], ids=["silver", "paint"])
def test_a_box_in_the_place_of_a_glass_box_hides_it(gl, material: Material) -> None:
    def scene(*items: SceneObject) -> Scene:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn((1.0, 0.4, 0.2), 28.0), (0.0, 0.0, 1.2)
        other = solid("other", box((0.4, 0.4, 0.4)), constant(1.5, "n"), (0.0, 1.5, 0.5))
        return stage(*(replace(o, object_to_world=matrix @ o.object_to_world) for o in items), other, lights=[SUN])

    glass, coat = solid("glass", box(), constant(1.5, "n")), SceneObject("coat", box(), material)
    want, found = (probe(gl, scene(*items), CAUSTIC) for items in ((coat,), (coat, glass)))
    assert found.shares["lost_depth"] + found.shares["lost_numeric"] < ROUNDING
    assert found.picture.sum() == pytest.approx(want.picture.sum(), rel=0.02)


def test_only_what_may_touch_is_looked_at() -> None:
    assert contacts(coated(Mirror(), 1e-5)) == [(0, 1)] and contacts(coated(Mirror(), 1e-2, 0.0)) == []
    assert overlapping_solids(coated(Mirror(), 0.0)) == [0] and overlapping_solids(coated(Mirror(), 1e-2, 0.0)) == []
    apart = [
        solid(f"bead {i}", box((0.1, 0.1, 0.1)), constant(1.5, "n"), (0.2 * (i % 8), 0.2 * (i // 8), 0.05))
        for i in range(40)
    ]
    assert len(overlapping_solids(stage(*apart))) == 32


def test_the_rules_of_contact_by_themselves(gl) -> None:
    texels = SceneTexels(gl.ctx, {"TRIANGLES": TRIANGLE.zeros(1), "OBJECTS": OBJECT.zeros(1)})
    rng = np.random.default_rng(3)
    count, near, grating = 4096, 3e-5, 4
    cosine, height = rng.uniform(0.02, 1.0, count), rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-7, -3, count)
    leaning = rng.uniform(0.8, 1.0, count)
    normal = np.column_stack([np.sqrt(1.0 - leaning**2), np.zeros(count), leaning])
    key, other = rng.uniform(0.0, 4.0, count), rng.integers(0, 4, (count, 2))
    other_key = key + rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-9, -4, count)
    floats = {"cosine": cosine, "height": height, "normal": normal, "key": key, "other_key": other_key}
    inputs = {name: as_f32(values) for name, values in floats.items()}
    words = {"kind": rng.choice([0, 1, 2, grating], count), "bit": rng.choice([0, 5, NONE], count)}
    words |= {"mask": rng.choice([0, 1, 32, 33], count), "first": other[:, 0], "second": other[:, 1]}
    inputs |= {name: values.astype(np.uint32) for name, values in words.items()}
    body = """
    left_normal = vec3(0.0, 0.0, 1.0);
    sheet = accept_sheet(height / cosine, height, normal, kind, vec3(0.0)) ? 1u : 0u;
    crossed_in = crossed_in_contact(height, -1.0, bit, RayOrigin(NONE, NONE, 0u, mask)) ? 1u : 0u;
    crossed_out = crossed_in_contact(height, 1.0, bit, RayOrigin(NONE, NONE, 0u, mask)) ? 1u : 0u;
    comes = comes_first(key, cosine, first, other_key, second) ? 1u : 0u;
    """
    defines = {**bindings.SCENE_DEFINES, **texels.defines, "TRIANGLE_COUNT": 0, "SPECTRAL_SAMPLES": 2, "CONTACTS": 1}
    outputs = dict.fromkeys(("sheet", "crossed_in", "crossed_out", "comes"), "uint")
    got = evaluate(gl.ctx, ["lib/intersect.glsl"], body, inputs, outputs, defines, SCENE_STRUCTS, binders=[texels.bind])
    texels.release()
    f = {name: inputs[name].astype(float) for name in floats}
    limit = np.where(words["kind"] == grating, near, 2 * 4e-7)
    want = np.where(f["normal"][:, 2] > 0.9, f["height"] > limit, f["height"] / f["cosine"] > -near)
    sure = (np.abs(f["height"] - limit) > 1e-9) & (np.abs(leaning - 0.9) > 1e-5)
    np.testing.assert_array_equal(got["sheet"][sure], want[sure])
    has_bit, inside = words["bit"] != NONE, (words["mask"] >> (words["bit"] & 31)) & 1
    for name, impossible in (("crossed_in", inside == 1), ("crossed_out", inside == 0)):
        np.testing.assert_array_equal(got[name], has_bit & impossible & (f["height"] < 2 * near), err_msg=name)
    rounding = 4e-7 * (2.0 + f["key"]) / np.maximum(f["cosine"], 0.1)
    apart = np.abs(f["key"] - f["other_key"])
    tie = (apart < rounding) & (other[:, 0] != other[:, 1])
    sure = np.abs(apart / rounding - 1.0) > 1e-3
    want = np.where(tie, other[:, 0] < other[:, 1], f["key"] < f["other_key"])
    np.testing.assert_array_equal(got["comes"][sure], want[sure])
