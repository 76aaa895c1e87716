"""A saved scene loads as itself; over its file, what was not edited stays as it was written."""

from __future__ import annotations

import difflib
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.files import own_files
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.document import Document
from spectrasplat.edit.glass import set_dispersion_gain
from spectrasplat.edit.lights import set_light, set_light_power
from spectrasplat.edit.objects import rename, set_diffuse_colour, set_position, set_rotation, set_scale
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Dab, Dielectric, Scene

from tests.unit.scene_texts import THREE_LINES, load, refusal

RICH = """
name = "rich"
background = [0.1, 0.2, 0.3]
[camera]
kind = "orthographic"
position = [1.0, -7.0, 3.0]
vertical_extent = 3.5
[render]
size = [320, 200]
photons = 1e5
exposure_ev = -0.5
max_depth = 12
[[lights]]
name = "key"
kind = "spot"
position = [0.3, 0.0, 5.0]
target = [0.1, 0.2, 0.0]
half_angle_deg = 20
softness = 0.25
spectrum = {blackbody = 3200}
flux_lm = 900
[[lights]]
kind = "area"
position = [3, 0, 5]
size = [1.0, 2.0]
tangent = [1, 1, 0]
spectrum = "F11"
luminance_nt = 5
[[lights]]
kind = "directional"
direction = [0, 1, -1]
angular_diameter_deg = 0.5
spectrum = [{laser = 450}, {illuminant = "A", weight = 2}]
[materials."my glass"]
n_d = 1.7
V_d = 30
absorption = {colour = [0.3, 0.9, 0.7], distance = 2}
priority = 2
[materials.table]
kind = "diffuse"
colour = "#808080"
[[objects]]
name = "ring"
shape = "torus"
triangles = 800
material = "my glass"
rotation_deg = [10, 20, 30]
[[objects]]
shape = "lens"
radius2 = inf
triangles = 400
glass = "N-SF11"
position = [0, 0, 2]
instances = [{position = [1, 0, 0]}, {position = [2, 0, 0]}]
[[objects]]
mesh = "block.ply"
smooth = 30
position = [0, 3, 0]
material = {name = "T", table = [[400, 1.53], [587.56, 1.52], [700, 1.51]]}
[[objects]]
shape = "plane"
width = 30
material = "table"
position = [0, 0, -3]
"""


def assert_same(one: Scene, two: Scene) -> None:
    assert (one.name, one.camera, one.background_rgb, one.render) == (
        two.name,
        two.camera,
        two.background_rgb,
        two.render,
    )
    assert len(one.lights) == len(two.lights) and len(one.objects) == len(two.objects)
    for a, b in zip(one.lights, two.lights, strict=True):
        rounded = ("spectral_power", "direction", "tangent")
        told = [{k: v for k, v in light.given().items() if k not in rounded} for light in (a, b)]
        assert type(a) is type(b) and told[0] == told[1]
        np.testing.assert_allclose(b.direction, a.direction, rtol=1e-14)
        top = a.spectral_power.density.max()
        np.testing.assert_allclose(b.spectral_power.density, a.spectral_power.density, atol=1e-9 * top)
        np.testing.assert_allclose(b.spectral_power.lines, a.spectral_power.lines, rtol=1e-12)
    for a, b in zip(one.objects, two.objects, strict=True):
        assert a.name == b.name and type(a.material) is type(b.material)
        np.testing.assert_array_equal(a.object_to_world, b.object_to_world)
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
        np.testing.assert_array_equal(a.mesh.triangles, b.mesh.triangles)
        assert (a.mesh.corner_normals is None) == (b.mesh.corner_normals is None)
        if isinstance(a.material, Dielectric):
            assert a.material.priority == b.material.priority
            assert a.material.dispersion == b.material.dispersion
            if a.material.absorption is not None:
                np.testing.assert_allclose(
                    b.material.absorption.coefficient, a.material.absorption.coefficient, rtol=1e-12
                )
        else:
            assert a.material == b.material


