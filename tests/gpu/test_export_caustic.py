"""Caustics for other programs, read back as those would read them: what was bright where is bright there again."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from PIL import Image
from spectrasplat.base.image_io import read_image
from spectrasplat.base.tone_map import into_gamut, srgb_eotf
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.staging import Y_UP_TO_Z_UP

COLOUR = [0.8, 0.4, 0.2]
LENSES = {"big": (0.4, -0.2, 0.5), "small": (-0.7, 0.5, 0.25)}
"""Centre and radius: no reflection or turn by a right angle puts both onto each other's light."""
SCENE = {
    "camera": {"position": [0.5, -4.0, 3.0], "target": [0.0, 0.0, 0.0]},
    "lights": [{"kind": "directional", "direction": [0.0, 0.0, -1.0], "illuminance_lx": 1000.0}],
    "objects": [
        *(
            {"name": name, "shape": "sphere", "radius": r, "glass": "N-BK7", "position": [x, y, 1.2]}
            for name, (x, y, r) in LENSES.items()
        ),
        {
            "name": "floor",
            "shape": "plane",
            "width": 6.0,
            "height": 5.0,
            "material": {"kind": "diffuse", "colour": COLOUR},
        },
    ],
}
Sampler = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def baked() -> ss.CausticMap:
    return ss.caustic(ss.load(SCENE), "floor", size=(120, 90), photons=40_000)


def points_on(baked: ss.CausticMap) -> np.ndarray:
    """World (n, 3), at the middles of the map's texels."""
    corner = {name: np.array(place) for name, place in baked.placement["corners_world"].items()}  # type: ignore[attr-defined]
    height, width = baked.rgb.shape[:2]
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    across, down = corner["top_right"] - corner["top_left"], corner["bottom_left"] - corner["top_left"]
    return (corner["top_left"] + u[..., None] * across + v[..., None] * down).reshape(-1, 3)


def nearest(picture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Texels at (n, 2) from the upper left, clamped."""
    height, width = picture.shape[:2]
    x = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    return picture[np.clip((uv[:, 1] * height).astype(int), 0, height - 1), x]


def on_mesh(corners: np.ndarray, uv: np.ndarray, picture: np.ndarray) -> Sampler:
    """What a mesh (t, 3, 3) with texture coordinates (t, 3, 2) shows at points in its plane z = 0."""

    def sample(points: np.ndarray) -> np.ndarray:
        found = np.full((len(points), 3), np.nan)
        for triangle, places in zip(corners, uv, strict=True):
            flat = np.vstack([triangle[:, :2].T, np.ones(3)])
            weights = np.linalg.solve(flat, np.vstack([points[:, :2].T, np.ones(len(points))])).T
            inside = (weights >= -1e-9).all(axis=1)
            found[inside] = nearest(picture, weights[inside] @ places)
        return found

    return sample


def check(baked: ss.CausticMap, sample: Sampler, factor: np.ndarray, tolerance: float) -> None:
    """Everywhere the map's light times `factor`, and the brightest of it below the lenses."""
    points = points_on(baked)
    got, wanted = sample(points), into_gamut(baked.rgb).reshape(-1, 3) * factor
    assert np.abs(got - wanted).max() < tolerance * wanted.max()
    light = got.sum(axis=1)
    for x, y, radius in LENSES.values():
        near = np.linalg.norm(points[:, :2] - (x, y), axis=1) < 1.2 * radius
        middle = (light[near, None] * points[near]).sum(axis=0) / light[near].sum()
        assert middle[:2] == pytest.approx([x, y], abs=0.06)
        assert light[near].sum() * np.prod(baked.placement["texel_size_units"]) > 0.0  # type: ignore[arg-type]
    outside = sample(np.array([[2.9, 2.4, 0.0], [-2.9, -2.4, 0.0], [-2.9, 2.4, 0.0]]))
    assert (np.nan_to_num(outside) == 0.0).all()


def glb(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, object]]:
    """World corners with z up, texture coordinates, emission in cd/unit², and the material."""
    pygltflib = pytest.importorskip("pygltflib")
    file = pygltflib.GLTF2().load(str(path))
    blob, types = file.binary_blob(), {5126: np.float32, 5125: np.uint32}

    def view(index: int) -> bytes:
        found = file.bufferViews[index]
        return blob[found.byteOffset : found.byteOffset + found.byteLength]

    def array(index: int) -> np.ndarray:
        found = file.accessors[index]
        return np.frombuffer(view(found.bufferView), types[found.componentType]).reshape(found.count, -1)

    primitive, material = file.meshes[0].primitives[0], file.materials[0]
    triangles = array(primitive.indices).reshape(-1, 3)
    corners = array(primitive.attributes.POSITION)[triangles].astype(float)
    world = np.array(file.nodes[0].matrix or np.eye(4).ravel()).reshape(4, 4).T
    corners = corners @ (Y_UP_TO_Z_UP @ world)[:3, :3].T
    image = np.asarray(Image.open(io.BytesIO(view(file.images[0].bufferView))))
    strength = material.extensions["KHR_materials_emissive_strength"]["emissiveStrength"]
    emission = srgb_eotf(image / 255.0) * strength * material.emissiveFactor
    return corners, array(primitive.attributes.TEXCOORD_0)[triangles], emission, material


