"""Edits of the environment and of pictures on surfaces: what they change, what they keep, what they refuse, and that
they can be saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import environments as environment
from spectrasplat.edit.lights import delete_light
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.objects import delete, set_diffuse_colour, set_material
from spectrasplat.model.environment import direction_of
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Black, Diffuse, Scene
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import dirty_level

STUDIO = assets_dir() / "environments" / "studio.hdr"
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return replace(load_scene(assets_dir() / "scenes" / "prism.toml"), environment=None)


@pytest.fixture(scope="module")
def with_map(scene: Scene) -> Scene:
    return environment.set_environment_map(scene, STUDIO)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "stripes.png"
    Image.fromarray(np.tile(np.array([[0, 0, 0], [255, 255, 255]], np.uint8), (4, 2, 1))).save(path)
    return path


def table_of(scene: Scene) -> int:
    return next(i for i, item in enumerate(scene.objects) if isinstance(item.material, Diffuse))


def cost(before: Scene, after: Scene) -> DirtyLevel:
    old, new = (LiveInputs(s, s.camera, 64, 36) for s in (before, after))
    return dirty_level(old, old, new)


def test_where_an_environment_is_seen_neither_receiver_nor_light_is_needed(scene: Scene, tmp_path: Path) -> None:
    """Every way to do without them gives a scene that can be saved and opened again; without the environment all are
    refused."""
    scene = delete_light(scene, 1)
    sky, table = environment.set_environment_kind(scene, "sky"), table_of(scene)
    for edit, arguments in ((delete, [table]), (set_material, [table, Black()]), (delete_light, [0])):
        with pytest.raises(UserError, match="only .* environment"):
            edit(scene, *arguments)
        bare = edit(sky, *arguments)
        save_scene(bare, tmp_path / "bare.toml")
        assert len(load_scene(tmp_path / "bare.toml").objects) == len(bare.objects)
        with pytest.raises(UserError, match="before taking it away"):
            environment.set_environment_kind(bare, "constant")


def test_kinds_come_and_go(scene: Scene) -> None:
    assert environment.environment_kind(scene) == "constant"
    for kind in ("gradient", "sky"):
        made = environment.set_environment_kind(scene, kind)
        assert environment.environment_kind(made) == kind and made.environment.rgb.max() > 0.0
        assert environment.set_environment_kind(made, kind) is made
        assert environment.set_environment_kind(made, "constant").environment is None
    with pytest.raises(UserError, match="without a file"):
        environment.set_environment_kind(scene, "map")


def test_a_first_sky_is_as_bright_as_the_light_asks_for_and_follows_the_sun() -> None:
    lit = load_scene(assets_dir() / "scenes" / "water.toml")
    sun = next(light for light in lit.lights if light.kind == "directional")
    sky = environment.set_environment_kind(lit, "sky").environment
    table = sun.spectral_power.luminous() / np.pi
    assert 0.05 * table < sky.parameters["luminance"] < table
    # The brightest place of a clear sky lies about the sun, which it does not show.
    height, width = sky.rgb.shape[:2]
    row, column = np.unravel_index(sky.rgb[..., 1].argmax(), (height, width))
    toward = direction_of(sky, np.array((column + 0.5) / width), np.array((row + 0.5) / height))
    assert toward @ -np.array(sun.direction) / np.linalg.norm(sun.direction) > 0.999


def test_parameters_are_changed_one_at_a_time(scene: Scene) -> None:
    made = environment.set_environment(
        environment.set_environment_kind(scene, "gradient"), zenith=(0.0, 0.0, 0.0), intensity=2.0
    )
    told = made.environment.parameters
    assert told["zenith"] == [0.0, 0.0, 0.0] and told["intensity"] == 2.0 and made.environment.rgb[0].max() < 1e-3
    np.testing.assert_allclose(
        made.environment.rgb[127:129].mean(axis=(0, 1)), 2.0 * np.array(told["horizon"]), rtol=1e-3
    )
    sky = environment.set_environment(environment.set_environment_kind(scene, "sky"), type=5, luminance=3.0)
    assert np.ptp(sky.environment.rgb[:128]) < 1e-5 and sky.environment.rgb[0, 0, 0] == pytest.approx(3.0)
    with pytest.raises(UserError, match="type 16"):
        environment.set_environment(sky, type=16)
    with pytest.raises(UserError, match="choose a gradient"):
        environment.set_environment(scene, type=3)


def test_turning_a_map_keeps_its_picture_and_is_only_looked_at(with_map: Scene) -> None:
    turned = environment.set_map_rotation(with_map, 90.0)
    assert turned.environment.rgb is with_map.environment.rgb
    middle = direction_of(turned.environment, np.array(0.5), np.array(0.5))
    np.testing.assert_allclose(middle, (0.0, 1.0, 0.0), atol=1e-12)
    assert cost(with_map, turned) == DirtyLevel.CAMERA
    with pytest.raises(UserError, match="finite"):
        environment.set_map_rotation(with_map, float("nan"))


def test_intensity_scales_and_comes_back_from_nothing(with_map: Scene) -> None:
    base, before = with_map.environment, environment.map_intensity(with_map.environment)
    double = environment.set_map_intensity(with_map, 2.0 * before)
    np.testing.assert_allclose(double.environment.rgb, 2.0 * base.rgb, rtol=1e-6)
    dark = environment.set_map_intensity(double, 0.0)
    assert dark.environment.rgb.max() == 0.0
    np.testing.assert_allclose(environment.set_map_intensity(dark, before).environment.rgb, base.rgb, rtol=1e-6)
    with pytest.raises(UserError, match="out of range"):
        environment.set_map_intensity(with_map, 1e39)


def test_a_panorama_without_units_is_made_to_suit_the_lights_and_another_takes_its_place(
    with_map: Scene, scene: Scene
) -> None:
    bright = replace(
        scene, lights=tuple(replace(light, spectral_power=light.spectral_power.scaled(1e4)) for light in scene.lights)
    )
    fitted = environment.set_environment_map(bright, STUDIO).environment
    assert environment._mean_luminance(fitted) == pytest.approx(environment._usual_radiance(bright), rel=0.1)
    like_it = replace(scene, background_rgb=(0.5, 0.5, 0.5))
    assert environment.map_intensity(environment.set_environment_map(like_it, STUDIO).environment) == 1.0
    turned = environment.set_map_rotation(environment.set_map_intensity(with_map, 7.0), 30.0)
    again = environment.set_environment_map(turned, STUDIO)
    assert environment.map_intensity(again.environment) == 7.0
    np.testing.assert_allclose(again.environment.world_to_local, turned.environment.world_to_local, atol=1e-12)
    with pytest.raises(UserError, match="nothing.hdr"):
        environment.set_environment_map(scene, Path("nothing.hdr"))


def test_a_picture_is_worn_tinted_shared_and_taken_off(scene: Scene, picture: Path) -> None:
    table = table_of(scene)
    worn = environment.set_texture(scene, table, picture)
    assert worn.objects[table].material.reflectance_rgb == (1.0, 1.0, 1.0)
    tinted = set_diffuse_colour(worn, table, (1.0, 0.5, 0.5))
    assert tinted.objects[table].material.texture is worn.objects[table].material.texture
    double = replace(worn, objects=(*worn.objects, replace(scene.objects[table], name="twin")))
    cpu_reference = environment.set_texture(double, len(double.objects) - 1, picture)
    assert cpu_reference.objects[-1].material.texture is worn.objects[table].material.texture
    assert cost(scene, worn) == DirtyLevel.BUILD and cost(worn, tinted) == DirtyLevel.CAMERA
    clamped = environment.set_texture_wrap(worn, table, "clamp")
    assert cost(worn, clamped) == DirtyLevel.CAMERA
    assert clamped.objects[table].material.texture.rgb is worn.objects[table].material.texture.rgb
    plain = environment.clear_texture(worn, table)
    assert plain.objects[table].material.texture is None


def test_what_cannot_wear_a_picture_says_so(scene: Scene, picture: Path) -> None:
    table = table_of(scene)
    glass = next(i for i, item in enumerate(scene.objects) if not isinstance(item.material, Diffuse))
    bare = replace(scene.objects[table], mesh=replace(scene.objects[table].mesh, uv=None))
    with pytest.raises(UserError, match="no texture coordinates"):
        environment.set_texture(
            replace(scene, objects=(*scene.objects[:table], bare, *scene.objects[table + 1 :])), table, picture
        )
    with pytest.raises(UserError, match="not diffuse"):
        environment.set_texture(scene, glass, picture)
    with pytest.raises(UserError, match="no picture"):
        environment.set_texture_wrap(scene, table, "clamp")
