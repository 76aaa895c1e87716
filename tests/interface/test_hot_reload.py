"""Shaders on disk: a mistake keeps the last good programs and names file and line; mended, the picture follows."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.base import paths
from spectrasplat.base.paths import assets_dir
from spectrasplat.gpu.context import Context
from spectrasplat.ui.frame import view_model_of

from tests.interface.rig import Hands, viewer

PATIENCE = 400
"""Frames."""


@pytest.fixture
def shaders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shaders that may be broken."""
    folder = tmp_path / "shaders"
    shutil.copytree(paths.shaders_dir(), folder)
    monkeypatch.setattr(paths, "shaders_dir", lambda: folder)
    return folder


@pytest.fixture
def hands(gl: Context, shaders: Path) -> Iterator[Hands]:
    with viewer(gl, assets_dir() / "scenes" / "prism.toml", photons=1 << 12, size=(600, 420)) as hands:
        hands.settle()
        yield hands


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


def frames_until_error_is(hands: Hands, present: bool) -> str | None:
    """Frames from F5 until a shader error is shown, or is gone."""
    hands.interface.key(imgui.Key.f5)
    for _ in range(PATIENCE):
        hands.interface.frame()
        told = view_model_of(hands.session).shader_error
        if (told is not None) == present:
            return told
    raise AssertionError(f"shader error still {told!r}")


def test_a_mistake_is_shown_with_file_and_line_and_a_change_in_the_picture(hands: Hands, shaders: Path) -> None:
    before = hands.picture()
    edit(shaders / "camera/camera.comp", "void main() {", "void main() {\n    this is no GLSL;")
    line = (shaders / "camera/camera.comp").read_text().splitlines().index("    this is no GLSL;") + 1
    told = frames_until_error_is(hands, present=True)
    assert told is not None and f"camera.comp:{line}" in told
    hands.settle()
    assert np.array_equal(hands.picture(), before)
    edit(shaders / "camera/camera.comp", "    this is no GLSL;\n", "")
    frames_until_error_is(hands, present=False)
    assert np.abs(hands.settle() - before).max() <= 1e-5 * before.max()
    hands.interface.frame(2)
    box = hands.interface.find("Picture")
    (left, top), (right, bottom) = box.at(0.02, 0.02), box.at(0.98, 0.98)
    shown = slice(round(top), round(bottom)), slice(round(left), round(right))
    before = hands.interface.screenshot()[shown].astype(float)
    edit(shaders / "display/display.comp", "pixel, vec4(colour, 1.0)", "pixel, vec4(1.0 - colour, 1.0)")
    hands.interface.key(imgui.Key.f5)
    hands.interface.frame(4)
    assert view_model_of(hands.session).shader_error is None
    after = hands.interface.screenshot()[shown].astype(float)
    # Most of the area is the picture, now inverted (exposure follows a little); messages and buttons cover the rest.
    assert np.mean(np.abs(before + after - 255.0).max(axis=-1) <= 16.0) > 0.5
