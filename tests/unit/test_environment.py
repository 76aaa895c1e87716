"""Environments: pictures hang where the conventions say, skies are those of the standard, and all of them light."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.image_io import write_image
from spectrasplat.edit import environments
from spectrasplat.features.facts import Facts
from spectrasplat.features.features import Features
from spectrasplat.model.environment import (
    SKY_TYPES,
    constant,
    direction_of,
    from_map,
    gradient,
    horizontal_illuminance,
    relative_luminance,
    sky,
    up_and_rotation,
    world_to_local,
)
from spectrasplat.model.environment_light import (
    EnvironmentLight,
    lighting_environment,
    why_no_environment_light,
)
from spectrasplat.model.geometry import primitives
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.lights.light import Light
from spectrasplat.model.lights.outlined import AreaLight
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.panorama_lights import PanoramaWindow, lights_of, with_panorama_lights
from spectrasplat.model.scene import Black, Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.reference.camera_reference import render_camera_reference

from tests.unit.picture_bytes import hdr_file


def looked_up(environment: Environment, direction: tuple[float, float, float]) -> np.ndarray:
    """Texel seen in a world direction, by the words of `texture.Environment`."""
    x, y, z = environment.world_to_local @ np.array(direction) / np.linalg.norm(direction)
    height, width = environment.rgb.shape[:2]
    u, v = 0.5 - math.atan2(y, x) / (2.0 * math.pi), math.acos(max(-1.0, min(1.0, z))) / math.pi
    return environment.rgb[min(int(v * height), height - 1), int(u * width) % width]


def numbered_map(path: Path, width: int = 16, height: int = 8) -> Path:
    """A picture whose red is the column and whose green is the row."""
    rgb = np.zeros((height, width, 3), np.float32)
    rgb[..., 0], rgb[..., 1] = np.arange(width), np.arange(height)[:, None]
    write_image(path, rgb)
    return path


# -- how a picture hangs ------------------------------------------------------------------


def test_the_middle_of_a_map_lies_at_x_and_its_left_at_y(tmp_path: Path) -> None:
    environment = from_map(numbered_map(tmp_path / "a.npy"))
    assert environment.kind == "map" and environment.source == str((tmp_path / "a.npy").resolve())
    assert looked_up(environment, (1.0, -1e-6, 0.0))[0] == 8 and looked_up(environment, (1.0, 1e-6, 0.0))[0] == 7
    assert looked_up(environment, (-1e-6, 1.0, 0.0))[0] == 3 and looked_up(environment, (1e-6, -1.0, 0.0))[0] == 11
    assert looked_up(environment, (-1.0, 1e-6, 0.0))[0] == 0 and looked_up(environment, (-1.0, -1e-6, 0.0))[0] == 15
    assert looked_up(environment, (0.01, 0.0, 1.0))[1] == 0 and looked_up(environment, (0.01, 0.0, -1.0))[1] == 7


def test_rotation_is_anticlockwise_from_above(tmp_path: Path) -> None:
    environment = from_map(numbered_map(tmp_path / "a.npy"), rotation_deg=90.0)
    # What was seen along x is now seen along y.
    assert looked_up(environment, (1e-6, 1.0, 0.0))[0] == 8


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (0.3, -0.5, -0.8)])
def test_up_is_up_and_the_frame_a_rotation(up: tuple[float, float, float]) -> None:
    for angle in (0.0, 33.0, -170.0):
        matrix = world_to_local(up, angle)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-13)
        np.testing.assert_allclose(matrix @ np.array(up) / np.linalg.norm(up), (0.0, 0.0, 1.0), atol=1e-14)
        again_up, again_angle = up_and_rotation(Environment(np.zeros((1, 2, 3), np.float32), matrix))
        assert again_angle == pytest.approx(angle, abs=1e-9)
        np.testing.assert_allclose(world_to_local(again_up, again_angle), matrix, atol=1e-14)


# -- maps ---------------------------------------------------------------------------------


def test_a_single_bright_texel_survives_and_intensity_scales_it(tmp_path: Path) -> None:
    rgbe = np.full((16, 32, 4), 128, np.uint8)
    rgbe[3, 20] = (255, 240, 200, 148)
    (tmp_path / "sun.hdr").write_bytes(hdr_file(rgbe.tobytes(), 32, 16))
    environment = from_map(tmp_path / "sun.hdr", intensity=3.0)
    assert environment.rgb.dtype == np.float32 and environment.rgb.shape == (16, 32, 3)
    np.testing.assert_allclose(environment.rgb[3, 20], 3.0 * 4096.0 * np.array([255, 240, 200]), rtol=1e-6)
    assert np.median(environment.rgb) == pytest.approx(1.5)


def test_a_map_that_is_not_two_to_one_is_told(tmp_path: Path) -> None:
    notes: list[str] = []
    from_map(numbered_map(tmp_path / "a.npy", 16, 9), notes=notes)
    assert len(notes) == 1 and "16 × 9" in notes[0] and "stretched" in notes[0]
    from_map(numbered_map(tmp_path / "b.npy"), notes=notes)
    assert len(notes) == 1


@pytest.mark.parametrize("size", [(5000, 40), (8192, 60), (64, 3000)])
def test_a_large_map_is_averaged_by_area(tmp_path: Path, size: tuple[int, int]) -> None:
    width, height = size
    rgb = np.random.default_rng(6).random((height, width, 3)).astype(np.float32)
    rgb[height // 2, width // 3] = 1e6
    write_image(tmp_path / "a.npy", rgb)
    notes: list[str] = []
    environment = from_map(tmp_path / "a.npy", notes=notes)
    assert environment.rgb.shape == (min(height, 2048), min(width, 4096), 3)
    assert "averaged down" in notes[-1]
    np.testing.assert_allclose(
        environment.rgb.mean(axis=(0, 1), dtype=float), rgb.mean(axis=(0, 1), dtype=float), rtol=1e-6
    )
    # The first texel is the mean over its share of the source, weights by hand.
    step_x, step_y = max(1.0, width / 4096), max(1.0, height / 2048)
    across, down = ([1.0] * int(s) + ([s - int(s)] if s > int(s) else []) for s in (step_x, step_y))
    block = rgb[: len(down), : len(across)].astype(float)
    expected = np.einsum("y,x,yxc->c", down, across, block) / (step_x * step_y)
    np.testing.assert_allclose(environment.rgb[0, 0], expected, rtol=1e-5)


# -- gradients ----------------------------------------------------------------------------


def test_a_gradient_meets_its_three_colours_and_has_no_edge() -> None:
    environment = gradient((1.0, 2.0, 30.0), (4.0, 5.0, 6.0), (0.5, 0.25, 0.0), intensity=2.0)
    rgb = environment.rgb.astype(float)
    assert environment.kind == "gradient" and rgb.shape[0] >= 256 and np.ptp(rgb, axis=1).max() == 0.0
    np.testing.assert_allclose(rgb[0, 0], (2.0, 4.0, 60.0), rtol=1e-3)
    np.testing.assert_allclose(rgb[-1, 0], (1.0, 0.5, 0.0), atol=1e-3)
    half = len(rgb) // 2
    np.testing.assert_allclose(rgb[half - 1 : half + 1, 0], np.tile([8.0, 10.0, 12.0], (2, 1)), rtol=1e-3)
    assert (np.diff(rgb[:half, 0, 2]) < 0.0).all(), "monotonous from the zenith to the horizon"
    # The slope has no step: second differences stay of the order of the first squared, horizon included.
    assert np.abs(np.diff(rgb[:, 0], n=2, axis=0)).max() < 3e-3 * np.ptp(rgb)


# -- skies --------------------------------------------------------------------------------


def test_the_overcast_sky_is_three_times_as_bright_at_the_zenith() -> None:
    """Type 1 replaces Moon and Spencer's (1 + 2 sin γ)/3: it keeps the 1/3 at the horizon and stays within 0.055 above
    20°."""
    elevation = np.radians(np.linspace(0.0, 90.0, 91))
    towards = np.stack([np.cos(elevation), 0.0 * elevation, np.sin(elevation)], axis=1)
    found = relative_luminance(1, towards, np.array([0.0, 0.6, 0.8]))
    assert found[0] == pytest.approx(1.0 / 3.0, abs=5e-3)
    np.testing.assert_allclose(found[20:], (1.0 + 2.0 * np.sin(elevation[20:])) / 3.0, atol=0.055)
    assert found[30] == pytest.approx((1.0 + 4.0 * math.exp(-1.4)) / (1.0 + 4.0 * math.exp(-0.7)), rel=1e-12)


@pytest.mark.parametrize("sky_type", SKY_TYPES)
def test_every_type_is_one_at_the_zenith_and_positive(sky_type: int) -> None:
    sun = np.array([math.cos(0.5), 0.0, math.sin(0.5)])
    assert relative_luminance(sky_type, np.array([0.0, 0.0, 1.0]), sun) == pytest.approx(1.0, rel=1e-14)
    rgb = sky(30.0, 0.0, 2.5, sky_type).rgb
    assert rgb.min() > 0.0 and np.isfinite(rgb).all()
    np.testing.assert_allclose(rgb[0].mean(), 2.5, rtol=0.01)


def test_the_clear_sky_against_numbers_worked_by_hand() -> None:
    """Type 12, sun 30° high: at the sun's place f(0) = 1 + 10 (1 − e^(−3π/2)) + 0.45 and φ(60°) = 1 − e^(−0.64)."""
    angle = math.radians(30.0)
    sun = np.array([math.cos(angle), 0.0, math.sin(angle)])
    tail = math.exp(-1.5 * math.pi)
    toward = (1.0 + 10.0 * (1.0 - tail) + 0.45) * (1.0 - math.exp(-0.64))
    zenith = (1.0 + 10.0 * (math.exp(-math.pi) - tail) + 0.45 * 0.25) * (1.0 - math.exp(-0.32))
    assert relative_luminance(12, sun, sun) == pytest.approx(toward / zenith, rel=1e-12)


