"""Roughness as a property of glass: keys, what is said of wrong ones, saving, animation, what it compiles and costs."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.bench.features.static_costs import RecordSizes, static_costs
from spectrasplat.edit import objects
from spectrasplat.edit.parameters import Stage, apply, value_of
from spectrasplat.features.explained import explain
from spectrasplat.features.features import Features, beam_objects, why_no_beams
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.obj_materials import _materials
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.materials.dielectric import Dielectric
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import _object

from tests.unit.gltf_builder import Builder, glass_material

SCENE = """
[camera]
position = [0, -3, 1]
[[objects]]
name = "ground"
shape = "sphere"
glass = "N-SF11"
roughness = 0.4 # frosted
[[objects]]
name = "table"
shape = "plane"
position = [0, 0, -0.6]
material = "diffuse"
[materials.ice]
glass = "F2"
roughness = 0.2
[[objects]]
name = "ice"
shape = "box"
position = [2, 0, 0]
material = "ice"
"""


def scene(folder: Path, text: str = SCENE) -> Scene:
    path = folder / "scene.toml"
    path.write_text(text)
    return load_scene(path)


def roughness(each: Scene) -> list[float]:
    return [item.material.roughness if item.material.transmits else 0.0 for item in each.objects]


def prism() -> Scene:
    return load_scene(assets_dir() / "scenes" / "prism.toml")


def ground(each: Scene, how: float = 0.3) -> Scene:
    changed = (
        replace(item, material=item.material.changed(roughness=how)) if item.material.transmits else item
        for item in each.objects
    )
    return replace(each, objects=tuple(changed))


def test_it_stands_on_objects_and_on_materials(tmp_path: Path) -> None:
    found = scene(tmp_path)
    assert roughness(found) == [0.4, 0.0, 0.2]
    assert found.objects[0].material.microfacet_width == pytest.approx(0.16)
    above = scene(tmp_path, SCENE + "roughness = 0.7\n")
    assert roughness(above)[2] == 0.7, "the object's goes above the material's"
    assert "roughness 0.4" in found.objects[0].material.words()
    assert "rough" not in prism().objects[0].material.words()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("roughness = 0.4", "roughness = -0.1", "roughness"),
        ("roughness = 0.2", "roughness = 1.5", "roughness"),
        ("roughness = 0.4", "rougness = 0.4", "roughness"),
        ('material = "diffuse"', 'material = "diffuse"\nroughness = 0.1', "is for the surface of glass"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path: Path, old: str, new: str, told: str) -> None:
    with pytest.raises(UserError, match=told) as caught:
        scene(tmp_path, SCENE.replace(old, new))
    assert "\n" not in str(caught.value)


def test_it_is_saved_as_it_was_written(tmp_path: Path) -> None:
    before = scene(tmp_path)
    save_scene(before, tmp_path / "again.toml")
    assert roughness(load_scene(tmp_path / "again.toml")) == roughness(before)
    path = tmp_path / "scene.toml"
    item = before.objects[0]
    edited = replace(item, material=item.material.changed(roughness=0.25))
    save_scene(replace(before, objects=(edited, *before.objects[1:])), path, words_from=path)
    table = tomllib.loads(path.read_text())["objects"][0]
    assert (table["glass"], table["roughness"]) == ("N-SF11", 0.25) and "material" not in table
    assert "# frosted" in path.read_text()
    save_scene(
        replace(before, objects=(replace(item, material=item.material.changed(roughness=0.0)), *before.objects[1:])),
        path,
        words_from=path,
    )
    assert "roughness" not in tomllib.loads(path.read_text())["objects"][0], "polished is what glass is"


def test_it_is_animated_and_edited() -> None:
    base = prism()
    name = next(item.name for item in base.objects if item.material.transmits)
    stage = Stage(base, base.camera)
    changed = apply(stage, f"objects.{name}.roughness", 0.5)
    assert value_of(changed, f"objects.{name}.roughness") == 0.5
    index = [item.name for item in base.objects].index(name)
    assert objects.set_material(base, index, changed.scene.objects[index].material).objects[index].material.is_rough


def test_what_an_edit_redoes() -> None:
    polished, rough, rougher = (
        next(item for item in ground(prism(), how).objects if item.material.transmits) for how in (0.0, 0.2, 0.3)
    )
    rough, rougher = (replace(polished, material=each.material) for each in (rough, rougher))
    assert _object(polished, rough) == DirtyLevel.BUILD
    assert _object(rough, rougher) == DirtyLevel.TRACE
    assert polished.material.content()[-1] == 0.0 and rough.material.content()[-1] == 0.2


def test_scenes_without_it_do_without() -> None:
    base = prism()
    plain, rough = (Features.of(each, RenderSettings()) for each in (base, ground(base)))
    assert not plain.rough and not plain.has_lobe_columns
    assert "ROUGH_SURFACES" not in plain.defines() and "LOBE_COLUMNS" not in plain.defines()
    assert rough.rough and rough.has_lobe_columns and not replace(rough, footprints=False).has_lobe_columns
    assert RecordSizes.of(rough).ray - RecordSizes.of(replace(rough, rough=False)).ray == 64
    assert RecordSizes.of(rough).photon == RecordSizes.of(plain).photon
    assert static_costs(ground(base), rough)["rough surfaces"] == "64 B a ray"
    told = {name: (included, reason) for name, included, reason in explain(ground(base), rough)}
    assert told["rough surfaces"][0] and "prism" in told["rough surfaces"][1]


def test_beams_leave_it_to_photons() -> None:
    base = prism()
    assert beam_objects(base) and not beam_objects(ground(base))
    item = next(o for o in ground(base).objects if o.material.transmits)
    assert why_no_beams(item) == "its surface is rough"
    assert not Features.of(ground(base), RenderSettings()).beams


def test_polished_glass_is_what_it_was() -> None:
    glass = Dielectric(find("N-BK7"))
    assert glass.roughness == 0.0 and not glass.is_rough and "roughness" not in glass.values()
    assert np.isclose(glass.changed(roughness=1.0).microfacet_width, 1.0)


def test_gltf_brings_its_roughness(tmp_path: Path) -> None:
    for factor, wanted in ((0.35, 0.35), (None, 0.0), (7.0, 1.0)):
        values = glass_material() | ({} if factor is None else {"pbrMetallicRoughness": {"roughnessFactor": factor}})
        found = load_gltf(Builder().tetrahedron(values).glb(tmp_path / "m.glb"))
        assert found.objects[0].material.roughness == wanted
        assert any("roughnessFactor" in note for note in found.notes) == (factor is None)
    save_gltf(ground(prism(), 0.35), tmp_path / "own.glb")
    assert 0.35 in roughness(load_gltf(tmp_path / "own.glb"))


def test_obj_glass_brings_its_roughness() -> None:
    found = _materials("newmtl ice\nNi 1.6\nillum 7\nPr 0.3\nnewmtl pane\nd 0.1\nPr two\n", "m.mtl", notes := [])
    assert found["ice"].material().roughness == 0.3 and found["pane"].material().roughness == 0.0
    assert "'Pr'" in notes[0]
