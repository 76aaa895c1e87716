"""Crystals and polarisers in the words of a scene file, and what of them is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.commands.glass import describe
from spectrasplat.edit.glass import set_dispersion, set_dispersion_gain
from spectrasplat.edit.parameters import paths
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.lights import PointLight
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.optics.catalogue import find, find_entry
from spectrasplat.model.optics.crystals import crystals, find_crystal
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Grating,
    Material,
    Mirror,
    Polariser,
    Scene,
    SceneObject,
)
from spectrasplat.model.scene_checks import check_scene
from spectrasplat.model.scene_key import scene_key


def read(values: dict[str, Any]) -> Material:
    return read_material(SceneTable(values, Path("scene.toml"), "materials.x"))


def scene_of(material: Material) -> Scene:
    things = (SceneObject("thing", box((1.0, 1.0, 1.0)), material), SceneObject("floor", plane(9.0, 9.0), Diffuse()))
    lamp = PointLight("lamp", illuminant("D65"), (0.0, 0.0, 5.0))
    return Scene("test", Camera((0.0, -5.0, 2.0), (0.0, 0.0, 0.0)), (lamp,), things)


@pytest.mark.parametrize(
    ("name", "n_o", "n_e"),
    [
        ("calcite", 1.6584, 1.4864),
        ("quartz", 1.5442, 1.5533),
        ("sapphire", 1.7681, 1.7600),
        ("zircon", 1.925, 1.984),
        ("rutile", 2.613, 2.909),
        ("ice", 1.3090, 1.3104),
        ("magnesium fluoride", 1.3777, 1.3895),
    ],
)
def test_indices_at_the_sodium_line(name: str, n_o: float, n_e: float) -> None:
    """Hecht, Optics (5th ed.), table 8.1; gem tables."""
    crystal = find_crystal(name)
    assert float(crystal.ordinary.index(589.3)) == pytest.approx(n_o, abs=1e-3)
    assert float(crystal.extraordinary.index(589.3)) == pytest.approx(n_e, abs=1e-3)


def test_a_crystal_has_all_names_of_its_substance() -> None:
    for one, other in (("Ruby", "sapphire"), ("emerald", "beryl"), ("citrine", "quartz"), ("TiO2", "rutile")):
        assert find_crystal(one).extraordinary == find_crystal(other).extraordinary
    assert all(crystal.ordinary != crystal.extraordinary for crystal in crystals().values())


def test_the_glass_command_says_what_is_a_crystal() -> None:
    assert 'crystal = "beryl", n_e 1.577' in describe(find_entry("emerald"))
    assert "crystal" not in describe(find_entry("N-BK7"))


@pytest.mark.parametrize(
    "values",
    [
        {"crystal": "calcite"},
        {"crystal": "quartz", "axis": [0.6, 0.8, 0.0], "dispersion_gain": 2.0},
        {"ordinary": {"n_d": 1.7, "V_d": 40.0}, "extraordinary": {"n_d": 1.55}},
        {"ordinary": {"glass": "Schott N-BK7"}, "extraordinary": {"glass": "Schott N-SF11"}},
    ],
)
def test_a_crystal_is_written_as_it_was_read(values: dict[str, Any]) -> None:
    crystal = read(values)
    assert crystal.is_crystal and crystal.polarises and crystal.why_no_beams
    assert crystal.values() == values
    assert read(crystal.values()) == crystal


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"crystal": "calcit"},
            "materials.x.crystal: 'calcit' is no uniaxial crystal that is known, did you mean 'cal",
        ),
        ({"crystal": "N-BK7"}, "'spectrasplat glass extraordinary' lists all"),
        ({"crystal": "calcite", "glass": "N-BK7"}, "materials.x.crystal cannot stand beside 'glass'"),
        ({"glass": "N-BK7", "axis": [0, 0, 1]}, "materials.x.axis is a crystal's: give 'crystal'"),
        ({"extraordinary": {"n_d": 1.6}}, "materials.x.extraordinary needs 'ordinary' beside it"),
    ],
)
def test_what_cannot_be_is_a_sentence(values: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError) as caught:
        read(values)
    assert message in str(caught.value) and str(caught.value).startswith("scene.toml: ")


@pytest.mark.parametrize("key", [{"roughness": 0.2}, {"thin": True}, {"film_nm": 400.0}, {"coating": "ar"}])
def test_what_crystals_do_not_carry_is_refused(key: dict[str, Any]) -> None:
    crystal = read({"crystal": "calcite", **key})
    with pytest.raises(UserError, match=f"'thing' is a crystal with '{next(iter(key))}'"):
        crystal.check_on(box((1.0, 1.0, 1.0)), "thing", "scene.toml")


def test_a_polariser_is_a_sheet_with_its_axis_in_it() -> None:
    with pytest.raises(UserError, match="is a closed solid and a polariser a thin sheet"):
        Polariser().check_on(box((1.0, 1.0, 1.0)), "thing", "scene.toml")
    with pytest.raises(UserError, match="runs along the normal of its surface"):
        Polariser(axis=(0.0, 0.0, 1.0)).check_on(plane(1.0, 1.0), "thing", "scene.toml")


def test_sheets_in_and_on_crystals_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Dielectric, "check_on", lambda *_: None)
    monkeypatch.setattr(Polariser, "check_on", lambda *_: None)
    crystal = scene_of(read({"crystal": "calcite"}))
    for height, fits in ((0.0, False), (0.5, False), (0.5001, False), (0.7, True)):
        place = np.eye(4)
        place[2, 3] = height
        for sheet in (Polariser(), Grating(), Dielectric(find("N-BK7"), thin=True), Mirror(metal="gold")):
            scene = replace(crystal, objects=(*crystal.objects, SceneObject("sheet", plane(0.5, 0.5), sheet, place)))
            if fits:
                check_scene(scene, "scene.toml")
            else:
                with pytest.raises(UserError, match="'sheet' lies in the crystal of 'thing' or on it"):
                    check_scene(scene, "scene.toml")


def test_equal_indices_are_glass() -> None:
    same = read({"ordinary": {"n_d": 1.6}, "extraordinary": {"n_d": 1.6}})
    assert not same.is_crystal and not scene_of(same).polarised
    assert scene_of(read({"crystal": "ice"})).polarised and scene_of(Polariser()).polarised


def test_the_axis_turns_with_the_object() -> None:
    turned = np.eye(4)
    turned[:3, :3] = [[0.0, 0.0, 2.0], [0.0, 2.0, 0.0], [-2.0, 0.0, 0.0]]
    crystal = read({"crystal": "calcite"})
    assert isinstance(crystal, Dielectric)
    np.testing.assert_allclose(crystal.axis_in_world(turned), [1.0, 0.0, 0.0])
    assert scene_key(scene_of(crystal)) != scene_key(scene_of(replace(crystal, axis=(1.0, 0.0, 0.0))))


def test_edits_know_both_indices() -> None:
    scene = scene_of(read({"crystal": "calcite"}))
    gained = set_dispersion_gain(scene, 0, 3.0).objects[0].material
    assert gained.is_crystal and gained.dispersion.gain == gained.extraordinary.gain == 3.0
    assert gained.values()["crystal"] == "calcite"
    assert not set_dispersion(scene, 0, find("N-BK7")).objects[0].material.is_crystal
    known = paths(scene, scene.camera)
    assert "objects.thing.dispersion_gain" in known and "objects.thing.n_d" not in known
