"""Faceting designs: GemCad's files in every guise, stones of known proportions, and designs recovered from meshes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.gems.facet_design import FacetDesign, Tier, asc_text, read_asc, write_asc
from spectrasplat.model.gems.from_mesh import design_in
from spectrasplat.model.geometry.half_spaces import convex_solid
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import brilliant, step_cut
from spectrasplat.model.io.mesh_io import load_mesh
from spectrasplat.model.io.scene_file import load_scene, scene_of
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Scene

DESIGNS = sorted((assets_dir() / "gems").glob("*.asc"))
SQUARE = """GemCad 5.0
g 96 0.0
y 4 y
I 1.54
H Square
a -45 0.7 24 n P1 48 72 96
a 90 0.8 24 n G1 48 72 96
a 45 0.7 24 n C1 48 72 96
a 0 0.3 96 n T
F end
"""


def written(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "stone.asc"
    path.write_bytes(text.encode(encoding))
    return path


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """How far a half-space of one set is at most from its nearest of the other, in direction and distance."""
    each = np.abs(a[:, None] - b).max(axis=2)
    return float(max(each.min(axis=0).max(), each.min(axis=1).max()))


def scene_with(tmp_path: Path, **keys: object) -> Scene:
    return scene_of({"objects": [{"name": "stone", "glass": "diamond", **keys}]}, tmp_path / "scene.toml")


# ---- known answers ------------------------------------------------------------------------------


def test_round_brilliant_has_the_proportions_of_its_angles() -> None:
    """Mains of 40.75° and 34.5° that meet the girdle: pavilion depth tan 40.75° / 2 of the diameter, crown height
    (1 - table) tan 34.5° / 2, as for Tolkowsky's 53 % table: 43.1 % and 16.2 %."""
    half, table = 0.01, 0.53
    pavilion, crown = math.radians(40.75), math.radians(34.5)
    eight = tuple(12.0 * k for k in range(1, 9))
    sixteen = tuple(6.0 * k + 3.0 for k in range(16))
    girdle = math.cos(math.pi / 16)
    height = half + (1.0 - table) * math.tan(crown)
    tiers = (
        Tier(-40.75, math.sin(pavilion) + half * math.cos(pavilion), eight),
        Tier(90.0, girdle, sixteen),
        Tier(34.5, math.sin(crown) + half * math.cos(crown), eight),
        Tier(0.0, height, (96.0,)),
    )
    mesh = FacetDesign("single cut", tiers).mesh()
    low, high = mesh.bounds()
    assert mesh.is_closed and len(mesh.convex_planes) == 33
    assert (-low[2] - half) / 2.0 == pytest.approx(0.5 * math.tan(pavilion), abs=1e-12)  # 0.431
    assert (high[2] - half) / 2.0 == pytest.approx(0.162, abs=5e-4)
    top = mesh.vertices[mesh.vertices[:, 2] > high[2] - 1e-9]
    assert len(top) == 8
    # An octagon whose sides are where bezels meet the table.
    np.testing.assert_allclose(np.linalg.norm(top[:, :2], axis=1), table / math.cos(math.pi / 8), atol=1e-12)


def test_indices_start_at_the_front_and_run_counter_clockwise_seen_from_the_table(tmp_path: Path) -> None:
    for gear, x in (("96 0.0", 1.0), ("-96 0.0", -1.0)):
        design = read_asc(written(tmp_path, SQUARE.replace("g 96 0.0", f"g {gear}")))
        np.testing.assert_allclose(design.planes[4], (x, 0.0, 0.0, 0.8), atol=1e-15)  # index 24
        np.testing.assert_allclose(design.planes[7], (0.0, -1.0, 0.0, 0.8), atol=1e-15)  # index 96
    moved = read_asc(written(tmp_path, SQUARE.replace("g 96 0.0", "g 96 24")))
    np.testing.assert_allclose(moved.planes[4], (0.0, -1.0, 0.0, 0.8), atol=1e-15)


