"""Switches under `[render]`: what a scene file, the command line and an edit may set, what is saved, what the viewer
does again, and which scenes have nothing for a switch to do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.commands.opened import open_scene
from spectrasplat.commands.options import read
from spectrasplat.commands.table import Render
from spectrasplat.edit import edits
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.features.facts import why_no_haze
from spectrasplat.features.features import Features
from spectrasplat.model.environment_light import why_no_bounces
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Black, Diffuse
from spectrasplat.model.scene_key import picture_key, scene_key
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import appearance_differs, dirty_level

from tests.unit.scene_texts import FLOOR, THREE_LINES, load, refusal

TEXT = THREE_LINES + FLOOR


@dataclass(frozen=True)
class Setting:
    """One switch: its key, its default and another value, the feature that programs are compiled for, and values that
    are refused; `keys_differ` says whether scenes that differ in it have other caustics, other pictures."""

    key: str
    default: object
    other: object
    feature: str | None
    level: DirtyLevel
    keys_differ: tuple[bool, bool]
    refused_in_file: tuple[str, ...]
    refused_option: tuple[str, ...] = ()
    feature_of_layer: bool = True

    def file(self, value: object) -> str:
        return TEXT + f"[render]\n{self.key} = {str(value).lower()}\n"

    def option(self, value: object) -> object:
        """A switch is given as yes or no, a number as it is typed."""
        return value if isinstance(value, bool) else str(value)


SETTINGS = {
    each.key: each
    for each in (
        Setting("bounces", 0, 2, "bounces", DirtyLevel.BUILD, (True, True), ("4", "-1", '"many"', "1.5"), ("4", "two")),
        Setting("haze", 0.0, 0.02, "haze", DirtyLevel.BUILD, (False, True), ("-0.1", "nan", '"thin"'), ("-0.1", "x")),
        Setting(
            "polarisation", False, True, "polarised", DirtyLevel.BUILD, (True, True), ('"s"',), feature_of_layer=False
        ),
        Setting("antialias_highlights", True, False, None, DirtyLevel.NOTHING, (False, False), ("2",)),
    )
}


@pytest.fixture(params=SETTINGS)
def setting(request: pytest.FixtureRequest) -> Setting:
    return SETTINGS[request.param]


def test_a_scene_file_sets_it_and_programs_follow(tmp_path: Path, setting: Setting) -> None:
    plain, other = load(tmp_path, TEXT), load(tmp_path, setting.file(setting.other))
    for scene, value in ((plain, setting.default), (other, setting.other)):
        assert getattr(scene.render, setting.key) == value
        if setting.feature:
            assert bool(getattr(Features.of(scene, RenderSettings()), setting.feature)) == bool(value)
    if setting.feature and setting.feature_of_layer:
        assert not getattr(Features.of(other, RenderSettings(layer="caustic")), setting.feature)


def test_it_is_saved_where_it_is_no_default(tmp_path: Path, setting: Setting) -> None:
    scene, path = load(tmp_path, TEXT), tmp_path / "saved.toml"
    for value in (setting.default, setting.other):
        save_scene(edits.set_render_defaults(scene, **{setting.key: value}), path)
        assert (setting.key in path.read_text()) == (value != setting.default)
        assert getattr(load(tmp_path, path.read_text()).render, setting.key) == value


def test_other_values_are_refused(tmp_path: Path, setting: Setting) -> None:
    for value in setting.refused_in_file:
        assert setting.key in refusal(tmp_path, TEXT + f"[render]\n{setting.key} = {value}\n")
    for value in setting.refused_option:
        with pytest.raises(UserError, match=f"--{setting.key}"):
            read(Render, {setting.key: value})


@pytest.mark.parametrize("value", ["1.0", "-1"])
def test_haze_scatters_neither_all_forward_nor_all_back(tmp_path: Path, value: str) -> None:
    assert "haze_anisotropy" in refusal(tmp_path, TEXT + f"[render]\nhaze_anisotropy = {value}\n")
    with pytest.raises(UserError, match="--haze-anisotropy"):
        read(Render, {"haze_anisotropy": value})


@pytest.mark.parametrize(("key", "value", "bounds"), [("bounces", 4, "at most 3"), ("haze", -1.0, "at least 0")])
def test_an_edit_has_the_bounds_of_the_file(tmp_path: Path, key: str, value: float, bounds: str) -> None:
    with pytest.raises(UserError, match=f"{key} is {value:g} but must be {bounds}"):
        edits.set_render_defaults(load(tmp_path, TEXT), **{key: value})


@pytest.mark.parametrize("in_file", [False, True])
def test_the_command_line_overrules_the_scene(tmp_path: Path, setting: Setting, in_file: bool) -> None:
    (tmp_path / "scene.toml").write_text(setting.file(setting.other) if in_file else TEXT)
    given = {"scene": str(tmp_path / "scene.toml"), "output": "out.png"}
    scene = open_scene(read(Render, given))
    assert getattr(scene.render, setting.key) == (setting.other if in_file else setting.default)
    for value in (setting.default, setting.other):
        scene = open_scene(read(Render, given | {setting.key: setting.option(value)}))
        assert getattr(scene.render, setting.key) == value


def test_what_an_edit_does_again(tmp_path: Path, setting: Setting) -> None:
    scene = load(tmp_path, TEXT)
    other = edits.set_render_defaults(scene, **{setting.key: setting.other})
    for key, differs in zip((scene_key, picture_key), setting.keys_differ, strict=True):
        assert (key(scene) != key(other)) == differs
        assert key(scene) == key(replace(scene, render=replace(scene.render, width=5)))
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    assert dirty_level(inputs, inputs, replace(inputs, scene=other)) == setting.level


def test_thicker_haze_traces_nothing(tmp_path: Path) -> None:
    scene = load(tmp_path, SETTINGS["haze"].file(0.02))
    inputs = LiveInputs(scene, scene.camera, 32, 18)
    thicker = replace(inputs, scene=edits.set_render_defaults(scene, haze=0.1))
    assert dirty_level(inputs, inputs, thicker) == DirtyLevel.CAMERA and appearance_differs(inputs, thicker)
    assert "no light" in str(why_no_haze(replace(scene, lights=())))


def test_bounces_are_left_out_where_no_surface_sees_another(tmp_path: Path) -> None:
    scene = load(tmp_path, SETTINGS["bounces"].file(2))
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
