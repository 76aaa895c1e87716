"""Losses are told without being asked: by the light pass, by the picture, by the command line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import BrokenPictureError, DeviceError, UserError
from spectrasplat.base.image_io import write_image
from spectrasplat.gpu.context import device_sentence
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.lights import AreaLight, PointLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.scene_checks import check_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.notices import light_notices, picture_notices
from spectrasplat.render.still import render
from spectrasplat.stress.rigs.probe import light_pass
from spectrasplat.stress.rigs.scene_parts import BEAM, TABLE, solid, stage

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
        assert light_notices(light) == []


@pytest.mark.parametrize("height", [1e-6, 1e-5, 1e-2])
def test_a_lamp_on_the_floor_shines(gl, height: float) -> None:
    lamp = PointLight("lamp", WHITE, position=(0.3, 0.0, height))
    ceiling = np.eye(4)
    ceiling[2, 3] = 4.0
    scene = stage(BLOCK, SceneObject("ceiling", plane(8.0, 8.0), Diffuse(), ceiling), lights=[lamp])
    with light_pass(gl, scene, SETTINGS) as (light, _):
        light.begin(8192, 1)
        light.run_pass(0, 8192, lambda _: True)
        ended = light.stats.tally.ended
        assert ended["deposited"] > 0.3 * light.stats.tally.emitted


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


@pytest.mark.parametrize("suffix", [".png", ".exr", ".npy"])
def test_a_picture_that_is_not_finite_is_never_written(tmp_path: Path, suffix: str) -> None:
    rgb = np.ones((4, 6, 3), np.float32)
    rgb[1, 2, 0] = np.nan
    with pytest.raises(BrokenPictureError, match="not written") as error:
        write_image(tmp_path / f"x{suffix}", rgb)
    assert error.value.exit_code == 1 and not list(tmp_path.iterdir())


def test_what_opengl_says_is_a_sentence() -> None:
    told = device_sentence("GL_OUT_OF_MEMORY", "the splat pass")
    assert "out of memory" in told and "smaller picture" in told
    assert issubclass(DeviceError, UserError) and DeviceError.exit_code == 2
