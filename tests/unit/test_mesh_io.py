"""Mesh files: every format reads back exactly, and every lie in a file is one sentence."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.mesh_health import examine, repair
from spectrasplat.model.io.mesh_io import load_mesh, save_ply

pytestmark = pytest.mark.core

TETRAHEDRON_OBJ = """# comment
v 0 0 0
v 1 0 0 1.0 0.5 0.5
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f -1 -2 -4
"""
ASCII_PLY = """ply
format ascii 1.0
comment a square of one quad and one triangle
element vertex 4
property float x
property float y
property float z
property float s
property float t
element face 2
property uchar flags
property list uchar int vertex_index
end_header
0 0 0 0 0
1 0 0 1 0
1 1 0 1 1
0 1 0 0 1
7 4 0 1 2 3
7 3 0 1 2
"""


def _write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def _binary_stl(mesh: Mesh, promised: int | None = None) -> bytes:
    facets = np.zeros(len(mesh.triangles), dtype=[("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    facets["p"] = mesh.corners()
    return b"solid in name only".ljust(80) + struct.pack("<I", promised or len(facets)) + facets.tobytes()


def _binary_ply(order: str, rows: list[list[int]], vertices: np.ndarray, promised_vertices: int | None = None) -> bytes:
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = (
        f"ply\nformat {kind} 1.0\nelement vertex {promised_vertices or len(vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(rows)}\nproperty list uchar int vertex_indices\n"
        "end_header\n"
    )
    faces = b"".join(struct.pack(f"{order}B{len(row)}i", len(row), *row) for row in rows)
    return header.encode() + vertices.astype(f"{order}f4").tobytes() + faces


@pytest.mark.parametrize("mesh", [primitives.lens(triangles=400), primitives.box(), primitives.plane()])
def test_saved_ply_reads_back_exactly(tmp_path: Path, mesh: Mesh) -> None:
    save_ply(mesh, tmp_path / "m.ply")
    again, _ = repair(load_mesh(tmp_path / "m.ply"))
    np.testing.assert_array_equal(again.corners(), mesh.corners())
    assert again.is_closed == mesh.is_closed
    assert (again.corner_normals is None) == (mesh.corner_normals is None)
    if mesh.corner_normals is not None:
        np.testing.assert_allclose(again.corner_normals, mesh.corner_normals, atol=1e-15)
    if mesh.uv is not None:
        np.testing.assert_array_equal(again.uv, mesh.uv)
    assert again.source == str(tmp_path / "m.ply")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("mixed", [False, True])
def test_binary_ply_of_both_byte_orders_and_polygons(tmp_path: Path, order: str, mixed: bool) -> None:
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
    rows = [[0, 1, 2, 3], [0, 1, 2]] if mixed else [[0, 1, 2], [0, 2, 3]]
    mesh = load_mesh(_write(tmp_path, "m.ply", _binary_ply(order, rows, square)))
    expected = [(0, 1, 2), (0, 2, 3), (0, 1, 2)] if mixed else rows
    np.testing.assert_array_equal(mesh.triangles, expected)
    np.testing.assert_array_equal(mesh.vertices, square)


def test_ascii_ply_with_uv_and_face_properties(tmp_path: Path) -> None:
    mesh = load_mesh(_write(tmp_path, "m.ply", ASCII_PLY))
    np.testing.assert_array_equal(mesh.triangles, [(0, 1, 2), (0, 2, 3), (0, 1, 2)])
    np.testing.assert_array_equal(mesh.uv, mesh.corners()[:, :, :2])


def test_obj_with_relative_numbers_is_closed(tmp_path: Path) -> None:
    mesh = load_mesh(_write(tmp_path, "m.obj", TETRAHEDRON_OBJ))
    assert mesh.is_closed
    assert mesh.volume() == pytest.approx(1.0 / 6.0)
    assert mesh.corner_normals is None and mesh.uv is None


@pytest.mark.parametrize("form", ["{0}", "{0}/{0}", "{0}//{0}", "{0}/{0}/{0}"])
@pytest.mark.parametrize("pad", ["", "\nf " + " ".join(["{1}"] * 4)])
def test_obj_corner_forms(tmp_path: Path, form: str, pad: str) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + "vn 0 0 2\n" * 4
    text += "f " + " ".join(form.format(k) for k in (1, 2, 3))
    text += "\nf " + " ".join(form.format(k) for k in (1, 2, 3, 4)) if pad else ""
    mesh = load_mesh(_write(tmp_path, "m.obj", text + "\n"))
    assert len(mesh.triangles) == (3 if pad else 1)
    if form.count("/") == 2:
        np.testing.assert_array_equal(mesh.corner_normals, np.broadcast_to([0.0, 0.0, 1.0], mesh.corners().shape))
    if form in ("{0}/{0}", "{0}/{0}/{0}"):
        np.testing.assert_array_equal(mesh.uv, mesh.corners()[:, :, :2])


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("shift", range(8))
@pytest.mark.parametrize("turn", [1, -1])
def test_hollow_polygons_are_cut_within_their_outline(tmp_path: Path, binary: bool, shift: int, turn: int) -> None:
    # A rod with a groove: a fan about a corner of its ends covers up to 1.9 times their area, or none of the groove.
    outline = np.roll([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], shift, axis=0)[::turn]
    outline = np.column_stack([outline, np.zeros(8)])[:, [1, 2, 0]]
    vertices = np.vstack([outline, outline + (0, 1, 0)])
    ends = np.arange(8)
    sides = [[i, (i + 1) % 8, 8 + (i + 1) % 8, 8 + i] for i in range(8)]
    rows = [ends[::-1].tolist(), (8 + ends).tolist(), *sides]
    words = ["v\t{}\t{}\t{}".format(*each) for each in vertices]
    words += ["f\t" + " ".join(str(1 + number) for number in row) for row in rows]
    text = _binary_ply("<", rows, vertices) if binary else "\n".join(words)
    mesh = load_mesh(_write(tmp_path, "rod.ply" if binary else "rod.obj", text))
    assert mesh.is_closed and abs(mesh.volume()) == pytest.approx(7.0)
    assert np.linalg.norm(mesh.area_vectors(), axis=1).sum() == pytest.approx(2 * 7.0 + 16.0)


@pytest.mark.parametrize("binary", [True, False])
def test_stl_is_welded(tmp_path: Path, binary: bool) -> None:
    ball = primitives.sphere(1.0, 320)
    facet = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"
    lines = ["".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners) for corners in ball.corners().tolist()]
    text = "solid ball\n" + "".join(map(facet.format, lines)) + "endsolid ball\n"
    mesh = load_mesh(_write(tmp_path, "m.stl", _binary_stl(ball) if binary else text))
    assert mesh.is_closed and len(mesh.vertices) == len(ball.vertices)
    assert mesh.volume() == pytest.approx(ball.volume(), rel=1e-6)


def test_smooth_modes(tmp_path: Path) -> None:
    save_ply(primitives.lens(0.8, -0.8, 0.3, 0.9, 3_000), tmp_path / "lens.ply")
    from_file = load_mesh(tmp_path / "lens.ply")
    assert load_mesh(tmp_path / "lens.ply", smooth=False).corner_normals is None
    creased = load_mesh(tmp_path / "lens.ply", smooth=30)
    agree = np.einsum("tcj,tcj->tc", creased.corner_normals, from_file.corner_normals)
    assert agree.min() > np.cos(np.radians(4.0))  # the rim stays sharp, the faces smooth
    round_all = load_mesh(tmp_path / "lens.ply", smooth=True)
    assert np.einsum("tcj,tcj->tc", round_all.corner_normals, from_file.corner_normals).min() < 0.9


def test_angle_weights_ignore_how_a_face_is_cut(tmp_path: Path) -> None:
    save_ply(primitives.box(), tmp_path / "box.ply")
    mesh = load_mesh(tmp_path / "box.ply", smooth=True)
    corners = mesh.corners()
    np.testing.assert_allclose(
        mesh.corner_normals, corners / np.linalg.norm(corners, axis=2, keepdims=True), atol=1e-12
    )
    np.testing.assert_allclose(
        load_mesh(tmp_path / "box.ply", smooth=89.9).corner_normals,
        np.repeat(mesh.face_normals()[:, None], 3, axis=1),
        atol=1e-12,
    )


SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
GOOD_PLY = _binary_ply("<", [[0, 1, 2], [0, 2, 3]], SQUARE)
LIES = {
    "few.ply": (_binary_ply("<", [[0, 1, 2]], SQUARE[:3], 1000), "promises 1000 of 'vertex', but the file ends after"),
    "huge.ply": (_binary_ply("<", [[0, 1, 2]], SQUARE[:3], 10**15), "promises 10+ of 'vertex'"),
    "cut.ply": (GOOD_PLY[:-5], "promises 2 of 'face', but the file ends after 1"),
    "more.ply": (GOOD_PLY + b"more", "4 bytes follow"),
    "index.ply": (_binary_ply("<", [[0, 1, 9]], SQUARE), "face 0 names vertex 9"),
    "negative.ply": (_binary_ply("<", [[0, -1, 2]], SQUARE), "face 0 names vertex -1"),
    "ascii.ply": (ASCII_PLY.replace("vertex 4", "vertex 1000"), "promises 1000 of 'vertex', but the file ends after 6"),
    "ascii_more.ply": (ASCII_PLY + "3 0 1 2\n", "4 numbers follow"),
    "word.ply": (ASCII_PLY.replace("7 4 0", "7 4 x"), "no number"),
    "nan.ply": (ASCII_PLY.replace("1 1 0 1 1", "1 nan 0 1 1"), "vertex 2 is not finite"),
    "type.ply": (ASCII_PLY.replace("float y", "flot y"), "line 6 of the PLY header"),
    "noend.ply": (ASCII_PLY.split("end_header")[0], "no end_header"),
    "points.ply": (ASCII_PLY.split("element face")[0] + "end_header\n" + "0 0 0 0 0\n" * 4, "point cloud"),
    "empty.ply": ("", "the file is empty"),
    "faceless.ply": (_binary_ply("<", [], SQUARE), "no faces"),
    "fewer.ply": (ASCII_PLY.replace("vertex 4", "vertex -4"), "line 4"),
    "large.ply": (ASCII_PLY.replace("1 1 0 1 1", "1 1e200 0 1 1"), "vertex 2"),
    "png.ply": (b"\x89PNG\r\n", "not a PLY file"),
    "zero.obj": (TETRAHEDRON_OBJ.replace("f 1 3 2", "f 0 3 2"), "line 6: the face names vertex 0"),
    "big.obj": (TETRAHEDRON_OBJ.replace("f 1 3 2", "f 1 3 7"), "line 6: the face names vertex 7, but the file has 4"),
    "early.obj": (TETRAHEDRON_OBJ.replace("f -1 -2 -4", "f -1 -2 -9"), "line 9: the face names vertex"),
    "zero_bulk.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4: the face names vertex 0"),
    "normal.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//2\n", "line 5: the face names normal 2"),
    "word.obj": (TETRAHEDRON_OBJ.replace("v 0 1 0", "v 0 one 0"), "line 4: expected 3 numbers"),
    "corner.obj": (TETRAHEDRON_OBJ.replace("f 1 2 4", "f 1 two 4"), "line 7 holds what is no face corner"),
    "points.obj": ("v 0 0 0\n", "no faces"),
    "text.obj": ("hello\n", "no vertices"),
    "count.stl": (
        _binary_stl(primitives.box(), promised=1000),
        "promises 1000 triangles, but the file has room for 12",
    ),
    "short.stl": (b"abc", "too few"),
    "cut.stl": ("solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "truncated"),
    "word.stl": (
        "solid x\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 z 0\nendfacet\nendsolid",
        "three num",
    ),
    "mesh.fbx": ("x", "unknown mesh format"),
}


@pytest.mark.parametrize("name", LIES)
def test_lying_file_is_one_sentence(tmp_path: Path, name: str) -> None:
    content, says = LIES[name]
    with pytest.raises(UserError, match=says) as caught:
        load_mesh(_write(tmp_path, name, content))
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_missing_file_and_bad_crease(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nothing\.ply: No such file"):
        load_mesh(tmp_path / "nothing.ply")
    with pytest.raises(UserError, match="crease angle"):
        load_mesh(_write(tmp_path, "m.obj", TETRAHEDRON_OBJ), smooth=200.0)


def test_failed_save_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_ply(primitives.box(), tmp_path / "m.ply")
    before = (tmp_path / "m.ply").read_bytes()

    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(UserError, match="disk is full"):
        save_ply(primitives.sphere(), tmp_path / "m.ply")
    assert (tmp_path / "m.ply").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.ply"]


def test_unwelded_file_counts_as_open_until_repaired(tmp_path: Path) -> None:
    save_ply(primitives.lens(triangles=400), tmp_path / "m.ply")
    mesh = load_mesh(tmp_path / "m.ply")
    assert examine(mesh).boundary_edges > 0 and examine(mesh).duplicate_vertices > 0
    mended, notes = repair(mesh)
    assert examine(mended).watertight and notes == ()
