"""The camera's reference renderer against closed forms: lights, textures, what lies beyond, furnaces, its own error,
the cache.

What is seen without glass is exact but for the pixel's area. Behind glass pictures are estimates: z is the distance
from the closed form in the picture's own standard deviations (8 parts, so Student's t with 7 degrees of freedom: the
mean of z² over many values is 7/5 = 1.4).
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.lamps import cosine, isotropic, lamp, lopsided
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, daylight_per_lumen, rgb709_to_xyz, rgb_basis
from spectrasplat.model.optics.glass import constant as constant_index
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import cmf_at, laser
from spectrasplat.model.scene import (
    Absorption,
    Black,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Material,
    Mirror,
    Scene,
    SceneObject,
)
from spectrasplat.model.texture import Environment, Texture
from spectrasplat.reference.camera_reference import (
    CameraRun,
    camera_reference_key,
    render_camera_reference,
)
from spectrasplat.reference.rounds import Picture
from spectrasplat.reference.spectral_caustic import CausticPlan

from tests.unit.camera_scenes import ABOVE, D65, FLINT, WHITE, place, plate, scene_of


def z_squared(picture: Picture, expected: np.ndarray) -> float:
    """Mean of z² on Y where the picture has noise."""
    noisy = picture.variance[..., 1] > 0.0
    return float(np.mean((picture.xyz[..., 1] - expected[..., 1])[noisy] ** 2 / picture.variance[..., 1][noisy]))


# ---- what is seen straight: exact ------------------------------------------------------------


def test_a_plate_under_a_point_light_is_lamberts_law() -> None:
    light = PointLight("l", D65.scaled(5.0), (0.3, -0.2, 1.5))
    picture = render_camera_reference(scene_of(light, plate(Diffuse((0.8, 0.4, 0.1)))), 33, 33, samples=256)
    middle = (np.arange(33) + 0.5) / 33 - 0.5
    x, y = np.meshgrid(middle, -middle)
    lux = 5.0 * 1.5 / ((x - 0.3) ** 2 + (y + 0.2) ** 2 + 1.5**2) ** 1.5
    np.testing.assert_allclose(picture.rgb, lux[..., None] * np.array([0.8, 0.4, 0.1]) / math.pi, rtol=2e-3)
    assert picture.fates == {"depth": 0.0, "numeric": 0.0}


def test_a_spectral_reflectance_meets_the_lights_spectrum() -> None:
    curve = np.where(np.abs(VISIBLE_NM - 600.0) < 30.0, 0.9, 0.1)
    light = DirectionalLight("l", D65 + laser(532.0, 0.01), direction=(0.0, 0.0, -1.0))
    picture = render_camera_reference(scene_of(light, plate(Diffuse(reflectance=curve))), 3, 3, samples=8)
    expected = K_M * ((D65.density * curve) @ cmf_xyz() + 0.01 * 0.1 * cmf_at(532.0)) / math.pi
    np.testing.assert_allclose(picture.xyz, np.broadcast_to(expected, (3, 3, 3)), rtol=1e-9)


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        (DirectionalLight("sun", D65, direction=(0.6, 0.0, -0.8), angular_diameter_deg=4.0), 0.8),
        (CollimatedLight("beam", D65, (0.0, 0.0, 2.0), radius=0.9), 1.0),
        (CollimatedLight("away", D65, (3.0, 0.0, 2.0), radius=0.9), 0.0),
        (SpotLight("spot", D65, (0.0, 0.0, 2.0), inner_half_angle_deg=40.0, outer_half_angle_deg=50.0), 0.25),
        (
            SpotLight(
                "soft",
                D65,
                (0.0, 0.0, 2.0),
                (math.sin(0.3), 0.0, -math.cos(0.3)),
                inner_half_angle_deg=0.0,
                outer_half_angle_deg=math.degrees(0.6),
            ),
            0.125,
        ),
        (AreaLight("disc", D65, (0.0, 0.0, 2.0), radius=1.0), math.pi * 0.2),
        (AreaLight("turned", D65, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), radius=1.0), 0.0),
    ],
    ids=lambda value: value.name if isinstance(value, Light) else "",
)
def test_every_kind_of_light_gives_its_irradiance(light: Light, expected: float) -> None:
    """On a plate below its middle: r²/(r² + h²) of the hemisphere for a disc, half a smoothstep half way down a spot's
    edge."""
    camera = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1e-3)
    picture = render_camera_reference(
        scene_of(light, plate(Diffuse((1.0, 1.0, 1.0))), camera=camera), 3, 3, samples=2048
    )
    assert picture.xyz[1, 1, 1] * math.pi == pytest.approx(expected, rel=1e-3, abs=1e-12)


def test_lamps_give_their_candela(tmp_path: Path) -> None:
    """Below a lamp, and aside from it where the file says something else."""
    camera = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1e-3)
    floor = plate(Diffuse((1.0, 1.0, 1.0)))
    for text in (isotropic(), cosine(), lopsided()):
        light = lamp(tmp_path, D65, text, position=(0.9, 0.4, 2.0), direction=(0.0, 0.6, -0.8), rotation_deg=15.0)
        picture = render_camera_reference(scene_of(light, floor, camera=camera), 3, 3, samples=16)
        way = -np.asarray(light.position)
        distance = np.linalg.norm(way)
        u, v = light.across
        theta = math.acos(way @ np.asarray(light.direction) / distance)
        share = light.profile.at(np.array(theta), np.array(math.atan2(way @ v, way @ u)))
        expected = float(share) * (2.0 / distance) / distance**2
        assert picture.xyz[1, 1, 1] * math.pi == pytest.approx(expected, rel=1e-3)


def test_lights_are_seen_from_the_front_through_each_other_and_hide_nothing() -> None:
    front = AreaLight("a", D65, (0.0, 0.0, 3.0), (0.0, 0.0, 1.0), radius=0.2)
    through = AreaLight(
        "b", D65.scaled(2.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), shape="rectangle", width=0.2, height=0.8
    )
    from_behind = AreaLight("c", D65.scaled(4.0), (0.0, 0.0, 4.0), radius=3.0)
    below = replace(front, position=(0.0, 0.0, -1.0))
    picture = render_camera_reference(scene_of(front, through, from_behind, below, plate(Black())), 21, 21, samples=8)
    y = picture.xyz[..., 1]
    assert y[10, 10] == pytest.approx(3.0) and y[10, 13] == pytest.approx(1.0) and y[4, 10] == pytest.approx(2.0)
    assert y[4, 4] == 0.0


def test_the_suns_disc_is_seen_where_nothing_hides_it() -> None:
    sun = DirectionalLight("sun", D65, direction=(0.0, 0.0, -1.0), angular_diameter_deg=8.0)
    up = Camera((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=8.0)
    half = place(primitives.plane(1.0, 1.0), Black(), (0.5, 0.0, 0.5))
    picture = render_camera_reference(scene_of(sun, half, camera=up), 40, 40, samples=64)
    columns = picture.xyz[..., 1].sum(axis=0)
    hidden, seen = sorted([columns[:20].sum(), columns[20:].sum()])
    # Solid angle on the film: π tan² r of 4 tan² r, halved; its radiance 1/(π sin² r).
    assert hidden == 0.0
    assert seen == pytest.approx(0.5 * math.pi / 4 * 1600 / (math.pi * math.sin(math.radians(4.0)) ** 2), rel=3e-3)


def test_shadow_rays_stop_at_glass() -> None:
    light = DirectionalLight("l", D65, direction=(0.0, 0.0, -1.0))
    pane = place(primitives.box((0.5, 0.5, 0.1)), Dielectric(constant_index(1.0)), (0.25, 0.0, 4.0))
    camera = replace(ABOVE, position=(0.0, 0.0, 3.0))
    y = render_camera_reference(scene_of(light, plate(), pane, camera=camera), 20, 20, samples=8).xyz[..., 1]
    assert y[10, 12] == 0.0 and y[10, 8] == pytest.approx(0.8 / math.pi)


# ---- textures and what lies beyond -----------------------------------------------------------


def test_a_texture_lies_upright_and_is_interpolated() -> None:
    rgb = np.random.default_rng(3).random((4, 6, 3)).astype(np.float32)
    light = DirectionalLight("l", D65, direction=(0.0, 0.0, -1.0))
    camera = replace(ABOVE, vertical_extent=1.0)
    for wrap in ("clamp", "repeat"):
        page = place(primitives.plane(1.5, 1.0), Diffuse((1.0, 0.5, 1.0), texture=Texture(rgb, wrap)))
        picture = render_camera_reference(scene_of(light, page, camera=camera), 60, 40, samples=32)
        rows, columns = (np.arange(40) + 0.5) / 10 - 0.5, (np.arange(60) + 0.5) / 10 - 0.5
        expected = np.zeros((40, 60, 3))
        for i, y in enumerate(rows):
            for j, x in enumerate(columns):
                for dy in range(2):
                    for dx in range(2):
                        r, c = math.floor(y) + dy, math.floor(x) + dx
                        r, c = (r % 4, c % 6) if wrap == "repeat" else (min(max(r, 0), 3), min(max(c, 0), 5))
                        expected[i, j] += (
                            (1 - abs(y - math.floor(y) - dy)) * (1 - abs(x - math.floor(x) - dx)) * rgb[r, c]
                        )
        # The mean over a pixel of a bilinear patch is its middle; 32 samples leave a little of the slope.
        np.testing.assert_allclose(picture.rgb * math.pi, expected * [1.0, 0.5, 1.0], atol=0.012)


def test_the_environment_is_seen_the_way_its_picture_lies() -> None:
    rgb = np.zeros((64, 128, 3), np.float32)
    rgb[:, :, 0] = np.arange(128)
    rgb[:, :, 1] = np.arange(64)[:, None]
    to_local = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # local x is the world's y
    env = Environment(rgb, to_local)
    thing = place(primitives.plane(0.1, 0.1), Black(), (0.0, 0.0, -50.0))

    def looks(direction: tuple[float, float, float], up=(0.0, 0.0, 1.0)) -> np.ndarray:
        camera = Camera((0.0, 0.0, 0.0), direction, up=up, vertical_fov_deg=0.01)
        return render_camera_reference(scene_of(thing, camera=camera, environment=env), 1, 1, samples=8).rgb[0, 0, :2]

    np.testing.assert_allclose(looks((0.0, 1.0, 0.0)), [63.5, 31.5], atol=0.01)  # the middle
    np.testing.assert_allclose(looks((1.0, 0.0, 0.0)), [95.5, 31.5], atol=0.01)  # to the right of local x is −local y
    np.testing.assert_allclose(looks((-1.0, 0.0, 0.0)), [31.5, 31.5], atol=0.01)
    np.testing.assert_allclose(looks((0.0, 1.0, 1.0))[1], 15.5, atol=0.01)  # 45° up: a quarter from the top
    assert looks((0.0, 0.001, 1.0), up=(0.0, 1.0, 0.0))[1] == pytest.approx(0.0, abs=0.01)
    # The seam joins the last column and the first.
    assert looks((0.0, -1.0, 0.0))[0] == pytest.approx(63.5, abs=1.0)


def test_a_constant_environment_is_exact() -> None:
    rgb = np.array([0.2, 0.7, 1.9])
    thing = place(primitives.plane(0.1, 0.1), Black(), (0.0, 0.0, -50.0))
    camera = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    flat = Environment(np.broadcast_to(rgb.astype(np.float32), (8, 16, 3)).copy())
    for more in ({"background_rgb": tuple(rgb)}, {"environment": flat}):
        picture = render_camera_reference(scene_of(thing, camera=camera, **more), 4, 4, samples=8)
        np.testing.assert_allclose(picture.xyz, np.broadcast_to(rgb709_to_xyz(rgb), (4, 4, 3)), rtol=1e-6)


# ---- furnaces --------------------------------------------------------------------------------


def ball_scene(*more: SceneObject, material: Material | None = None) -> Scene:
    camera = Camera((0.0, -4.0, 0.3), (0.0, 0.0, 0.0), vertical_fov_deg=32.0)
    ball = place(sphere(1.0, 5120), material or Dielectric(FLINT))
    return scene_of(ball, *more, camera=camera, background_rgb=(1.0, 1.0, 1.0))


def nested() -> Scene:
    inner = place(primitives.box((0.5, 0.6, 0.7)), Dielectric(from_abbe(1.4, 60.0), None, 1), (0.2, 0.0, 0.1))
    mirror = place(sphere(0.4, 320), Mirror((1.0, 1.0, 1.0)), (-1.0, 0.5, 1.0))
    return ball_scene(inner, mirror)


def unit_run(scene: Scene) -> CameraRun:
    """A run in which every wavelength answers with one over the daylight's own power: white is 1 in each path."""
    run = CameraRun(scene, 48, 36)
    spectra = run._spectra
    return_one = np.repeat(1.0 / spectra.daylight[:, None], 3, axis=1)
    run._spectra = spectra._replace(response=return_one, beyond_xyz=np.full_like(spectra.beyond_xyz, 1.0 / 3.0))
    return run