def test_a_saved_scene_loads_as_itself(tmp_path: Path) -> None:
    from spectrasplat.model.geometry.primitives import box
    from spectrasplat.model.io.mesh_io import save_ply

    save_ply(box(), tmp_path / "block.ply")
    scene = load(tmp_path, RICH)
    (tmp_path / "elsewhere").mkdir()
    saved = tmp_path / "elsewhere" / "saved.toml"
    with own_files():
        save_scene(scene, saved)
        again = load_scene(saved)
    assert_same(scene, again)
    assert again.objects[1].mesh is again.objects[2].mesh
    text = saved.read_text()
    assert 'spectrum = "FL11"' in text and "blackbody = 3200.0" in text and 'mesh = "../block.ply"' in text
    assert sorted(p.name for p in saved.parent.iterdir()) == ["saved.toml"]


def test_meshes_without_a_description_are_saved_as_triangles(tmp_path: Path) -> None:
    from dataclasses import replace

    from spectrasplat.model.geometry.primitives import box, sphere

    scene = load(tmp_path, THREE_LINES)
    ball, table = scene.objects
    matrix = np.diag([1.0, 1.0, 2.0, 1.0])
    edited = replace(
        scene,
        objects=(
            replace(ball, mesh=sphere(triangles=80).transformed(matrix)),
            replace(ball, name="b", mesh=box()),
            table,
        ),
    )
    saved = tmp_path / "saved.toml"
    save_scene(edited, saved)
    again = load_scene(saved)
    np.testing.assert_allclose(
        np.ptp(again.objects[0].mesh.vertices, axis=0), np.ptp(edited.objects[0].mesh.vertices, axis=0)
    )
    assert again.objects[0].mesh.volume() == pytest.approx(edited.objects[0].mesh.volume(), rel=1e-12)
    assert again.objects[0].mesh.corner_normals is not None
    np.testing.assert_array_equal(again.objects[1].mesh.vertices, box().vertices)
    assert 'shape = "inline"' in saved.read_text()


# -- edited dispersion ----------------------------------------------------------------------

PAINTED = """
[materials.strong]
n_d = 1.6
V_d = 30
dispersion_gain = 2.5
[[objects]]
name = "ball"
shape = "sphere"
material = "strong"
[[objects]]
name = "sf11"
shape = "sphere"
glass = "N-SF11"
dispersion_gain = 0.25
position = [2, 0, 0]
[[objects]]
name = "stronger"
shape = "sphere"
material = "strong"
dispersion_gain = 4
position = [4, 0, 0]
[[objects]]
name = "wall"
shape = "plane"
material = "diffuse"
position = [0, 0, -3]
local_dispersion = [
    {position = [0.25, 0.1, 0.0], radius = 0.5, log2_gain = 1.5},
    {position = [0, 0, 0], radius = 1, falloff = 0.2, erase = 0.75},
]
[[objects]]
name = "tile"
shape = "plane"
material = "diffuse"
local_dispersion = [{position = [0, 0, 0], radius = 1, log2_gain = -1}]
instances = [
    {position = [0, 0, -4]},
    {position = [0, 0, -5], local_dispersion = [{position = [0, 1, 0], radius = 2, log2_gain = 1}]},
]
"""


def test_gain_and_dabs_are_read_and_saved(tmp_path: Path) -> None:
    scene = load(tmp_path, PAINTED)
    ball, sf11, stronger, wall, tile1, tile2 = scene.objects
    assert [o.material.dispersion.gain for o in (ball, sf11, stronger)] == [2.5, 0.25, 4.0]
    assert ball.material.dispersion.V_d == pytest.approx(12.0, rel=1e-3)
    assert sf11.material.dispersion.n_d == pytest.approx(1.784720, abs=1e-6)
    assert wall.local_dispersion == (Dab((0.25, 0.1, 0.0), 0.5, 1.5), Dab((0, 0, 0), 1.0, 0.0, 0.2, 0.75))
    assert tile1.local_dispersion == (Dab((0, 0, 0), 1.0, -1.0),)
    assert tile2.local_dispersion == (Dab((0, 0, 0), 1.0, -1.0), Dab((0, 1, 0), 2.0, 1.0))
    assert any("2.5 times" in note for note in scene.notes)
    save_scene(scene, tmp_path / "again.toml")
    again = load_scene(tmp_path / "again.toml")
    assert_same(scene, again)
    assert [o.local_dispersion for o in again.objects] == [o.local_dispersion for o in scene.objects]
    assert again.objects[4].mesh is again.objects[5].mesh


