"""Presets: every one applies, and says the truth about itself."""

from __future__ import annotations

import re

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import edits, presets
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Dielectric, Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(assets_dir() / "scenes" / "prism.toml")


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