def test_square_stone_has_its_volume(tmp_path: Path) -> None:
    """Pavilion and crown are pyramids of 45° on a square of side 1.6: their tips would be at 0.7 √2, and
    each plane reaches the girdle at 0.7 √2 - 0.8; the table cuts the upper one at 0.3."""
    edge = 0.7 * math.sqrt(2.0) - 0.8
    upper = 0.7 * math.sqrt(2.0) - 0.3
    below = (2.0 * 0.8) ** 2 * (0.8 / 3.0 + edge)
    above = 2.0**2 * (0.8**3 - upper**3) / 3.0 + 1.6**2 * edge
    assert read_asc(written(tmp_path, SQUARE)).mesh().volume() == pytest.approx(below + above, rel=1e-12)


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
def test_shipped_designs_are_whole_stones(path: Path) -> None:
    design = read_asc(path)
    mesh = design.mesh()
    assert not design.cut_away and mesh.is_closed and mesh.volume() > 0.0
    slack = design.planes[:, 3] - mesh.vertices @ design.planes[:, :3].T
    assert slack.min() > -1e-12
    # Every facet is a polygon of the stone, of as many corners as touch its plane.
    assert (np.sum(np.abs(slack) < 1e-9, axis=0) >= 3).all()
    assert len(mesh.vertices) - (len(mesh.triangles) * 3) // 2 + len(mesh.triangles) == 2


# ---- files in the wild --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "encoding"),
    [
        (lambda text: text.replace("\n", "\r\n") + "\x1a", "utf-8"),
        (lambda text: text, "utf-16"),
        (lambda text: "\ufeff" + text.replace("Square", "Carré"), "utf-8"),
        (lambda text: text.replace("Square", "Carré"), "latin-1"),
        (lambda text: text.replace(" ", "\t"), "utf-8"),
        (lambda text: text.replace("g 96", "g96").replace("a -45", "a-45"), "utf-8"),
        (lambda text: text.replace("g 96", "96").replace("y 4 y\n", "").replace("I 1.54\n", ""), "utf-8"),
        (lambda text: text.replace("24 n P1 48 72 96", "24 n\nP1 48\n 72\n96 n P\nG cut to\ncentre point"), "utf-8"),
        (lambda text: text.replace("P1 48", "Main facet 48 n 7"), "utf-8"),
        (lambda text: text.replace("24 n P1 48 72 96", "24 48 72 96 n"), "utf-8"),
        (lambda text: text.replace("a 90 ", "A -90.0 ").replace("I 1.54", "i 1.54"), "utf-8"),
        (lambda text: text.replace("a 0 0.3 96 n T", "a -0.0 0.9 n C\na 0 0.3 n T"), "utf-8"),
        (lambda text: text.replace("g 96", "; by hand\ng 96").replace("24 n", "24.0 n"), "utf-8"),
        (lambda text: text.replace("24 n C1", "24 n C1 -72 120e-1 n x").replace("120e-1 n x ", ""), "utf-8"),
    ],
)
def test_files_of_all_guises_are_the_same_stone(tmp_path: Path, change, encoding: str) -> None:  # type: ignore[no-untyped-def]
    plain = read_asc(written(tmp_path, SQUARE)).mesh()
    text = change(SQUARE)
    mesh = read_asc(written(tmp_path, text, encoding)).mesh()
    if "0.9 n C" in text:
        assert mesh.bounds()[0][2] == pytest.approx(-0.9)  # a culet
    else:
        assert mesh.volume() == pytest.approx(plain.volume(), rel=1e-12)


