"""A receiver with the light that was baked onto it, as other programs take it: a mesh that glows by a picture.

In .glb and .gltf its light is the emissive texture, sRGB as glTF wants it, times KHR_materials_emissive_strength, so
that full white is that many cd/unit² (glTF 2.0, 3.9.3: nits). In .usda, .usdc and .usd (the extra `usd`) it is a
linear .exr next to the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ...base.image_io import png_bytes, write_image
from ..geometry.mesh_health import welded_corners
from ..staging import Y_UP_TO_Z_UP, UpAxis
from .gltf_document import Additions, GltfDocument, write_document
from .scene_pictures import nearest_levels


@dataclass(frozen=True)
class LitMesh:
    """Corners are those of triangles, one by one."""

    name: str
    corners: np.ndarray
    """float64 (t, 3, 3), the scene's coordinates."""
    normals: np.ndarray | None
    """float64 (t, 3, 3), or None for flat facets."""
    uv: np.ndarray
    """float64 (t, 3, 2), (0, 0) the picture's upper left corner; beyond 0 to 1 its border goes on."""
    emission: np.ndarray
    """float32 (h, w, 3), linear Rec.709 radiance, cd/unit²; within the gamut."""
    base_rgb: tuple[float, float, float]
    """Its own reflectance, linear Rec.709, for all other light."""
    up: UpAxis
    """Which axis of its coordinates is up."""

    @property
    def strength(self) -> float:
        """Radiance that the full value of an 8-bit texture stands for, cd/unit²."""
        return float(self.emission.max()) or 1.0


STRENGTH = "KHR_materials_emissive_strength"
_CLAMP, _LINEAR, _MIPMAPPED = 33071, 9729, 9987


def write_lit_gltf(lit: LitMesh, path: Path, into: Path) -> None:
    """Write it, self-contained, into a file that becomes `path`; glTF's y is up, so a z-up receiver is turned."""
    json: dict[str, Any] = {"asset": {"version": "2.0", "generator": "SpectraSplat"}, "scene": 0}
    new = Additions(json, buffer=0)
    primitive = new.primitive(lit.corners, lit.normals, lit.uv) | {"material": 0}
    image = new.view(png_bytes(nearest_levels(lit.emission / lit.strength)))
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
    json |= {
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"name": lit.name, "primitives": [primitive]}],
        "materials": [material],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": _CLAMP, "wrapT": _CLAMP, "magFilter": _LINEAR, "minFilter": _MIPMAPPED}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "buffers": [{"byteLength": len(new.data)}],
        "extensionsUsed": [STRENGTH],
    }
    document = GltfDocument(path, json, bytes(new.data))
    write_document(document, path, into)


def check_usd() -> None:
    """Raise `UserError` with the remedy where USD cannot be written."""
    try:
        import pxr  # noqa: F401
    except ImportError:
        raise UserError("USD files need the package usd-core: pip install usd-core") from None


def texture_path(path: Path) -> Path:
    """The .exr that belongs to a USD file."""
    return path.with_suffix(".exr")


def write_lit_usd(lit: LitMesh, path: Path, into: Path, texture_into: Path) -> None:
    """Write it and its texture into files that become `path` and `texture_path(path)`. Raises `UserError`."""
    check_usd()
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

    write_image(texture_path(path), lit.emission, into=texture_into)
    # A layer of no file: USD keeps those of files open by their names. "usd" is binary.
    layer = Sdf.Layer.CreateAnonymous(".usda" if path.suffix.lower() == ".usda" else ".usdc")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if lit.up == "z" else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/SpectraSplat")
    stage.SetDefaultPrim(root.GetPrim())
    place = f"/SpectraSplat/{_identifier(lit.name)}"
    mesh = UsdGeom.Mesh.Define(stage, place)
    mesh.GetPrim().SetDisplayName(lit.name)
    normals = [] if lit.normals is None else [lit.normals]
    columns = [column.astype(np.float32) for column in (lit.corners, lit.uv, *normals)]
    (positions, uv, *normals), triangles = welded_corners(columns)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions))
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([positions.min(axis=0), positions.max(axis=0)])))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    if normals:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals[0]))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1))))
    material = UsdShade.Material.Define(stage, f"{place}_lit")
    _shade(stage, material, lit, f"./{texture_path(path).name}", Gf, Sdf, UsdShade)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    if not layer.Export(str(into), args={"format": "usda" if path.suffix.lower() == ".usda" else "usdc"}):
        raise UserError(f"cannot write {path}: is the disk full?")


def _shade(stage: Any, material: Any, lit: LitMesh, texture: str, Gf: Any, Sdf: Any, UsdShade: Any) -> None:
    """A UsdPreviewSurface whose emissive colour is the texture as it is (raw: its numbers are linear)."""
    types = Sdf.ValueTypeNames
    base = material.GetPath()
    surface = UsdShade.Shader.Define(stage, base.AppendChild("surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", types.Color3f).Set(Gf.Vec3f(*lit.base_rgb))
    surface.CreateInput("roughness", types.Float).Set(1.0)
    surface.CreateInput("metallic", types.Float).Set(0.0)
    reader = UsdShade.Shader.Define(stage, base.AppendChild("st"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    picture = UsdShade.Shader.Define(stage, base.AppendChild("caustic"))
    picture.CreateIdAttr("UsdUVTexture")
    picture.CreateInput("file", types.Asset).Set(Sdf.AssetPath(texture))
    picture.CreateInput("sourceColorSpace", types.Token).Set("raw")
    for side in ("wrapS", "wrapT"):
        picture.CreateInput(side, types.Token).Set("clamp")
    result = reader.CreateOutput("result", types.Float2)
    picture.CreateInput("st", types.Float2).ConnectToSource(result)
    colour = picture.CreateOutput("rgb", types.Float3)
    surface.CreateInput("emissiveColor", types.Color3f).ConnectToSource(colour)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))


def _identifier(name: str) -> str:
    """A prim's name: letters, digits and underscores."""
    made = re.sub(r"\W", "_", name, flags=re.ASCII)
    return made if made and not made[0].isdigit() else f"_{made}"