def test_the_bright_side_is_where_the_sun_is() -> None:
    for azimuth in (0.0, 90.0, -135.0):
        for up in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)):
            environment = sky(25.0, azimuth, up=up)
            row, column = divmod(int(environment.rgb[..., 1].argmax()), environment.rgb.shape[1])
            height, width = environment.rgb.shape[:2]
            brightest = direction_of(environment, (column + 0.5) / width, (row + 0.5) / height)
            a = math.radians(azimuth)
            expected = np.array([math.cos(a), math.sin(a), math.tan(math.radians(25.0))]) @ world_to_local(up)
            # The luminance's peak lies a little below the sun, towards the brighter horizon.
            assert brightest @ expected / np.linalg.norm(expected) > math.cos(math.radians(4.0))


def test_the_ground_is_lit_by_the_sky() -> None:
    """Under the uniform sky the illuminance is π L, so that a ground of reflectance ρ has the luminance ρ L."""
    environment = sky(40.0, 0.0, 7.0, 5, (0.1, 0.2, 0.4))
    half = environment.rgb.shape[0] // 2
    np.testing.assert_allclose(environment.rgb[:half], 7.0, rtol=1e-6)
    np.testing.assert_allclose(
        environment.rgb[half:], np.broadcast_to([0.7, 1.4, 2.8], (half, environment.rgb.shape[1], 3)), rtol=1e-6
    )