def test_names_and_title_are_kept(tmp_path: Path) -> None:
    design = read_asc(
        written(tmp_path, SQUARE.replace("n P1 48", "n P1 48 n b c").replace("72 96\na 90", "72 96 G x\na 90"))
    )
    assert (design.tiers[0].name, design.title, design.n_d) == ("P1/b c", "Square", 1.54)
    again = read_asc(written(tmp_path, asc_text(design)))
    assert again == replace(design, tiers=(replace(design.tiers[0], name="P1/b_c"), *design.tiers[1:]))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (SQUARE, "", "the file is empty"),
        ("GemCad 5.0", "solid stone", "line 1: it does not begin with 'GemCad'"),
        ("g 96 0.0\n", "", "there is no gear"),
        ("g 96 0.0", "g 9.6", "line 2: a gear has 3 to 1000 teeth, not 9.6"),
        ("g 96 0.0", "g 96 0 0 4", "line 2: '96 0 0 4' behind g is not understood"),
        ("g 96 0.0", "g 96\ng 64", "line 3: 'g' was given before"),
        ("I 1.54", "I 154", "line 4: a refractive index of 154"),
        ("H Square", "hello", "line 5: 'hello' is not understood"),
        ("a -45 0.7", "a -45,0 0.7", "line 6: a tier begins with its angle and distance"),
        ("a -45 0.7", "a -145 0.7", "line 6: an angle of -145° is none"),
        ("a -45 0.7", "a -45 -0.7", "line 6: a distance of -0.7 is none"),
        ("a -45 0.7", "a -45 1e99", "line 6: a distance of 1e+99"),
        ("24 n P1 48 72 96", "", "line 6: a tier without indices"),
        ("48 72 96\na 90", "4872 96\na 90", "line 6: index 4872 is beyond the gear's 96 teeth"),
        ("24 n P1", "24 P1", "line 6: 'P1' is no index"),
        ("72 96\na 90", "72 G to depth\n96\na 90", "line 7: numbers follow a cutting instruction"),
        ("a 90", "p 1 2\na 90", "line 7: a preform (p) is not read"),
        ("a 0 0.3 96 n T", "a 0 0.3 96\n" * 1000, "has 1012 facets; a stone has 4 to 1000"),
        ("a -45 0.7 24 n P1 48 72 96\n", "", "make no stone: they do not close"),
        ("a 0 0.3 96 n T", "a 0 0.3 96\na -0 -0.0 96\na 0 0 96", "make no stone: they leave nothing"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in SQUARE
    with pytest.raises(UserError) as caught:
        read_asc(written(tmp_path, SQUARE.replace(old, new, 1))).mesh()
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


# ---- rounding -----------------------------------------------------------------------------------


@pytest.mark.parametrize("stone", [brilliant(), brilliant(girdle=0.0), step_cut()], ids=["round", "sharp", "step"])
@pytest.mark.parametrize("digits", [3, 6, 8, 9, 12])
def test_planes_survive_the_decimals_of_a_file(stone: Mesh, digits: int) -> None:
    """Planes that meet in one point only nearly: the mesh stays closed, and knows each of its planes."""
    planes = stone.convex_planes.copy()
    planes[:, 3] = np.round(planes[:, 3], digits)
    mesh = convex_solid("stone", planes)
    assert mesh.is_closed
    assert mesh.convex_planes is not None and apart(planes, mesh.convex_planes) < 1e-6
    assert mesh.volume() == pytest.approx(stone.volume(), rel=10.0 * 10.0**-digits)


def test_any_planes_make_a_hull() -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        normals = rng.normal(size=(int(rng.integers(40, 160)), 3)) * (1.0, 1.0, 10.0 ** rng.uniform(-2, 1))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        origin = rng.normal(size=3)
        distances = 10.0 ** rng.uniform(-4, 4) * (rng.uniform(0.9, 1.1, len(normals)) + normals @ origin)
        mesh = convex_solid("hull", np.column_stack([normals, distances]))
        beyond = mesh.vertices @ normals.T - distances
        assert mesh.is_closed and beyond.max() < 1e-8 * np.ptp(mesh.vertices)
        assert (np.sum(np.abs(beyond) < 1e-8 * np.ptp(mesh.vertices), axis=1) >= 3).all()


# ---- out and back -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "tiers", "fold"),
    [
        ({"shape": "brilliant"}, 7, 8),
        ({"shape": "step_cut", "corner": 0.1}, 23, 2),
        ({"shape": "brilliant", "rotation_deg": [40.0, 25.0, 10.0]}, 7, 8),
        ({"shape": "box", "size": [1.0, 1.0, 0.5]}, 3, 4),
        ({"shape": "polygon_prism", "sides": 5}, 3, 5),
    ],
)
def test_stones_come_back_from_their_files(tmp_path: Path, keys: dict[str, object], tiers: int, fold: int) -> None:
    scene = scene_with(tmp_path, **keys)
    design, _ = design_in(scene, "stone")
    assert (len(design.tiers), design.symmetry, design.is_mirrored) == (tiers, fold, True)
    assert design.n_d == pytest.approx(2.4175, abs=1e-4)
    write_asc(design, tmp_path / "out.asc")
    back = load_mesh(tmp_path / "out.asc")
    assert apart(scene.objects[0].mesh.convex_planes, back.convex_planes) < 1e-9


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
def test_designs_come_back_from_their_stones(tmp_path: Path, path: Path) -> None:
    design = read_asc(path)
    again, _ = design_in(scene_with(tmp_path, mesh=str(path)), "stone")
    assert apart(design.planes, again.planes) < 1e-9
    assert f"\ny {again.symmetry} {'y' if again.is_mirrored else 'n'}\n" in path.read_text()
    assert len(again.tiers) == len({(t.angle_deg, round(t.distance, 9)) for t in design.tiers})


