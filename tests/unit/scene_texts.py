"""Scene files as short texts, and what reading them says."""

from __future__ import annotations

from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene

THREE_LINES = '[[objects]]\nshape = "sphere"\nglass = "N-SF11"\n'
FLOOR = '[[objects]]\nshape = "plane"\nwidth = 9.0\nheight = 9.0\nmaterial = "diffuse"\nposition = [0, 0, -2]\n'


def load(tmp_path: Path, text: str) -> Scene:
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def refusal(tmp_path: Path, text: str) -> str:
    with pytest.raises(UserError) as caught:
        load(tmp_path, text)
    sentence = str(caught.value)
    assert "\n" not in sentence and "scene.toml" in sentence
    return sentence
