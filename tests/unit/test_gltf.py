"""Reading glTF: every form it may have, and files that lie."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_document import open_document
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.scene import Absorption, Dielectric, Diffuse, Mirror

from tests.unit.gltf_builder import FACES, POSITIONS, Builder, glass_material

pytestmark = pytest.mark.core


def test_bare_glb_gets_light_camera_and_table_and_says_so(tmp_path: Path) -> None:
    scene = load_gltf(Builder().tetrahedron(glass_material()).written(tmp_path / "m.glb"))
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
    assert load_gltf(builder.written(tmp_path / "m.glb")).objects[0].mesh.is_closed


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
    path = builder.written(tmp_path / "m.glb")
    assert load_gltf(path).objects[0].mesh.volume() == pytest.approx(1.0 / 6.0)
    np.testing.assert_allclose(open_document(path).accessor(attributes["NORMAL"]), [(0.0, 0.0, 1.0)] * 4)


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])])
def test_strips_and_fans(tmp_path: Path, mode: int, order: list[int]) -> None:
    builder = Builder().tetrahedron()
    square = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "<f4")
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive |= {"mode": mode, "indices": builder.accessor(np.array(order, "<u2"), "SCALAR", 5123)}
    primitive["attributes"]["POSITION"] = builder.accessor(square, "VEC3", 5126)
    mesh = load_gltf(builder.written(tmp_path / "m.glb")).objects[0].mesh
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
    scene = load_gltf(builder.written(tmp_path / "m.glb"))
    first, second, _table = scene.objects
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
    scene = load_gltf(builder.written(tmp_path / "m.glb"))
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
    camera = load_gltf(builder.written(tmp_path / "m.glb")).camera
    assert camera.kind == "orthographic" and camera.vertical_extent == 3.0


MATERIALS: dict[str, tuple[dict[str, Any], Any]] = {
    "default": ({}, Diffuse((1.0, 1.0, 1.0))),
    "diffuse": (
        {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0}},
        Diffuse((0.1, 0.2, 0.3)),
    ),
    "varnish": (
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 1],
                "metallicFactor": 0,
                "roughnessFactor": 0.3,
            },
            "extensions": {"KHR_materials_ior": {"ior": 1.7}},
        },
        Diffuse((0.1, 0.2, 0.3), roughness=0.3, coat_index=1.7),
    ),
    "sheen": ({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5}}, Diffuse((1.0, 1.0, 1.0))),
    "mirror": (
        {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.8, 0.7, 1], "roughnessFactor": 0.05}},
        Mirror((0.9, 0.8, 0.7), roughness=0.05),
    ),
    "brushed": ({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0.5}}, Mirror(roughness=0.5)),
    "named": ({"extras": {"spectrasplat": {"glass": "n-sf11"}}}, Dielectric(catalogue.find("N-SF11"))),
    "short": ({"extras": {"glass": "Schott N-BK7"}}, Dielectric(catalogue.find("N-BK7"))),
    "named wins": (glass_material() | {"extras": {"glass": "F2"}}, Dielectric(catalogue.find("F2"))),
    "tinted": (
        glass_material(attenuationColor=[0.5, 0.9, 1.0], attenuationDistance=2.0),
        Dielectric(glass.from_abbe(1.6, 40.0, "crown"), Absorption.of_colour((0.5, 0.9, 1.0), 2.0)),
    ),
    "table": (
        {"extras": {"spectrasplat": {"material": {"n_d": 1.7, "V_d": 30.0, "priority": 2}}}},
        Dielectric(glass.from_abbe(1.7, 30.0), priority=2),
    ),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_materials(tmp_path: Path, name: str) -> None:
    values, expected = MATERIALS[name]
    material = load_gltf(Builder().tetrahedron(values).written(tmp_path / "m.glb")).objects[0].material
    assert material.values() == expected.values()


def test_what_is_left_aside_is_said(tmp_path: Path) -> None:
    builder = Builder().tetrahedron(glass_material())
    builder.json |= {"extensionsUsed": ["EXT_of_tomorrow"], "animations": [{"channels": [], "samplers": []}]}
    text = " ".join(load_gltf(builder.written(tmp_path / "m.glb")).notes)
    assert "EXT_of_tomorrow" in text and "Animations" in text


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
    "required": (_spoiled(lambda j: j.update(extensionsRequired=["EXT_of_tomorrow"])), "EXT_of_tomorrow"),
    "empty": (_spoiled(lambda j: j.update(nodes=[{}])), "no triangles"),
    "glass": (_spoiled(lambda j: j.update(materials=[{"extras": {"glass": "N-BK8"}}])), "N-BK7"),
    "ior": (
        _spoiled(
            lambda j: j.update(
                materials=[
                    glass_material()
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
        load_gltf(builder.written(tmp_path / "m.glb"))
    assert "m.glb" in str(caught.value) and "\n" not in str(caught.value)


def test_index_out_of_range_names_the_face(tmp_path: Path) -> None:
    builder = Builder().tetrahedron()
    builder.json["meshes"][0]["primitives"][0]["indices"] = builder.accessor(np.array([0, 1, 9], "<u2"), "SCALAR", 5123)
    with pytest.raises(UserError, match=r"meshes\[0\].primitives\[0\]: face 0 names vertex 9"):
        load_gltf(builder.written(tmp_path / "m.glb"))


@pytest.mark.parametrize(
    ("at", "number", "says"),
    [
        (4, 7, "version 7.*glTF 2.0"),
        (8, 1 << 31, "promises 2147483648 bytes"),
        (12, 1 << 31, "promises 2147483648 bytes"),
    ],
)
def test_a_header_that_lies_is_refused(tmp_path: Path, at: int, number: int, says: str) -> None:
    data = bytearray(Builder().tetrahedron().written(tmp_path / "m.glb").read_bytes())
    data[at : at + 4] = number.to_bytes(4, "little")
    (tmp_path / "m.glb").write_bytes(data)
    with pytest.raises(UserError, match=says):
        load_gltf(tmp_path / "m.glb")


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
