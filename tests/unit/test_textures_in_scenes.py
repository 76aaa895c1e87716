"""Textures and environments in scene files: read once, refused in one sentence, saved and opened again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base import files
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import write_image
from spectrasplat.model.environment import sky, world_to_local
from spectrasplat.model.geometry import primitives
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Diffuse, Scene
from spectrasplat.model.texture import Environment, Texture

from tests.unit.scene_texts import load

BALL = '[[objects]]\nshape = "sphere"\nglass = "N-SF11"\n'
TABLE = '[[objects]]\nname = "table"\nshape = "plane"\nwidth = 9.0\nheight = 9.0\nposition = [0, 0, -2]\n'
CAMERA = "[camera]\nposition = [0, -6, 3]\ntarget = [0, 0, 0]\n"
LIGHT = "[[lights]]\nposition = [0, 0, 5]\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Pictures every test may use: a poster of 8 bits, a panorama, a mesh with and one without UVs."""
    levels = np.random.default_rng(7).integers(0, 256, (6, 8, 3)).astype(np.uint8)
    Image.fromarray(levels).save(tmp_path / "poster.png")
    write_image(tmp_path / "room.exr", np.random.default_rng(8).random((16, 32, 3)) * 50.0)
    (tmp_path / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "mapped.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    return tmp_path


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(UserError) as caught:
        load(folder, text)
    sentence = str(caught.value)
    assert "\n" not in sentence and sentence.startswith("scene.toml")
    return sentence


def again(scene: Scene, path: Path) -> Scene:
    save_scene(scene, path)
    return load_scene(path)


# -- textures -----------------------------------------------------------------------------


def test_a_texture_is_read_with_its_factor_and_wrap(folder: Path) -> None:
    text = LIGHT + BALL + TABLE
    plain = load(folder, text + 'material = { kind = "diffuse", texture = "poster.png" }').objects[1].material
    assert plain.reflectance_rgb == (1.0, 1.0, 1.0) and plain.texture.wrap == "repeat"
    assert plain.texture.rgb.shape == (6, 8, 3) and plain.texture.source == str((folder / "poster.png").resolve())
    tinted = load(
        folder,
        text + 'material = { kind = "diffuse", texture = { file = "poster.png", wrap = "clamp" }, colour = 0.5 }',
    )
    assert tinted.objects[1].material.reflectance_rgb == (0.5, 0.5, 0.5)
    assert tinted.objects[1].material.texture.wrap == "clamp"
    assert load(folder, text + 'material = "diffuse"').objects[1].material.reflectance_rgb == (0.8, 0.8, 0.8)


def test_one_picture_is_read_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spectrasplat.model import texture

    reads = []
    read = texture.read_picture
    monkeypatch.setattr(texture, "read_picture", lambda path: reads.append(path) or read(path))
    scene = load(
        folder,
        LIGHT
        + BALL
        + '[materials.a]\nkind = "diffuse"\ntexture = "poster.png"\n'
        + '[materials.b]\nkind = "diffuse"\ntexture = { file = "./poster.png", wrap = "clamp" }\n'
        + TABLE
        + 'material = "a"\n'
        + TABLE.replace("table", "wall")
        + 'material = { kind = "diffuse", texture = "poster.png" }\n'
        + TABLE.replace("table", "shelf")
        + 'material = "b"\n',
    )
    table, wall, shelf = (o.material.texture for o in scene.objects[1:])
    assert len(reads) == 1 and table is wall and shelf is not table and shelf.rgb is table.rgb


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        ('{ kind = "diffuse", texture = "gone.png" }', "objects[1].material.texture names"),
        ('{ kind = "diffuse", texture = "bare.obj" }', "'.obj' is not a picture format"),
        ('{ kind = "diffuse", texture = 3 }', "objects[1].material.texture must be a table such as { file"),
        (
            '{ kind = "diffuse", texture = "poster.png", reflectance = { nm = [400, 700], values = [0.1, 0.9] } }',
            "objects[1].material.texture cannot stand beside 'reflectance'",
        ),
        ('{ kind = "diffuse", texture = "room.exr" }', "values lie above 1"),
    ],
)
def test_a_bad_texture_is_one_sentence(folder: Path, material: str, expected: str) -> None:
    assert expected in refusal(folder, LIGHT + BALL + TABLE + f"material = {material}")


def test_pictures_that_are_none_name_the_key(folder: Path) -> None:
    (folder / "poster.png").write_bytes(b"#?RADIANCE\n\n")
    sentence = refusal(folder, LIGHT + BALL + TABLE + 'material = { kind = "diffuse", texture = "poster.png" }')
    assert "objects[1].material.texture cannot be used: " in sentence and "neither a PNG nor a JPEG" in sentence


