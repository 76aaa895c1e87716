"""glTF: opened directly as a scene, saved without loss, and refused in one sentence when it lies."""

from __future__ import annotations

import base64
import json
import math
import struct
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
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, attenuation_from_colour
from spectrasplat.model.optics.spectrum import blackbody, illuminant, laser, xyz_to_rgb709
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

POSITIONS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype="<f4")
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])


class Builder:
    """Writes small glTF files by hand, so that the reader is not tested with our own writer."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}

    def view(self, content: bytes, stride: int | None = None) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        self.json["bufferViews"].append(entry | ({"byteStride": stride} if stride else {}))
        self.data += content
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values: np.ndarray, kind: str, component: int, **more: Any) -> int:
        entry = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values)}
        self.json["accessors"].append(entry | {"type": kind} | more)
        return len(self.json["accessors"]) - 1

    def tetrahedron(self, material: dict[str, Any] | None = None) -> Builder:
        primitive = {
            "attributes": {"POSITION": self.accessor(POSITIONS, "VEC3", 5126)},
            "indices": self.accessor(FACES.ravel().astype("<u2"), "SCALAR", 5123),
        }
        if material is not None:
            self.json["materials"] = [material]
            primitive["material"] = 0
        self.json |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0, "name": "tetra"}]}
        self.json |= {"scenes": [{"nodes": [0]}], "scene": 0}
        return self

    def glb(self, path: Path) -> Path:
        if self.data:
            self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
        return path


def _glass_material(**volume: Any) -> dict[str, Any]:
    return {
        "name": "crown",
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_ior": {"ior": 1.6},
            "KHR_materials_volume": {"thicknessFactor": 1.0} | volume,
            "KHR_materials_dispersion": {"dispersion": 0.5},
        },
    }


# -- reading ------------------------------------------------------------------------------


def test_bare_glb_gets_light_camera_and_table_and_says_so(tmp_path: Path) -> None:
    scene = load_gltf(Builder().tetrahedron(_glass_material()).glb(tmp_path / "m.glb"))
    glass_object, table = scene.objects
    assert glass_object.name == "tetra" and glass_object.mesh.is_closed
    assert glass_object.mesh.volume() == pytest.approx(1.0 / 6.0)
    assert glass_object.material.dispersion.n_d == pytest.approx(1.6, abs=1e-6)
    assert glass_object.material.dispersion.V_d == pytest.approx(40.0, rel=1e-3)
    assert isinstance(table.material, Diffuse)
    corners = table.mesh.vertices @ table.object_to_world[:3, :3].T + table.object_to_world[:3, 3]
    assert np.ptp(corners[:, 1]) < 1e-12 and -0.01 < corners[0, 1] < 0.0  # below, y is up
    assert scene.lights[0].direction[1] < 0.0
    assert scene.camera.up == (0.0, 1.0, 0.0) and scene.camera.position[1] > 0.5
    text = " ".join(scene.notes)
    assert "No light" in text and "No camera" in text and "table was put" in text


@pytest.mark.parametrize("component", [("u1", 5121), ("<u2", 5123), ("<u4", 5125)])
def test_index_types(tmp_path: Path, component: tuple[str, int]) -> None:
    builder = Builder().tetrahedron()
    builder.json["meshes"][0]["primitives"][0]["indices"] = builder.accessor(
        FACES.ravel().astype(component[0]), "SCALAR", component[1]
    )
    assert load_gltf(builder.glb(tmp_path / "m.glb")).objects[0].mesh.is_closed


def test_strided_sparse_and_normalised_accessors(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    wide = np.zeros((4, 5), "<f4")
    wide[:, :3] = POSITIONS
    wide[3, :3] = 9.0  # put right by the sparse part
    view = builder.view(wide.tobytes(), stride=20)
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(np.array([3], "u1").tobytes()), "componentType": 5121},
        "values": {"bufferView": builder.view(POSITIONS[3].tobytes())},
    }
    builder.json["accessors"].append(
        {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    )
    attributes = builder.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["POSITION"] = len(builder.json["accessors"]) - 1
    attributes["NORMAL"] = builder.accessor(
        np.array([(0, 0, 127, 0)] * 4, "i1")[:, :3].copy(), "VEC3", 5120, normalized=True
    )
    mesh = load_gltf(builder.glb(tmp_path / "m.glb")).objects[0].mesh
    assert mesh.volume() == pytest.approx(1.0 / 6.0)
    np.testing.assert_allclose(mesh.corner_normals, np.broadcast_to([0.0, 0.0, 1.0], (4, 3, 3)))


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])])
def test_strips_and_fans(tmp_path: Path, mode: int, order: list[int]) -> None:
    builder = Builder().tetrahedron()
    square = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "<f4")
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive |= {"mode": mode, "indices": builder.accessor(np.array(order, "<u2"), "SCALAR", 5123)}
    primitive["attributes"]["POSITION"] = builder.accessor(square, "VEC3", 5126)
    mesh = load_gltf(builder.glb(tmp_path / "m.glb")).objects[0].mesh
    np.testing.assert_allclose(mesh.face_normals(), [(0, 0, 1), (0, 0, 1)])
    assert mesh.areas().sum() == pytest.approx(1.0)


def test_hierarchy_instances_and_mirroring(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    half = math.sqrt(0.5)
    builder.json["nodes"] = [
        {"translation": [1, 2, 3], "rotation": [0, 0, half, half], "scale": [2, 2, 2], "children": [1, 2]},
        {"mesh": 0, "translation": [1, 0, 0]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]},
    ]
    scene = load_gltf(builder.glb(tmp_path / "m.glb"))
    first, second = scene.objects
    assert first.mesh is second.mesh
    assert first.name != second.name
    # A quarter turn about z takes x to y; scaled by two, moved by (1, 2, 3).
    np.testing.assert_allclose(first.object_to_world @ [1, 0, 0, 1], [1, 2 + 4, 3, 1], atol=1e-12)
    np.testing.assert_allclose(second.object_to_world @ [1, 0, 0, 1], [1 - 2 * 6, 2 + 2 * 4, 3 + 14, 1], atol=1e-12)


def test_cameras_and_lights(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    down = {"rotation": [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)]}  # -z turned to -y
    builder.json["nodes"] += [
        {"camera": 0, "translation": [0, 0, 5]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 3, 0], **down},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}, "translation": [1, 3, 0], "name": "bulb"},
        {"extensions": {"KHR_lights_punctual": {"light": 2}}, **down},
    ]
    builder.json["scenes"][0]["nodes"] = [0, 1, 2, 3, 4]
    builder.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}]
    spot = {"type": "spot", "name": "spot", "intensity": 40.0, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}}
    lamps = [
        spot,
        {"type": "point", "intensity": 8.0, "color": [1.0, 0.5, 0.25]},
        {"type": "directional", "intensity": 3.0},
    ]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lamps}}
    scene = load_gltf(builder.glb(tmp_path / "m.glb"))
    assert scene.camera.vertical_fov_deg == pytest.approx(math.degrees(0.5))
    assert scene.camera.position == (0.0, 0.0, 5.0) and scene.camera.target[2] < 5.0
    light, bulb, sun = scene.lights
    np.testing.assert_allclose(light.direction, (0.0, -1.0, 0.0), atol=1e-12)
    assert light.position == (0.0, 3.0, 0.0)
    assert light.spectral_power.luminous() == pytest.approx(40.0)
    assert (light.inner_half_angle_deg, light.outer_half_angle_deg) == pytest.approx(np.degrees((0.1, 0.4)))
    assert bulb.name == "bulb"
    np.testing.assert_allclose(xyz_to_rgb709(bulb.spectral_power.xyz()) / 8.0, (1.0, 0.5, 0.25), atol=0.06)
    np.testing.assert_allclose(xyz_to_rgb709(sun.spectral_power.xyz()), 3.0, rtol=1e-6)
    assert scene.notes == ()


def test_orthographic_camera(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    builder.json["nodes"][0]["camera"] = 0
    builder.json["cameras"] = [
        {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1.5, "znear": 0, "zfar": 9}}
    ]
    camera = load_gltf(builder.glb(tmp_path / "m.glb")).camera
    assert camera.kind == "orthographic" and camera.vertical_extent == 3.0


MATERIALS: dict[str, tuple[dict[str, Any], Any]] = {
    "default": ({}, Diffuse((1.0, 1.0, 1.0))),
    "diffuse": (
        {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0}},
        Diffuse((0.1, 0.2, 0.3)),
    ),
    "mirror": (
        {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.8, 0.7, 1], "roughnessFactor": 0.05}},
        Mirror((0.9, 0.8, 0.7)),
    ),
    "named": ({"extras": {"spectrasplat": {"glass": "n-sf11"}}}, Dielectric(catalogue.find("N-SF11"))),
    "short": ({"extras": {"glass": "Schott N-BK7"}}, Dielectric(catalogue.find("N-BK7"))),
    "named wins": (_glass_material() | {"extras": {"glass": "F2"}}, Dielectric(catalogue.find("F2"))),
    "tinted": (
        _glass_material(attenuationColor=[0.5, 0.9, 1.0], attenuationDistance=2.0),
        Dielectric(glass.from_abbe(1.6, 40.0, "crown"), Absorption(attenuation_from_colour((0.5, 0.9, 1.0), 2.0))),
    ),
    "table": (
        {"extras": {"spectrasplat": {"material": {"n_d": 1.7, "V_d": 30.0, "priority": 2}}}},
        Dielectric(glass.from_abbe(1.7, 30.0), priority=2),
    ),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_materials(tmp_path: Path, name: str) -> None:
    values, expected = MATERIALS[name]
    material = load_gltf(Builder().tetrahedron(values).glb(tmp_path / "m.glb")).objects[0].material
    assert material.values() == expected.values()


def test_what_is_left_aside_is_said(tmp_path: Path) -> None:
    material = _glass_material(thicknessFactor=0.0) | {"normalTexture": {"index": 0}}
    builder = Builder().tetrahedron(material)
    builder.json |= {"extensionsUsed": ["KHR_materials_iridescence"], "animations": [{"channels": [], "samplers": []}]}
    text = " ".join(load_gltf(builder.glb(tmp_path / "m.glb")).notes)
    assert "thin-walled" in text and "textures" in text and "KHR_materials_iridescence" in text and "Animations" in text


# -- lies ---------------------------------------------------------------------------------


def _spoiled(change: Any) -> Any:
    def spoil(builder: Builder) -> None:
        change(builder.json)

    return spoil


BROKEN: dict[str, tuple[Any, str]] = {
    "count": (_spoiled(lambda j: j["accessors"][0].update(count=1000)), "promises 1000 elements"),
    "huge": (_spoiled(lambda j: j["accessors"][0].update(count=10**15)), "count must be from 1"),
    "view": (_spoiled(lambda j: j["bufferViews"][0].update(byteLength=10**9)), "its buffer has"),
    "offset": (_spoiled(lambda j: j["bufferViews"][0].update(byteOffset=-4)), "bufferViews.0. is not valid"),
    "type": (_spoiled(lambda j: j["accessors"][0].update(componentType=9)), "unknown type"),
    "node": (_spoiled(lambda j: j["scenes"][0].update(nodes=[7])), r"nodes\[7\], but there are 1"),
    "cycle": (_spoiled(lambda j: j["nodes"][0].update(children=[0])), "own ancestor"),
    "mesh": (_spoiled(lambda j: j["nodes"][0].update(mesh=3)), r"meshes\[3\]"),
    "nan": (_spoiled(lambda j: j["nodes"][0].update(translation=[math.nan, 0, 0])), "not finite"),
    "rotation": (_spoiled(lambda j: j["nodes"][0].update(rotation=[0, 0, 0, 0])), "does not follow glTF"),
    "schema": (_spoiled(lambda j: j.update(meshes=[{"primitives": 5}])), "does not follow glTF"),
    "array": (_spoiled(lambda j: j.update(nodes=5)), "must be an array"),
    "version": (_spoiled(lambda j: j.update(asset={"version": "1.0"})), "glTF version '1.0'"),
    "required": (_spoiled(lambda j: j.update(extensionsRequired=["KHR_draco_mesh_compression"])), "KHR_draco"),
    "empty": (_spoiled(lambda j: j.update(nodes=[{}])), "no triangles"),
    "glass": (_spoiled(lambda j: j.update(materials=[{"extras": {"glass": "N-BK8"}}])), "N-BK7"),
    "ior": (
        _spoiled(
            lambda j: j.update(
                materials=[
                    _glass_material()
                    | {
                        "extensions": {
                            "KHR_materials_transmission": {"transmissionFactor": 1},
                            "KHR_materials_ior": {"ior": -1.0},
                        }
                    }
                ]
            )
        ),
        "materials.0.",
    ),
    "material key": (
        _spoiled(lambda j: j.update(materials=[{"extras": {"spectrasplat": {"material": {"glas": "F2"}}}}])),
        r"materials\[0\].extras.spectrasplat.material",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_lying_glb_is_one_sentence(tmp_path: Path, name: str) -> None:
    change, says = BROKEN[name]
    builder = Builder().tetrahedron({})
    change(builder)
    with pytest.raises(UserError, match=says) as caught:
        load_gltf(builder.glb(tmp_path / "m.glb"))
    assert "m.glb" in str(caught.value) and "\n" not in str(caught.value)


def test_index_out_of_range_names_the_face(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    builder.json["meshes"][0]["primitives"][0]["indices"] = builder.accessor(np.array([0, 1, 9], "<u2"), "SCALAR", 5123)
    with pytest.raises(UserError, match=r"meshes\[0\].primitives\[0\]: face 0 names vertex 9"):
        load_gltf(builder.glb(tmp_path / "m.glb"))


@pytest.mark.parametrize("fraction", np.linspace(0.0, 0.99, 23))
def test_glb_cut_anywhere_is_refused(tmp_path: Path, fraction: float) -> None:
    whole = Builder().tetrahedron().glb(tmp_path / "m.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(whole[: int(fraction * len(whole))])
    with pytest.raises(UserError, match="cut.glb"):
        load_gltf(tmp_path / "cut.glb")


def test_random_damage_never_gives_a_traceback(tmp_path: Path) -> None:
    builder = Builder().tetrahedron(_glass_material())
    whole = bytearray(builder.glb(tmp_path / "m.glb").read_bytes())
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(150):
        damaged = bytearray(whole)
        for at in rng.integers(12, len(whole), 3):
            damaged[at] = rng.integers(0, 256)
        (tmp_path / "d.glb").write_bytes(damaged)
        try:
            load_gltf(tmp_path / "d.glb")
        except UserError:
            refused += 1
    assert refused > 50


def test_not_a_glb_and_missing_buffer_file(tmp_path: Path) -> None:
    (tmp_path / "x.glb").write_bytes(b"\x89PNG" * 10)
    with pytest.raises(UserError, match="not a GLB file"):
        load_gltf(tmp_path / "x.glb")
    (tmp_path / "x.gltf").write_text("[1, 2")
    with pytest.raises(UserError, match="JSON is not valid"):
        load_gltf(tmp_path / "x.gltf")
    builder = Builder().tetrahedron()
    builder.json["buffers"] = [{"byteLength": len(builder.data), "uri": "gone.bin"}]
    (tmp_path / "y.gltf").write_text(json.dumps(builder.json))
    with pytest.raises(UserError, match=r"gone\.bin"):
        load_gltf(tmp_path / "y.gltf")
    (tmp_path / "gone.bin").write_bytes(builder.data)
    assert load_gltf(tmp_path / "y.gltf").objects[0].mesh.is_closed


# -- saving -------------------------------------------------------------------------------


def _rich_scene() -> Scene:
    ball = primitives.sphere(0.5, 320)
    moved, mirrored = np.eye(4), np.diag([-1.0, 2.0, 1.0, 1.0])
    moved[:3, 3] = (0.0, 1.5, 0.25)
    tint = Absorption(attenuation_from_colour((0.5, 0.9, 0.8), 1.5))
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
    assert set(document.extensionsUsed) >= {"KHR_lights_punctual", "KHR_materials_dispersion"}
    assert document.accessors[document.meshes[0].primitives[0].attributes.POSITION].max == pytest.approx(
        [0.5] * 3, abs=0.01
    )


def _foreign(path: Path) -> Path:
    """A file with much in it that this program does not understand."""
    builder = Builder().tetrahedron(_glass_material() | {"emissiveFactor": [0, 0, 1], "extras": {"artist": "me"}})
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
    return builder.glb(path)


def test_unchanged_scene_keeps_the_document(tmp_path: Path) -> None:
    path = _foreign(tmp_path / "a.glb")
    before = open_document(path).json
    scene = load_gltf(path)
    save_gltf(scene, tmp_path / "b.glb", original=path)
    after = open_document(tmp_path / "b.glb").json
    for key in ("animations", "textures", "images", "extras"):
        assert after[key] == before[key]
    assert after["materials"][0] == before["materials"][0]
    assert after["nodes"][:3] == before["nodes"] and after["meshes"][0] == before["meshes"][0]
    assert after["extensions"]["EXT_unknown"] == {"y": 3}
    # The fitted table, light and camera are now part of the file; saving again changes nothing.
    again = load_gltf(tmp_path / "b.glb")
    assert again.notes == tuple(n for n in scene.notes if "added" not in n and "table" not in n)
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
    path = builder.glb(tmp_path / "a.glb")
    scene = load_gltf(path)
    first, second = scene.objects
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
    path = tmp_path / "a.gltf"
    builder.json["buffers"] = [
        {
            "byteLength": len(builder.data),
            "uri": "data:application/octet-stream;base64," + base64.b64encode(builder.data).decode(),
        }
    ]
    path.write_text(json.dumps(builder.json))
    scene = load_gltf(path)
    _, second, third = scene.objects
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
