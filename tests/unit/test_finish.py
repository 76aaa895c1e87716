"""Finishes of receivers: what a scene file says and is refused, what is saved, tables of a coat's albedo."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference import finish
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import edits, parameters
from spectrasplat.features.features import Features
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.io.toml_text import toml_text
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.optics import coat, rough_diffuse
from spectrasplat.model.scene import Diffuse
from spectrasplat.model.settings import RenderSettings

PLAIN = {"kind": "diffuse", "colour": [0.5, 0.25, 0.125]}


def read(values: dict[str, object], tmp_path: Path) -> Diffuse:
    plain = tomllib.loads(toml_text({"materials": {"wood": values}}))["materials"]["wood"]
    material = read_material(SceneTable(plain, tmp_path / "scene.toml", "materials.wood"))
    assert isinstance(material, Diffuse)
    return material


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"roughness": 0.25},
        {"roughness": 0.0, "coat_index": 1.7},
        {"diffuse_roughness": 0.5},
        {"roughness": 1.0, "diffuse_roughness": 1.0},
    ],
)
def test_a_finish_is_read_and_written_back(told: dict[str, float], tmp_path: Path) -> None:
    material = read(PLAIN | told, tmp_path)
    assert material.values() == PLAIN | told
    assert read(material.values(), tmp_path) == material
    assert material.has_coat == ("roughness" in told)
    assert (material.content() == Diffuse(material.reflectance_rgb).content()) == (not told)
    assert ("coat" in material.words()) == material.has_coat


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"roughness": 1.5}, "roughness.*is 1.5 but must be at most 1"),
        ({"roughness": "smooth"}, "roughness.*must be a number"),
        ({"coat_index": 1.4}, "coat_index.*there is none; give its 'roughness'"),
        ({"roughness": 0.1, "coat_index": 0.9}, "coat_index.*must be at least 1"),
        ({"diffuse_roughness": -0.1}, "diffuse_roughness.*must be at least 0"),
        ({"rougness": 0.1}, "did you mean 'roughness'"),
    ],
)
def test_what_cannot_be_is_one_sentence_with_the_key(told: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message):
        read(PLAIN | told, tmp_path)


def test_a_measured_reflectance_may_be_coated_but_is_not_rough(tmp_path: Path) -> None:
    measured = {"kind": "diffuse", "reflectance": {"nm": [380, 780], "values": [0.2, 0.6]}}
    assert read(measured | {"roughness": 0.3}, tmp_path).roughness == 0.3
    with pytest.raises(UserError, match="diffuse_roughness.*goes with 'colour' only"):
        read(measured | {"diffuse_roughness": 0.3}, tmp_path)


def test_edits_of_colour_keep_the_finish_and_numbers_are_animated() -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    index = next(i for i, o in enumerate(scene.objects) if o.material.receives)
    scene = edits.set_material(scene, index, Diffuse(roughness=0.25, diffuse_roughness=0.5))
    scene = edits.set_diffuse_colour(scene, index, (0.1, 0.2, 0.3))
    assert scene.objects[index].material == Diffuse((0.1, 0.2, 0.3), roughness=0.25, diffuse_roughness=0.5)
    stage = parameters.Stage(scene, scene.camera)
    path = f"objects.{scene.objects[index].name}.roughness"
    moved = parameters.apply(stage, path, 0.75)
    assert moved.scene.objects[index].material.roughness == 0.75


def test_only_scenes_with_a_finish_have_its_features() -> None:
    scene, settings = load_scene(assets_dir() / "scenes" / "prism.toml"), RenderSettings()
    index = next(i for i, o in enumerate(scene.objects) if o.material.receives)
    plain = Features.of(scene, settings)
    assert not plain.coats and not plain.rough_diffuse
    glossy = Features.of(edits.set_material(scene, index, Diffuse(roughness=0.2)), settings)
    assert glossy.coats and glossy.camera_specular and not glossy.rough_diffuse
    rough = Features.of(edits.set_material(scene, index, Diffuse(diffuse_roughness=0.2)), settings)
    assert rough.rough_diffuse and replace(rough, rough_diffuse=False) == plain


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_the_albedo_of_a_coat_is_its_lobe_summed_up(alpha: float) -> None:
    """Against a plain sum over the hemisphere, which draws nothing."""
    directions, weights = finish.hemisphere(1200, 700)
    for cosine in (0.95, 0.5, 0.2):
        o = np.broadcast_to(finish.toward(cosine), directions.shape)
        summed = (weights * finish.lobe(np.array(alpha), np.array(1.5), o, directions)).sum()
        assert coat.directional_albedo(alpha, 1.5, np.array([cosine]))[0] == pytest.approx(summed, rel=3e-3)


def test_base_and_coat_return_all_light_from_every_side() -> None:
    """Over a base that absorbs nothing: E + ∫ (1 − E)(1 − E) / (1 − mean) cos / π = 1."""
    cosine = np.linspace(0.0, 1.0, 1025)
    for alpha, index in ((0.0, 1.5), (0.0625, 1.5), (1.0, 2.5)):
        albedo, under = coat.coat_tables(alpha, index, 1025)
        returned = albedo + (1.0 - albedo) * 2.0 * np.trapezoid(under * cosine, cosine)
        np.testing.assert_allclose(returned, 1.0, atol=1e-12)
        assert (albedo >= 0.0).all() and (albedo <= 1.0).all()


def test_single_scattering_alone_would_lose_much_of_a_rough_lobe() -> None:
    """How large the loss is that the base gets back: nothing when polished, seven tenths of a lossless lobe at 1."""
    seen = np.array([1.0])
    for alpha, lost in ((0.0, 0.0), (0.0625, 0.005), (0.25, 0.084), (1.0, 0.693)):
        assert 1.0 - coat.directional_albedo(alpha, np.inf, seen)[0] == pytest.approx(lost, abs=2e-3)


def test_a_rough_base_sends_back_its_albedo() -> None:
    directions, weights = finish.hemisphere(100, 100)
    for reflectance in (0.2, 0.8, 1.0):
        for cosine in (0.9, 0.3):
            o = np.broadcast_to(finish.toward(cosine), directions.shape)
            sent = finish.eon(np.array([reflectance]), 0.7, o, directions)[:, 0]
            summed = (weights * directions[:, 2] * sent).sum() / np.pi
            assert rough_diffuse.albedo(np.array(reflectance), 0.7, np.array(cosine)) == pytest.approx(summed, abs=4e-4)
            assert summed <= 1.0 + 4e-4
    assert summed == pytest.approx(1.0, abs=4e-4)