@pytest.mark.parametrize("plane", [False, True], ids=["receiver", "plane"])
def test_a_glb_glows_where_the_caustic_lies(baked: ss.CausticMap, tmp_path: Path, plane: bool) -> None:
    path = baked.export(tmp_path / "floor.glb", plane=plane)
    corners, uv, emission, material = glb(path)
    reflectance = np.ones(3) if plane else np.array(COLOUR)
    # Half a code of the brightest values, where codes are widest.
    check(baked, on_mesh(corners, uv, emission), reflectance / np.pi, 0.005)
    base = material.pbrMetallicRoughness.baseColorFactor  # type: ignore[attr-defined]
    assert base == pytest.approx([0.0, 0.0, 0.0, 1.0] if plane else [*COLOUR, 1.0])
    read = load_gltf(path).objects[0]
    assert read.name == ("floor caustic" if plane else "floor")
    low, high = read.mesh.transformed(read.object_to_world).bounds()
    assert high[1] - low[1] < 1e-6  # y is up
    if not plane:
        assert high - low == pytest.approx([6.0, 0.0, 5.0], abs=1e-5)
    told = json.loads((tmp_path / "floor.json").read_text())
    assert told["up_axis"] == "z" and told["largest_emission"] == pytest.approx(emission.max(), rel=1e-6)


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_usd_glows_where_the_caustic_lies(baked: ss.CausticMap, tmp_path: Path, suffix: str) -> None:
    pxr = pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdShade

    assert pxr is not None
    stage = Usd.Stage.Open(str(baked.export(tmp_path / f"floor{suffix}")))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/SpectraSplat/floor"))
    triangles = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get(), float)
    uv = np.stack([st[:, 0], 1.0 - st[:, 1]], axis=1)[triangles]
    corners = np.array(mesh.GetPointsAttr().Get(), float)[triangles]
    material = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0]
    surface = material.ComputeSurfaceSource()[0]
    texture = UsdShade.Shader(surface.GetInput("emissiveColor").GetConnectedSource()[0].GetPrim())
    assert texture.GetInput("sourceColorSpace").Get() == "raw"
    assert tuple(surface.GetInput("diffuseColor").Get()) == pytest.approx(COLOUR)
    emission = read_image(texture.GetInput("file").Get().resolvedPath).rgb
    check(baked, on_mesh(corners, uv, emission), np.array(COLOUR) / np.pi, 1e-5)