PAINT = '[[objects]]\nshape = "plane"\nmaterial = "diffuse"\nlocal_dispersion = '


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("dispersion_gain = -1", "objects[0].dispersion_gain is -1 but must be at least 0"),
        ("dispersion_gain = 1000", "objects[0].dispersion_gain: the refractive index is"),
        (
            "local_dispersion = [{position = [0, 0, 0], radius = 1}]",
            "objects[0].local_dispersion is painted on what receives",
        ),
        (
            '[[objects]]\nshape = "plane"\nmaterial = "black"\ndispersion_gain = 2',
            "objects[1].dispersion_gain is for glass",
        ),
        (PAINT + "[{position = [0, 0, nan], radius = 1}]", "objects[1].local_dispersion[0].position[2] is nan"),
    ],
)
def test_mistakes_of_gain_and_dabs_have_their_sentence(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in refusal(tmp_path, THREE_LINES + text)


Edit = Callable[[Scene], Scene]


def moved(position: tuple[float, float, float]) -> Edit:
    return lambda scene: set_light(scene, 0, scene.lights[0].changed(position=position))


CASES: dict[str, tuple[Edit, list[str]]] = {
    "gain": (lambda s: set_dispersion_gain(s, 0, 2.0), ["+dispersion_gain = 2.0"]),
    "turn": (
        lambda s: set_rotation(s, 0, (-90.0, 0.0, 30.0)),
        [
            "-rotation_deg = [-90.0, 0.0, 0.0]      # stands upright, its refracting edge towards +y",
            "+rotation_deg = [-90.0, 0.0, 30.0]      # stands upright, its refracting edge towards +y",
        ],
    ),
    "move": (lambda s: set_position(s, 0, (0.2, 0.0, 0.601)), ["+position = [0.2, 0.0, 0.601]"]),
    "lift": (
        lambda s: set_position(s, 0, (0.0, 0.0, 0.9)),
        ["-rests_at_z = 0.001", "+position = [0.0, 0.0, 0.9]"],
    ),
    "name": (lambda s: rename(s, 0, "flint"), ['-name = "prism"', '+name = "flint"']),
    "power": (
        lambda s: set_light_power(s, 0, 10_000.0, "illuminance_lx"),
        ["-illuminance_lx = 20_000", "+illuminance_lx = 10000.0"],
    ),
    "lamp": (moved((-4.0, -2.0, 1.0)), ["-position = [-4.404, -2.570, 0.909]", "+position = [-4.0, -2.0, 1.0]"]),
    "view": (
        lambda s: replace(s, camera=replace(s.camera, vertical_fov_deg=25.0)),
        ["-vertical_fov_deg = 30.0", "+vertical_fov_deg = 25.0"],
    ),
    "colour": (
        lambda s: set_diffuse_colour(s, 1, (0.8, 0.5, 0.5)),
        [
            '-material = { kind = "diffuse", colour = 0.8 }',
            '+material = { kind = "diffuse", colour = [0.8, 0.5, 0.5] }',
        ],
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_only_what_was_edited_differs(name: str, tmp_path: Path) -> None:
    edit, wanted = CASES[name]
    path = tmp_path / "prism.toml"
    text = (assets_dir() / "scenes" / "prism.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    document = Document.open(path)
    document.history.push(name, edit(document.scene))
    document.save()
    lines = difflib.unified_diff(text.splitlines(), path.read_text(encoding="utf-8").splitlines(), lineterm="", n=0)
    differing = [line for line in lines if not line.startswith(("---", "+++", "@@"))]
    assert sorted(differing) == sorted(wanted)
    _assert_alike(load_scene(path), document.scene)


@pytest.mark.parametrize("scene", ["achromat", "brilliant_studio", "spectrometer", "wine_glass", "ball"])
def test_whatever_is_edited_reads_back(scene: str, tmp_path: Path) -> None:
    path = tmp_path / f"{scene}.toml"
    text = (assets_dir() / "scenes" / f"{scene}.toml").read_text(encoding="utf-8")
    path.write_text(text.replace('"../', f'"{assets_dir().as_posix()}/'), encoding="utf-8")
    document = Document.open(path)
    changed = document.scene
    for index, item in enumerate(changed.objects):
        changed = set_rotation(changed, index, (10.0 + index, 20.0, 30.0))
        changed = set_scale(changed, index, (1.0, 2.0, 0.5 + index))
        changed = rename(changed, index, f"{item.name} moved")
    for index, light in enumerate(changed.lights):
        changed = set_light(changed, index, light.changed(direction=(0.6, 0.0, -0.8)))
    document.history.push("all", changed)
    document.save()
    _assert_alike(load_scene(path), changed)


def _assert_alike(found: Scene, wanted: Scene) -> None:
    assert [item.name for item in found.objects] == [item.name for item in wanted.objects]
    for a, b in zip(found.objects, wanted.objects, strict=True):
        np.testing.assert_allclose(a.object_to_world, b.object_to_world, atol=2e-8 * np.abs(b.object_to_world).max())
        assert a.material.values() == b.material.values()
    for a, b in zip(found.lights, wanted.lights, strict=True):
        assert a.name == b.name and a.spectral_power.power_w() == pytest.approx(b.spectral_power.power_w(), rel=1e-8)
        assert np.allclose(a.position, b.position) and np.allclose(a.direction, b.direction)
    assert found.camera == wanted.camera and found.render == wanted.render


def _changed_lines(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[0] in "+-" and not line.startswith(("---", "+++"))]


def test_saved_into_another_folder_only_names_of_files_differ(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    there.mkdir()
    scenes = assets_dir() / "scenes"
    shutil.copytree(scenes / "prism_case", here / "prism_case")
    # What is called like a file, and names none.
    text = (scenes / "prism_case.toml").read_text(encoding="utf-8").replace('name = "slit"', 'name = "prism_case"')
    (here / "case.toml").write_text(text, encoding="utf-8")
    document = Document.open(here / "case.toml")
    document.history.push("Rename", rename(document.scene, 2, "ground"))
    document.save(there / "case.toml")
    saved = (there / "case.toml").read_text(encoding="utf-8")
    differing = _changed_lines(text, saved)
    assert {line.split(" = ")[0].lstrip("+-") for line in differing} == {"mesh", "name"}
    assert len(differing) == 2 * 4  # three meshes, which had to be copied, and the name
    _assert_alike(load_scene(there / "case.toml"), document.scene)
    shutil.rmtree(here)
    load_scene(there / "case.toml")


def test_saved_into_the_folder_above_files_are_named_where_they_are(tmp_path: Path) -> None:
    here = tmp_path / "here"
    scenes = assets_dir() / "scenes"
    shutil.copytree(scenes / "prism_case", here / "prism_case")
    text = (scenes / "prism_case.toml").read_text(encoding="utf-8")
    (here / "case.toml").write_text(text, encoding="utf-8")
    Document.open(here / "case.toml").save(tmp_path / "above.toml")
    differing = _changed_lines(text, (tmp_path / "above.toml").read_text(encoding="utf-8"))
    assert [line for line in differing if line.startswith("+")] == [
        f'+mesh = "here/prism_case/{name}.ply"' for name in ("prism", "slit", "floor")
    ]
    load_scene(tmp_path / "above.toml")
