"""How a scene is told to follow polarisation: its file, the command line, the viewer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from scene_texts import FLOOR, THREE_LINES, load, refusal
from spectrasplat.commands.render import RenderRequest, scene_as_asked
from spectrasplat.edit import edits
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.model.features import Features
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.scene_key import picture_key, scene_key
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import dirty_level

TEXT = THREE_LINES + FLOOR
ASKED = TEXT + "[render]\npolarisation = true\n"


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load(tmp_path, TEXT)


def test_it_is_off_unless_asked_for(tmp_path: Path, scene: Scene) -> None:
    assert not scene.render.polarisation and not Features.of(scene, RenderSettings()).polarised
    asked = load(tmp_path, ASKED)
    assert asked.render.polarisation and Features.of(asked, RenderSettings()).polarised


def test_it_is_saved_where_it_is_on(tmp_path: Path, scene: Scene) -> None:
    path = tmp_path / "saved.toml"
    for shown in (scene, edits.set_render_defaults(scene, polarisation=True)):
        save_scene(shown, path)
        assert ("polarisation" in path.read_text()) == shown.render.polarisation


def test_anything_but_yes_or_no_is_refused(tmp_path: Path) -> None:
    assert "polarisation" in refusal(tmp_path, TEXT + '[render]\npolarisation = "s"\n')


@pytest.mark.parametrize("says", [None, True, False])
@pytest.mark.parametrize("text", [TEXT, ASKED])
def test_the_command_line_goes_above_the_scene(tmp_path: Path, text: str, says: bool | None) -> None:
    (tmp_path / "scene.toml").write_text(text)
    request = RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", polarisation=says)
    assert scene_as_asked(request).render.polarisation == (text == ASKED if says is None else says)


def test_pictures_with_and_without_are_told_apart(scene: Scene) -> None:
    asked = edits.set_render_defaults(scene, polarisation=True)
    for key in (scene_key, picture_key):
        assert key(scene) != key(asked) and key(scene) == key(replace(scene, render=replace(scene.render, width=5)))


def test_the_viewer_builds_anew(scene: Scene) -> None:
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    asked = replace(inputs, scene=edits.set_render_defaults(scene, polarisation=True))
    assert dirty_level(inputs, inputs, asked) == DirtyLevel.BUILD
