"""A tetrahedron in glTF, to be spoiled as a test needs it."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

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

    def tetrahedron(self, material: dict[str, Any] | None = None, faces: np.ndarray = FACES) -> Builder:
        """`faces`: those of them that are there."""
        primitive = self.primitive(faces)
        if material is not None:
            self.json["materials"] = [material]
            primitive["material"] = 0
        self.json |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0, "name": "tetra"}]}
        self.json |= {"scenes": [{"nodes": [0]}], "scene": 0}
        return self

    def primitive(self, faces: np.ndarray) -> dict[str, Any]:
        return {
            "attributes": {"POSITION": self.accessor(POSITIONS, "VEC3", 5126)},
            "indices": self.accessor(faces.ravel().astype("<u2"), "SCALAR", 5123),
        }

    def content(self, suffix: str) -> bytes:
        """The whole file: a .glb, or a .gltf with its buffer inside."""
        buffer = {"byteLength": len(self.data)} if self.data else {}
        if suffix == ".gltf" and buffer:
            buffer["uri"] = "data:;base64," + base64.b64encode(self.data).decode()
        document = self.json | ({"buffers": [buffer, *self.json.get("buffers", [])]} if buffer else {})
        text = json.dumps(document).encode()
        if suffix == ".gltf":
            return text
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def written(self, path: Path) -> Path:
        """Written to a .glb or, by the name, to a .gltf."""
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(self.content(path.suffix))
        return path


def glass_material(**volume: Any) -> dict[str, Any]:
    return {
        "name": "crown",
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_ior": {"ior": 1.6},
            "KHR_materials_volume": {"thicknessFactor": 1.0} | volume,
            "KHR_materials_dispersion": {"dispersion": 0.5},
        },
    }
