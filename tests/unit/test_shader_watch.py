"""Changes of shader files on disk are noticed once, and not before it is time to look."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from spectrasplat.gpu.shader_watch import INTERVAL_S, ShaderWatch


class Clock:
    """A clock that stands until it is moved."""

    now = 0.0

    def __call__(self) -> float:
        return self.now

    def wait(self) -> None:
        """Until the next look."""
        self.now += 1.01 * INTERVAL_S


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "lib").mkdir()
    (tmp_path / "trace.comp").write_text("void main() {}")
    (tmp_path / "lib" / "optics.glsl").write_text("float f() { return 1.0; }")
    return tmp_path


def test_each_change_is_told_once(folder: Path) -> None:
    clock = Clock()
    watch = ShaderWatch(folder, clock)
    clock.wait()
    assert watch.changed() == ()
    (folder / "lib" / "optics.glsl").write_text("float f() { return 2.5; }")
    (folder / "new.frag").write_text("void main() {}")
    (folder / "trace.comp").unlink()
    clock.wait()
    assert watch.changed() == ("lib/optics.glsl", "new.frag", "trace.comp")
    clock.wait()
    assert watch.changed() == ()


def test_same_length_is_told_by_the_time(folder: Path) -> None:
    clock = Clock()
    watch = ShaderWatch(folder, clock)
    os.utime(folder / "trace.comp", ns=(1, 1))
    clock.wait()
    assert watch.changed() == ("trace.comp",)


def test_other_files_and_too_early_looks_tell_nothing(folder: Path) -> None:
    clock = Clock()
    watch = ShaderWatch(folder, clock)
    (folder / "README.md").write_text("not a shader")
    (folder / "trace.comp").write_text("void main() { /* later */ }")
    assert watch.changed() == ()
    clock.wait()
    assert watch.changed() == ("trace.comp",)