def test_a_users_stl_of_float32_off_its_origin_comes_back_at_the_size_of_a_stone(tmp_path: Path) -> None:
    stone = brilliant(diameter=8.0)
    corners = (stone.corners() + (30.0, -7.0, 3.0)).astype("<f4")
    rows = b"".join(bytes(12) + triangle.tobytes() + b"\0\0" for triangle in corners)
    (tmp_path / "stone.stl").write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + rows)
    design, words = design_in(load_scene(tmp_path / "stone.stl"), "stone")
    assert len(design.facets) == 73 and len(design.tiers) == 7 and design.symmetry == 8
    assert "0.25 times its size" in words
    angles = sorted(tier.angle_deg for tier in design.tiers)
    assert angles[1] == pytest.approx(-40.75, abs=1e-3) and design.mesh().is_closed


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"shape": "polygon_prism", "sides": 7}, "on 80, which fits best, a facet of 90° is 0.429 of a tooth off"),
        ({"shape": "brilliant", "scale": [1.0, 1.3, 1.0]}, "of a tooth off"),
        ({"shape": "sphere"}, "its surface is smooth"),
        ({"shape": "inline", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]}, "is open"),
    ],
)
def test_what_is_no_design_is_refused(tmp_path: Path, keys: dict[str, object], sentence: str) -> None:
    with pytest.raises(UserError, match="stone") as caught:
        design_in(scene_with(tmp_path, **keys), "stone")
    assert sentence in str(caught.value)


# ---- as scenes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "made", "n_d"),
    [("1.54", "quartz", 1.5443), ("1.76", "sapphire", 1.7682), ("2.42", "diamond", 2.4175), ("2.3", "its index", 2.3)],
)
def test_a_stone_is_of_what_its_index_says(tmp_path: Path, index: str, made: str, n_d: float) -> None:
    scene = load_scene(written(tmp_path, SQUARE.replace("1.54", index)))
    assert made in scene.notes[0]
    assert scene.objects[0].material.dispersion.n_d == pytest.approx(n_d, abs=1e-4)


def test_what_others_cut_away_is_said_and_the_file_kept_in_a_saved_scene(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, SQUARE.replace("a 0 0.3", "a 5 0.9 12 n extra\na 0 0.3")))
    assert any("extra at index 12" in note for note in scene.notes)
    save_scene(scene, tmp_path / "scene.toml")
    assert 'mesh = "stone.asc"' in (tmp_path / "scene.toml").read_text()
    again = load_scene(tmp_path / "scene.toml")
    np.testing.assert_array_equal(again.objects[0].mesh.vertices, scene.objects[0].mesh.vertices)
