"""The camera's pass on diffuse surfaces: lights, shadows, the pixel's filter and how samples add up, against radiances
that can be written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, SceneObject

from tests.gpu.camera_rig import (
    ABOVE,
    DOWN,
    REFLECTANCE,
    WHITE,
    at,
    floor,
    floor_points,
    horizontal,
    point_light_radiance,
    quad,
    render,
)

TILTED = Camera(position=(1.0, -6.0, 3.5), target=(0.3, 0.2, 0.0), up=(0, 0, 1), vertical_fov_deg=28.0)


@pytest.mark.parametrize("camera", [ABOVE, TILTED, replace(TILTED, kind="orthographic", vertical_extent=3.0)])
def test_lambert_floor_under_a_point_light(gl, camera):
    """Off-centre light and a picture that is not square: every axis of the camera's map counts."""
    light = PointLight("lamp", WHITE, position=(0.7, -0.4, 1.5))
    rgb = render(gl, [floor()], [light], camera=camera)
    expected = point_light_radiance(floor_points((32, 24), camera), light.position)
    assert rgb[..., 1] == pytest.approx(expected, rel=1e-4)
    assert np.ptp(rgb, axis=-1).max() < 1e-4 * rgb.max()  # D65 is white


def test_spot_edge_hard_and_soft(gl):
    points = floor_points((64, 64), ABOVE)
    angle = np.arctan2(np.linalg.norm(points[..., :2], axis=-1), 2.0)
    for inner, outer in ((25.0, 25.0), (15.0, 30.0)):
        light = SpotLight(
            "spot", WHITE, position=(0, 0, 2), direction=DOWN, inner_half_angle_deg=inner, outer_half_angle_deg=outer
        )
        rgb = render(gl, [floor()], [light], size=(64, 64))
        share = rgb[..., 1] / point_light_radiance(points, light.position)
        if inner == outer:
            clear = np.abs(angle - np.radians(inner)) > 1e-3
            assert share[clear] == pytest.approx((angle < np.radians(inner))[clear].astype(float), abs=1e-4)
        else:
            t = np.clip((np.radians(outer) - angle) / np.radians(outer - inner), 0, 1)
            assert share == pytest.approx(t * t * (3 - 2 * t), abs=1e-4)


def test_sun_penumbra_is_as_wide_as_its_disc(gl):
    """A half-plane at height 1: the penumbra is the sun's disc cut by a straight edge."""
    diameter = 20.0
    blocker = horizontal(0.0, 6.0, -6, 6, 1.0, Diffuse((0, 0, 0)), "blocker")
    camera = replace(ABOVE, position=(0, 0, 0.5), vertical_extent=1.0)  # below the blocker
    light = DirectionalLight("sun", WHITE, direction=DOWN, angular_diameter_deg=diameter)
    rgb = render(gl, [floor(), blocker], [light], size=(64, 64), samples=64, camera=camera)
    share = rgb[..., 1].mean(axis=0) / (REFLECTANCE / np.pi * 1000.0)
    radius = np.tan(np.radians(diameter / 2))
    x = (np.arange(64) + 0.5) / 64 - 0.5
    u = np.clip(x / radius, -1, 1)
    expected = 1 - (0.5 + (u * np.sqrt(1 - u * u) + np.arcsin(u)) / np.pi)
    # The cosine over a 10 degree half angle costs up to 1.5 %.
    assert share == pytest.approx(expected, abs=0.02)
    assert share[x < -radius - 0.02].min() > 0.97 and share[x > radius + 0.02].max() == 0


def test_sun_without_extent_has_a_sharp_shadow_and_the_right_cosine(gl):
    blocker = horizontal(0.0, 6.0, -6, 6, 1.0, Diffuse((0, 0, 0)), "blocker")
    camera = replace(ABOVE, position=(0, 0, 0.5), vertical_extent=0.25)
    tilt = np.radians(30)
    light = DirectionalLight("sun", WHITE, direction=(np.sin(tilt), 0, -np.cos(tilt)))
    share = render(gl, [floor(), blocker], [light], size=(64, 8), camera=camera)[..., 1] / (
        REFLECTANCE / np.pi * 1000.0
    )
    x = floor_points((64, 8), camera)[..., 0]
    expected = np.where(x < np.tan(tilt), np.cos(tilt), 0.0)
    assert share == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_collimated_beam_ends_at_its_aperture(gl, shape):
    light = CollimatedLight(
        "beam",
        WHITE,
        position=(0.5, 0.2, 3),
        direction=DOWN,
        tangent=(1, 0, 0),
        shape=shape,
        radius=0.8,
        width=1.6,
        height=0.96,
    )
    rgb = render(gl, [floor()], [light], size=(40, 40))
    x, y = np.moveaxis(floor_points((40, 40), ABOVE)[..., :2] - (0.5, 0.2), -1, 0)
    lit = np.hypot(x, y) < 0.8 if shape == "disc" else (np.abs(x) < 0.8) & (np.abs(y) < 0.48)
    assert rgb[..., 1] == pytest.approx(np.where(lit, REFLECTANCE / np.pi * 1000.0, 0.0), rel=1e-5)