def test_a_mesh_without_texture_coordinates_cannot_wear_one(folder: Path) -> None:
    text = (
        LIGHT
        + BALL
        + '[[objects]]\nname = "sheet"\nmesh = "{}"\nmaterial = {{ kind = "diffuse", texture = "poster.png" }}\n'
    )
    sentence = refusal(folder, text.format("bare.obj"))
    assert "object 'sheet' has a texture, but its mesh no texture coordinates; export it with UVs" in sentence
    assert load(folder, text.format("mapped.obj")).objects[1].mesh.uv is not None
    (folder / "mapped.obj").write_text((folder / "mapped.obj").read_text().replace("vt 1 0", "vt nan 0"))
    assert "object 'sheet' has texture coordinates that are not finite" in refusal(folder, text.format("mapped.obj"))


# -- environments -------------------------------------------------------------------------


def test_each_kind_of_environment_is_read(folder: Path) -> None:
    text = CAMERA + BALL
    scene = load(folder, text + '[environment]\nkind = "map"\nfile = "room.exr"\nintensity = 2.0\nrotation_deg = 30\n')
    assert scene.environment.kind == "map" and scene.environment.rgb.max() > 60.0 and scene.lights == ()
    assert len(scene.objects) == 1
    np.testing.assert_allclose(scene.environment.world_to_local, world_to_local((0, 0, 1), 30.0))
    scene = load(folder, text + '[environment]\nkind = "gradient"\nzenith = [1, 2, 30]\nhorizon = 4\nup = [0, 2, 0]\n')
    assert scene.environment.kind == "gradient"
    np.testing.assert_allclose(scene.environment.rgb[-1, 0], (4.0, 4.0, 4.0), rtol=1e-3)
    np.testing.assert_allclose(scene.environment.world_to_local[2], (0, 1, 0))
    scene = load(folder, text + '[environment]\nkind = "sky"\ntype = 5\nluminance = 3\nground = "#ffffff"\n')
    np.testing.assert_allclose(scene.environment.rgb, 3.0, rtol=1e-6)
    for line, expected in (("radiance = [5, 6, 0]", (5.0, 6.0, 0.0)), ("colour = 0.5\nintensity = 4", (2.0, 2.0, 2.0))):
        scene = load(folder, LIGHT + BALL + TABLE + f'material = "diffuse"\n[environment]\nkind = "constant"\n{line}\n')
        assert scene.environment.kind == "constant" and scene.background_rgb == expected
        np.testing.assert_allclose(scene.environment.rgb, np.broadcast_to(expected, (8, 16, 3)))


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('kind = "map"', "environment.file is missing"),
        ('kind = "map"\nfile = "gone.hdr"', "environment.file names"),
        ('kind = "map"\nfile = "bare.obj"', "environment.file cannot be used"),
        (
            'kind = "gradient"\nzenith = [1, -1, 1]\nhorizon = 1',
            "environment.zenith must be three radiances of 0 or more",
        ),
        ('kind = "constant"\ncolour = 1\nradiance = 2', "environment.radiance cannot stand beside 'colour'"),
    ],
)
def test_a_bad_environment_is_one_sentence(folder: Path, lines: str, expected: str) -> None:
    assert expected in refusal(folder, CAMERA + BALL + f"[environment]\n{lines}\n")


def test_environment_and_background_exclude_each_other(folder: Path) -> None:
    sentence = refusal(folder, "background = [1, 1, 1]\n" + CAMERA + BALL + '[environment]\nkind = "sky"\n')
    assert "environment cannot stand beside 'background'" in sentence
    assert "environment must be a table" in refusal(folder, 'environment = "room.exr"\n' + CAMERA + BALL)


def test_without_an_environment_light_and_receiver_are_still_needed(folder: Path) -> None:
    assert "holds no light" in refusal(folder, "lights = []\n" + CAMERA + BALL + TABLE + 'material = "diffuse"')
    assert "nothing receives the light" in refusal(folder, CAMERA + LIGHT + BALL)
    dark = load(folder, "lights = []\n" + CAMERA + BALL + '[environment]\nkind = "sky"\n')
    assert dark.lights == ()
    # With a diffuse object in view, a file that says nothing of lights gets its sun as ever.
    lit = load(folder, CAMERA + BALL + TABLE + 'material = "diffuse"\n[environment]\nkind = "sky"\n')
    assert [light.name for light in lit.lights] == ["sun"]


