"""A user's own file: which way is up, what is glass, and that picture, table, light and room fit it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.commands.options import read
from spectrasplat.commands.table import View
from spectrasplat.edit.document import Document
from spectrasplat.edit.opening import Opening, open_scene
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Camera, Dielectric, Scene
from spectrasplat.model.scene_environment import STUDIO_MAP
from spectrasplat.model.scene_objects import make_shape
from spectrasplat.model.staging import Staging, guessed_up

from tests.unit.gltf_builder import Builder


def obj_file(path: Path, mesh: Mesh, y_up: bool, scale: float = 1.0) -> Path:
    """An OBJ without normals, as most programs write it."""
    x, y, z = scale * mesh.vertices.T
    rows = np.stack([x, z, -y] if y_up else [x, y, z], axis=1)
    lines = [f"v {a:.6f} {b:.6f} {c:.6f}" for a, b, c in rows]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.triangles + 1]
    path.write_text("\n".join(lines))
    return path


def projected(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Places (n, 2) in the picture; ±1 are its upper and lower border."""
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    seen = points - np.array(camera.position)
    depth = (seen @ forward) * math.tan(math.radians(0.5 * camera.vertical_fov_deg))
    return np.stack([seen @ right, seen @ np.cross(right, forward)], axis=1) / depth[:, None]


def world_points(scene: Scene) -> np.ndarray:
    item = scene.objects[0]
    return item.mesh.vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]


@pytest.mark.parametrize("y_up", [True, False])
@pytest.mark.parametrize("shape", ["torus", "cup", "prism"])
def test_up_is_guessed_from_the_form(tmp_path: Path, shape: str, y_up: bool) -> None:
    profile = [[0, 0], [0.8, 0], [1.0, 3.0], [0.9, 3.0], [0.7, 0.1], [0, 0.1]]
    made = make_shape("revolution", profile=profile) if shape == "cup" else make_shape(shape)
    scene = load_scene(obj_file(tmp_path / "own.obj", made, y_up, 30.0))
    axis = "y" if y_up else "z"
    assert any(f"{axis} was taken" in note for note in scene.notes)
    # Upright again, whichever way the file has it.
    low, high = made.bounds()
    points = world_points(scene)
    assert np.ptp(points, axis=0) == pytest.approx(30.0 * (high - low), rel=1e-5)


def test_a_shape_that_tells_nothing_stands_as_its_kind_of_file_does() -> None:
    ball = make_shape("sphere")
    assert [guessed_up(ball, suffix)[0] for suffix in (".obj", ".stl", ".ply")] == ["y", "z", "z"]


def test_up_can_be_said(tmp_path: Path) -> None:
    path = obj_file(tmp_path / "own.obj", make_shape("torus"), y_up=True)
    scene = load_scene(path, Staging(up="z"))
    assert not any("taken" in note for note in scene.notes)
    assert int(np.argmin(np.ptp(world_points(scene), axis=0))) == 1
    toml = tmp_path / "own.toml"
    toml.write_text('[[objects]]\nshape = "torus"\n')
    with pytest.raises(UserError, match="--up is for meshes"):
        load_scene(toml, Staging(up="y"))


@pytest.mark.parametrize("shape", ["torus", "prism", "brilliant", "lens"])
@pytest.mark.parametrize("scale", [1e-3, 200.0])
def test_the_picture_is_filled_by_the_glass_and_its_shadow(tmp_path: Path, shape: str, scale: float) -> None:
    scene = load_scene(obj_file(tmp_path / "own.obj", make_shape(shape), y_up=False, scale=scale), Staging(up="z"))
    points, (_, table) = world_points(scene), scene.objects
    x, y, z = scene.lights[0].direction
    shadow = points - np.outer((points[:, 2] - table.object_to_world[2, 3]) / z, (x, y, z))
    places = projected(scene.camera, np.concatenate([points, shadow]))
    assert np.abs(places[:, 0]).max() < 1.5 and np.abs(places[:, 1]).max() < 1.0  # all of it, in 3:2
    # Tight: one of the two sides is used well.
    assert max(np.ptp(places[:, 0]) / 3.0, np.ptp(places[:, 1]) / 2.0) > 0.8
    # The glass itself is no dot.
    glass = np.ptp(projected(scene.camera, points), axis=0)
    assert glass.max() > 0.6


