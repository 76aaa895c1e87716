"""A lit mesh as .glb or .gltf: its light is the emissive texture, sRGB as glTF wants it, times
KHR_materials_emissive_strength, so that full white is that many cd/unit² (glTF 2.0, 3.9.3: nits)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base.tone_map import srgb_oetf
from ..staging import Y_UP_TO_Z_UP
from .gltf_document import GltfDocument, write_document
from .lit_mesh import LitMesh
from .scene_pictures import png_bytes

STRENGTH = "KHR_materials_emissive_strength"
_CLAMP, _LINEAR, _MIPMAPPED = 33071, 9729, 9987
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_FLOAT, _UINT = 5126, 5125


def write_lit_gltf(lit: LitMesh, path: Path, into: Path) -> None:
    """Write it, self-contained, into a file that becomes `path`; glTF's y is up, so what stands along z is turned."""
    data, views, accessors = bytearray(), [], []

    def view(content: bytes, **more: int) -> int:
        data.extend(b"\0" * (-len(data) % 4))
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)} | more)
        data.extend(content)
        return len(views) - 1

    def accessor(values: np.ndarray, kind: str, component: int, target: int, **more: Any) -> int:
        stored = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        entry = {"bufferView": view(stored.tobytes(), target=target), "componentType": component}
        accessors.append(entry | {"count": len(values), "type": kind} | more)
        return len(accessors) - 1

    positions, uv, normals, triangles = lit.welded()
    bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    attributes = {"POSITION": accessor(positions, "VEC3", _FLOAT, _ARRAY_BUFFER, **bounds)}
    if normals is not None:
        attributes["NORMAL"] = accessor(normals, "VEC3", _FLOAT, _ARRAY_BUFFER)
    attributes["TEXCOORD_0"] = accessor(uv, "VEC2", _FLOAT, _ARRAY_BUFFER)
    indices = accessor(triangles.reshape(-1, 1), "SCALAR", _UINT, _ELEMENT_BUFFER)
    codes = np.rint(255.0 * srgb_oetf(np.clip(lit.emission / lit.strength, 0.0, 1.0))).astype(np.uint8)
    image = view(png_bytes(codes))
    node: dict[str, Any] = {"name": lit.name, "mesh": 0}
    if lit.up == "z":
        node["matrix"] = Y_UP_TO_Z_UP.ravel().tolist()  # by columns: its transpose, which turns back
    material = {
        "name": f"{lit.name} lit",
        "pbrMetallicRoughness": {
            "baseColorFactor": [*lit.base_rgb, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "doubleSided": True,
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": {"index": 0},
        "extensions": {STRENGTH: {"emissiveStrength": lit.strength}},
    }
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    json = {
        "asset": {"version": "2.0", "generator": "SpectraSplat"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"name": lit.name, "primitives": [primitive]}],
        "materials": [material],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": _CLAMP, "wrapT": _CLAMP, "magFilter": _LINEAR, "minFilter": _MIPMAPPED}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
        "extensionsUsed": [STRENGTH],
    }
    document = GltfDocument(path, json, bytes(data))
    document.set_buffer(0, bytes(data))
    write_document(document, path, into)
