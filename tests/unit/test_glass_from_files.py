"""Glass as glTF and Wavefront files describe it: what filters, what is a thin sheet, what is said of the rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.io import gltf_document
from spectrasplat.model.io.gltf import load_gltf
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Diffuse, Material, Scene

from tests.unit.gltf_builder import FACES, POSITIONS, Builder, glass_material
from tests.unit.scene_texts import load

CLOSED, OPEN = FACES, FACES[:1]
RED = (1.0, 0.2, 0.2)


def pbr(*rgba: float, **more: Any) -> dict[str, Any]:
    return {"pbrMetallicRoughness": {"baseColorFactor": rgba, "metallicFactor": 0, "roughnessFactor": 0} | more}


def through(factor: float, **extensions: Any) -> dict[str, Any]:
    of = {"transmission": {"transmissionFactor": factor}} | extensions
    return {"extensions": {f"KHR_materials_{name}": values for name, values in of.items()}}


def opened(path: Path, material: dict[str, Any], faces: np.ndarray) -> tuple[Material, Scene]:
    scene = load_gltf(Builder().tetrahedron(material | {"name": "it"}, faces).written(path / "m.glb"))
    return scene.objects[0].material, scene


GLTF: dict[str, tuple[dict[str, Any], np.ndarray, Any, tuple[float, ...], str]] = {
    # material, mesh, what it is, transmittance or reflectance, a word of the note about it
    "base colour": (pbr(*RED, 1) | through(1, volume={"thicknessFactor": 1}), CLOSED, "solid", RED, ""),
    "pane": (pbr(*RED, 1) | through(1), OPEN, "sheet", RED, ""),
    "window of a box": (pbr(*RED, 1) | through(1), CLOSED, "solid", RED, "thin-walled"),
    "half": (
        pbr(0.2, 0.2, 1, 1) | through(0.5, volume={"thicknessFactor": 1}),
        CLOSED,
        "solid",
        (0.1, 0.1, 0.5),
        "transmissionFactor",
    ),
    "less than half": (pbr(0.2, 0.2, 1, 1) | through(0.4), CLOSED, "diffuse", (0.2, 0.2, 1), "opaque"),
    "blended": (pbr(0.8, 0.9, 1, 0.2) | {"alphaMode": "BLEND"}, CLOSED, "sheet", (0.96, 0.98, 1), "thin glass"),
    "dark car window": (pbr(0, 0, 0, 0.4) | {"alphaMode": "BLEND"}, OPEN, "sheet", (0.6, 0.6, 0.6), "thin glass"),
    "blended little": (pbr(0.8, 0.9, 1, 0.9) | {"alphaMode": "BLEND"}, CLOSED, "diffuse", (0.8, 0.9, 1), "opaque"),
    "alpha of no effect": (pbr(0.8, 0.9, 1, 0.2), CLOSED, "diffuse", (0.8, 0.9, 1), ""),
    "thick sheet": (
        pbr(1, 1, 1, 1)
        | through(1, volume={"thicknessFactor": 2.0, "attenuationDistance": 1.0, "attenuationColor": (0.5, 1, 0)}),
        OPEN,
        "sheet",
        (0.25, 1, 0),
        "thickness",
    ),
    "glossiness": (
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.1, 0.2, 0.3, 1]}}},
        CLOSED,
        "diffuse",
        (0.1, 0.2, 0.3),
        "pbrSpecularGlossiness",
    ),
}


@pytest.mark.parametrize("name", GLTF)
def test_gltf_glass(tmp_path: Path, name: str) -> None:
    values, faces, kind, rgb, word = GLTF[name]
    material, scene = opened(tmp_path, values, faces)
    found = "solid" if material.is_solid else "sheet" if material.thin else material.kind
    assert found == kind and material.absorption is None
    assert (material.reflectance_rgb if kind == "diffuse" else material.transmittance_rgb) == pytest.approx(rgb)
    told = [note for note in scene.notes if "'it'" in note]
    assert len(told) == (word != "") and word in "".join(told)


@pytest.mark.parametrize("closed", [True, False])
def test_parts_of_one_solid_are_joined(tmp_path: Path, closed: bool) -> None:
    builder = Builder().tetrahedron(pbr(1, 1, 1, 1) | through(1), FACES[:2])
    other = builder.primitive(FACES[2:] if closed else FACES[2:3]) | {"material": 0}
    builder.json["meshes"][0]["primitives"].append(other)
    scene = load_gltf(builder.written(tmp_path / "m.glb"))
    glass = [item for item in scene.objects if item.material.transmits]
    assert [item.material.thin for item in glass] == ([False] if closed else [True, True])
    assert glass[0].mesh.is_closed == closed and not any("open" in note for note in scene.notes)
    if closed:  # it is saved in its parts
        moved = replace(glass[0], object_to_world=np.diag([2.0, 2.0, 2.0, 1.0]))
        save_gltf(replace(scene, objects=(moved, *scene.objects[1:])), tmp_path / "n.glb", original=tmp_path / "m.glb")
        again = load_gltf(tmp_path / "n.glb").objects[0]
        assert again.mesh.volume() == pytest.approx(1.0 / 6.0) and again.object_to_world[0, 0] == 2.0


@pytest.mark.parametrize("factor", [1.0, 0.6, 0.4])
@pytest.mark.parametrize("faces", [CLOSED, OPEN], ids=["solid", "sheet"])
def test_iridescence_is_a_film(tmp_path: Path, factor: float, faces: np.ndarray) -> None:
    """On a solid its thickness can be dragged; a sheet carries it as a coating, being no film itself."""
    iridescence = {"iridescenceFactor": factor, "iridescenceIor": 1.4, "iridescenceThicknessMaximum": 300.0}
    values = pbr(1, 1, 1, 1) | through(1, volume={"thicknessFactor": 1}, iridescence=iridescence)
    material, scene = opened(tmp_path, values, faces)
    film, told = material.film, [note for note in scene.notes if "ridescence" in note]
    if factor < 0.5:
        assert film is None and "not shown" in told[0]
        return
    (layer,) = film.layers
    assert (layer.nm, layer.medium.n_d, film.alone) == (300.0, pytest.approx(1.4), False) and len(told) == (factor < 1)
    assert material.film_nm == (300.0 if faces is CLOSED else 0.0)
    save_gltf(scene, tmp_path / "n.glb", original=tmp_path / "m.glb")
    again = load_gltf(tmp_path / "n.glb").objects[0].material
    assert again.film == film and again.thin == material.thin


NOT_SHOWN: dict[str, dict[str, Any]] = {
    "clearcoat": {"clearcoatFactor": 1.0},
    "sheen": {"sheenColorFactor": [0.1, 0, 0]},
    "iridescence": {"iridescenceFactor": 0.4},
    "anisotropy": {"anisotropyStrength": 0.3},
    "diffuse_transmission": {"diffuseTransmissionFactor": 0.2},
    "specular": {"specularFactor": 0.5},
}


def test_what_glass_has_besides_is_said_once_a_kind(tmp_path: Path) -> None:
    extensions = {f"KHR_materials_{name}": values for name, values in NOT_SHOWN.items()}
    glass = glass_material() | pbr(1, 1, 1, 1) | {"normalTexture": {"index": 0}, "emissiveFactor": [1, 0, 0]}
    glass["extensions"] |= extensions | {
        "KHR_materials_transmission": {"transmissionFactor": 1.0, "transmissionTexture": {"index": 0}}
    }
    builder = Builder().tetrahedron(glass | {"name": "a"})
    neutral = glass_material() | pbr(1, 1, 1, 1) | {"name": "c"}
    neutral["extensions"] |= {name: dict.fromkeys(values, 0.0) for name, values in extensions.items()}
    neutral["extensions"]["KHR_materials_specular"] = {"specularFactor": 1.0}
    builder.json["materials"] += [glass | {"name": "b"}, neutral]
    for material in (1, 2):
        builder.json["meshes"].append({"primitives": [builder.primitive(FACES) | {"material": material}]})
        builder.json["nodes"].append({"mesh": material})
    builder.json["scenes"][0]["nodes"] = [0, 1, 2]
    builder.json["extensionsUsed"] = list(extensions)
    notes = load_gltf(builder.written(tmp_path / "m.glb")).notes
    for word in (*extensions, "normalTexture", "transmissionTexture", "emissiveFactor"):
        assert sum(word in note and "'a', 'b'" in note for note in notes) == 1, word
    assert not any("'c'" in note or "left aside" in note for note in notes)


MTL: dict[str, tuple[str, bool, str, tuple[float, ...], str]] = {
    # statements, whether the cube is closed, what it is, transmittance or reflectance, a word of the notes
    "Tf": ("Kd 0 0 0\nTf 0.1 0.8 0.1\nNi 1.52\nillum 6", True, "solid", (0.1, 0.8, 0.1), ""),
    "Tf of a pane": ("Tf 0.1 0.8 0.1\nillum 4", False, "sheet", (0.1, 0.8, 0.1), ""),
    "Tf 0 of programs that never set it": ("Kd 0 0 0\nTf 0 0 0\nillum 9", True, "solid", (1, 1, 1), ""),
    "Tf with d": ("Kd 1 1 1\nTf 1 0.5 0.5\nd 0.3", True, "solid", (1, 0.5, 0.5), ""),
    "d": ("Kd 0.5 1 1\nd 0.2", True, "solid", (0.9, 1, 1), ""),
    "d of a pane": ("Kd 0.5 1 1\nd 0.2", False, "sheet", (0.9, 1, 1), ""),
    "d, half and more": ("Kd 0.5 1 1\nd 0.7\nmap_Kd a.png", True, "diffuse", (0.5, 1, 1), "shown opaque"),
    "Tr": ("Kd 0.5 1 1\nTr 0.8", True, "solid", (0.9, 1, 1), ""),
    "Tr beside d is d": ("Kd 0.5 1 1\nTr 0.2\nd 0.2", True, "solid", (0.9, 1, 1), ""),
    "Tr 1 of programs that mean opaque": ("Kd 0.5 1 1\nTr 1\nmap_Kd a.png", True, "diffuse", (0.5, 1, 1), "map_Kd"),
    "light": ("Kd 0.5 1 1\nKe 1 1 0\nKe 0 0 0", True, "diffuse", (0.5, 1, 1), "Ke"),
}
BOX = "".join(f"v {x} {y} {z}\n" for z in (0, 1) for y in (0, 1) for x in (0, 1))
SIDES = ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6")


@pytest.mark.parametrize("name", MTL)
def test_mtl_glass(tmp_path: Path, name: str) -> None:
    statements, closed, kind, rgb, word = MTL[name]
    (tmp_path / "m.mtl").write_text(f"newmtl it\n{statements}\nnewmtl ball\nillum 4\n")
    sides = "".join(f"f {side}\n" for side in SIDES[: 6 if closed else 1])
    ball = BOX.replace("v ", "v 9") + "".join(
        "f " + " ".join(str(int(n) + 8) for n in side.split()) + "\n" for side in SIDES
    )
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\n{BOX}o it\nusemtl it\n{sides}o ball\nusemtl ball\n{ball}")
    scene = load_scene(tmp_path / "m.obj")
    material, ball_of = (next(o for o in scene.objects if o.name == wanted).material for wanted in ("it", "ball"))
    found = "solid" if material.is_solid else "sheet" if material.thin else material.kind
    assert (found, ball_of.is_solid) == (kind, True)
    rgb_found = material.reflectance_rgb if isinstance(material, Diffuse) else material.transmittance_rgb
    assert rgb_found == pytest.approx(rgb)
    assert word in " ".join(scene.notes) and sum("shown" in note for note in scene.notes) >= (word != "")


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("slab", ["thickness = {t}", "thickness = 1\nscale = [1, 1, {t}]"])
def test_a_plate_that_no_light_would_pass_is_named(unit: float, slab: str, tmp_path: Path) -> None:
    # GPU renderings of plates of 2 by 2 are black at 4e-6 and right at 1e-5 and above (reference: 1.000).
    for thickness, named in ((1e-6, True), (4e-6, True), (1e-5, False), (1e-2, False)):
        sizes = f"width = {2 * unit}\nheight = {2 * unit}\nrotation_deg = [20, 10, 0]\n"
        sizes += slab.format(t=thickness * unit)
        ball = f'shape = "sphere"\nradius = {0.1 * unit}\n'
        (tmp_path / "s.toml").write_text(f'[[objects]]\nname = "p"\nshape = "slab"\n{sizes}\n[[objects]]\n{ball}')
        notes = [note for note in load_scene(tmp_path / "s.toml").notes if "light may not pass" in note]
        assert len(notes) == named and all(note.startswith("'p': thinner than 7") for note in notes)


def test_a_scene_file_makes_sheets(tmp_path: Path) -> None:
    table = """
        [camera]
        position = [0, -9, 3]
        [[lights]]
        kind = "point"
        position = [0, 0, 5]
        [[objects]]
        shape = "plane"
        material = "diffuse"
        [[objects]]
        name = "pane"
        shape = "plane"
        position = [0, 0, 1]
        material = {glass = "N-BK7", roughness = 0.2, colour = [1, 0.2, 0.2]}
        thin = true
    """
    (tmp_path / "s.toml").write_text(table)
    scene = load_scene(tmp_path / "s.toml")
    pane = scene.objects[1].material
    assert pane.thin and pane.transmittance_rgb == RED and "thin" in pane.words() and not pane.is_rough
    assert [note for note in scene.notes if "'pane'" in note] == ["'pane': roughness has no effect in a thin sheet"]
    assert pane.values()["thin"] is True and pane.values()["colour"] == [*RED]
    assert any("thin = true" in note for note in load(tmp_path, table.replace("thin = true", "")).notes)


# -- compressed meshes --------------------------------------------------------------------


def compressed(method: str) -> Builder:
    builder = Builder()
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [method]
    builder.json |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
    if method == gltf_document.DRACO:
        draco = pytest.importorskip("DracoPy")
        view = builder.view(draco.encode(POSITIONS, FACES.astype(np.uint32), quantization_bits=14))
        accessors = [
            {"componentType": 5126, "count": 4, "type": "VEC3"},
            {"componentType": 5125, "count": 12, "type": "SCALAR"},
        ]
        extension = {"bufferView": view, "attributes": {"POSITION": 0}}
        primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": {method: extension}}
        builder.json |= {"accessors": accessors, "meshes": [{"primitives": [primitive]}]}
        return builder
    meshopt = pytest.importorskip("meshoptimizer")
    packed = (
        ("ATTRIBUTES", POSITIONS, 12, meshopt.encode_vertex_buffer(POSITIONS, 4, 12), 4),
        (
            "TRIANGLES",
            FACES.astype("<u2").ravel(),
            2,
            meshopt.encode_index_buffer(FACES.astype("u4").ravel(), 12, 4),
            12,
        ),
    )
    for mode, values, stride, data, count in packed:
        kind, component = ("VEC3", 5126) if mode == "ATTRIBUTES" else ("SCALAR", 5123)
        builder.accessor(values, kind, component)
        view = builder.view(bytes(data))
        own = builder.json["bufferViews"].pop()
        how = {"buffer": 0, "byteOffset": own["byteOffset"], "byteLength": own["byteLength"]}
        how |= {"byteStride": stride, "count": count, "mode": mode}
        builder.json["bufferViews"][view - 1] |= {"buffer": 1, "byteOffset": 0, "extensions": {method: how}}
    builder.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]
    builder.json["buffers"] = [{"byteLength": 96, "extensions": {method: {"fallback": True}}}]
    return builder


@pytest.mark.parametrize("method", [gltf_document.DRACO, gltf_document.MESHOPT[0]])
def test_compressed_meshes(tmp_path: Path, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = compressed(method).written(tmp_path / "m.glb")
    mesh = load_gltf(path).objects[0].mesh
    assert mesh.is_closed and mesh.volume() == pytest.approx(1.0 / 6.0, rel=1e-3)
    monkeypatch.setattr(gltf_document, "import_module", _missing)
    with pytest.raises(UserError, match=r"pip install '\.\[gltf\]'"):
        load_gltf(path)


def _missing(package: str) -> None:
    raise ImportError(package)