def test_area_disc_lights_the_floor_and_is_seen_from_its_front_only(gl):
    luminance, radius, height = 1000.0, 0.7, 1.0
    light = AreaLight("panel", WHITE, position=(0, 0, height), direction=DOWN, radius=radius)
    camera = replace(ABOVE, position=(0, 0, 0.5), vertical_extent=0.02)
    rgb = render(gl, [floor()], [light], size=(16, 16), samples=64, camera=camera)
    irradiance = np.pi * luminance * radius**2 / (radius**2 + height**2)
    assert rgb[..., 1].mean() == pytest.approx(REFLECTANCE / np.pi * irradiance, rel=3e-3)
    upward = replace(camera, target=(0, 0, 5), vertical_extent=2.0)
    seen = render(gl, [floor()], [light], size=(40, 40), samples=64, camera=upward)[..., 1]
    assert seen[20, 20] == pytest.approx(luminance, rel=1e-5)
    assert seen.mean() == pytest.approx(luminance * np.pi * radius**2 / 4, rel=5e-3)
    behind = render(gl, [floor()], [light], size=(40, 40), camera=ABOVE)[..., 1]
    assert behind.max() < 0.5 * luminance


def test_glass_throws_a_shadow(gl):
    """Light through glass comes back through the caustic map; the direct part must be gone, all of it."""
    solid = SceneObject("cube", primitives.box((1, 1, 0.2)), Dielectric(glass.constant(1.5)), at(0, 0, 1))
    camera = replace(ABOVE, position=(0, 0, 0.5))
    light = PointLight("lamp", WHITE, position=(0, 0, 3))
    rgb = render(gl, [floor(), solid], [light], size=(40, 40), camera=camera)[..., 1]
    x, y = np.moveaxis(np.abs(floor_points((40, 40), camera)[..., :2]), -1, 0)
    shadow = np.maximum(x, y) < 0.5 * 3.0 / 1.9  # the upper rim is nearest to the light
    expected = point_light_radiance(floor_points((40, 40), camera), light.position)
    assert rgb == pytest.approx(np.where(shadow, 0.0, expected), rel=1e-4)


def test_a_floor_is_lit_on_both_sides_but_not_through(gl):
    below = Camera(position=(0, 0, -5), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=4.0)
    lamp = PointLight("lamp", WHITE, position=(0, 0, -1.5))
    assert render(gl, [floor()], [lamp], camera=below)[12, 16, 1] == pytest.approx(
        REFLECTANCE / np.pi * 1000 / 1.5**2, rel=0.01
    )
    assert render(gl, [floor()], [lamp], camera=ABOVE).max() == 0


def test_box_filter_over_a_slanted_edge(gl):
    """Coverage of a half-plane with slope 1:3, against polygon areas by fine quadrature."""
    half = quad([[-9, -3, 0], [9, 3, 0], [9, 9, 0], [-9, 9, 0]], Diffuse((0, 0, 0)), "half")
    samples = 64
    share = render(gl, [half], size=(16, 16), samples=samples, background=(1, 1, 1))[..., 1]
    fine = (np.arange(16 * 50) + 0.5) / 50
    x, y = -2 + 4 * fine / 16, 2 - 4 * fine / 16
    covered = (y[:, None] < x[None, :] / 3).reshape(16, 50, 16, 50).mean(axis=(1, 3))
    assert ((covered > 0.02) & (covered < 0.98)).sum() > 15
    assert share == pytest.approx(covered, abs=2.0 / samples)
    # The steepest error a point sample at the centre would make is near a half.
    assert np.abs(render(gl, [half], size=(16, 16), background=(1, 1, 1))[..., 1] - covered).max() > 0.3