def test_the_horizontal_illuminance_of_an_overcast_sky() -> None:
    """7π/9 of the zenith's luminance for Moon and Spencer's law, which the rows hold here."""
    height = 400
    sine = np.cos(0.5 * np.pi * (np.arange(height) + 0.5) / height)
    assert horizontal_illuminance(np.tile((1.0 + 2.0 * sine) / 3.0, (8, 1)).T) == pytest.approx(
        7.0 * np.pi / 9.0, rel=1e-5
    )


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
    (light,), rest = lights_of(panorama)
    elevation, azimuth = math.radians(35.0), math.radians(azimuth_deg)
    expected = math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)
    assert np.dot(light.direction, expected) < -math.cos(math.radians(0.3))
    assert 1.5 < light.angular_diameter_deg < 2.5 and rest.rgb.max() == pytest.approx(1.0)
    # The light and the rest are the panorama: nothing is lost, nothing counts twice.
    toward = -np.array(light.direction)
    whole, left = (irradiance(EnvironmentLight(e), toward, 1 << 14) for e in (panorama, rest))
    np.testing.assert_allclose(left + xyz_to_rgb709(light.spectral_power.xyz()), whole, rtol=4e-3)


def test_lights_at_the_pole_are_whole() -> None:
    """All columns meet there: a sun beside it was two, and a round lamp about it lost 3 % of its light."""
    (light,), _ = lights_of(sunny(89.7, 0.0, radius_deg=0.6))
    assert np.dot(light.direction, (0.0, 0.0, -1.0)) > math.cos(math.radians(0.5))
    panorama = sunny(90.0, 0.0, radius_deg=3.0)
    (lamp,), rest = lights_of(panorama)
    edges = np.cos(np.pi * np.arange(257) / 256)
    whole, left = (((edges[:-1] - edges[1:]) @ e.rgb.sum(axis=1) * 2.0 * np.pi / 512) for e in (panorama, rest))
    assert isinstance(lamp, PanoramaWindow) and lamp.is_disc
    np.testing.assert_allclose(left + lamp.solid_angle_sr * lamp.radiance, whole, rtol=1e-5)


def test_wide_glows_and_weak_spots_are_no_lights() -> None:
    assert lights_of(sunny(35.0, 10.0, radius_deg=14.0))[0] == ()
    assert lights_of(sunny(35.0, 10.0, sun=15.0))[0] == ()
    scene = Scene("s", Camera((0, -1, 1), (0, 0, 0)), (), (), environment=sunny(35.0, 10.0))
    lit = with_panorama_lights(scene)
    assert len(lit.lights) == 1 and with_panorama_lights(scene) is lit and with_panorama_lights(lit) is lit
    unlit = replace(scene, environment=replace(scene.environment, lights=False))
    assert with_panorama_lights(unlit) is unlit


