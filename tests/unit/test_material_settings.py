"""Settings of materials (rough glass, gratings, finishes of receivers): keys and what is said of wrong ones, saving,
animation, what an edit does again, and what programs are compiled for."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.commands.inspect_features import static_costs
from spectrasplat.edit import objects
from spectrasplat.edit.objects import set_material
from spectrasplat.features.facts import Facts, beam_objects, camera_needs, why_no_beams
from spectrasplat.features.features import Features
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.obj_materials import _materials
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.materials import MATERIAL_KINDS, Material, Mirror
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.scene import Diffuse, Grating, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import _object

from tests.unit.gltf_builder import Builder, glass_material
from tests.unit.scene_texts import load

GLASS, GRATING, PAINT = 'glass = "N-SF11"\n', 'kind = "grating"\n', 'kind = "diffuse"\ncolour = [0.5, 0.25, 0.125]\n'
MEASURED = 'kind = "diffuse"\nreflectance = { nm = [380, 780], values = [0.2, 0.6] }\n'


def read(keys: str) -> Any:
    return read_material(SceneTable(tomllib.loads(keys), Path("s.toml")))


def shipped(name: str) -> Scene:
    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


def with_material(scene: Scene, index: int, **changed: object) -> Scene:
    return set_material(scene, index, scene.objects[index].material.changed(**changed))


def ground(scene: Scene, roughness: float = 0.3) -> Scene:
    """Its first object, which is glass, with a rough surface."""
    return with_material(scene, 0, roughness=roughness)


def finished(scene: Scene, **finish: float) -> Scene:
    """Its second object, which is the table, with a finish."""
    return set_material(scene, 1, Diffuse(**finish))


@pytest.fixture(scope="module")
def prism() -> Scene:
    return shipped("prism")


@pytest.fixture(scope="module")
def spectrometer() -> Scene:
    return shipped("spectrometer")


# -- keys -----------------------------------------------------------------------------------


def test_keys_mean_what_they_say() -> None:
    assert read(GLASS + "roughness = 0.4").microfacet_width == pytest.approx(0.16)
    assert read(GRATING) == Grating()
    assert read(GRATING + "orders = [2, 0]\nefficiency = 0.4").efficiency == (0.4, 0.4)
    assert sum(read(GRATING + "orders = [0, 1, 2, 3, 4, 5]").efficiency) <= 1.0 + 1e-9
    whole = "orders = [1]\nefficiency = [1.0]\nlines_per_mm = 5000\nreflects = true\ndirection = [2, 0, 0]"
    assert read(GRATING + whole) == Grating(5000.0, (1,), (1.0,), True, (1.0, 0.0, 0.0))
    assert read(MEASURED + "roughness = 0.3").roughness == 0.3


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        (GLASS + "roughness = -0.1", "roughness"),
        (GLASS + "roughness = 1.5", "at most 1"),
        (GRATING + "efficiency = 0.4", "adds up to 1.2"),
        (GRATING + "efficiency = [0.5, 0.4, 0.3]", "adds up to 1.2"),
        (GRATING + "efficiency = [0.5, 0.4]", "has 2 entries but needs 3"),
        (GRATING + "efficiency = [0.5, -0.1, 0.1]", "holds -0.1"),
        (GRATING + "orders = []", "is empty"),
        (GRATING + "orders = [1, 1]", "names the order 1 twice"),
        (GRATING + "orders = [51]", "from -50 to 50"),
        (GRATING + "line_per_mm = 600", "lines_per_mm"),
        (PAINT + "coat_index = 1.4", "there is none; give its 'roughness'"),
        (MEASURED + "diffuse_roughness = 0.3", "goes with 'colour' only"),
    ],
)
def test_bad_keys_get_a_sentence(keys: str, told: str) -> None:
    with pytest.raises(UserError, match="s.toml") as error:
        read(keys)
    assert told in str(error.value) and "\n" not in str(error.value)


# -- in scenes ------------------------------------------------------------------------------

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


def roughness(scene: Scene) -> list[float]:
    return [item.material.roughness if item.material.transmits else 0.0 for item in scene.objects]


def test_roughness_stands_on_objects_and_on_materials(tmp_path: Path) -> None:
    assert roughness(load(tmp_path, SCENE)) == [0.4, 0.0, 0.2]
    above = load(tmp_path, SCENE + "roughness = 0.7\n")
    assert roughness(above)[2] == 0.7, "the object's goes above the material's"
    assert "roughness 0.4" in above.objects[0].material.words()
    with pytest.raises(UserError, match="is for the surface of glass"):
        load(tmp_path, SCENE.replace('material = "diffuse"', 'material = "diffuse"\nroughness = 0.1'))


@pytest.mark.parametrize("suffix", [".toml", ".glb"])
def test_scene_files_and_glb_keep_them(prism: Scene, spectrometer: Scene, tmp_path: Path, suffix: str) -> None:
    for scene in (ground(prism, 0.35), finished(prism, roughness=0.25, diffuse_roughness=0.5), spectrometer):
        (save_gltf if suffix == ".glb" else save_scene)(scene, tmp_path / f"again{suffix}")
        again = {item.name: item.material for item in load_scene(tmp_path / f"again{suffix}").objects}
        assert all(again[item.name].values() == item.material.values() for item in scene.objects)


def test_other_programs_files_bring_their_roughness(tmp_path: Path) -> None:
    for factor, wanted in ((0.35, 0.35), (None, 0.0), (7.0, 1.0)):
        values = glass_material() | ({} if factor is None else {"pbrMetallicRoughness": {"roughnessFactor": factor}})
        found = load_gltf(Builder().tetrahedron(values).written(tmp_path / "m.glb"))
        assert found.objects[0].material.roughness == wanted
        assert any("roughnessFactor" in note for note in found.notes) == (factor is None)
    told = _materials("newmtl ice\nNi 1.6\nillum 7\nPr 0.3\nnewmtl pane\nd 0.1\nPr two\n", "m.mtl", notes := [])
    assert told["ice"].material().roughness == 0.3 and told["pane"].material().roughness == 0.0
    assert "'Pr'" in notes[0]


# -- edits ----------------------------------------------------------------------------------


def test_a_grating_is_a_sheet_whose_lines_lie_in_it(spectrometer: Scene) -> None:
    screen = next(o for o in spectrometer.objects if o.material.receives)
    solid = replace(spectrometer.objects[0], mesh=box((1.0, 1.0, 1.0)))
    painted = replace(spectrometer, objects=(replace(solid, material=screen.material), *spectrometer.objects[1:]))
    with pytest.raises(UserError, match="closed solid and a grating a thin sheet"):
        objects.set_material(painted, 0, solid.material)
    with pytest.raises(UserError, match="along the normal"):
        objects.set_material(spectrometer, 0, Grating(direction=(0.0, 0.0, 1.0)))
    turn = np.diag([1.0, 1.0, 1.0, 1.0])
    turn[:3, :3] = [[0, -2, 0], [2, 0, 0], [0, 0, 2]]
    assert np.allclose(Grating().lines_in_world(turn), [-1.0, 0.0, 0.0])


def cost(old: Material, new: Material) -> DirtyLevel:
    """What the viewer does again."""
    return _object(*(SceneObject("thing", MESH, material, np.eye(4)) for material in (old, new)))


MESH = plane(1.0, 1.0)
ROUGH, LINES = read(GLASS + "roughness = 0.2"), Grating()


@pytest.mark.parametrize(
    ("old", "new", "level"),
    [
        (read(GLASS), ROUGH, DirtyLevel.BUILD),
        (ROUGH, read(GLASS + "roughness = 0.3"), DirtyLevel.TRACE),
        (LINES, replace(LINES, lines_per_mm=700.0), DirtyLevel.TRACE),
        (LINES, replace(LINES, orders=(1,), efficiency=(0.5,)), DirtyLevel.BUILD),
        (Mirror((0.5, 0.5, 0.5)), Mirror((0.9, 0.1, 0.1)), DirtyLevel.BUILD),
    ],
)
def test_what_an_edit_does_again(old: Material, new: Material, level: DirtyLevel) -> None:
    assert cost(old, new) == level and cost(old, old) == DirtyLevel.NOTHING


@pytest.mark.parametrize("old", MATERIAL_KINDS)
@pytest.mark.parametrize("new", MATERIAL_KINDS)
def test_every_kind_can_become_every_other(old: str, new: str) -> None:
    level = cost(MATERIAL_KINDS[old].usual(), MATERIAL_KINDS[new].usual())
    assert level == (DirtyLevel.NOTHING if old == new else DirtyLevel.BUILD)


# -- programs -------------------------------------------------------------------------------


def test_only_rough_glass_has_lobes_and_beams_leave_it_to_photons(prism: Scene) -> None:
    plain, rough = (Features.of(each, RenderSettings()) for each in (prism, ground(prism)))
    assert not plain.rough and not plain.has_lobe_columns
    assert "ROUGH_SURFACES" not in plain.defines() and "LOBE_COLUMNS" not in plain.defines()
    assert rough.rough and rough.has_lobe_columns and not replace(rough, footprints=False).has_lobe_columns
    facts = Facts(ground(prism), RenderSettings())
    assert static_costs(facts, rough)["rough surfaces"] == "64 B a ray"
    told = {name: (included, reason) for name, included, reason in rough.explain(facts)}
    assert told["rough surfaces"][0] and "prism" in told["rough surfaces"][1]
    assert beam_objects(prism) and not beam_objects(ground(prism)) and not rough.beams
    assert why_no_beams(ground(prism).objects[0]) == "its surface is rough"


def test_a_grating_takes_a_spectral_column_as_glass_does(spectrometer: Scene) -> None:
    features = Features.of(spectrometer, RenderSettings())
    assert features.gratings and features.spectral_groups == 1 and not features.dielectrics and not features.reindexed
    assert camera_needs(spectrometer, RenderSettings()) == (True, True)
    assert ("gratings", True, "there are gratings") in features.explain(Facts(spectrometer, RenderSettings()))
    assert not Features.of(spectrometer, RenderSettings(editable=True)).reindexed


def test_only_a_finish_has_its_features(prism: Scene) -> None:
    plain, glossy, rough = (
        Features.of(each, RenderSettings())
        for each in (prism, finished(prism, roughness=0.2), finished(prism, diffuse_roughness=0.2))
    )
    assert not plain.coats and not plain.rough_diffuse
    assert glossy.coats and glossy.camera_specular and not glossy.rough_diffuse
    assert rough.rough_diffuse and replace(rough, rough_diffuse=False) == plain
