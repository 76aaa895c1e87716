"""How a scene is told that diffuse surfaces light each other, and where that has nothing to follow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from scene_texts import FLOOR, THREE_LINES, load, refusal
from spectrasplat.base.errors import UserError
from spectrasplat.commands.render import RenderRequest, scene_as_asked
from spectrasplat.edit import edits
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.model.bounces import why_no_bounces
from spectrasplat.model.features import Features
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Black, Diffuse, Scene
from spectrasplat.model.scene_key import picture_key, scene_key
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import dirty_level

TEXT = THREE_LINES + FLOOR
ASKED = TEXT + "[render]\nbounces = 2\n"


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load(tmp_path, TEXT)


def test_it_is_off_unless_asked_for(tmp_path: Path, scene: Scene) -> None:
    assert scene.render.bounces == 0 and Features.of(scene, RenderSettings()).bounces == 0
    asked = load(tmp_path, ASKED)
    assert asked.render.bounces == 2 and Features.of(asked, RenderSettings()).bounces == 2
    assert Features.of(asked, RenderSettings(layer="caustic")).bounces == 0


def test_it_is_saved_where_it_is_on(tmp_path: Path, scene: Scene) -> None:
    path = tmp_path / "saved.toml"
    for bounces in (0, 3):
        save_scene(edits.set_render_defaults(scene, bounces=bounces), path)
        assert ("bounces = 3" in path.read_text()) == (bounces == 3)
        assert ("bounces" in path.read_text()) == (bounces > 0)


@pytest.mark.parametrize("value", ["4", "-1", '"many"', "1.5"])
def test_other_numbers_are_refused(tmp_path: Path, value: str) -> None:
    assert "bounces" in refusal(tmp_path, TEXT + f"[render]\nbounces = {value}\n")


def test_an_edit_is_held_to_the_same_bounds(scene: Scene) -> None:
    with pytest.raises(UserError, match="bounces is 4 but must lie between 0 and 3"):
        edits.set_render_defaults(scene, bounces=4)


@pytest.mark.parametrize("says", [None, "0", "3"])
@pytest.mark.parametrize("text", [TEXT, ASKED])
def test_the_command_line_goes_above_the_scene(tmp_path: Path, text: str, says: str | None) -> None:
    (tmp_path / "scene.toml").write_text(text)
    request = RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", bounces=says)
    assert scene_as_asked(request).render.bounces == ((2 if text == ASKED else 0) if says is None else int(says))


def test_the_command_line_refuses_what_is_no_number_of_bounces(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(TEXT)
    for says in ("4", "two"):
        with pytest.raises(UserError, match="--bounces"):
            scene_as_asked(RenderRequest(str(tmp_path / "scene.toml"), tmp_path / "out.png", bounces=says))


def test_pictures_with_and_without_are_told_apart(scene: Scene) -> None:
    asked = edits.set_render_defaults(scene, bounces=1)
    for key in (scene_key, picture_key):
        assert key(scene) != key(asked) != key(edits.set_render_defaults(scene, bounces=2))


def test_the_viewer_builds_anew(scene: Scene) -> None:
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    asked = replace(inputs, scene=edits.set_render_defaults(scene, bounces=1))
    assert dirty_level(inputs, inputs, asked) == DirtyLevel.BUILD


def test_it_is_left_out_where_no_surface_sees_another(tmp_path: Path) -> None:
    scene = load(tmp_path, ASKED)
    assert why_no_bounces(scene) is None  # the floor sees itself in the glass
    floor = next(o for o in scene.objects if o.material.receives)
    glass = next(o for o in scene.objects if o.material.transmits)
    alone = replace(scene, objects=(floor, replace(floor, name="again")))
    assert "one plane" in str(why_no_bounces(alone))
    black = replace(scene, objects=(floor, replace(glass, material=Black())))
    assert "one plane" in str(why_no_bounces(black))
    assert why_no_bounces(replace(scene, objects=(floor, replace(glass, material=Diffuse())))) is None
    assert "nothing shines" in str(why_no_bounces(replace(scene, lights=(), environment=None)))
    assert "no surface is diffuse" in str(why_no_bounces(replace(scene, objects=(glass,))))