# -- saved and opened again ---------------------------------------------------------------


def test_textures_survive_saving_elsewhere(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(files.ENVIRONMENT, str(folder))
    text = (
        LIGHT
        + BALL
        + TABLE
        + 'material = { kind = "diffuse", colour = 0.25, texture = { file = "poster.png", wrap = "clamp" } }'
    )
    scene = load(folder, text)
    (folder / "deep" / "er").mkdir(parents=True)
    back = again(scene, folder / "deep" / "er" / "copy.toml")
    old, new = scene.objects[1].material, back.objects[1].material
    assert new.reflectance_rgb == old.reflectance_rgb and new.texture.wrap == "clamp"
    assert new.texture.source == old.texture.source
    np.testing.assert_array_equal(new.texture.rgb, old.texture.rgb)
    assert 'file = "../../poster.png"' in (folder / "deep" / "er" / "copy.toml").read_text()


@pytest.mark.parametrize("exact", [True, False])
def test_a_texture_without_a_file_gets_one(folder: Path, exact: bool) -> None:
    scene = load(folder, LIGHT + BALL + TABLE + 'material = { kind = "diffuse", texture = "poster.png" }')
    rgb = scene.objects[1].material.texture.rgb * (1.0 if exact else 0.37)
    item = replace(scene.objects[1], material=Diffuse((1.0, 1.0, 1.0), texture=Texture(rgb.astype(np.float32))))
    other = replace(item, name="wall", material=Diffuse((1.0, 1.0, 1.0), texture=Texture(rgb[::-1].astype(np.float32))))
    back = again(replace(scene, objects=(scene.objects[0], item, other)), folder / "copy.toml")
    for one, two in zip((item, other), back.objects[1:], strict=True):
        np.testing.assert_array_equal(one.material.texture.rgb, two.material.texture.rgb)
    assert {p.suffix for p in (folder / "copy_pictures").iterdir()} == {".png" if exact else ".exr"}


@pytest.mark.parametrize(
    "lines",
    [
        'kind = "map"\nfile = "room.exr"\nintensity = 0.5\nrotation_deg = -70\nup = [0.1, 0.2, 1]',
        'kind = "gradient"\nzenith = [1, 2, 30]\nhorizon = 4\nnadir = [0, 0, 1]\nintensity = 2\nup = [0, 1, 0]',
        (
            'kind = "sky"\ntype = 13\nsun_elevation_deg = 12.5\nsun_azimuth_deg = 200\nluminance = 3000\n'
            "ground = [0.1, 0.2, 0.3]"
        ),
    ],
)
def test_environments_survive_saving(folder: Path, lines: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(files.ENVIRONMENT, str(folder))
    scene = load(folder, CAMERA + BALL + f"[environment]\n{lines}\n")
    (folder / "deep").mkdir()
    back = again(scene, folder / "deep" / "copy.toml")
    assert back.environment.kind == scene.environment.kind and back.environment.source == scene.environment.source
    np.testing.assert_array_equal(back.environment.rgb, scene.environment.rgb)
    np.testing.assert_allclose(back.environment.world_to_local, scene.environment.world_to_local, atol=1e-15)
    assert back.environment.parameters.keys() == scene.environment.parameters.keys() and back.lights == ()
    for key, value in scene.environment.parameters.items():
        np.testing.assert_allclose(back.environment.parameters[key], value, atol=1e-15)


def test_an_environment_made_in_memory_is_saved_with_its_picture(folder: Path) -> None:
    scene = load(folder, CAMERA + BALL + '[environment]\nkind = "sky"\n')
    made = Environment(sky(20.0).rgb, world_to_local((0.0, -0.6, 0.8), 77.0))
    back = again(replace(scene, environment=made), folder / "copy.toml")
    np.testing.assert_array_equal(back.environment.rgb, made.rgb)
    np.testing.assert_allclose(back.environment.world_to_local, made.world_to_local, atol=1e-12)


# -- texture coordinates ------------------------------------------------------------------


def test_a_plane_shows_the_whole_picture_once_the_right_way_up() -> None:
    plane = primitives.plane(4.0, 2.0)
    corners, uv = plane.corners().reshape(-1, 3), plane.uv.reshape(-1, 2)
    np.testing.assert_allclose(uv, corners[:, :2] / (4.0, 2.0) + 0.5)


@pytest.mark.parametrize("mesh", [primitives.box((1.0, 2.0, 0.5)), primitives.slab(3.0, 2.0, 0.1)], ids=["box", "slab"])
def test_every_face_of_a_box_shows_the_whole_picture_from_outside(mesh) -> None:
    normals, corners = mesh.face_normals(), mesh.corners()
    for direction in np.concatenate([np.eye(3), -np.eye(3)]):
        face = normals @ direction > 0.9
        assert face.sum() == 2
        uv, points = mesh.uv[face], corners[face]
        assert {tuple(pair) for pair in uv.reshape(-1, 2)} == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
        # Not mirrored: u, v and the outward normal are right-handed on every triangle.
        d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        assert (d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0] > 0.0).all()
        if abs(direction[2]) < 0.5:
            np.testing.assert_allclose(uv[..., 1], points[..., 2] / np.ptp(points[..., 2]) + 0.5)


def test_a_disc_cuts_its_circle_out_of_the_picture() -> None:
    disc = primitives.disc(0.25, 12)
    np.testing.assert_allclose(disc.uv, disc.corners()[..., :2] / 0.5 + 0.5, atol=1e-15)


def test_a_globe_has_its_map_the_right_way_round() -> None:
    for mesh, axes in (
        (primitives.sphere(2.0, 2_000), (2.0, 2.0, 2.0)),
        (primitives.ellipsoid((1.0, 2.0, 3.0), 2_000), (1.0, 2.0, 3.0)),
    ):
        direction = mesh.corners() / axes
        # v is the latitude; u the azimuth up to whole turns, continuous within each triangle.
        np.testing.assert_allclose(
            mesh.uv[..., 1], 1.0 - np.arccos(np.clip(direction[..., 2], -1.0, 1.0)) / np.pi, atol=1e-7
        )
        level = np.hypot(direction[..., 0], direction[..., 1])
        away = level > 1e-9
        azimuth = (mesh.uv[..., 0][away] - 0.5) * 2.0 * np.pi
        np.testing.assert_allclose(np.cos(azimuth), direction[..., 0][away] / level[away], atol=1e-9)
        assert np.ptp(mesh.uv[..., 0], axis=1).max() <= 0.5 + 1e-9
        # Middle of the picture at +x, the right of it towards +y, seen from outside.
        d1, d2 = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
        equator = np.abs(direction[..., 2]).max(axis=1) < 0.9
        assert (d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0] > 0.0)[equator].all()