@pytest.mark.parametrize("scene", [ball_scene(), nested()], ids=["ball", "nested"])
def test_glass_in_a_white_room_is_white_path_by_path(scene: Scene) -> None:
    run = unit_run(scene)
    run.advance()
    picture = run.picture()
    lost = picture.fates["depth"] + picture.fates["numeric"]
    assert lost < 1e-5
    assert np.abs(picture.xyz - 1.0).max() < 1e-12 or (
        lost > 0.0 and np.mean(np.abs(picture.xyz - 1.0) > 1e-12) <= lost * picture.amount * 3
    )


def test_glass_in_a_white_room_is_white_in_colour() -> None:
    picture = render_camera_reference(nested(), 32, 24, samples=512)
    assert z_squared(picture, np.broadcast_to(WHITE, picture.xyz.shape)) == pytest.approx(1.4, abs=0.4)
    # 32 × 24 pixels of 512 samples: a hundredth of one per cent of too much or too little light would show.
    np.testing.assert_allclose(picture.xyz.mean(axis=(0, 1)), WHITE, rtol=2e-4)


def test_a_camera_inside_an_absorbing_ball_sees_the_room_by_way_of_its_radius() -> None:
    """From the middle all rays meet the surface upright: T e^(−αR) Σ (R e^(−2αR))^k of the room's light."""
    alpha, n = 0.4, 1.5
    ball = place(sphere(1.0, 20480), Dielectric(constant_index(n), Absorption(np.full(401, alpha))))
    camera = Camera((0.0, 0.0, 0.0), (0.3, 1.0, 0.2), vertical_fov_deg=50.0)
    picture = render_camera_reference(
        scene_of(ball, camera=camera, background_rgb=(1.0, 1.0, 1.0)), 24, 24, samples=512
    )
    reflectance = ((n - 1) / (n + 1)) ** 2
    expected = (1 - reflectance) * math.exp(-alpha) / (1 - reflectance * math.exp(-2 * alpha))
    mean, error = picture.xyz[..., 1].mean(), math.sqrt(picture.variance[..., 1].mean() / 576)
    assert abs(mean - expected) < 5.0 * error + 2e-4
    assert abs(mean - math.exp(-alpha)) > 20.0 * error  # the mutant without Fresnel


