"""Saving glTF: a scene comes back as itself, and of a loaded document only what was edited changes."""

from __future__ import annotations

import base64
import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_document import open_document
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.spectrum import blackbody, illuminant, laser
from spectrasplat.model.scene import (
    Absorption,
    Black,
    Camera,
    Dab,
    Dielectric,
    Diffuse,
    Mirror,
    RenderDefaults,
    Scene,
    SceneObject,
)

from tests.unit.gltf_builder import Builder, glass_material


def _rich_scene() -> Scene:
    ball = primitives.sphere(0.5, 320)
    moved, mirrored = np.eye(4), np.diag([-1.0, 2.0, 1.0, 1.0])
    moved[:3, 3] = (0.0, 1.5, 0.25)
    tint = Absorption.of_colour((0.5, 0.9, 0.8), 1.5)
    grey = np.full(401, 0.4) + 0.1 * np.sin(VISIBLE_NM / 50.0)
    return Scene(
        "rich",
        Camera((1.0, 2.0, 5.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=28.0),
        (
            DirectionalLight(
                "sun", illuminant("D65").scaled_to_luminous(2e4), direction=(0.0, -0.6, -0.8), angular_diameter_deg=0.5
            ),
            PointLight("bulb", blackbody(2900.0).scaled_to_luminous(80.0), position=(1.0, 3.0, 0.5)),
            SpotLight("spot", laser(532.0, 2.0), (0.0, 4.0, 0.0), (0.0, -1.0, 0.0), 12.0, 12.0),
            AreaLight(
                "panel",
                illuminant("A").scaled_to_power(3.0),
                (0.0, 5.0, 0.0),
                (0.0, -1.0, 0.0),
                (1.0, 0.0, 0.0),
                shape="rectangle",
                width=2.0,
                height=0.5,
            ),
            CollimatedLight("beam", laser(633.0), (-4.0, 1.0, 0.0), (1.0, 0.0, 0.0), radius=0.1),
        ),
        (
            SceneObject("ball", ball, Dielectric(catalogue.find("N-SF11"), tint, 3)),
            SceneObject("twin", ball, Dielectric(catalogue.find("N-SF11"), tint, 3), moved),
            SceneObject(
                "coefficients", primitives.box(), Dielectric(glass.sellmeier((1.1, 0.2), (0.01, 0.02))), mirrored
            ),
            SceneObject("mirror", primitives.disc(), Mirror((0.9, 0.8, 0.7))),
            SceneObject("stop", primitives.plane(), Black()),
            SceneObject("paint", primitives.plane(4.0, 4.0), Diffuse((0.4, 0.4, 0.4), grey)),
            SceneObject("varnish", primitives.disc(), Diffuse((0.5, 0.6, 0.7), roughness=0.25, coat_index=1.6)),
            SceneObject("clay", primitives.disc(), Diffuse((0.5, 0.3, 0.2), roughness=0.9, diffuse_roughness=0.5)),
            SceneObject("coated paint", primitives.disc(), Diffuse((0.4, 0.4, 0.4), grey, roughness=0.3)),
            SceneObject("floor", primitives.plane(9.0, 9.0), Diffuse((0.5, 0.6, 0.7))),
        ),
    )


def _rounded(value: Any) -> Any:
    """Numbers to twelve digits, so that the last bit of a logarithm does not matter."""
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(v) for v in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def _assert_same(a: Scene, b: Scene, digits: float = 1e-6) -> None:
    assert [o.name for o in a.objects] == [o.name for o in b.objects]
    for one, two in zip(a.objects, b.objects, strict=True):
        assert _rounded(one.material.values()) == _rounded(two.material.values()), one.name
        np.testing.assert_allclose(two.object_to_world, one.object_to_world, atol=1e-12)
        np.testing.assert_allclose(two.mesh.corners(), one.mesh.corners(), atol=digits)
        assert two.mesh.is_closed == one.mesh.is_closed
        assert (one.mesh.corner_normals is None) == (two.mesh.corner_normals is None)
    assert {light.name for light in a.lights} == {light.name for light in b.lights}
    by_name = {light.name: light for light in b.lights}
    for light in a.lights:
        other = by_name[light.name]
        turned = {"direction": other.direction} if light.has_direction else {}
        assert replace(light, spectral_power=other.spectral_power, **turned) == other
        np.testing.assert_allclose(light.direction, other.direction, atol=1e-12)
        np.testing.assert_allclose(light.spectral_power.density, other.spectral_power.density, rtol=1e-9)
        np.testing.assert_allclose(light.spectral_power.lines, other.spectral_power.lines, rtol=1e-9)
    np.testing.assert_allclose(a.camera.position, b.camera.position, atol=1e-12)
    np.testing.assert_allclose(a.camera.target, b.camera.target, atol=1e-9)
    assert a.camera.vertical_fov_deg == pytest.approx(b.camera.vertical_fov_deg)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_round_trip_of_everything_a_scene_holds(tmp_path: Path, suffix: str) -> None:
    scene = _rich_scene()
    save_gltf(scene, tmp_path / f"a{suffix}")
    again = load_gltf(tmp_path / f"a{suffix}")
    _assert_same(scene, again)
    assert again.objects[0].mesh is again.objects[1].mesh
    assert again.notes == ()


def test_saved_file_is_read_by_others(tmp_path: Path) -> None:
    import pygltflib

    save_gltf(_rich_scene(), tmp_path / "a.glb")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    dispersion = document.materials[0].extensions["KHR_materials_dispersion"]["dispersion"]
    assert dispersion == pytest.approx(20.0 / catalogue.find("N-SF11").V_d)
    assert document.materials[0].extensions["KHR_materials_ior"]["ior"] == pytest.approx(1.78472, abs=1e-4)
    varnish = next(m for m in document.materials if m.pbrMetallicRoughness.roughnessFactor == 0.25)
    assert varnish.extensions["KHR_materials_ior"]["ior"] == 1.6 and varnish.pbrMetallicRoughness.metallicFactor == 0.0
    assert set(document.extensionsUsed) >= {"KHR_lights_punctual", "KHR_materials_dispersion"}
    assert document.accessors[document.meshes[0].primitives[0].attributes.POSITION].max == pytest.approx(
        [0.5] * 3, abs=0.01
    )


def _foreign(path: Path) -> Path:
    """A file with much in it that this program does not understand."""
    builder = Builder().tetrahedron(glass_material() | {"emissiveFactor": [0, 0, 1], "extras": {"artist": "me"}})
    builder.json["nodes"] = [
        {"name": "group", "translation": [0, 1, 0], "children": [1, 2], "extras": {"keep": 1}},
        {"name": "tetra", "mesh": 0, "translation": [2, 0, 0]},
        {"name": "empty", "extensions": {"EXT_unknown": {"x": [1, 2]}}},
    ]
    builder.json |= {
        "animations": [{"name": "spin", "channels": [], "samplers": []}],
        "textures": [{"source": 0}],
        "images": [{"uri": "data:image/png;base64," + base64.b64encode(b"png").decode()}],
        "extensionsUsed": ["EXT_unknown"],
        "extensions": {"EXT_unknown": {"y": 3}},
        "extras": {"pipeline": "x"},
    }
    return builder.written(path)


def test_unchanged_scene_keeps_the_document(tmp_path: Path) -> None:
    path = _foreign(tmp_path / "a.glb")
    before = open_document(path).json
    scene = load_gltf(path)
    save_gltf(scene, tmp_path / "b.glb", original=path)
    after = open_document(tmp_path / "b.glb").json
    for key in ("animations", "textures", "images"):
        assert after[key] == before[key]
    assert after["extras"]["pipeline"] == before["extras"]["pipeline"]
    assert after["materials"][0] == before["materials"][0]
    assert after["nodes"][:3] == before["nodes"] and after["meshes"][0] == before["meshes"][0]
    assert after["extensions"]["EXT_unknown"] == {"y": 3}
    # The fitted table, light and camera are now part of the file; saving again changes nothing.
    again = load_gltf(tmp_path / "b.glb")
    assert again.notes == tuple(n for n in scene.notes if not any(word in n for word in ("added", "table", "studio")))
    _assert_same(scene, again)
    save_gltf(again, tmp_path / "c.glb", original=tmp_path / "b.glb")
    assert (tmp_path / "c.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_edits_change_what_they_mean_and_no_more(tmp_path: Path) -> None:
    path = _foreign(tmp_path / "a.glb")
    scene = load_gltf(path)
    tetra, table = scene.objects
    moved = tetra.object_to_world.copy()
    moved[:3, 3] += (0.5, 0.0, 0.0)
    edited = replace(
        scene,
        objects=(
            replace(tetra, material=Dielectric(catalogue.find("F2")), object_to_world=moved),
            table,
            SceneObject("new ball", primitives.sphere(0.2, 80), Mirror()),
        ),
        lights=(PointLight("bulb", illuminant("A").scaled_to_luminous(9.0), (0.0, 3.0, 0.0)),),
    )
    save_gltf(edited, tmp_path / "b.glb", original=path)
    _assert_same(edited, load_gltf(tmp_path / "b.glb"))
    document = open_document(tmp_path / "b.glb").json
    material = document["materials"][0]
    assert material["emissiveFactor"] == [0, 0, 1] and material["extras"]["artist"] == "me"
    assert document["nodes"][0] == open_document(path).json["nodes"][0]
    assert document["nodes"][2]["extensions"] == {"EXT_unknown": {"x": [1, 2]}}
    # And once more, from the saved file: take something away.
    save_gltf(replace(edited, objects=edited.objects[:2]), tmp_path / "c.glb", original=tmp_path / "b.glb")
    _assert_same(replace(edited, objects=edited.objects[:2]), load_gltf(tmp_path / "c.glb"))


def test_one_of_two_instances_can_change(tmp_path: Path) -> None:
    builder = Builder().tetrahedron({"name": "paint"})
    builder.json["nodes"] = [
        {"mesh": 0, "name": "a", "children": [1]},
        {"mesh": 0, "name": "b", "translation": [3, 0, 0]},
    ]
    path = builder.written(tmp_path / "a.glb")
    scene = load_gltf(path)
    first, second, _table = scene.objects
    shift = first.object_to_world.copy()
    shift[0, 3] = -2.0
    # The first carries a child, which must stay where it is.
    edited = replace(scene, objects=(second, replace(first, material=Black(), object_to_world=shift)))
    save_gltf(edited, tmp_path / "b.glb", original=path)
    _assert_same(edited, load_gltf(tmp_path / "b.glb"))


def test_changed_light_and_camera_replace_the_old_ones(tmp_path: Path) -> None:
    save_gltf(_rich_scene(), tmp_path / "a.glb")
    scene = load_gltf(tmp_path / "a.glb")
    lights = {light.name: light for light in scene.lights}
    lights["bulb"] = replace(lights["bulb"], spectral_power=laser(589.0, 1.0))
    lights["sun"] = replace(lights["sun"], direction=(0.0, -1.0, 0.0))
    del lights["beam"]
    camera = replace(scene.camera, position=(0.0, 1.0, 9.0), vertical_fov_deg=50.0)
    edited = replace(scene, lights=tuple(lights.values()), camera=camera)
    save_gltf(edited, tmp_path / "b.gltf", original=tmp_path / "a.glb")
    _assert_same(edited, load_gltf(tmp_path / "b.gltf"))
    assert len(open_document(tmp_path / "b.gltf").json["nodes"]) > 0


def test_save_refuses_other_suffixes_and_keeps_old_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UserError, match=r"\.glb or \.gltf"):
        save_gltf(_rich_scene(), tmp_path / "a.obj")
    save_gltf(_rich_scene(), tmp_path / "a.glb")
    before = (tmp_path / "a.glb").read_bytes()
    monkeypatch.setattr(Path, "write_bytes", lambda self, data: (_ for _ in ()).throw(OSError(28, "full", str(self))))
    with pytest.raises(UserError, match="disk is full"):
        save_gltf(_rich_scene(), tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_bytes() == before and len(list(tmp_path.iterdir())) == 1


# -- edited dispersion ----------------------------------------------------------------------


def _painted_scene() -> Scene:
    scene = _rich_scene()
    objects = list(scene.objects)
    strong = glass.with_gain(catalogue.find("N-SF11"), 3.0)
    objects[0] = replace(objects[0], material=Dielectric(strong, objects[0].material.absorption, 3))
    dabs = (Dab((0.1, 0.2, 0.0), 0.3, 1.25, 0.7), Dab((-0.3, 1 / 3, 0.0), 0.5, 0.0, 1.0, 0.5))
    objects[-1] = replace(objects[-1], local_dispersion=dabs)
    render = RenderDefaults(640, 360, 5_000, -0.5, 12)
    return replace(scene, objects=tuple(objects), background_rgb=(0.1, 0.2, 0.3), render=render)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gain_dabs_background_and_render_defaults_come_back_exactly(tmp_path: Path, suffix: str) -> None:
    scene, path = _painted_scene(), tmp_path / f"a{suffix}"
    save_gltf(scene, path)
    again = load_gltf(path)
    assert again.objects[0].material.dispersion == scene.objects[0].material.dispersion
    assert again.objects[1].material.dispersion.gain == 1.0
    assert [o.local_dispersion for o in again.objects] == [o.local_dispersion for o in scene.objects]
    assert (again.background_rgb, again.render) == (scene.background_rgb, scene.render)


def test_other_viewers_get_the_effective_abbe_number(tmp_path: Path) -> None:
    save_gltf(_painted_scene(), tmp_path / "a.gltf")
    materials = json.loads((tmp_path / "a.gltf").read_text())["materials"]
    told = [
        m["extensions"]["KHR_materials_dispersion"]["dispersion"]
        for m in materials
        if "KHR_materials_dispersion" in m.get("extensions", {})
    ]
    plain = 20.0 / catalogue.find("N-SF11").V_d
    assert told[:2] == [pytest.approx(3.0 * plain), pytest.approx(plain)]


def test_painting_and_erasing_a_loaded_file_touches_only_its_node(tmp_path: Path) -> None:
    save_gltf(_rich_scene(), tmp_path / "a.gltf")
    before = json.loads((tmp_path / "a.gltf").read_text())
    scene = load_gltf(tmp_path / "a.gltf")
    painted = replace(scene.objects[-1], local_dispersion=(Dab((0.0, 0.0, 0.0), 1.0, 1.0),))
    save_gltf(replace(scene, objects=(*scene.objects[:-1], painted)), tmp_path / "b.gltf", tmp_path / "a.gltf")
    after = json.loads((tmp_path / "b.gltf").read_text())
    changed = [a.get("name") for a, b in zip(after["nodes"], before["nodes"], strict=True) if a != b]
    assert changed == ["floor"] and after["materials"] == before["materials"]
    again = load_gltf(tmp_path / "b.gltf")
    assert again.objects[-1].local_dispersion == painted.local_dispersion
    save_gltf(scene, tmp_path / "c.gltf", tmp_path / "b.gltf")
    assert json.loads((tmp_path / "c.gltf").read_text())["nodes"] == before["nodes"]


def test_dabs_follow_their_primitive_when_others_leave_the_node(tmp_path: Path) -> None:
    builder = Builder().tetrahedron({"name": "paint"})
    mesh = builder.json["meshes"][0]
    mesh["primitives"] = [dict(mesh["primitives"][0]) for _ in range(3)]
    path = builder.written(tmp_path / "a.gltf")
    scene = load_gltf(path)
    _, second, third, _table = scene.objects
    dabs = [(Dab((float(i), 0.0, 0.0), 1.0, 1.0),) for i in range(3)]
    moved = np.array(second.object_to_world)
    moved[0, 3] += 5.0
    objects = (
        replace(second, object_to_world=moved, local_dispersion=dabs[1]),
        replace(third, local_dispersion=dabs[2]),
    )
    save_gltf(replace(scene, objects=objects), tmp_path / "b.gltf", path)
    again = {float(o.object_to_world[0, 3]): o.local_dispersion for o in load_gltf(tmp_path / "b.gltf").objects}
    assert again == {5.0: dabs[1], 0.0: dabs[2]}


def test_dabs_on_glass_in_a_glb_are_refused(tmp_path: Path) -> None:
    save_gltf(_painted_scene(), tmp_path / "a.gltf")
    values = json.loads((tmp_path / "a.gltf").read_text())
    kept = next(n for n in values["nodes"] if n["name"] == "floor").pop("extras")
    next(n for n in values["nodes"] if n["name"] == "ball")["extras"] = kept
    (tmp_path / "a.gltf").write_text(json.dumps(values))
    with pytest.raises(UserError, match=r"a\.gltf: nodes.*local_dispersion.*not diffuse"):
        load_gltf(tmp_path / "a.gltf")
