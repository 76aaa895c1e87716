"""Losses are told without being asked: by the light pass, by the picture, by the command line."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import DeviceError, UserError, sentence_of
from spectrasplat.gpu.context import check_device
from spectrasplat.model.geometry.primitives import box, plane, sphere
from spectrasplat.model.lights import AreaLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.scene_checks import check_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.frames import FrameRenderer, Picture
from spectrasplat.render.notices import FrameNotices, light_notices, loss_notices, picture_notices
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.probe import light_pass
from spectrasplat.stress.rigs.scene_parts import BEAM, TABLE, solid, stage

from tests.fuzz.kills import SCENE

pytestmark = pytest.mark.usefixtures("commands_share_context")
SETTINGS = RenderSettings(width=80, height=45, photons=8192, spp=4, layer="caustic")
BLOCK = solid("block", box(), constant(1.5, "n"), (0.3, 0.0, 1.2))
WHITE = illuminant("D65").scaled_to_luminous(10.0)


def notices(gl, scene: Scene, **values) -> tuple[str, ...]:
    return render(scene, replace(SETTINGS, **values), context=gl).stats.notices


def test_a_scene_without_losses_says_nothing(gl) -> None:
    assert notices(gl, stage(BLOCK)) == ()


def test_paths_that_are_given_up_are_told(gl) -> None:
    (told,) = notices(gl, stage(BLOCK), max_depth=2)
    assert "given up" in told and "--max-depth" in told


def test_a_light_whose_light_reaches_nothing_is_told(gl) -> None:
    facing_away = np.diag([1.0, 1.0, 1.0, 1.0])
    facing_away[2, 3] = 4.0
    mirror = SceneObject("mirror", plane(3.0, 3.0), Mirror(), facing_away)
    (told,) = notices(gl, stage(mirror))
    assert "'beam'" in told and "reaches a receiver" in told


def test_a_receiver_narrower_than_the_first_photons_lie_apart_has_its_light(gl) -> None:
    """A detector in a ball's light gets its share of a wider one's: 4,096 photons over the ball lie 0.015 apart."""

    def deposited(side: float) -> float:
        ball = solid("ball", sphere(radius=0.5), constant(1.5, "n"), (0.0, 0.0, 1.2))
        place = np.eye(4)
        place[:3, 3] = 0.053, 0.021, 0.0
        scene = replace(stage(ball), objects=(ball, SceneObject("detector", plane(side, side), Diffuse(), place)))
        with light_pass(gl, scene, SETTINGS) as (light, _):
            light.begin(200_000, 1)
            light.run_pass(0, 200_000, lambda _: True)
            return light.stats.tally.ended["deposited"] / light.stats.tally.emitted

    assert deposited(0.004) / 0.004**2 == pytest.approx(deposited(0.1) / 0.1**2, rel=0.2)


def test_a_picture_that_lacks_what_its_maps_hold_is_told(gl) -> None:
    scene = stage(BLOCK)
    with light_pass(gl, scene, SETTINGS) as (light, _):
        light.begin(8192, 1)
        light.run_pass(0, 8192, lambda _: True)
        light.finish()
        right = render(scene, SETTINGS, context=gl).rgb
        assert picture_notices(light, scene.camera, SETTINGS, right) == []
        (told,) = picture_notices(light, scene.camera, SETTINGS, 0.3 * right)
        assert "30 %" in told
        (told,) = picture_notices(light, scene.camera, SETTINGS, 0.0 * right)
        assert "black" in told
        (told,) = picture_notices(light, scene.camera, replace(SETTINGS, layer="beauty"), 0.0 * right)
        assert "nothing that is lit" in told
        assert light_notices(light) == []


def test_scenes_that_can_give_no_picture_are_refused() -> None:
    def refused(scene: Scene) -> str:
        with pytest.raises(UserError) as error:
            check_scene(scene, "scene.toml")
        return str(error.value)

    tiny = np.diag([1e-30, 1e-30, 1e-30, 1.0])
    assert "units" in refused(replace(stage(), objects=(replace(TABLE, object_to_world=tiny),)))
    far = np.eye(4)
    far[0, 3] = 1e16
    assert "origin" in refused(replace(stage(), objects=(replace(TABLE, object_to_world=far),)))
    panel = AreaLight("panel", WHITE, position=(0.0, 0.0, 3.0), radius=1e-20)
    assert "point light" in refused(stage(BLOCK, lights=[panel]))
    dark = replace(BEAM, spectral_power=WHITE.scaled_to_luminous(0.0))
    assert any("no power" in note for note in check_scene(stage(BLOCK, lights=[dark]), "scene.toml"))


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        ("GL_OUT_OF_MEMORY", 2, "out of memory .*smaller picture"),
        ("GL_CONTEXT_LOST", 2, "device was lost .*start again"),
        ("GL_UNKNOWN_ERROR", 2, "device was lost .*start again"),
        ("GL_INVALID_VALUE", 1, "fault of SpectraSplat itself; please report it with .*doctor"),
        ("GL_INVALID_OPERATION", 1, "fault of SpectraSplat itself; please report it with .*doctor"),
        ("cannot create texture", None, "no memory left, or was lost .*smaller picture"),
        ("data size mismatch 80 (expected 100)", None, "fault of SpectraSplat itself"),
    ],
)
def test_what_opengl_says_is_a_sentence_that_blames_nobody_else(error: str, code: int | None, told: str) -> None:
    if code is None:
        sentence = sentence_of(moderngl.Error(error))
    else:
        with pytest.raises(DeviceError, match="in the splat pass") as raised:
            check_device(SimpleNamespace(error=error), "the splat pass")
        assert raised.value.exit_code == code
        sentence = str(raised.value)
    assert sentence is not None and error in sentence and re.search(told, sentence) and "driver" not in sentence


GIVEN_UP = SCENE + "[render]\nmax_depth = 2\n"
FEW = ("--size", "32x18", "--photons", "4k")


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("render", "scene.toml", "-o", "out.npy", *FEW),
        ("animate", "scene.toml", "-o", "frames", "--frames", "3", *FEW, "--spp", "1"),
        ("bake", "scene.toml", "floor", "-o", "map.npy", *FEW),
    ],
    ids=lambda command: command[0],
)
def test_each_command_says_it_once(command: tuple[str, ...], tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(GIVEN_UP)
    assert main(list(command)) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "given up" in line]
    assert len(told) == 1 and told[0].startswith("note: ")
    assert ("frame 1 and 2 more: " in told[0]) == (command[0] == "animate")


@pytest.mark.parametrize("command", ["animate", "bake"])
def test_no_command_writes_what_is_not_finite(command: str, tmp_path: Path, monkeypatch, capsys) -> None:
    broken = property(lambda self: Picture(np.full((18, 32, 3), np.nan, np.float32)))
    monkeypatch.setattr(FrameRenderer, "picture", broken)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(GIVEN_UP)
    options = ("-o", "x", "--frames", "2", "--spp", "1") if command == "animate" else ("floor", "-o", "x.png")
    assert main([command, "scene.toml", *options, *FEW]) == 1
    told = [line for line in capsys.readouterr().err.splitlines() if "not finite" in line]
    assert len(told) == 1 and "is not written" in told[0]
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".png", ".part")]
    assert not (tmp_path / "x.json").exists()


def test_shares_that_change_from_frame_to_frame_are_one_notice() -> None:
    notices = FrameNotices()
    for number, share in enumerate((2.0, 7.5), 1):
        notices.take(loss_notices({"lost_numeric": 0.01 * share}), number)
    notices.take(loss_notices({"lost_depth": 0.5}, 9), 2)
    first, second = notices.lines(of_frames=True)
    assert first.startswith("frame 1 and 1 more: 2.0 %") and second.startswith("frame 2: 50.0 %")
