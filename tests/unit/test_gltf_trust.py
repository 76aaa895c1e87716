"""glTF files from anybody: what they may read, what saving takes along, and how long and large reading them becomes."""

from __future__ import annotations

import base64
import json
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_document import open_document
from spectrasplat.model.io.gltf_write import save_gltf

from tests.unit.gltf_builder import Builder

SECRET = b"correct horse battery staple"


def tetrahedron(**more: Any) -> dict[str, Any]:
    return json.loads(Builder().tetrahedron().content(".gltf")) | more


def written(path: Path, document: dict[str, Any]) -> Path:
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("uri", ["../secret", "{folder}/secret", "%2e%2e/secret", "inside/../../secret"])
@pytest.mark.parametrize("kind", ["buffers", "images"])
def test_what_climbs_out_of_the_folder_is_not_read(tmp_path: Path, kind: str, uri: str) -> None:
    (tmp_path / "secret").write_bytes(SECRET * 10)
    entry = {"uri": uri.format(folder=tmp_path), "byteLength": 100}
    document = tetrahedron()
    if kind == "buffers":
        document["buffers"] = [entry]
    else:
        document |= {
            "images": [entry],
            "textures": [{"source": 0}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        }
        document["meshes"][0]["primitives"][0]["material"] = 0
    path = written(tmp_path / "scene" / "a.gltf", document)
    with pytest.raises(UserError, match=r"lies outside the scene's folder") as caught:
        load_gltf(path)
    assert "horse" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_saving_takes_along_only_what_is_referred_to(tmp_path: Path, suffix: str) -> None:
    folder, elsewhere = tmp_path / "scene", tmp_path / "elsewhere"
    elsewhere.mkdir()
    Image.new("RGB", (2, 2), "red").save(tmp_path / "worn.png")
    document = tetrahedron(
        images=[{"uri": "secret.png"}, {"uri": "worn.png"}, {"uri": "secret.jpg"}],
        textures=[{"source": 1}, {"source": 2}],  # the second is no picture, and nothing wears it
    )
    document["buffers"].append({"uri": "secret.bin", "byteLength": len(SECRET)})
    document["bufferViews"].append({"buffer": 1, "byteLength": len(SECRET)})
    path = written(folder / "a.gltf", document)
    for name in ("secret.png", "secret.jpg", "secret.bin"):
        (folder / name).write_bytes(SECRET)
    (folder / "worn.png").write_bytes((tmp_path / "worn.png").read_bytes())
    save_gltf(load_gltf(path), elsewhere / f"b{suffix}", path)
    held = (elsewhere / f"b{suffix}").read_bytes()
    assert SECRET not in held and base64.b64encode(SECRET)[:-4] not in held
    back = open_document(elsewhere / f"b{suffix}")
    assert [str(image.get("uri"))[:10] for image in back.items("images")] == ["secret.png", "data:image", "secret.jpg"]
    assert back.items("buffers")[1]["uri"] == "secret.bin"
    assert load_gltf(elsewhere / f"b{suffix}").objects[0].mesh.is_closed


def test_what_an_animation_or_a_skin_refers_to_goes_along(tmp_path: Path) -> None:
    document = tetrahedron(
        animations=[{"channels": [], "samplers": [{"input": 2, "output": 2, "interpolation": "LINEAR"}]}]
    )
    document["buffers"].append({"uri": "times.bin", "byteLength": 8})
    document["bufferViews"].append({"buffer": 1, "byteLength": 8})
    document["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR"})
    path = written(tmp_path / "scene" / "a.gltf", document)
    (tmp_path / "scene" / "times.bin").write_bytes(np.array([0, 1], "<f4").tobytes())
    (tmp_path / "elsewhere").mkdir()
    save_gltf(load_gltf(path), tmp_path / "elsewhere" / "b.gltf", path)
    assert open_document(tmp_path / "elsewhere" / "b.gltf").accessor(2).tolist() == [0.0, 1.0]


def test_nodes_take_a_time_in_proportion_to_their_number(tmp_path: Path) -> None:
    def seconds(count: int) -> float:
        nodes = [{"mesh": 0, "name": "same", "translation": [2 * i, 0, 0]} for i in range(count)]
        path = written(tmp_path / "a.gltf", tetrahedron(nodes=nodes, scenes=[{"nodes": list(range(count))}]))
        begun = time.process_time()
        assert len({item.name for item in load_gltf(path).objects}) == count + 1  # and a table
        return time.process_time() - begun

    seconds(10)
    few, many = seconds(300), seconds(2400)
    assert many < 25 * few  # 64 where it is quadratic


@pytest.mark.parametrize("stored", [True, False])
def test_a_count_is_held_against_the_bytes_before_memory_is_taken(tmp_path: Path, stored: bool) -> None:
    document = tetrahedron()
    document["accessors"][0]["count"] = 99_999_999
    if not stored:
        del document["accessors"][0]["bufferView"]
    path = written(tmp_path / "a.gltf", document)
    tracemalloc.start()
    with pytest.raises(UserError, match="promises 99999999 elements"):
        load_gltf(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 16 << 20, f"{peak >> 20} MiB"


def test_many_accessors_of_the_same_bytes_have_a_limit_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spectrasplat.model.io.gltf_document.MAX_ELEMENTS", 100)
    document = tetrahedron()
    document["accessors"] += [document["accessors"][0] | {"name": str(i)} for i in range(30)]
    document["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 2 + i}, "indices": 1} for i in range(30)]
    with pytest.raises(UserError, match="more than 100 elements together"):
        load_gltf(written(tmp_path / "a.gltf", document))


def test_a_transform_out_of_range_is_refused(tmp_path: Path) -> None:
    for scale in ([1e200] * 3, [float("nan")] * 3):
        with pytest.raises(UserError, match=r"nodes\[0\] has a transform"):
            load_gltf(written(tmp_path / "a.gltf", tetrahedron(nodes=[{"mesh": 0, "scale": scale}])))