def test_lights_reach_and_the_room_is_there(tmp_path: Path) -> None:
    scene = load_scene(obj_file(tmp_path / "own.obj", make_shape("torus"), y_up=True))
    lamp, above = scene.lights
    assert lamp.kind == "spot" and above.kind == "directional"
    centre = world_points(scene).mean(axis=0)
    distance = float(np.linalg.norm(centre - lamp.position))
    assert lamp.spectral_power.luminous() / distance**2 == pytest.approx(3.0, rel=0.05)
    assert scene.environment is not None and scene.environment.source == str(STUDIO_MAP.resolve())


def test_the_studio_is_saved_by_its_word_alone(tmp_path: Path) -> None:
    scene = load_scene(obj_file(tmp_path / "own.obj", make_shape("torus"), y_up=True))
    save_scene(scene, tmp_path / "kept.toml")
    text = (tmp_path / "kept.toml").read_text()
    assert 'kind = "studio"' in text and ".hdr" not in text
    again = load_scene(tmp_path / "kept.toml")
    np.testing.assert_array_equal(again.environment.rgb, scene.environment.rgb)
    assert [light.name for light in again.lights] == ["lamp", "from above"] and again.camera == scene.camera


# -- glass ----------------------------------------------------------------------------------


def opaque_file(path: Path) -> Path:
    builder = Builder().tetrahedron(
        {"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.7, 0.7, 1.0]}}
    )
    builder.json["nodes"] = [{"mesh": 0, "name": "stone"}, {"mesh": 0, "name": "foot", "translation": [0, -3, 0]}]
    builder.json["scenes"][0]["nodes"] = [0, 1]
    return builder.written(path)


def test_an_opaque_glb_is_lit_stands_on_a_table_and_says_why_nothing_is_glass(tmp_path: Path) -> None:
    scene = load_scene(opaque_file(tmp_path / "own.glb"))
    assert [o.name for o in scene.objects] == ["stone", "foot", "table"] and len(scene.lights) == 2
    (told,) = [note for note in scene.notes if note.startswith("Nothing here is glass")]
    assert "--glass stone=N-SF11" in told and "'foot'" in told
    # The table lies below everything along the file's own up.
    assert scene.camera.up == (0.0, 1.0, 0.0)
    assert scene.objects[2].object_to_world[1, 3] < -3.0


def test_glass_for_all_and_for_one(tmp_path: Path) -> None:
    path = opaque_file(tmp_path / "own.glb")
    scene = load_scene(path, Staging(glass=((None, "diamond"), ("foot", "N-SF11"))))
    stone, foot, table = (o.material for o in scene.objects)
    assert isinstance(stone, Dielectric) and stone.dispersion.n_d == pytest.approx(2.4175, abs=1e-3)
    assert isinstance(foot, Dielectric) and foot.dispersion.n_d == pytest.approx(1.78472, abs=1e-4)
    assert table.receives and not any("Nothing here is glass" in note for note in scene.notes)


@pytest.mark.parametrize(
    ("name", "chosen"),
    [("S*", "stone"), ("[fs]*", "stone foot"), ("foot", "foot"), ("paint", "stone foot"), ("P?INT", "stone foot")],
)
def test_glass_by_pattern_and_by_material(tmp_path: Path, name: str, chosen: str) -> None:
    scene = load_scene(opaque_file(tmp_path / "own.glb"), Staging(glass=((name, "amethyst"), ("fo*", "Thin N-SF11"))))
    assert [o.name for o in scene.objects if o.material.transmits and o.material.thin] == ["foot"]
    glasses = {o.name: o.material.dispersion.name for o in scene.objects if o.material.transmits}
    assert glasses == {"foot": "Schott N-SF11"} | ({"stone": "quartz (ordinary)"} if "stone" in chosen else {})


def test_what_is_not_glass_stays_in_the_picture(tmp_path: Path) -> None:
    path = opaque_file(tmp_path / "own.glb")
    before, after = load_scene(path), load_scene(path, Staging(glass=(("foot", "N-SF11"),)))
    assert [o.name for o in after.objects] == ["stone", "foot", "table"] and after.camera == before.camera
    assert [light.position for light in after.lights] == [light.position for light in before.lights]


@pytest.mark.parametrize(
    ("glass", "said"),
    [
        (("ston", "diamond"), "no object 'ston'.*did you mean.*stone"),
        (("*gem", "diamond"), "no object '.gem'.*it holds 'stone', 'foot' and the materials 'paint'"),
        ((None, "diamont"), "diamont"),
    ],
)
def test_what_cannot_be_made_glass_is_told(tmp_path: Path, glass: tuple[str | None, str], said: str) -> None:
    with pytest.raises(UserError, match=said):
        load_scene(opaque_file(tmp_path / "own.glb"), Staging(glass=(glass,)))


def test_a_glb_may_have_z_up(tmp_path: Path) -> None:
    scene = load_scene(opaque_file(tmp_path / "own.glb"), Staging(up="z"))
    assert scene.camera.up == (0.0, 0.0, 1.0) and scene.lights[0].direction[2] < 0.0
    normal = scene.objects[2].object_to_world[:3, 2]
    np.testing.assert_allclose(normal, (0.0, 0.0, 1.0), atol=1e-12)


def test_a_table_of_the_files_own_is_enough(tmp_path: Path) -> None:
    clear = {"name": "clear", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}
    builder = Builder().tetrahedron(clear)
    builder.json["materials"].append({"name": "wood"})
    wide = dict(builder.json["meshes"][0]["primitives"][0], material=1)
    builder.json["meshes"].append({"name": "board", "primitives": [wide]})
    builder.json["nodes"] = [
        {"mesh": 0, "name": "stone"},
        {"mesh": 1, "name": "board", "translation": [-5, -1, -5], "scale": [20, 0.01, 20]},
    ]
    builder.json["scenes"][0]["nodes"] = [0, 1]
    scene = load_scene(builder.written(tmp_path / "own.glb"))
    assert [o.name for o in scene.objects] == ["stone", "board"]


# -- what is asked for --------------------------------------------------------------------------


def test_options_are_parsed() -> None:
    assert View().opening is None
    asked = read(View, {"up": "y", "glass": ["diamond", "a=b=N-BK7"], "environment": "sky"})
    assert asked.opening == Opening(Staging("y", ((None, "diamond"), ("a=b", "N-BK7"))), "sky")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"up": "x"}, "--up 'x'"),
        ({"glass": ["stone="]}, "names no glass"),
        ({"glass": ["=N-BK7"]}, "names no glass"),
        ({"environment": "nowhere.hdr"}, "neither studio nor sky nor a file"),
    ],
)
def test_mistakes_are_sentences(given: dict[str, object], said: str) -> None:
    with pytest.raises(UserError, match=said):
        read(View, given)


