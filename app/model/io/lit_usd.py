"""A lit mesh as .usda, .usdc or .usd (the extra `usd`), with its light as a linear .exr beside it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ...base.image_io import write_into
from .lit_mesh import LitMesh


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

    write_into(texture_into, lit.emission)
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
    positions, uv, normals, triangles = lit.welded()
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions))
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([positions.min(axis=0), positions.max(axis=0)])))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    if normals is not None:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
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
