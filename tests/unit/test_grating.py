"""The grating as a material: keys and what is said of wrong ones, saving, animation, what it compiles and costs."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import objects
from spectrasplat.edit.parameters import Stage, apply, paths, value_of
from spectrasplat.features.explained import explain
from spectrasplat.features.features import Features, camera_needs
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.scene import Grating, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import _object


def read(keys: str) -> Grating:
    material = read_material(SceneTable(tomllib.loads('kind = "grating"\n' + keys), Path("s.toml")))
    assert isinstance(material, Grating)
    return material


@pytest.fixture(scope="module")
def spectrometer() -> Scene:
    return load_scene(assets_dir() / "scenes" / "spectrometer.toml")


def test_defaults_and_shared_efficiency() -> None:
    assert read("") == Grating()
    assert read("orders = [2, 0]\nefficiency = 0.4").efficiency == (0.4, 0.4)
    assert sum(read("orders = [0, 1, 2, 3, 4, 5]").efficiency) <= 1.0 + 1e-9
    whole = read("orders = [1]\nefficiency = [1.0]\nlines_per_mm = 5000\nreflects = true\ndirection = [2, 0, 0]")
    assert whole == Grating(5000.0, (1,), (1.0,), True, (1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("efficiency = 0.4", "adds up to 1.2"),
        ("efficiency = [0.5, 0.4, 0.3]", "adds up to 1.2"),
        ("efficiency = [0.5, 0.4]", "has 2 entries but needs 3"),
        ("efficiency = [0.5, -0.1, 0.1]", "holds -0.1"),
        ("efficiency = 2", "at most 1"),
        ("orders = []", "is empty"),
        ("orders = [0.5]", "whole numbers"),
        ("orders = [1, 1]", "names the order 1 twice"),
        ("orders = [51]", "from -50 to 50"),
        ("orders = 1", "must be a list"),
        ("lines_per_mm = 0", "at least 1"),
        ("lines_per_mm = 20000", "at most 10000"),
        ("lines_per_mm = nan", "finite"),
        ("direction = [0, 0, 0]", "zero vector"),
        ("reflects = 1", "true or false"),
        ("line_per_mm = 600", "lines_per_mm"),
    ],
)
def test_bad_keys_get_a_sentence(keys: str, told: str) -> None:
    with pytest.raises(UserError, match="s.toml") as error:
        read(keys)
    assert told in str(error.value)
    assert str(error.value).count("\n") == 0


def test_no_closed_solid_and_no_lines_along_the_normal(spectrometer: Scene) -> None:
    table = next(i for i, o in enumerate(spectrometer.objects) if o.name == "table")
    solid = replace(spectrometer.objects[0], mesh=box((1.0, 1.0, 1.0)))
    with pytest.raises(UserError, match="closed solid and a grating a thin sheet"):
        objects.with_object(
            replace(
                spectrometer,
                objects=(replace(solid, material=spectrometer.objects[table].material), *spectrometer.objects[1:]),
            ),
            0,
            solid,
        )
    with pytest.raises(UserError, match="along the normal"):
        objects.set_material(spectrometer, 0, Grating(direction=(0.0, 0.0, 1.0)))


def test_is_saved_in_scene_files_and_in_glb(spectrometer: Scene, tmp_path: Path) -> None:
    save_scene(spectrometer, tmp_path / "again.toml")
    assert load_scene(tmp_path / "again.toml").objects[0].material == spectrometer.objects[0].material
    save_gltf(spectrometer, tmp_path / "again.glb")
    again = {o.name: o for o in load_gltf(tmp_path / "again.glb").objects}
    assert again["grating"].material == spectrometer.objects[0].material


def test_lines_can_be_animated(spectrometer: Scene) -> None:
    stage = Stage(spectrometer, spectrometer.camera, 0.0)
    path = "objects.grating.lines_per_mm"
    assert path in paths(spectrometer, spectrometer.camera) and value_of(stage, path) == 600.0
    assert "objects.screen.lines_per_mm" not in paths(spectrometer, spectrometer.camera)
    finer = apply(stage, path, 1200.0)
    assert value_of(finer, path) == 1200.0
    with pytest.raises(UserError, match="out of range"):
        apply(stage, path, 0.5)


def test_other_numbers_trace_again_and_other_orders_build_again(spectrometer: Scene) -> None:
    item = spectrometer.objects[0]

    def cost(**changed) -> DirtyLevel:
        return _object(item, replace(item, material=replace(item.material, **changed)))

    assert cost() == DirtyLevel.NOTHING
    assert cost(lines_per_mm=700.0) == DirtyLevel.TRACE
    assert cost(orders=(1,), efficiency=(0.5,)) == DirtyLevel.BUILD


def test_takes_a_spectral_column_as_glass_does(spectrometer: Scene) -> None:
    features = Features.of(spectrometer, RenderSettings())
    assert features.gratings and features.spectral_groups == 1 and not features.dielectrics and not features.reindexed
    assert camera_needs(spectrometer, RenderSettings()) == (True, True)
    assert ("gratings", True, "there are gratings") in explain(spectrometer, features)
    edited = Features.of(spectrometer, RenderSettings(anchor_weights=True))
    assert not edited.reindexed


def test_lines_turn_with_the_object() -> None:
    turn = np.diag([1.0, 1.0, 1.0, 1.0])
    turn[:3, :3] = [[0, -2, 0], [2, 0, 0], [0, 0, 2]]
    item = SceneObject("g", box((1, 1, 1)), Grating(), turn)
    assert np.allclose(item.material.lines_in_world(item.object_to_world), [-1.0, 0.0, 0.0])
