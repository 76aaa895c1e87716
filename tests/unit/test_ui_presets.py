"""Presets: every one applies, says the reference about itself, and users' own come back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import edits, presets
from spectrasplat.edit.own_presets import OwnPresets, load_own_presets, save_own_presets
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.scene import Absorption, Camera, Dielectric, Diffuse, Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(assets_dir() / "scenes" / "prism.toml")


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path))
    return tmp_path


def glass_index(scene: Scene) -> int:
    return next(i for i, o in enumerate(scene.objects) if isinstance(o.material, Dielectric))


@pytest.mark.parametrize("preset", presets.material_presets(), ids=lambda p: p.name)
def test_every_glass_applies_and_its_remark_is_true(scene: Scene, preset: presets.MaterialPreset) -> None:
    index = glass_index(scene)
    changed = presets.apply_material(edits.set_priority(scene, index, 7), index, preset)
    material = changed.objects[index].material
    assert isinstance(material, Dielectric) and material.priority == 7
    if preset.tint is not None:  # tells its colourant instead, and absorbs
        assert preset.tint.colourant in preset.remark and material.absorption is not None
        return
    told = dict(re.findall(r"(n_d|V_d) ([\d.]+)", preset.remark))
    assert material.absorption is None and f"{material.dispersion.n_d:.3f}" == told["n_d"]
    assert "V_d" not in told or f"{material.dispersion.V_d:.0f}" == told["V_d"]


@pytest.mark.parametrize("preset", presets.light_presets(), ids=lambda p: p.name)
def test_every_light_applies_and_keeps_place_kind_and_brightness(scene: Scene, preset: presets.LightPreset) -> None:
    before = scene.lights[0]
    after = presets.apply_light(scene, 0, preset).lights[0]
    assert (after.name, after.kind, after.position, after.direction) == (
        before.name,
        before.kind,
        before.position,
        before.direction,
    )
    assert edits.light_power(after) == pytest.approx(edits.light_power(before))
    assert edits.spectrum_words(after.spectral_power)[0] == preset.kind
    for value in re.findall(r"(\d+) K", preset.remark):
        assert preset.kind == "illuminant" or float(value) == preset.value


def test_the_sun_widens_a_directional_light_only(scene: Scene) -> None:
    sun = next(p for p in presets.light_presets() if p.name == "Sun")
    point = edits.set_light_kind(scene, 0, "point")
    assert presets.apply_light(point, 0, sun).lights[0].kind == "point"
    wide = edits.set_light_kind(scene, 0, "directional")
    assert presets.apply_light(wide, 0, sun).lights[0].angular_diameter_deg == 0.53


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("kind", ["pinhole", "orthographic"])
@pytest.mark.parametrize("preset", presets.view_presets(), ids=lambda p: p.name)
def test_every_view_sees_the_glass_upright(
    scene: Scene, preset: presets.ViewPreset, kind: str, up: tuple[float, float, float]
) -> None:
    turned = replace(scene, camera=replace(scene.camera, up=up))
    camera = presets.view_camera(turned, replace(scene.camera, kind=kind), preset)
    forward = np.subtract(camera.target, camera.position)
    distance = np.linalg.norm(forward)
    forward = forward / distance
    assert abs(forward @ camera.up) < 0.7 and camera.kind == kind
    corners = np.concatenate(
        [
            o.mesh.vertices @ o.object_to_world[:3, :3].T + o.object_to_world[:3, 3]
            for o in scene.objects
            if isinstance(o.material, Dielectric)
        ]
    )
    across = np.linalg.norm(np.cross(corners - camera.position, forward), axis=1)
    depth = (corners - camera.position) @ forward
    half = (
        np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * depth if kind == "pinhole" else 0.5 * camera.vertical_extent
    )
    assert (depth > 0).all() and (across < half).all()


# -- users' own -----------------------------------------------------------------------------


def test_own_presets_come_back_as_they_were(scene: Scene) -> None:
    assert load_own_presets() == (OwnPresets(), None)
    tinted = Dielectric(glass.with_gain(catalogue.find("N-SF11"), 2.0), Absorption(np.full(401, 0.25)), 2)
    camera = Camera((1.0, 2.0, 3.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=4.0)
    lamp = edits.set_light_spectrum(scene, 0, "laser", 532.0).lights[0]
    own = OwnPresets().with_material('my "green" glass', tinted).with_material("paint", Diffuse((0.1, 0.2, 0.3)))
    own = own.with_light("beam", lamp).with_view("detail", camera)
    save_own_presets(own)
    again, notice = load_own_presets()
    assert notice is None and [p.name for p in again.materials] == ['my "green" glass', "paint"]
    material = again.materials[0].material
    assert isinstance(material, Dielectric) and material.dispersion == tinted.dispersion and material.priority == 2
    np.testing.assert_allclose(material.absorption.coefficient, 0.25)
    assert again.materials[1].material == Diffuse((0.1, 0.2, 0.3)) and again.views[0].camera == camera
    applied = presets.apply_light(scene, 0, again.lights[0]).lights[0]
    assert applied.name == scene.lights[0].name and edits.spectrum_words(applied.spectral_power) == ("laser", 532.0)
    assert edits.light_power(applied) == pytest.approx(edits.light_power(lamp))
    assert presets.view_camera(scene, scene.camera, again.views[0]) == camera
    replaced = again.with_material("paint", Diffuse((0.5, 0.5, 0.5)))
    assert len(replaced.materials) == 2 and replaced.materials[1].material == Diffuse((0.5, 0.5, 0.5))
    assert replaced.without("paint").materials == again.materials[:1]
    with pytest.raises(UserError, match="needs a name"):
        again.with_view("  ", camera)


@pytest.mark.parametrize("content", [b"[materials", b"\xff", b"[materials.a]\nn_d = -3", b"[lamps.a]\nx = 1"])
def test_damaged_presets_are_set_aside_and_told(config: Path, content: bytes) -> None:
    (config / "presets.toml").write_bytes(content)
    own, notice = load_own_presets()
    assert own == OwnPresets() and notice is not None and "presets.broken.toml" in notice
    assert (config / "presets.broken.toml").read_bytes() == content
    assert load_own_presets() == (OwnPresets(), None)
