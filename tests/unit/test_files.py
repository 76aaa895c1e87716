"""What files may be read: regular ones, of a sensible length, in or below the scene's folder; nothing of them is
quoted."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base import files
from spectrasplat.base.errors import UserError, plain
from spectrasplat.model.io.mesh_io import load_mesh
from spectrasplat.model.io.picture_files import read_picture
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.lights.ies_file import read_ies
from spectrasplat.model.optics.spectrum import from_csv

from tests.unit.scene_texts import load

SECRET = "xyzzy:0:0:plugh horse battery"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
SCENE = '[[objects]]\nmesh = "{}"\nglass = "N-BK7"\n'


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: os.symlink("/dev/zero", path), os.mkdir])
@pytest.mark.parametrize(
    ("suffix", "read"),
    [
        (".toml", load_scene),
        (".glb", load_scene),
        (".obj", load_mesh),
        (".ply", load_mesh),
        (".stl", load_mesh),
        (".hdr", read_picture),
        (".png", read_picture),
        (".exr", read_picture),
        (".npy", read_picture),
        (".ies", read_ies),
        (".csv", from_csv),
    ],
)
def test_pipes_devices_and_folders_are_refused_at_once(tmp_path: Path, suffix: str, read, make) -> None:
    make(tmp_path / f"a{suffix}")
    with pytest.raises(UserError, match="a device or a pipe|is a folder|Is a directory|is not a file"):
        read(tmp_path / f"a{suffix}")


def test_longer_files_are_refused_before_they_are_read(tmp_path: Path) -> None:
    with (tmp_path / "long").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(OSError, match="longer than 16 MiB"):
        files.read_bytes(tmp_path / "long", files.SETTINGS_BYTES)


@pytest.mark.parametrize("name", ["a" * 300 + ".toml", "a\0b.toml"])
def test_names_that_no_file_can_have_are_one_sentence(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError):
        load_scene(tmp_path / name)
    with pytest.raises(UserError, match="not a file"):
        load(tmp_path, SCENE.format(name.replace("\0", "\\u0000").replace(".toml", ".obj")))


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A mesh beside the folder `scenes`."""
    (tmp_path / "scenes").mkdir()
    mesh = tmp_path / "secret.obj"
    mesh.write_text(TETRAHEDRON)
    return mesh


@pytest.mark.parametrize("how", ["climbing", "absolute", "link"])
def test_a_scene_reads_in_or_below_its_folder_only(outside: Path, how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = outside.parent / "scenes" / "scene.toml"
    (scene.parent / "link.obj").symlink_to(outside)
    scene.write_text(SCENE.format({"climbing": "../secret.obj", "absolute": outside, "link": "link.obj"}[how]))
    with pytest.raises(UserError, match=r"outside the scene's folder; copy it there, or allow it with --allow-outside"):
        load_scene(scene)
    monkeypatch.setenv(files.ENVIRONMENT, os.pathsep.join(["/nowhere", str(outside.parent)]))
    assert load_scene(scene).objects
    monkeypatch.delenv(files.ENVIRONMENT)
    files.allow_outside(True)
    try:
        assert load_scene(scene).objects
    finally:
        files.allow_outside(False)


def test_what_is_saved_elsewhere_can_be_read_there(outside: Path) -> None:
    scene = outside.parent / "scene.toml"
    scene.write_text(SCENE.format("secret.obj"))
    elsewhere = outside.parent / "scenes" / "copy.toml"
    save_scene(load_scene(scene), elsewhere)
    save_scene(load_scene(scene), elsewhere)  # again: the copy is there
    (copy,) = (elsewhere.parent / "copy_files").iterdir()
    assert copy.read_text() == TETRAHEDRON
    assert np.array_equal(load_scene(elsewhere).objects[0].mesh.vertices, load_scene(scene).objects[0].mesh.vertices)


@pytest.mark.parametrize(
    ("name", "read", "before"),
    [
        ("a.obj", load_mesh, ""),
        ("a.obj", load_mesh, TETRAHEDRON + "f 1 2 "),
        ("a.obj", load_mesh, "v "),
        ("a.ply", load_mesh, "ply\nformat ascii 1.0\n"),
        ("a.ply", load_mesh, "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n"),
        ("a.stl", load_mesh, "solid\nfacet normal 0 0 0\nvertex "),
        ("a.csv", from_csv, "1 2\n"),
        ("a.ies", read_ies, "TILT="),
        ("a.ies", read_ies, "TILT=NONE\n1 "),
        ("a.hdr", read_picture, "#?RADIANCE\nFORMAT="),
        ("a.hdr", read_picture, "#?RADIANCE\n\n-Y 1 "),
        ("a.npy", read_picture, ""),
        ("a.png", read_picture, ""),
        ("a.exr", read_picture, ""),
    ],
)
def test_no_sentence_quotes_what_a_file_holds(tmp_path: Path, name: str, read, before: str) -> None:
    (tmp_path / name).write_text(before + SECRET + "\nvertex\nvertex\nendsolid\n")
    with pytest.raises(UserError) as caught:
        read(tmp_path / name)
    assert not any(word in str(caught.value) for word in ("xyzzy", "plugh", "horse", "battery"))


def npy(header: str, body: bytes = b"") -> bytes:
    text = header.encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body


@pytest.mark.parametrize(
    "data",
    [
        npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000, 3)}"),
        npy("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, -1)}", bytes(4)),
        npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", bytes(8)),
        npy("{'descr': '<f4', 'fortran_order'"),  # was a TokenError
        npy("(" * 5000),
        npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,)}", bytes(4)),
        b"\x93NUMPY\x07\x00",
        b"",
    ],
)
def test_damaged_arrays_are_a_reason(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(ValueError, match="header|promises|numbers"):
        files.read_npy(tmp_path / "a.npy")


@pytest.mark.parametrize("order", ["C", "F"])
def test_sound_arrays_are_what_numpy_reads(tmp_path: Path, order: str) -> None:
    values = np.asarray(np.random.default_rng(3).normal(size=(4, 5, 3)), order=order)  # type: ignore[call-overload]
    np.save(tmp_path / "a.npy", values)
    np.testing.assert_array_equal(files.read_npy(tmp_path / "a.npy"), values)


def test_nothing_printed_commands_a_terminal() -> None:
    assert plain("a\x1b]0;b\x07\nc\x9b31m\u202ed") == "a\\x1b]0;b\\x07 c\\x9b31m\\u202ed"
    assert plain("Größe 5 µm × λ") == "Größe 5 µm × λ"


def test_the_command_line_allows_more_for_one_run(outside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = outside.parent / "scenes" / "scene.toml"
    scene.write_text(SCENE.format("../secret.obj") + 'name = "a[/]b\\u001b[31m"\n')
    assert main(["inspect", str(scene)]) == 2
    assert main(["inspect", "--allow-outside", str(scene)]) == 0
    told = capsys.readouterr().out
    assert "a[/]b\\x1b[31m" in told and "\x1b[31m" not in told
    assert main(["inspect", str(scene)]) == 2  # and not for the next
