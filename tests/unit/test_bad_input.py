"""Every bad input of a newcomer, through the real command line: one sentence, exit code 2, nothing half-written.

Most cases call `main` in this process, with a renderer that must not be reached; those about
signals, the disk and OpenGL run the program itself.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import reserve_driver_cache
from spectrasplat.render.bake import written_with

from tests.unit.bad_inputs import CASES, CORNERS, FACES, FLOOR, MESH, PLAIN, VIEW, Case, glass, mesh_case, ply

ROOT = Path(__file__).resolve().parents[2]
OLD = b"the picture of yesterday"


def lay_out(folder: Path, case: Case) -> None:
    """The files of `case`, and a picture of yesterday that must survive."""
    for name, data in case.files.items():
        (folder / name).write_bytes(data)
    if case.scene is not None:
        data = case.scene.encode() if isinstance(case.scene, str) else case.scene
        (folder / case.name).write_bytes(data)
    (folder / "out.png").write_bytes(OLD)
    (folder / "made.png").mkdir()
    os.mkfifo(folder / "pipe.png")


def contents(folder: Path) -> dict[str, bytes | None]:
    return {entry.name: entry.read_bytes() if entry.is_file() else None for entry in folder.iterdir()}


def use_renderer(monkeypatch: pytest.MonkeyPatch, render: Callable[..., Any]) -> None:
    module = ModuleType("spectrasplat.render.still")
    module.render = render  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "spectrasplat.render.still", module)


def grey_picture(_scene: object, settings: Any, **_: object) -> SimpleNamespace:
    """What a renderer returns, without one."""
    stats = SimpleNamespace(photons=1, splats=1, seconds=0.1, renderer="none", is_software=True, notices=())
    rgb = np.full((settings.height, settings.width, 3), 0.5, np.float32)
    return SimpleNamespace(rgb=rgb, spectral=None, bin_edges_nm=None, stats=stats)


@pytest.mark.parametrize("name", CASES)
def test_one_sentence_and_nothing_touched(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    case = CASES[name]
    use_renderer(monkeypatch, lambda *_, **__: pytest.fail("the renderer was reached"))
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path, case)
    before = contents(tmp_path)
    assert main(["render", case.name, "-o", case.output, *case.options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and captured.err.startswith("spectrasplat: ")
    assert [part for part in case.told if part not in captured.err] == []
    assert contents(tmp_path) == before


def test_what_is_written_with_another_file_replaces_its_own_predecessor_only(tmp_path: Path) -> None:
    path = tmp_path / "table.exr"
    place = path.with_suffix(".json")
    assert written_with(path) == [path, place]
    path.write_bytes(OLD)
    place.write_text('{"file": "table.exr"}')
    assert written_with(path) == [path, place]
    with pytest.raises(UserError, match=r"table\.glb: .* replace table\.json next to it, .* choose another"):
        written_with(path.with_suffix(".glb"))
    place.write_text("[1, 2")
    with pytest.raises(UserError, match="table.json"):
        written_with(path)
    place.unlink()
    with pytest.raises(UserError, match="replace table.exr next"):
        written_with(path.with_suffix(".usda"), path)


def test_mesas_cache_has_room_for_its_index_or_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mesa writes it as memory: pages that a full disk cannot hold end the process (seen on a tmpfs of 64 KiB)."""
    monkeypatch.setattr(os, "environ", {"XDG_CACHE_HOME": str(tmp_path)})
    reserve_driver_cache()
    index = tmp_path / "mesa_shader_cache" / "index"
    assert index.stat().st_blocks * 512 >= 65536 * 20 and "MESA_SHADER_CACHE_DISABLE" not in os.environ
    index.unlink()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        reserve_driver_cache()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "true"


# -- what is rendered all the same, with a warning -----------------------------------------

TWO_OPEN = CORNERS + "1 1 1\n" + FACES + "3 0 1 4\n"
WARNINGS = {
    "open": (
        ply(CORNERS + FACES[:24], faces=3),
        ["open mesh 'm': 3 boundary edges; the side is decided by the face normals"],
    ),
    "inside out": (
        ply(CORNERS + "3 0 1 2\n3 0 3 1\n3 1 3 2\n3 0 2 3\n"),
        ["mesh 'm' was inside out (volume -0.1667); it was turned to face outward"],
    ),
    "non-manifold": (
        ply(TWO_OPEN, 5, 5),
        [
            "open mesh 'm': 2 boundary edges; the side is decided by the face normals",
            "non-manifold mesh 'm': 1 edge with more than two triangles; the side is decided by the face normals",
        ],
    ),
    "wound inconsistently": (
        ply(CORNERS + "3 0 1 2\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"),
        ["mesh 'm': 1 triangle turned to face as all others do"],
    ),
    "degenerate triangles": (
        ply(CORNERS + FACES + "3 0 0 1\n3 1 1 1\n", faces=6),
        ["mesh 'm': 2 degenerate triangles dropped"],
    ),
    "zero normals": (
        ply(CORNERS.replace("\n", " 0 0 0\n") + FACES, normals=True),
        ["mesh 'm': 12 zero normals replaced by the face normal"],
    ),
    "normals that are no numbers": (
        ply(CORNERS.replace("\n", " nan 0 0\n") + FACES, normals=True),
        ["mesh 'm': 12 zero normals replaced by the face normal"],
    ),
}