def test_a_mirrors_tint_is_its_colour() -> None:
    mirror = place(primitives.plane(9.0, 9.0), Mirror((0.9, 0.5, 0.2)))
    picture = render_camera_reference(scene_of(mirror, background_rgb=(2.0, 2.0, 2.0)), 16, 16, samples=512)
    np.testing.assert_allclose(picture.rgb.mean(axis=(0, 1)), [1.8, 1.0, 0.4], rtol=2e-3)


# ---- its own error, its key; limits and cache: test_photon_reference.py -----------------------


def test_the_key_knows_textures_and_what_lies_beyond() -> None:
    rgb = np.ones((2, 2, 3), np.float32)
    room = Environment(rgb)
    scene = scene_of(PointLight("l", D65, (0, 0, 1)), plate(Diffuse(texture=Texture(rgb))))

    def key(caustic: CausticPlan | None = None, **changes: object) -> str:
        return camera_reference_key(replace(scene, **changes), 8, 8, 64, caustic)  # type: ignore[arg-type]

    in_room = key(environment=room)
    keys = [
        key(),
        key(CausticPlan()),
        key(CausticPlan(photons=5)),
        key(objects=(plate(Diffuse(texture=Texture(0.5 * rgb))),)),
        key(objects=(plate(Diffuse(texture=Texture(rgb, "clamp"))),)),
        key(background_rgb=(0.1, 0.1, 0.1)),
        in_room,
        key(environment=replace(room, world_to_local=np.diag([-1.0, -1.0, 1.0]))),
        key(environment=replace(room, rgb=2.0 * rgb)),
    ]
    assert len(set(keys)) == len(keys)
    assert key(name="other", environment=replace(room, source="elsewhere")) == in_room
    np.testing.assert_allclose(K_M * (rgb_basis() @ np.ones(3) * daylight_per_lumen()) @ cmf_xyz(), WHITE, rtol=1e-9)
