"""How a scene is told whether edges of what is overexposed have steps: its file, the command line, the viewer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from scene_texts import FLOOR, THREE_LINES, load, refusal
from spectrasplat.commands.render import RenderRequest, scene_as_asked
from spectrasplat.edit import edits
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import dirty_level

TEXT = THREE_LINES + FLOOR
OFF = TEXT + "[render]\nantialias_highlights = false\n"


def test_it_is_on_unless_a_scene_says_no(tmp_path: Path) -> None:
    assert load(tmp_path, TEXT).render.antialias_highlights
    assert not load(tmp_path, OFF).render.antialias_highlights
    assert "antialias_highlights" in refusal(tmp_path, TEXT + "[render]\nantialias_highlights = 2\n")


def test_what_a_scene_says_is_saved(tmp_path: Path) -> None:
    scene, path = load(tmp_path, TEXT), tmp_path / "saved.toml"
    for shown in (scene, edits.set_render_defaults(scene, antialias_highlights=False)):
        save_scene(shown, path)
        assert load(tmp_path, path.read_text()).render.antialias_highlights == shown.render.antialias_highlights


@pytest.mark.parametrize("says", [None, True, False])
@pytest.mark.parametrize("text", [TEXT, OFF])
def test_the_command_line_goes_above_the_scene(tmp_path: Path, text: str, says: bool | None) -> None:
    (tmp_path / "scene.toml").write_text(text)
    request = RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", antialias_highlights=says)
    assert scene_as_asked(request).render.antialias_highlights == (text == TEXT if says is None else says)


def test_the_viewer_only_shows_anew(tmp_path: Path) -> None:
    scene = load(tmp_path, TEXT)
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    asked = replace(inputs, scene=edits.set_render_defaults(scene, antialias_highlights=False))
    assert dirty_level(inputs, inputs, asked) == DirtyLevel.NOTHING