def rendered(
    scene: str,
    files: dict[str, bytes],
    options: list[str],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> list[str]:
    """The lines on stderr of a rendering that ends well and replaces the old picture."""
    use_renderer(monkeypatch, grey_picture)
    monkeypatch.chdir(folder)
    lay_out(folder, Case(scene, (), files=files))
    assert main(["render", "scene.toml", "-o", "out.png", "--size", "8x8", *options]) == 0
    assert (folder / "out.png").read_bytes().startswith(b"\x89PNG")
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize("name", WARNINGS)
def test_an_odd_mesh_is_rendered_with_a_warning(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, warnings = WARNINGS[name]
    told = rendered(VIEW + MESH.format("m.ply") + FLOOR, {"m.ply": data}, [], tmp_path, monkeypatch, capsys)
    assert told == [f"note: {warning}" for warning in warnings]


def test_glass_data_that_end_inside_the_visible_are_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = glass('name = "mine", table = [[500, 1.5], [600, 1.4]]')
    (told,) = rendered(scene, {}, [], tmp_path, monkeypatch, capsys)
    assert told.startswith("note: mine: data reach from 500 to 600 nm") and "nearest value" in told


def test_options_without_effect_are_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (told,) = rendered(PLAIN, {}, ["--bins", "8"], tmp_path, monkeypatch, capsys)
    assert told.startswith("note: --bins") and ".exr" in told
    assert main(["render", "scene.toml", "-o", "x.npy", "--size", "8x8", "--exposure", "1"]) == 0
    assert capsys.readouterr().err.startswith("note: --exposure does not change a .npy picture")


def test_warnings_are_told_before_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise MemoryError

    use_renderer(monkeypatch, fail)
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path, mesh_case(WARNINGS["open"][0]))
    assert main(["render", "scene.toml", "-o", "out.png"]) == 2
    warning, error = capsys.readouterr().err.splitlines()
    assert warning.startswith("note: open mesh") and error.startswith("spectrasplat: out of memory")
    assert "fewer photons" in error
    assert (tmp_path / "out.png").read_bytes() == OLD


# -- OpenGL, the disk and Ctrl-C -------------------------------------------------------------


@pytest.mark.parametrize(
    ("problem", "told"),
    [
        (None, "OpenGL is missing"),
        ("eglCreateContext failed (0x3009)", "OpenGL 4.3 is needed and this driver has less"),
    ],
)
def test_opengl_missing_or_too_old(
    problem: str | None, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import glcontext
    from spectrasplat.gpu import context, osmesa

    def no_library(*_: object) -> None:
        raise OSError("libOSMesa.so.8 is not installed")

    def refuse(**_: object) -> None:
        raise Exception(problem)

    monkeypatch.delenv("SPECTRASPLAT_BACKEND", raising=False)
    monkeypatch.setattr(osmesa, "load_library", no_library)
    monkeypatch.setattr(context, "_first_loadable", lambda names: None if problem is None else names[0])
    monkeypatch.setattr(glcontext, "get_backend_by_name", lambda _name: refuse)
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path, Case(PLAIN, ()))
    before = contents(tmp_path)
    assert main(["render", "scene.toml", "-o", "out.png"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("spectrasplat: ") and told in line and "apt-get install libegl1" in line
    assert contents(tmp_path) == before


@pytest.mark.parametrize("suffix", [".png", ".exr", ".npy"])
def test_full_disk(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A limit on the size of files stands for the full disk: the same failing write, by a real system call."""
    use_renderer(monkeypatch, grey_picture)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(PLAIN)
    output = tmp_path / f"out{suffix}"
    output.write_bytes(OLD)
    noise = np.random.default_rng(1).random((96, 96, 3), np.float32)
    use_renderer(monkeypatch, lambda *a, **k: SimpleNamespace(**vars(grey_picture(*a, **k)) | {"rgb": noise}))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))  # Python ignores SIGXFSZ
    try:
        code = main(["render", "scene.toml", "-o", output.name])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    (line,) = capsys.readouterr().err.splitlines()
    assert code == 2 and line.startswith(f"spectrasplat: cannot write out{suffix}: ")
    assert {entry.name for entry in tmp_path.iterdir()} == {"scene.toml", output.name}
    assert output.read_bytes() == OLD


def program(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "spectrasplat", *arguments]


def test_the_program_itself(tmp_path: Path) -> None:
    output = tmp_path / "out.png"
    output.write_bytes(OLD)
    done = subprocess.run(
        program("render", str(tmp_path / "gone.toml"), "-o", str(output)),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("spectrasplat: ") and "gone.toml does not exist" in line
    assert output.read_bytes() == OLD


def test_a_second_ctrl_c_leaves_the_old_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        for _press in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5.0)
        pytest.fail("Ctrl-C did not end the rendering")

    use_renderer(monkeypatch, interrupted)
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path, Case(PLAIN, ()))
    before = contents(tmp_path)
    assert main(["render", "scene.toml", "-o", "out.png"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "spectrasplat: interrupted"
    assert contents(tmp_path) == before
