"""glTF's base colour textures: read from wherever they lie, the right way up, and written out again."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.model.environment import sky
from spectrasplat.model.geometry import primitives
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.picture_files import read_picture
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.texture import Texture

LEVELS = np.random.default_rng(3).integers(0, 256, (4, 6, 3)).astype(np.uint8)


def png(levels: np.ndarray = LEVELS) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(levels).save(buffer, "PNG")
    return buffer.getvalue()


def quad(folder: Path, image: dict[str, Any] | None, data: bytes = b"", uv: bool = True, **more: Any) -> Path:
    """A unit quad in z = 0 facing +z, glTF's (0, 0) at its upper left, written by hand; `data` goes behind its
    accessors."""
    positions = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], "<f4")
    coordinates = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], "<f4")
    indices = np.array([0, 1, 2, 0, 2, 3], "<u4")
    parts = [positions.tobytes(), coordinates.tobytes(), indices.tobytes(), data]
    starts = np.cumsum([0] + [len(p) for p in parts]).tolist()
    buffer = b"".join(parts)
    attributes = {"POSITION": 0} | ({"TEXCOORD_0": 1} if uv else {})
    texture = {"source": 0} | ({"sampler": 0} if "samplers" in more else {})
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(buffer), "uri": "data:;base64," + base64.b64encode(buffer).decode()}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": s, "byteLength": len(p)} for s, p in zip(starts, parts, strict=False) if p
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5125, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0}]}],
        "materials": [
            {
                "name": "poster",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.5, 1, 1, 1],
                    "metallicFactor": 0,
                    "baseColorTexture": {"index": 0},
                },
            }
        ],
        "nodes": [{"mesh": 0, "name": "quad"}],
        "scenes": [{"nodes": [0]}],
        "textures": [texture],
        "images": [image] if image else [],
    }
    path = folder / "quad.gltf"
    path.write_text(json.dumps(document | more))
    return path


def data_uri(data: bytes, kind: str = "image/png") -> dict[str, str]:
    return {"uri": f"data:{kind};base64," + base64.b64encode(data).decode()}


def poster_of(scene: Scene) -> Texture:
    (item,) = (o for o in scene.objects if o.name == "quad")
    assert isinstance(item.material, Diffuse) and item.material.texture is not None
    return item.material.texture


@pytest.mark.parametrize("where", ["data uri", "file", "buffer view"])
def test_the_image_is_found_wherever_it_lies(tmp_path: Path, where: str) -> None:
    (tmp_path / "a poster.png").write_bytes(png())
    image = {
        "data uri": data_uri(png()),
        "file": {"uri": "a%20poster.png"},
        "buffer view": {"bufferView": 3, "mimeType": "image/png"},
    }[where]
    scene = load_gltf(quad(tmp_path, image, png() if where == "buffer view" else b""))
    texture = poster_of(scene)
    assert texture.wrap == "repeat" and scene.objects[0].material.reflectance_rgb == (0.5, 1.0, 1.0)
    np.testing.assert_array_equal(texture.rgb, read_picture(tmp_path / "a poster.png")[0])
    assert texture.source == (str(tmp_path / "a poster.png") if where == "file" else None)
    assert not any("texture" in note for note in scene.notes)


def test_v_runs_up_after_loading(tmp_path: Path) -> None:
    mesh = load_gltf(quad(tmp_path, data_uri(png()))).objects[0].mesh
    np.testing.assert_array_equal(mesh.uv, mesh.corners()[..., :2])


@pytest.mark.parametrize(
    ("sampler", "wrap", "told"),
    [
        ({}, "repeat", False),
        ({"wrapS": 10497, "wrapT": 10497}, "repeat", False),
        ({"wrapS": 33071, "wrapT": 33071}, "clamp", False),
        ({"wrapS": 33648, "wrapT": 33648}, "repeat", True),
        ({"wrapS": 33071}, "repeat", True),
    ],
)
def test_the_sampler_decides_how_it_repeats(tmp_path: Path, sampler: dict[str, int], wrap: str, told: bool) -> None:
    scene = load_gltf(quad(tmp_path, data_uri(png()), samplers=[sampler]))
    assert poster_of(scene).wrap == wrap
    assert any("are repeated" in note for note in scene.notes) == told


def test_what_is_not_shown_is_told(tmp_path: Path) -> None:
    def notes_without_texture(path: Path) -> str:
        scene = load_gltf(path)
        assert scene.objects[0].material.texture is None
        return " ".join(scene.notes)

    assert "has no texture coordinates" in notes_without_texture(quad(tmp_path, data_uri(png()), uv=False))
    assert "neither PNG nor JPEG" in notes_without_texture(quad(tmp_path, data_uri(b"RIFF", "image/webp")))
    assert "neither PNG nor JPEG" in notes_without_texture(quad(tmp_path, None, textures=[{}]))
    second = {"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0, "texCoord": 1}}}
    assert "second set" in notes_without_texture(quad(tmp_path, data_uri(png()), materials=[second]))
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    more = {"normalTexture": {"index": 0}, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": moved}}
    scene = load_gltf(quad(tmp_path, data_uri(png()), materials=[more]))
    assert poster_of(scene).rgb.shape == (4, 6, 3)
    assert all(
        word in " ".join(scene.notes) for word in ("without their KHR_texture_transform", "normalTexture is not")
    )
    basis = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    assert "KTX2" in notes_without_texture(quad(tmp_path, None, textures=basis))


@pytest.mark.parametrize(
    ("image", "more", "expected"),
    [
        (data_uri(png()[:80]), {}, "quad.gltf: images[0]: the picture is damaged"),
        (data_uri(b"nothing"), {}, "quad.gltf: images[0]: this is neither a PNG nor a JPEG"),
        ({"uri": "gone.png"}, {}, "images[0] needs"),
        ({"bufferView": 9, "mimeType": "image/png"}, {}, "refers to bufferViews[9]"),
        ({"mimeType": "image/png"}, {}, "refers to bufferViews[None]"),
        (None, {}, "refers to images[0], but there are 0"),
        (None, {"textures": []}, "refers to textures[0], but there are 0"),
        (data_uri(png()), {"samplers": []}, "refers to samplers[0], but there are 0"),
    ],
)
def test_bad_images_are_refused(
    tmp_path: Path, image: dict[str, Any] | None, more: dict[str, Any], expected: str
) -> None:
    with pytest.raises(UserError) as caught:
        load_gltf(quad(tmp_path, image, **more))
    assert expected in str(caught.value) and "\n" not in str(caught.value)


def textured_scene(tmp_path: Path, exact: bool = True) -> Scene:
    """Two walls of one picture, one of another wrap, a ball of a picture in memory."""
    (tmp_path / "poster.png").write_bytes(png())
    rgb = read_picture(tmp_path / "poster.png")[0]
    on_disk = Texture(rgb, "repeat", str((tmp_path / "poster.png").resolve()))
    memory = (rgb[::-1] * (1.0 if exact else 0.61)).astype(np.float32)
    box, ball = primitives.box((1.0, 2.0, 3.0)), primitives.sphere(0.5, 80)
    objects = (
        SceneObject("one", box, Diffuse((0.5, 0.6, 0.7), texture=on_disk)),
        SceneObject("two", box, Diffuse((0.5, 0.6, 0.7), texture=on_disk)),
        SceneObject("three", box, Diffuse((1.0, 1.0, 1.0), texture=replace(on_disk, wrap="clamp"))),
        SceneObject("ball", ball, Diffuse((1.0, 1.0, 1.0), texture=Texture(memory))),
    )
    light = PointLight("lamp", illuminant("D65"), position=(0.0, 9.0, 0.0))
    return Scene("walls", Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)), (light,), objects)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_textures_survive_saving_as_gltf(tmp_path: Path, suffix: str) -> None:
    scene = textured_scene(tmp_path)
    save_gltf(scene, tmp_path / f"walls{suffix}")
    back = load_gltf(tmp_path / f"walls{suffix}")
    assert back.notes == ()
    for old, new in zip(scene.objects, back.objects, strict=True):
        assert new.material.reflectance_rgb == old.material.reflectance_rgb
        assert new.material.texture.wrap == old.material.texture.wrap
        np.testing.assert_array_equal(new.material.texture.rgb, old.material.texture.rgb)
        np.testing.assert_allclose(new.mesh.uv, old.mesh.uv, atol=1e-7)
    assert back.objects[0].material.texture is back.objects[1].material.texture
    document = json.loads((tmp_path / "walls.gltf").read_text()) if suffix == ".gltf" else None
    if document:
        assert len(document["textures"]) == 3


def test_a_texture_that_8_bits_cannot_hold_is_rounded(tmp_path: Path) -> None:
    scene = textured_scene(tmp_path, exact=False)
    save_gltf(scene, tmp_path / "walls.glb")
    old, new = (s.objects[3].material.texture.rgb for s in (scene, load_gltf(tmp_path / "walls.glb")))
    assert 0.0 < np.abs(new - old).max() < 0.6 / 255.0 * 2.3  # half a level at the steepest place of the curve


def test_editing_the_factor_keeps_the_documents_texture(tmp_path: Path) -> None:
    path = quad(tmp_path, data_uri(png()))
    scene = load_gltf(path)
    item = scene.objects[0]
    for material in (replace(item.material, reflectance_rgb=(0.25, 0.25, 0.25)), replace(item.material, texture=None)):
        save_gltf(replace(scene, objects=(replace(item, material=material),)), tmp_path / "edited.gltf", original=path)
        document = json.loads((tmp_path / "edited.gltf").read_text())
        back = load_gltf(tmp_path / "edited.gltf").objects[0].material
        assert len(document["textures"]) == len(document["images"]) == 1
        assert back.reflectance_rgb == material.reflectance_rgb and (back.texture is None) == (material.texture is None)


def test_another_texture_takes_the_place_of_the_documents(tmp_path: Path) -> None:
    path = quad(tmp_path, data_uri(png()))
    scene = load_gltf(path)
    other = replace(scene.objects[0].material, texture=Texture(poster_of(scene).rgb[:, ::-1], "clamp"))
    save_gltf(
        replace(scene, objects=(replace(scene.objects[0], material=other),)), tmp_path / "edited.glb", original=path
    )
    texture = poster_of(load_gltf(tmp_path / "edited.glb"))
    assert texture.wrap == "clamp"
    np.testing.assert_array_equal(texture.rgb, other.texture.rgb)


def test_an_embedded_texture_gets_a_file_when_saved_as_toml(tmp_path: Path) -> None:
    scene = load_gltf(quad(tmp_path, data_uri(png())))
    save_scene(scene, tmp_path / "copy.toml")
    back = load_scene(tmp_path / "copy.toml")
    np.testing.assert_array_equal(poster_of(back).rgb, poster_of(scene).rgb)
    np.testing.assert_array_equal(back.objects[0].mesh.uv, scene.objects[0].mesh.uv)


def test_an_environment_survives_in_the_extras(tmp_path: Path) -> None:
    scene = replace(textured_scene(tmp_path), environment=sky(20.0, up=(0.0, 1.0, 0.0)))
    save_gltf(scene, tmp_path / "walls.glb")
    back = load_gltf(tmp_path / "walls.glb")
    np.testing.assert_array_equal(back.environment.rgb, scene.environment.rgb)
    np.testing.assert_allclose(back.environment.world_to_local, scene.environment.world_to_local, atol=1e-15)
    # With nothing diffuse an environment needs neither a lamp nor a table.
    from spectrasplat.model.optics import catalogue
    from spectrasplat.model.scene import Dielectric

    glass = replace(scene.objects[3], material=Dielectric(catalogue.find("N-SF11")))
    save_gltf(replace(scene, objects=(glass,), lights=()), tmp_path / "ball.glb")
    back = load_gltf(tmp_path / "ball.glb")
    assert back.lights == () and [o.name for o in back.objects] == ["ball"] and back.environment is not None