@pytest.mark.parametrize("y_up", [True, False])
def test_a_sky_stands_upright_and_suits_the_light(tmp_path: Path, y_up: bool) -> None:
    path = opaque_file(tmp_path / "own.glb")
    scene = open_scene(path, Opening(Staging("y" if y_up else "z"), "sky"))
    assert scene.environment is not None and scene.environment.kind == "sky"
    up = scene.environment.world_to_local[2]
    np.testing.assert_allclose(up, (0, 1, 0) if y_up else (0, 0, 1), atol=1e-12)
    assert 0.01 < scene.environment.parameters["luminance"] < 3.0


def test_a_panorama_is_taken_and_the_studio_can_be_asked_for(tmp_path: Path) -> None:
    path = opaque_file(tmp_path / "own.glb")
    taken = open_scene(path, Opening(environment=str(STUDIO_MAP)))
    assert taken.environment is not None and taken.environment.kind == "map"
    toml = tmp_path / "own.toml"
    toml.write_text(
        'lights = [{ kind = "point", position = [0, 0, 5] }]\n[[objects]]\nshape = "plane"\nmaterial = "diffuse"'
    )
    assert open_scene(toml).environment is None
    studio = open_scene(toml, Opening(environment="studio")).environment
    assert studio is not None and studio.source == str(STUDIO_MAP.resolve())
    with pytest.raises(UserError, match="neither studio nor sky nor a panorama"):
        open_scene(path, Opening(environment=str(toml)))


def test_documents_open_as_asked(tmp_path: Path) -> None:
    save_ply(make_shape("torus"), tmp_path / "own.ply")
    document = Document.open(tmp_path / "own.ply", Opening(Staging(up="y", glass=((None, "N-SF11"),))))
    assert document.path is None and document.scene.objects[0].material.dispersion.n_d > 1.7
