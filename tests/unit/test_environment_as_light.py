"""The environment as a light, without a device: directions by brightness, the sun of a panorama, what a scene file
says, and the reference that shaders are measured against."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit import environments
from spectrasplat.features.explained import explain
from spectrasplat.features.features import Features
from spectrasplat.model.environment import constant, direction_of, gradient, sky
from spectrasplat.model.environment_light import EnvironmentLight, lighting_environment, why_no_environment_light
from spectrasplat.model.environment_sun import sun_of, with_sun
from spectrasplat.model.geometry import primitives
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.scene import Black, Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.reference.camera_reference import render_camera_reference

SKY = gradient((0.2, 0.5, 2.0), (1.0, 0.9, 0.8), (0.3, 0.1, 0.1))


def irradiance(light: EnvironmentLight, normal: np.ndarray, count: int = 4096) -> np.ndarray:
    drawn = light.directions(0, count)
    return (drawn.weight * np.maximum(drawn.toward @ normal, 0.0)[:, None]).mean(axis=0)


@pytest.mark.parametrize("environment", [constant((1.0, 2.0, 0.0)), SKY, sky()], ids=["constant", "gradient", "sky"])
def test_directions_by_brightness_give_the_irradiance(environment: Environment) -> None:
    light = EnvironmentLight(environment, seed=3)
    normals = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [0.0, -1.0, 0.0]])
    exact = light.unshadowed(normals)
    for normal, expected in zip(normals, exact, strict=True):
        np.testing.assert_allclose(irradiance(light, normal), expected, rtol=4e-3, atol=1e-9)


def test_a_level_surface_under_a_uniform_sky_gets_pi_times_its_radiance() -> None:
    exact = EnvironmentLight(constant((1.0, 1.0, 1.0))).unshadowed(np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(exact, math.pi, rtol=5e-4)


def test_a_bright_window_gets_most_directions() -> None:
    rgb = np.full((64, 128, 3), 0.01, np.float32)
    rgb[10:14, 30:36] = 100.0
    drawn = EnvironmentLight(Environment(rgb, lights=True)).directions(0, 1000)
    window = direction_of(Environment(rgb), np.array(33.0 / 128.0), np.array(12.0 / 64.0))
    assert (drawn.toward @ window > math.cos(math.radians(15.0))).mean() > 0.9


def sunny(elevation_deg: float, azimuth_deg: float, radius_deg: float = 1.0, sun: float = 5000.0) -> Environment:
    height, width = 256, 512
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    rgb = np.ones((height, width, 3))
    elevation, azimuth = math.radians(elevation_deg), math.radians(azimuth_deg)
    toward = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    spot = direction_of(Environment(np.zeros((1, 1, 3), np.float32)), u, v) @ toward > math.cos(
        math.radians(radius_deg)
    )
    rgb[spot] = np.array([1.0, 0.8, 0.5]) * sun
    return Environment(rgb.astype(np.float32), lights=True)


@pytest.mark.parametrize("azimuth_deg", [30.0, 180.0, -179.5])
def test_the_sun_of_a_panorama_is_found_where_it_stands(azimuth_deg: float) -> None:
    panorama = sunny(35.0, azimuth_deg)
    found = sun_of(panorama)
    assert found is not None
    light, rest = found
    elevation, azimuth = math.radians(35.0), math.radians(azimuth_deg)
    expected = math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)
    assert np.dot(light.direction, expected) < -math.cos(math.radians(0.3))
    assert 1.5 < light.angular_diameter_deg < 2.5 and rest.rgb.max() == pytest.approx(1.0)
    # The light and the rest are the panorama: nothing is lost, nothing counts twice.
    toward = -np.array(light.direction)
    whole, left = (irradiance(EnvironmentLight(e), toward, 1 << 14) for e in (panorama, rest))
    np.testing.assert_allclose(left + xyz_to_rgb709(light.spectral_power.xyz()), whole, rtol=4e-3)


def test_soft_boxes_and_weak_spots_are_no_sun() -> None:
    assert sun_of(sunny(35.0, 10.0, radius_deg=6.0)) is None
    assert sun_of(sunny(35.0, 10.0, sun=15.0)) is None
    scene = Scene("s", Camera((0, -1, 1), (0, 0, 0)), (), (), environment=sunny(35.0, 10.0))
    lit = with_sun(scene)
    assert len(lit.lights) == 1 and with_sun(scene) is lit and with_sun(lit) is lit
    unlit = replace(scene, environment=replace(scene.environment, lights=False))
    assert with_sun(unlit) is unlit


SCENE = """
lights = []
[environment]
{0}
[[objects]]
shape = "plane"
material = "diffuse"
[camera]
position = [0.0, -2.0, 1.0]
"""


@pytest.mark.parametrize("kind", ['kind = "sky"', 'kind = "studio"', 'kind = "constant"\nradiance = 0.5'])
def test_a_scene_file_says_whether_its_environment_lights(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.toml"
    for words, lights in (("", True), ("\nlights = false", False)):
        path.write_text(SCENE.format(kind + words))
        scene = load_scene(path)
        assert (lighting_environment(scene) is not None) == lights
        features = Features.of(scene, RenderSettings())
        told = {name: (included, reason) for name, included, reason in explain(scene, features)}["environment light"]
        assert told[0] == features.environment_lights == lights
        save_scene(scene, tmp_path / "b.toml")
        assert (lighting_environment(load_scene(tmp_path / "b.toml")) is not None) == lights


def test_why_nothing_is_lit_is_told() -> None:
    camera, table = Camera((0, -1, 1), (0, 0, 0)), SceneObject("t", primitives.plane(1.0, 1.0), Diffuse())
    scene = Scene("s", camera, (), (table,), environment=SKY)
    assert why_no_environment_light(scene) is None
    assert why_no_environment_light(replace(scene, objects=())) == "no surface is diffuse"
    assert "background" in (why_no_environment_light(replace(scene, environment=None)) or "")
    assert "black" in (why_no_environment_light(replace(scene, environment=constant((0.0, 0.0, 0.0)))) or "")
    unlit = environments.set_environment_lights(scene, False)
    assert why_no_environment_light(unlit) == "environment.lights is false"
    again = environments.set_environment_lights(unlit, True)
    assert lighting_environment(again) is not None and "lights" not in again.environment.parameters


# ---- the reference ---------------------------------------------------------------------------


def seen_from_above(*objects: SceneObject, at: float) -> float:
    """Green radiance that the reference sees in the middle of a white floor under a sky of 1, at x = `at`."""
    floor = SceneObject("floor", primitives.plane(20.0, 20.0), Diffuse((1.0, 1.0, 1.0)))
    camera = Camera((at, 0.0, 0.2), (at, 0.0, 0.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=0.5)
    scene = Scene("s", camera, (), (floor, *objects), environment=constant((1.0, 1.0, 1.0)))
    return float(render_camera_reference(scene, 4, 4, samples=2048).rgb()[..., 1].mean())


def test_the_reference_knows_a_balls_shadow_in_closed_form() -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = 0.0, 0.0, 1.0
    ball = SceneObject("ball", primitives.sphere(0.5, 5000), Black(), matrix)
    assert seen_from_above(at=0.0) == pytest.approx(1.0, abs=2e-3)
    for x in (0.0, 0.6):
        distance = math.hypot(1.0, x)
        assert seen_from_above(ball, at=x) == pytest.approx(1.0 - (0.5 / distance) ** 2 / distance, abs=4e-3)
