"""Presets and tinted glasses by name: what they look like, that they apply, that a file keeps them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import presets
from spectrasplat.edit.glass import set_priority, set_tint
from spectrasplat.edit.lights import light_power, set_light_kind, spectrum_words
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.optics.colorimetry import cmf_xyz, daylight_per_lumen, xyz_to_rgb709
from spectrasplat.model.optics.tints import half_distance, tint, tint_of, tints
from spectrasplat.model.scene import Dielectric, Scene
from spectrasplat.model.staging import Staging

from tests.unit.scene_texts import load

PRISM = assets_dir() / "scenes" / "prism.toml"


def seen_through(name: str, distance: float) -> np.ndarray:
    """Linear Rec.709 of daylight behind so much of it, where clear glass has (1, 1, 1)."""
    found = tint(name)
    assert found is not None
    light = daylight_per_lumen() * np.exp(-found.coefficient * distance)
    return xyz_to_rgb709(683.002 * (light @ cmf_xyz()))


def test_light_is_half_as_bright_after_one_unit() -> None:
    weights = daylight_per_lumen() * cmf_xyz()[:, 1]
    for each in tints():
        assert each.coefficient.min() >= 0.0
        assert weights @ np.exp(-each.coefficient) / weights.sum() == pytest.approx(0.5, abs=1e-6)
        assert each.dispersion.n_d > 1.3
    assert half_distance(np.full(401, 2.0)) == pytest.approx(np.log(2.0) / 2.0)
    assert half_distance(np.zeros(401)) == np.inf


@pytest.mark.parametrize(
    ("name", "strongest"),
    [("cobalt blue", 2), ("Emerald Green", 1), ("ruby-red", 0), ("amber", 0), ("bottle green", 1), ("gold ruby", 0)],
)
def test_a_tint_has_the_colour_of_its_name(name: str, strongest: int) -> None:
    rgb = seen_through(name, 2.0)
    assert rgb.argmax() == strongest and rgb.min() < 0.6 * rgb.max()


def test_smoke_is_grey() -> None:
    rgb = seen_through("smoke", 2.0)
    assert rgb.max() - rgb.min() < 0.02


def test_a_tint_is_kept_by_name_and_depth(tmp_path: Path) -> None:
    scene = load_scene(PRISM)
    amber = tint("amber")
    assert amber is not None
    save_scene(set_tint(scene, 0, amber, 0.25), tmp_path / "a.toml")
    assert 'tint = "amber"' in (tmp_path / "a.toml").read_text()
    read = load_scene(tmp_path / "a.toml").objects[0].material.absorption
    found = tint_of(read.coefficient)
    assert load_scene(tmp_path / "a.toml").objects[0].material.words() == "Schott N-SF11, tinted amber"
    assert found is not None and found[0] is amber and found[1] == pytest.approx(0.25)


def test_a_tint_that_is_not_there_is_told(tmp_path: Path) -> None:
    text = PRISM.read_text().replace(
        'glass = "N-SF11"', 'material = { glass = "N-SF11", absorption = { tint = "ambre", distance = 1 } }'
    )
    with pytest.raises(UserError, match="did you mean 'amber'"):
        load(tmp_path, text)


def test_presets_and_staging_know_the_names_and_fit_the_depth() -> None:
    scene = load_scene(PRISM)
    preset = next(each for each in presets.material_presets() if each.name == "Ruby red")
    material = presets.apply_material(scene, 0, preset).objects[0].material
    assert material.dispersion.name.startswith("sapphire")
    found = tint_of(material.absorption.coefficient)
    assert found is not None and found[0].name == "ruby red"
    side = float(np.ptp(scene.objects[0].mesh.vertices, axis=0).min())
    assert found[1] == pytest.approx(0.5 * side, rel=0.5)
    mesh = load_scene(assets_dir() / "meshes" / "trefoil_knot.ply", Staging(glass=((None, "cobalt blue"),)))
    blue = next(item.material for item in mesh.objects if item.material.transmits)
    assert tint_of(blue.absorption.coefficient)[0].name == "cobalt blue"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(assets_dir() / "scenes" / "prism.toml")


def glass_index(scene: Scene) -> int:
    return next(i for i, o in enumerate(scene.objects) if isinstance(o.material, Dielectric))


@pytest.mark.parametrize("preset", presets.material_presets(), ids=lambda p: p.name)
def test_every_glass_applies_and_its_remark_is_true(scene: Scene, preset: presets.MaterialPreset) -> None:
    index = glass_index(scene)
    changed = presets.apply_material(set_priority(scene, index, 7), index, preset)
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
    assert light_power(after) == pytest.approx(light_power(before))
    assert spectrum_words(after.spectral_power)[0] == preset.kind
    for value in re.findall(r"(\d+) K", preset.remark):
        assert preset.kind == "illuminant" or float(value) == preset.value


def test_the_sun_widens_a_directional_light_only(scene: Scene) -> None:
    sun = next(p for p in presets.light_presets() if p.name == "Sun")
    point = set_light_kind(scene, 0, "point")
    assert presets.apply_light(point, 0, sun).lights[0].kind == "point"
    wide = set_light_kind(scene, 0, "directional")
    assert presets.apply_light(wide, 0, sun).lights[0].angular_diameter_deg == 0.53
