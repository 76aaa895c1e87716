"""How a scene is told that its air is hazy, and what an edit of that does again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from scene_texts import FLOOR, THREE_LINES, load, refusal
from spectrasplat.base.errors import UserError
from spectrasplat.commands.render import RenderRequest, scene_as_asked
from spectrasplat.edit import edits
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.model.features import Features, why_no_haze
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene_key import picture_key, scene_key
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import appearance_differs, dirty_level

TEXT = THREE_LINES + FLOOR
ASKED = TEXT + "[render]\nhaze = 0.02\nhaze_anisotropy = 0.3\n"


def test_it_is_off_unless_asked_for_and_saved_where_it_is_on(tmp_path: Path) -> None:
    scene, asked = load(tmp_path, TEXT), load(tmp_path, ASKED)
    assert scene.render.haze == 0.0 and not Features.of(scene, RenderSettings()).haze
    assert (asked.render.haze, asked.render.haze_anisotropy) == (0.02, 0.3)
    assert Features.of(asked, RenderSettings()).haze and not Features.of(asked, RenderSettings(layer="caustic")).haze
    assert "no light" in str(why_no_haze(replace(asked, lights=())))
    path = tmp_path / "saved.toml"
    for value in (scene, asked):
        save_scene(value, path)
        assert ("haze" in path.read_text()) == (value is asked)


@pytest.mark.parametrize(
    ("key", "value"),
    [("haze", "-0.1"), ("haze", "nan"), ("haze", '"thin"'), ("haze_anisotropy", "1.0"), ("haze_anisotropy", "-1")],
)
def test_other_values_are_refused(tmp_path: Path, key: str, value: str) -> None:
    assert key in refusal(tmp_path, TEXT + f"[render]\n{key} = {value}\n")
    option = {"haze": value.strip('"')} if key == "haze" else {"haze_anisotropy": value}
    (tmp_path / "scene.toml").write_text(TEXT)
    with pytest.raises(UserError, match=f"--{key.replace('_', '-')}"):
        scene_as_asked(RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", **option))


def test_the_command_line_goes_above_the_scene(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(ASKED)
    request = RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", haze="0")
    assert scene_as_asked(request).render.haze == 0.0
    assert scene_as_asked(replace(request, haze=None)).render.haze == 0.02


def test_the_viewer_traces_nothing_where_haze_gets_thicker(tmp_path: Path) -> None:
    scene = load(tmp_path, ASKED)
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    thicker = replace(inputs, scene=edits.set_render_defaults(scene, haze=0.1))
    clear = replace(inputs, scene=edits.set_render_defaults(scene, haze=0.0))
    assert dirty_level(inputs, inputs, thicker) == DirtyLevel.CAMERA and appearance_differs(inputs, thicker)
    assert dirty_level(inputs, inputs, clear) == DirtyLevel.BUILD
    assert scene_key(scene) == scene_key(thicker.scene) and picture_key(scene) != picture_key(thicker.scene)
    with pytest.raises(UserError, match="haze is -1 but must lie between"):
        edits.set_render_defaults(scene, haze=-1.0)