def several() -> tuple[Environment, list[PanoramaWindow]]:
    """A room with a sun, an upright and a tilted window and a round lamp, each all of one radiance."""
    height, width, fine = 256, 512, 4
    u, v = ((np.arange(fine * n) + 0.5) / (fine * n) for n in (width, height))
    toward = direction_of(Environment(np.zeros((1, 1, 3), np.float32)), *np.meshgrid(u, v))
    rgb, made = np.full((*toward.shape[:2], 3), 0.05), []
    for azimuth_deg, up, roll_deg, half, is_disc, radiance in (
        (40.0, 0.3, 0.0, (0.012, 0.012), True, (4e3, 3e3, 2e3)),
        (150.0, 0.2, 0.0, (0.10, 0.15), False, (20.0, 22.0, 25.0)),
        (-178.0, 0.9, 25.0, (0.06, 0.14), False, (30.0, 30.0, 30.0)),
        (-70.0, -0.3, 0.0, (0.08, 0.08), True, (60.0, 40.0, 20.0)),
    ):
        azimuth, roll = math.radians(azimuth_deg), math.radians(roll_deg)
        middle = np.array([math.cos(azimuth), math.sin(azimuth), up]) / math.hypot(1.0, up)
        level = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        tangent = math.cos(roll) * level + math.sin(roll) * np.cross(middle, level)
        made.append(PanoramaWindow(middle, tangent, half, is_disc, np.array(radiance)))
        rgb += made[-1].covers(toward)[..., None] * made[-1].radiance
    texels = rgb.reshape(height, fine, width, fine, 3).mean(axis=(1, 3)).astype(np.float32)
    return Environment(texels, lights=True), made


def received(light: Light, toward: np.ndarray) -> float:
    """Irradiance at the origin over a light's own quantity, on a plane across `toward`."""
    if not isinstance(light, AreaLight):
        return max(-float(np.array(light.direction) @ toward), 0.0)
    u, v = (g.ravel() for g in np.meshgrid(*2 * [(np.arange(200) + 0.5) / 100.0 - 1.0]))
    u, v = (c[u * u + v * v < 1.0] if light.is_disc else c for c in (u, v))
    tangent, across, axis = light.axes().T
    half = light.half_extent
    way = np.array(light.position) + half[0] * u[:, None] * tangent + half[1] * v[:, None] * across
    distance = np.linalg.norm(way, axis=1)
    return float((np.maximum(way @ toward, 0.0) * -(way @ axis) / distance**4).mean()) * light.area


def test_a_panorama_holds_several_lights_and_their_sum_is_the_panorama() -> None:
    panorama, made = several()
    found, rest = lights_of(panorama)
    assert len(found) == len(made) and abs(rest.rgb).max() < 0.2 * panorama.rgb.max()
    for expected in made[1:]:
        like = [each for each in found if isinstance(each, PanoramaWindow) and each.toward @ expected.toward > 0.9999]
        assert len(like) == 1 and like[0].is_disc == expected.is_disc
        assert sorted(like[0].half) == pytest.approx(sorted(expected.half), rel=0.03)
        np.testing.assert_allclose(like[0].radiance, expected.radiance, rtol=0.01)
        assert (
            expected.is_disc
            or abs(like[0].tangent @ expected.tangent) % 1.0 == pytest.approx(0.0, abs=0.02)
            or (abs(like[0].tangent @ expected.tangent) > 0.999)
        )
    # Their light on planes across each of them.
    scene = with_panorama_lights(Scene("s", Camera((0, -1, 1), (0, 0, 0)), (), (), environment=panorama))
    assert len({light.name for light in scene.lights}) == 4
    for toward in (each.toward for each in made):
        whole, left = (irradiance(EnvironmentLight(e), toward, 1 << 14) for e in (panorama, rest))
        for light in scene.lights:
            left = left + xyz_to_rgb709(light.spectral_power.xyz()) * received(light, toward)
        np.testing.assert_allclose(left, whole, rtol=0.01)


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
        told = {
            name: (included, reason) for name, included, reason in features.explain(Facts(scene, RenderSettings()))
        }["environment light"]
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
    return float(render_camera_reference(scene, 4, 4, samples=2048).rgb[..., 1].mean())


def test_the_reference_knows_a_balls_shadow_in_closed_form() -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = 0.0, 0.0, 1.0
    ball = SceneObject("ball", primitives.sphere(0.5, 5000), Black(), matrix)
    assert seen_from_above(at=0.0) == pytest.approx(1.0, abs=2e-3)
    for x in (0.0, 0.6):
        distance = math.hypot(1.0, x)
        assert seen_from_above(ball, at=x) == pytest.approx(1.0 - (0.5 / distance) ** 2 / distance, abs=4e-3)