@pytest.mark.parametrize("suffix", [".png", ".exr"])
@pytest.mark.parametrize("source", [None, (1.5, -1.0, 4.0)], ids=["above", "aslant"])
def test_a_cookie_throws_the_caustic_where_it_was(
    baked: ss.CausticMap, tmp_path: Path, suffix: str, source: tuple[float, float, float] | None
) -> None:
    """By the formula that its numbers give: I cos θ/r² times the picture is the map again."""
    path = baked.export(tmp_path / f"floor{suffix}", source=source)
    told = json.loads((tmp_path / "floor.json").read_text())
    picture = read_image(path).rgb
    assert picture.shape == (120, 120, 3) and picture.max() == pytest.approx(1.0)
    position, forward, right, up = (np.array(told[k]) for k in ("position", "direction", "right", "up"))
    assert np.linalg.det([right, up, -forward]) == pytest.approx(1.0)
    if source is None:
        assert position[2] > 0.0 and told["seen_from"] == "straight above the receiver"
    else:
        assert tuple(position) == source
    half = np.tan(np.radians(told["half_angle_deg"]))

    def lit(points: np.ndarray) -> np.ndarray:
        way = points - position
        depth = way @ forward
        x, y = way @ right / depth / half, way @ up / depth / half
        seen = (np.abs(x) < 1.0) & (np.abs(y) < 1.0)
        distance = np.linalg.norm(way, axis=1)
        share = told["intensity_cd"] * np.abs(way[:, 2]) / distance**3
        return nearest(picture, np.stack([0.5 + 0.5 * x, 0.5 - 0.5 * y], axis=1)) * (share * seen)[:, None]

    points = points_on(baked)
    got, wanted = lit(points), into_gamut(baked.rgb).reshape(-1, 3)
    # The cookie's pixels are coarser than the map's: what they carry agrees, and where.
    assert got.sum() == pytest.approx(wanted.sum(), rel=0.03)
    for x, y, radius in LENSES.values():
        near = np.linalg.norm(points[:, :2] - (x, y), axis=1) < 1.2 * radius
        assert got[near].sum() == pytest.approx(wanted[near].sum(), rel=0.08)
        middle = (got[near].sum(axis=1)[:, None] * points[near]).sum(axis=0) / got[near].sum()
        assert middle[:2] == pytest.approx([x, y], abs=0.06)
    seen = np.abs((points - position) @ np.stack([right, up]).T).max(axis=1) / ((points - position) @ forward)
    assert seen.max() <= half * 1.0001


def test_a_lone_lamp_is_where_the_cookie_is_seen_from(tmp_path: Path) -> None:
    scene = ss.load(SCENE)
    scene.lights.add(name="lamp", kind="spot", position=[0.2, 0.1, 5.0], target=[0.0, 0.0, 0.0], flux_lm=100.0)
    del scene.lights[0]
    baked = ss.caustic(scene, "floor", size=(32, 32), photons=5_000)
    baked.export(tmp_path / "floor.png")
    told = json.loads((tmp_path / "floor.json").read_text())
    assert told["seen_from"] == "light 'lamp'" and told["position"] == [0.2, 0.1, 5.0]
    with pytest.raises(ss.UserError, match="give a place above it with source"):
        baked.export(tmp_path / "edge.png", source=(9.0, 0.0, 0.001))


def test_a_scene_with_y_up_is_not_turned(tmp_path: Path) -> None:
    turned = json.loads(json.dumps(SCENE))
    turned["camera"] = {"position": [0.5, 3.0, 4.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0]}
    baked = ss.caustic(ss.load(turned), "floor", size=(32, 32), photons=5_000)
    read = load_gltf(baked.export(tmp_path / "floor.glb")).objects[0]
    low, high = read.mesh.transformed(read.object_to_world).bounds()
    assert high - low == pytest.approx([6.0, 5.0, 0.0], abs=1e-5)


def test_a_curved_receiver_keeps_its_texture_coordinates(tmp_path: Path) -> None:
    scene = ss.load(SCENE)
    scene.objects["floor"].update(shape="sphere", radius=2.0, position=[0.0, 0.0, -1.9], width=None, height=None)
    baked = ss.caustic(scene, "floor", size=(64, 64), photons=10_000)
    corners, uv, emission, _ = glb(baked.export(tmp_path / "floor.glb"))
    assert np.allclose(uv, baked.placement["triangle_uv"], atol=1e-6)
    lit = nearest(emission, uv.mean(axis=1)).sum(axis=1)
    assert np.linalg.norm(corners.mean(axis=1)[lit.argmax(), :2] - LENSES["big"][:2]) < 0.4
    for name, words in (("a.png", "flat receiver"), ("a.glb", "no plane")):
        with pytest.raises(ss.UserError, match=words):
            baked.export(tmp_path / name, plane=name.endswith(".glb"))


def test_wishes_that_do_not_go_together_are_refused(baked: ss.CausticMap, tmp_path: Path) -> None:
    with pytest.raises(ss.UserError, match=r"use \.glb or \.gltf"):
        baked.export(tmp_path / "a.fbx")
    with pytest.raises(ss.UserError, match="plane does not go with a cookie"):
        baked.export(tmp_path / "a.png", plane=True)
    with pytest.raises(ss.UserError, match="source does not go with a.glb"):
        baked.export(tmp_path / "a.glb", source=(0.0, 0.0, 1.0))
    assert list(tmp_path.iterdir()) == []


def test_without_usd_core_the_remedy_is_told(
    baked: ss.CausticMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    with pytest.raises(ss.UserError, match=r"pip install usd-core"):
        baked.export(tmp_path / "a.usda")
    assert list(tmp_path.iterdir()) == []