@pytest.mark.parametrize(
    "mesh",
    [primitives.box((1.0, 2.0, 0.5)), primitives.sphere(1.0, 320), primitives.disc(1.0)],
    ids=["box", "sphere", "disc"],
)
def test_pictures_on_primitives_leave_their_charts_alone(mesh) -> None:
    from spectrasplat.model.geometry.charts import build_charts

    atlas, bare = (build_charts(m, total_texels=40_000) for m in (mesh, replace(mesh, uv=None)))
    assert not atlas.from_own_uv
    np.testing.assert_array_equal(atlas.rects, bare.rects)
    np.testing.assert_array_equal(atlas.rows, bare.rows)


INLINE = (
    '[[objects]]\nname = "quad"\nshape = "inline"\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n'
    "triangles = [[0, 1, 2]]\n"
)


def test_inline_triangles_may_have_texture_coordinates(folder: Path) -> None:
    text = LIGHT + BALL + INLINE + 'material = { kind = "diffuse", texture = "poster.png" }\n'
    scene = load(folder, text + "uv = [[0, 0], [2, 0], [0, 3]]\n")
    np.testing.assert_array_equal(scene.objects[1].mesh.uv, [[(0, 0), (2, 0), (0, 3)]])
    np.testing.assert_array_equal(again(scene, folder / "copy.toml").objects[1].mesh.uv, scene.objects[1].mesh.uv)
    assert "uv has 2 rows for 1 triangles" in refusal(folder, text + "uv = [[0, 0], [2, 0]]\n")
    assert "no texture coordinates" in refusal(folder, text)


def test_a_mesh_without_a_description_keeps_its_texture_coordinates(folder: Path) -> None:
    scene = load(folder, LIGHT + BALL + TABLE + 'material = { kind = "diffuse", texture = "poster.png" }')
    for mesh in (primitives.box((1.0, 2.0, 3.0)), primitives.sphere(1.0, 80)):
        item = replace(scene.objects[1], mesh=mesh)
        back = again(replace(scene, objects=(scene.objects[0], item)), folder / "copy.toml").objects[1].mesh
        np.testing.assert_array_equal(back.uv, mesh.uv)
        np.testing.assert_array_equal(back.corners(), mesh.corners())
