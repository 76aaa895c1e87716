"""The camera's pass against radiances that can be written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.gpu.records import NONE, PLACEMENT, RECEIVER
from app.gpu.scene_buffers import SceneBuffers
from app.model import glass, primitives, spectrum
from app.model.camera_rays import camera_frame
from app.model.colorimetry import rgb709_to_xyz
from app.model.features import Features
from app.model.mesh import make_mesh
from app.model.scene import (
    Absorption,
    Camera,
    Dielectric,
    Diffuse,
    Light,
    Mirror,
    Scene,
    SceneObject,
)
from app.model.settings import RenderSettings
from app.model.spectral_tables import SpectralAxis
from app.passes.eye import CausticMaps, EyePass

REFLECTANCE = 0.5
WHITE = spectrum.illuminant("D65").scaled_to_luminous(1000.0)  # R = G = B = 1000
ABOVE = Camera(position=(0, 0, 10), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=4.0)
DOWN = (0.0, 0.0, -1.0)


def quad(corners, material, name="quad") -> SceneObject:
    return SceneObject(name, make_mesh(name, np.array(corners, float), np.array([[0, 1, 2], [0, 2, 3]])), material)


def horizontal(x0, x1, y0, y1, z, material, name="quad") -> SceneObject:
    return quad([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], material, name)


def floor(half=12.0) -> SceneObject:
    return horizontal(-half, half, -half, half, 0.0, Diffuse((REFLECTANCE,) * 3), "floor")


def eye_pass(gl, objects, lights=(), background=(0.0, 0.0, 0.0), camera=ABOVE, charts=False, **options) -> EyePass:
    scene = Scene("test", camera, tuple(lights), tuple(objects), background)
    features = Features.of(scene, RenderSettings())
    features = replace(features, charts=charts or features.charts)
    axis = SpectralAxis.build([o.material.dispersion for o in objects if isinstance(o.material, Dielectric)])
    return EyePass(gl, SceneBuffers(gl.ctx, scene, features, axis), **options)


def render(gl, objects, lights=(), size=(32, 24), samples=1, camera=ABOVE, maps=None, **options) -> np.ndarray:
    eye = eye_pass(gl, objects, lights, camera=camera, **options)
    assert eye.run(camera, *size, samples, maps=maps)
    rgb = eye.read_rgb()
    eye.scene.release()
    eye.release()
    return rgb


def picture_points(size, camera) -> tuple[np.ndarray, np.ndarray]:
    """Ray origins and unit directions of pixel centres, (H, W, 3), by the textbook."""
    width, height = size
    right, up, forward = camera_frame(camera)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * width / height
    y = 1 - 2 * (np.arange(height) + 0.5) / height
    across = x[None, :, None] * right + y[:, None, None] * up
    position = np.array(camera.position, float)
    if camera.kind == "orthographic":
        return position + 0.5 * camera.vertical_extent * across, np.broadcast_to(forward, across.shape)
    direction = forward + np.tan(np.radians(camera.vertical_fov_deg / 2)) * across
    return np.broadcast_to(position, across.shape), direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def floor_points(size, camera, height=0.0) -> np.ndarray:
    origin, direction = picture_points(size, camera)
    return origin + ((height - origin[..., 2]) / direction[..., 2])[..., None] * direction


def point_light_radiance(points, position, intensity=1000.0) -> np.ndarray:
    way = np.asarray(position) - points
    r2 = (way**2).sum(axis=-1)
    return REFLECTANCE / np.pi * intensity * way[..., 2] / np.sqrt(r2) / r2


TILTED = Camera(position=(1.0, -6.0, 3.5), target=(0.3, 0.2, 0.0), up=(0, 0, 1), vertical_fov_deg=28.0)


@pytest.mark.parametrize("camera", [ABOVE, TILTED, replace(TILTED, kind="orthographic", vertical_extent=3.0)])
def test_lambert_floor_under_a_point_light(gl, camera):
    """Off-centre light and a picture that is not square: every axis of the camera's map counts."""
    light = Light("lamp", "point", WHITE, position=(0.7, -0.4, 1.5))
    rgb = render(gl, [floor()], [light], camera=camera)
    expected = point_light_radiance(floor_points((32, 24), camera), light.position)
    assert rgb[..., 1] == pytest.approx(expected, rel=1e-4)
    assert np.ptp(rgb, axis=-1).max() < 1e-4 * rgb.max()  # D65 is white


@pytest.mark.parametrize("scale, offset", [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e4)])
def test_units_and_origin_of_the_scene_do_not_matter(gl, scale, offset):
    move = np.array([offset, -offset, offset])

    def moved(point):
        return tuple(float(v) for v in np.asarray(point) * scale + move)

    item = floor()
    mesh = make_mesh("floor", item.mesh.vertices * scale + move, item.mesh.triangles)
    light = Light("lamp", "point", WHITE.scaled(scale**2), position=moved((0.7, -0.4, 1.5)))
    camera = replace(TILTED, position=moved(TILTED.position), target=moved(TILTED.target))
    rgb = render(gl, [replace(item, mesh=mesh)], [light], camera=camera)
    expected = point_light_radiance(floor_points((32, 24), TILTED), (0.7, -0.4, 1.5))
    assert rgb[..., 1] == pytest.approx(expected, rel=2e-4)


def test_spot_edge_hard_and_soft(gl):
    points = floor_points((64, 64), ABOVE)
    angle = np.arctan2(np.linalg.norm(points[..., :2], axis=-1), 2.0)
    for inner, outer in ((25.0, 25.0), (15.0, 30.0)):
        light = Light("spot", "spot", WHITE, position=(0, 0, 2), direction=DOWN, inner_half_angle_deg=inner, outer_half_angle_deg=outer)
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
    light = Light("sun", "directional", WHITE, direction=DOWN, angular_diameter_deg=diameter)
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
    light = Light("sun", "directional", WHITE, direction=(np.sin(tilt), 0, -np.cos(tilt)))
    share = render(gl, [floor(), blocker], [light], size=(64, 8), camera=camera)[..., 1] / (REFLECTANCE / np.pi * 1000.0)
    x = floor_points((64, 8), camera)[..., 0]
    expected = np.where(x < np.tan(tilt), np.cos(tilt), 0.0)
    assert share == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_collimated_beam_ends_at_its_aperture(gl, shape):
    light = Light("beam", "collimated", WHITE, position=(0.5, 0.2, 3), direction=DOWN, tangent=(1, 0, 0), shape=shape, radius=0.8, width=1.6, height=0.96)
    rgb = render(gl, [floor()], [light], size=(40, 40))
    x, y = np.moveaxis(floor_points((40, 40), ABOVE)[..., :2] - (0.5, 0.2), -1, 0)
    lit = np.hypot(x, y) < 0.8 if shape == "disc" else (np.abs(x) < 0.8) & (np.abs(y) < 0.48)
    assert rgb[..., 1] == pytest.approx(np.where(lit, REFLECTANCE / np.pi * 1000.0, 0.0), rel=1e-5)


def test_area_disc_lights_the_floor_and_is_seen_from_its_front_only(gl):
    luminance, radius, height = 1000.0, 0.7, 1.0
    light = Light("panel", "area", WHITE, position=(0, 0, height), direction=DOWN, radius=radius)
    camera = replace(ABOVE, position=(0, 0, 0.5), vertical_extent=0.02)
    rgb = render(gl, [floor()], [light], size=(16, 16), samples=64, camera=camera)
    irradiance = np.pi * luminance * radius**2 / (radius**2 + height**2)
    assert rgb[..., 1].mean() == pytest.approx(REFLECTANCE / np.pi * irradiance, rel=3e-3)
    upward = replace(camera, target=(0, 0, 5), vertical_extent=2.0)
    seen = render(gl, [floor()], [light], size=(40, 40), camera=upward)[..., 1]
    assert seen[20, 20] == pytest.approx(luminance, rel=1e-5)
    assert seen.mean() == pytest.approx(luminance * np.pi * radius**2 / 4, rel=0.02)
    behind = render(gl, [floor()], [light], size=(40, 40), camera=ABOVE)[..., 1]
    assert behind.max() < 0.5 * luminance


def test_glass_throws_a_shadow(gl):
    """Light through glass comes back through the caustic map; the direct part must be gone, all of it."""
    solid = SceneObject("cube", primitives.box((1, 1, 0.2)), Dielectric(glass.constant(1.5)), _at(0, 0, 1))
    camera = replace(ABOVE, position=(0, 0, 0.5))
    light = Light("lamp", "point", WHITE, position=(0, 0, 3))
    rgb = render(gl, [floor(), solid], [light], size=(40, 40), camera=camera)[..., 1]
    x, y = np.moveaxis(np.abs(floor_points((40, 40), camera)[..., :2]), -1, 0)
    shadow = np.maximum(x, y) < 0.5 * 3.0 / 1.9  # the upper rim is nearest to the light
    expected = point_light_radiance(floor_points((40, 40), camera), light.position)
    assert rgb == pytest.approx(np.where(shadow, 0.0, expected), rel=1e-4)


def test_a_floor_is_lit_on_both_sides_but_not_through(gl):
    below = Camera(position=(0, 0, -5), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=4.0)
    lamp = Light("lamp", "point", WHITE, position=(0, 0, -1.5))
    assert render(gl, [floor()], [lamp], camera=below)[12, 16, 1] == pytest.approx(REFLECTANCE / np.pi * 1000 / 1.5**2, rel=0.01)
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


def test_launches_accumulate_and_repeat_bit_for_bit(gl, monkeypatch):
    lamp = Light("panel", "area", WHITE, position=(0, 0, 2), direction=DOWN, radius=0.5)
    blocker = horizontal(-0.5, 0.5, -0.5, 0.5, 1.0, Diffuse((0, 0, 0)), "blocker")
    eye = eye_pass(gl, [floor(), blocker], [lamp])
    eye.run(ABOVE, 40, 30, 8)
    first = eye.read_rgb()
    eye.run(ABOVE, 40, 30, 8, sample_offset=8)
    both = eye.read_rgb()
    eye.dispatch_seconds = 0.0  # the fewest rows a dispatch
    eye.run(ABOVE, 40, 30, 8)
    assert np.array_equal(eye.read_rgb(), first)
    eye.run(ABOVE, 40, 30, 8, sample_offset=8)
    assert np.array_equal(eye.read_rgb(), both)
    eye.run(ABOVE, 40, 30, 128)
    converged = eye.read_rgb()
    assert np.abs(both - converged).mean() < 0.85 * np.abs(first - converged).mean()


def test_rows_of_a_dispatch_stay_within_the_picture(gl):
    """They once grew fourfold with every quick sample, until after some 500 of them they were no number any more."""
    eye = eye_pass(gl, [floor()])
    eye.run(ABOVE, 16, 12, 6)
    assert 8 <= eye._rows_a_dispatch <= 16
    eye.release()
    eye.scene.release()


def test_a_stop_keeps_what_is_there(gl):
    eye = eye_pass(gl, [floor()], background=(3, 3, 3), camera=ABOVE)
    seen = []
    eye.run(ABOVE, 32, 32, 1)
    whole = eye.read_rgb()
    eye.dispatch_seconds = 0.0
    eye._rows_a_dispatch = 8
    assert not eye.run(ABOVE, 32, 32, 4, sample_offset=1, progress=seen.append, cancelled=lambda: len(seen) >= 6)
    assert seen == sorted(seen) and len(seen) == 6
    assert np.array_equal(eye.read_rgb(), whole)


# ---- glass and mirrors ----------------------------------------------------------------------


def _at(x, y, z) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def test_slab_before_the_background_has_fresnel_weights(gl):
    slab = SceneObject("slab", primitives.box((8, 8, 0.5)), Dielectric(glass.constant(1.5)))
    rgb = render(gl, [slab], background=(1, 2, 3))
    through, back = (1 - 0.04) ** 2, 0.04
    assert rgb[5, 5] == pytest.approx(np.array([1, 2, 3]) * (through + back), rel=1e-5)


def test_absorption_follows_beers_law(gl):
    alpha = Absorption(np.full(401, 1.3))
    slab = SceneObject("slab", primitives.box((8, 8, 0.5)), Dielectric(glass.constant(1.5), alpha))
    rgb = render(gl, [slab], background=(1, 1, 1))
    assert rgb[5, 5] == pytest.approx(0.96**2 * np.exp(-1.3 * 0.5) + 0.04, rel=1e-4)


def test_a_camera_may_stand_in_glass(gl):
    alpha = Absorption(np.full(401, 1.3))
    slab = SceneObject("slab", primitives.box((8, 8, 0.5)), Dielectric(glass.constant(1.5), alpha))
    camera = replace(ABOVE, position=(0.3, 0.1, 0), target=(0.3, 0.1, 1))
    rgb = render(gl, [slab], background=(1, 1, 1), camera=camera)
    near, across = np.exp(-1.3 * 0.25), np.exp(-1.3 * 0.5)
    assert rgb[5, 5] == pytest.approx(0.96 * near + 0.04 * near * across * 0.96, rel=1e-4)


def test_cemented_solids_have_no_film_of_air(gl):
    """Two touching slabs of n 1.5 and 1.6: the middle surface reflects (0.1/3.1)², not 4 + 5 %."""
    first = SceneObject("low", primitives.box((8, 8, 0.5)), Dielectric(glass.constant(1.5)))
    second = SceneObject("high", primitives.box((8, 8, 0.5)), Dielectric(glass.constant(1.6)), _at(0, 0, 0.5))
    rgb = render(gl, [first, second], background=(1, 1, 1))
    top, middle, bottom = (0.6 / 2.6) ** 2, (0.1 / 3.1) ** 2, 0.04
    assert rgb[5, 5] == pytest.approx((1 - top) * (1 - middle) * (1 - bottom) + top, rel=1e-4)


def test_a_smooth_glass_ball_is_a_lens(gl):
    """Through a smooth ball the ray at height h leaves by δ = 2 (i − r) and lands where optics says."""
    n, height = 1.5168, 2.0
    ball = SceneObject("ball", primitives.sphere(1.0, 20_480), Dielectric(glass.constant(n)), _at(0, 0, height))
    camera = replace(ABOVE, vertical_extent=1.1)
    lamp = Light("lamp", "point", WHITE, position=(2.5, 0, 0.6))
    rgb = render(gl, [floor(), ball], [lamp], size=(24, 24), camera=camera)[..., 1]
    points = floor_points((24, 24), camera)
    h = np.linalg.norm(points[..., :2], axis=-1)
    outward = points[..., :2] / h[..., None]
    i, r = np.arcsin(h), np.arcsin(h / n)
    turn = 2 * (i - r)  # towards the axis
    exit_angle = i - turn  # polar angle of the exit point, on the lower side
    exit_h, exit_z = np.sin(exit_angle), height - np.cos(exit_angle)
    landing = exit_h - exit_z * np.tan(turn)
    lit = np.concatenate([outward * landing[..., None], np.zeros((24, 24, 1))], axis=-1)
    rs, rp = np.sin(i - r) / np.sin(i + r), np.tan(i - r) / np.tan(i + r)
    through = (1 - 0.5 * (rs**2 + rp**2)) ** 2
    visible = h < 0.7
    expected = through * point_light_radiance(lit, lamp.position)
    # 20 480 facets bend the exit point by up to 1e-3 of the radius; what the lamp's shadow ray meets is glass or not.
    unshadowed = visible & (rgb > 0)
    assert unshadowed.sum() > 0.9 * visible.sum()
    assert rgb[unshadowed] == pytest.approx(expected[unshadowed], rel=0.01)


def test_refraction_shifts_what_lies_behind(gl):
    """A point light's floor through a slab seen at 45°: parallel shift by the slab's displacement."""
    slab = SceneObject("slab", primitives.box((30, 30, 1.0)), Dielectric(glass.constant(1.5168)), _at(0, 0, 2.0))
    camera = Camera(position=(0, -8, 10), target=(0, -1, 3), up=(0, 0, 1), kind="orthographic", vertical_extent=1.0)
    lamp = Light("lamp", "point", WHITE, position=(0, 3.0, 0.8))
    rgb = render(gl, [floor(20), slab], [lamp], camera=camera)[..., 1]
    points = floor_points((32, 24), camera)
    inside = np.arcsin(np.sin(np.radians(45)) / 1.5168)
    points[..., 1] += np.tan(inside) - 1.0  # one unit of slab: tan of the angle inside instead of outside
    theta, eta = -np.cos(np.radians(45)), 1 / 1.5168
    omega = np.cos(inside)
    rs = (-eta * theta - omega) / (-eta * theta + omega)
    rp = (-theta - eta * omega) / (-theta + eta * omega)
    through = (1 - 0.5 * (rs**2 + rp**2)) ** 2
    assert rgb == pytest.approx(through * point_light_radiance(points, lamp.position), rel=2e-4)


def test_total_reflection_loses_nothing(gl):
    """A right-angle prism turns the view by 90° with only two Fresnel losses."""
    corners = np.array([[-1, -1, -1], [1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, -1], [-1, 1, 1]], float)
    faces = np.array([[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]])
    prism = SceneObject("prism", make_mesh("prism", corners, faces), Dielectric(glass.constant(1.6)))
    screen = quad([[-4, -6, -6], [-4, 6, -6], [-4, 6, 6], [-4, -6, 6]], Mirror((0, 0, 0)), "black mirror")
    camera = Camera(position=(0, 0, -10), target=(0, 0, 0), up=(0, 1, 0), kind="orthographic", vertical_extent=1.0)
    background = render(gl, [prism], camera=camera, background=(1, 1, 1))[..., 1]
    r = (0.6 / 2.6) ** 2
    assert background == pytest.approx((1 - r) ** 2 + r, rel=1e-4)
    # It looks towards -x, where the black mirror now stands: only the first reflection is left.
    turned = render(gl, [prism, screen], camera=camera, background=(1, 1, 1))[..., 1]
    assert turned == pytest.approx(r, rel=1e-3)


def test_mirrors_chain_and_tint(gl):
    tilted = quad([[-3, -3, -3], [3, -3, 3], [3, 3, 3], [-3, 3, -3]], Mirror((0.9, 0.5, 0.25)), "first")
    facing = quad([[-6, -9, -9], [-6, 9, -9], [-6, 9, 9], [-6, -9, 9]], Mirror((1.0, 0.5, 1.0)), "second")
    rgb = render(gl, [tilted, facing], background=(1, 1, 1))
    assert rgb[12, 16] == pytest.approx([0.81, 0.125, 0.0625], rel=1e-5)


def test_the_sun_glints_in_a_mirror(gl):
    flat = horizontal(-6, 6, -6, 6, 0, Mirror((0.5, 0.5, 0.5)), "mirror")
    sun = Light("sun", "directional", WHITE, direction=DOWN, angular_diameter_deg=2.0)
    camera = Camera(position=(0, 0, 4), target=(0, 0, 0), up=(0, 1, 0), vertical_fov_deg=4.0)
    rgb = render(gl, [flat], [sun], size=(48, 48), camera=camera)[..., 1]
    solid_angle = np.pi * np.sin(np.radians(1.0)) ** 2
    assert rgb[24, 24] == pytest.approx(0.5 * 1000 / solid_angle, rel=1e-4)
    # Radiance over the picture adds up to the reflected irradiance.
    pixel = (2 * np.tan(np.radians(2.0)) / 48) ** 2
    assert rgb.sum() * pixel == pytest.approx(0.5 * 1000, rel=0.02)


# ---- caustic maps ---------------------------------------------------------------------------


def flat_maps(gl, scene: SceneBuffers, windows, channels: np.ndarray, scale=1.0) -> CausticMaps:
    """Maps of one flat receiver: `windows` are (x0, y0, world side, atlas x, atlas y, texels a side), finest first."""
    placements = PLACEMENT.zeros(len(windows))
    placements["blurred"] = NONE
    for i, (x0, y0, side, ax, ay, count) in enumerate(windows):
        per_unit = count / side
        to_world = 1.0 / scene.space.scale  # rows act on GPU space
        placements[i]["row_u"] = per_unit * to_world, 0, 0, ax + per_unit * (scene.space.centre[0] - x0)
        placements[i]["row_v"] = 0, per_unit * to_world, 0, ay + per_unit * (scene.space.centre[1] - y0)
        placements[i]["rect"] = ax, ay, ax + count, ay + count
        placements[i]["texel_area"] = 1 / per_unit**2
        placements[i]["next"] = i + 1 if i + 1 < len(windows) else NONE
    receivers = RECEIVER.zeros(1)
    receivers["reflectance_rgb"] = REFLECTANCE
    height, width = channels.shape[:2]
    textures = [gl.ctx.texture((width, height), 4, np.ascontiguousarray(channels[..., 4 * t : 4 * t + 4], np.float32).tobytes(), dtype="f4")
                for t in range(channels.shape[2] // 4)]
    return CausticMaps(textures, gl.ctx.buffer(receivers.tobytes()), gl.ctx.buffer(placements.tobytes()), scale)


def white_texels(luminous: np.ndarray) -> np.ndarray:
    """XYZW texels (H, W, 4) of D65 with the given lumens."""
    xyz = rgb709_to_xyz(luminous[..., None] * np.ones(3))
    return np.concatenate([xyz, luminous[..., None] / 200], axis=-1)


@pytest.mark.parametrize("layer", ["beauty", "caustic"])
def test_nested_windows_show_the_finest_map_that_covers_a_place(gl, layer):
    eye = eye_pass(gl, [floor(), SceneObject("far glass", primitives.box((1, 1, 1)), Dielectric(glass.constant(1.5)), _at(40, 3, 0))], layer=layer)
    rng = np.random.default_rng(5)
    lumens = rng.uniform(1, 2, (16, 24))
    # A fine window of 8² texels over [-0.5, 0.5]², a coarse one of 6² over [-1.5, 1.5]².
    maps = flat_maps(gl, eye.scene, [(-0.5, -0.5, 1.0, 1, 2, 8), (-1.5, -1.5, 3.0, 12, 5, 6)], white_texels(lumens), scale=0.5)
    size = (64, 64)
    eye.run(ABOVE, *size, 1, maps=maps)
    rgb = eye.read_rgb()
    x, y = np.moveaxis(floor_points(size, ABOVE)[..., :2], -1, 0)

    def bilinear(u, v, ax, ay, count):
        u, v = np.clip(u - 0.5, 0, count - 1), np.clip(v - 0.5, 0, count - 1)
        i, j = np.minimum(u.astype(int), count - 2), np.minimum(v.astype(int), count - 2)
        tile = lumens[ay : ay + count, ax : ax + count]
        fu, fv = u - i, v - j
        return (tile[j, i] * (1 - fu) + tile[j, i + 1] * fu) * (1 - fv) + (tile[j + 1, i] * (1 - fu) + tile[j + 1, i + 1] * fu) * fv

    fine = bilinear((x + 0.5) * 8, (y + 0.5) * 8, 1, 2, 8) * 64
    coarse = bilinear((x + 1.5) * 2, (y + 1.5) * 2, 12, 5, 6) * 4
    inside_fine, inside = np.maximum(abs(x), abs(y)) < 0.5, np.maximum(abs(x), abs(y)) < 1.5
    expected = 0.5 * REFLECTANCE / np.pi * np.where(inside_fine, fine, np.where(inside, coarse, 0.0))
    # Clamping the coordinate or the texels is the same thing at the border; 1e-3 is for half-texel rounding.
    assert rgb[..., 1] == pytest.approx(expected, rel=1e-3)


def test_charts_have_a_placement_a_triangle(gl):
    """A receiver of two triangles whose charts lie apart in the atlas, after another object's triangles."""
    blocker = horizontal(50, 51, 50, 51, 1, Diffuse((0, 0, 0)), "elsewhere")
    eye = eye_pass(gl, [blocker, horizontal(-2, 2, -2, 2, 0, Diffuse((REFLECTANCE,) * 3))], charts=True)
    lumens = np.zeros((16, 40))
    lumens[2:10, 2:10], lumens[5:13, 20:28] = 1.0, 3.0
    maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 2, 2, 8), (-2, -2, 4.0, 20, 5, 8)], white_texels(lumens))
    placements = np.frombuffer(maps.placements.read(), PLACEMENT.dtype).copy()
    placements["kind"], placements["next"] = 1, NONE
    maps.placements.write(placements.tobytes())
    receivers = RECEIVER.zeros(2)
    receivers["placement"] = NONE, 0
    receivers["kind"] = 0, 1
    receivers["first_triangle"] = 0, 2
    maps = replace(maps, receivers=gl.ctx.buffer(receivers.tobytes()))
    eye.run(ABOVE, 32, 32, 1, maps=maps)
    x, y = np.moveaxis(floor_points((32, 32), ABOVE)[..., :2], -1, 0)
    expected = REFLECTANCE / np.pi * np.where(y < x, 1.0, 3.0) * 4
    off_diagonal = np.abs(x - y) > 1e-6
    assert eye.read_rgb()[..., 1][off_diagonal] == pytest.approx(expected[off_diagonal], rel=1e-5)


def test_small_texels_are_averaged_by_the_pixel_and_keep_their_energy(gl):
    eye = eye_pass(gl, [floor()])
    lumens = np.zeros((256, 256))
    lumens[100, 37] = 3.0  # one focus
    maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 0, 0, 256)], white_texels(lumens))
    eye.run(ABOVE, 32, 32, 64, maps=maps)
    rgb = eye.read_rgb()[..., 1]
    pixel_area = (4 / 32) ** 2
    # The samples' shares of the pixel do not quite tile it: one texel of 64 is weighed to a few per cent.
    assert rgb.sum() * pixel_area * np.pi / REFLECTANCE == pytest.approx(3.0, rel=0.05)
    assert np.count_nonzero(rgb) == 1 and rgb[31 - 100 // 8, 37 // 8] > 0


def test_samples_weigh_texels_by_their_share_of_the_pixel(gl):
    """Pixels of 2.3 texels, every texel different: 16 samples give the box-filtered map to 6 %, its mean to half a per cent."""
    eye = eye_pass(gl, [floor()])
    rng = np.random.default_rng(3)
    lumens = rng.uniform(0.0, 1.0, (74, 74)) ** 4
    maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 0, 0, 74)], white_texels(lumens))
    eye.run(ABOVE, 32, 32, 16, maps=maps)
    edges = np.linspace(0, 74, 33)
    share = np.clip(np.minimum(edges[1:, None], np.arange(1, 75)) - np.maximum(edges[:-1, None], np.arange(74)), 0, None)
    expected = (share @ lumens @ share.T)[::-1] / (4 / 32) ** 2 * REFLECTANCE / np.pi
    got = eye.read_rgb()[..., 1]
    assert np.sqrt(np.mean((got - expected) ** 2)) < 0.06 * expected.mean()
    assert got.mean() == pytest.approx(expected.mean(), rel=5e-3)


def test_caustic_layer_has_no_direct_light_and_beauty_adds_it(gl):
    lamp = Light("lamp", "point", WHITE, position=(0, 0, 1.5))
    pictures = {}
    for layer in ("beauty", "caustic"):
        eye = eye_pass(gl, [floor()], [lamp], layer=layer, background=(5, 5, 5))
        maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 0, 0, 4)], white_texels(np.full((4, 4), 7.0)))
        eye.run(ABOVE, 16, 16, 1, maps=maps)
        pictures[layer] = eye.read_rgb()[..., 1]
    assert pictures["caustic"] == pytest.approx(REFLECTANCE / np.pi * 7.0, rel=1e-5)
    direct = point_light_radiance(floor_points((16, 16), ABOVE), lamp.position)
    assert pictures["beauty"] - pictures["caustic"] == pytest.approx(direct, rel=1e-3)


def test_spectral_bins(gl):
    """Six bins over two targets: map and light land in their bins and give the same white as XYZ does."""
    edges = np.array([380.0, 450.0, 500.0, 550.0, 600.0, 650.0, 780.0])
    lamp = Light("lamp", "point", spectrum.laser(532.0, 2.0), position=(0, 0, 2))
    eye = eye_pass(gl, [floor()], [lamp], bin_edges_nm=edges)
    energy = np.zeros((4, 4, 8))
    energy[..., :6] = [1, 2, 3, 4, 5, 6]
    maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 0, 0, 4)], energy)
    eye.run(ABOVE, 16, 16, 1, maps=maps)
    bins = eye.read_spectral()
    assert bins.shape == (16, 16, 6)
    direct = point_light_radiance(floor_points((16, 16), ABOVE), lamp.position, 2.0)
    expected = REFLECTANCE / np.pi * np.array([1, 2, 3, 4, 5, 6]) * np.ones((16, 16, 1))
    expected[..., 2] += direct
    assert bins == pytest.approx(expected, rel=1e-4)
    assert eye.read_rgb().shape == (16, 16, 3)


def test_a_bin_is_shown_in_its_own_colour(gl):
    from app.passes.present import Channels

    edges = tuple(np.linspace(380, 780, 33))
    channels = Channels(edges)
    white = channels.of_light(WHITE, None)
    assert channels.to_rgb709(white) == pytest.approx([1000, 1000, 1000], rel=0.02)
    background = channels.to_rgb709(channels.of_background((1.0, 1.0, 1.0)))
    assert background == pytest.approx([1, 1, 1], rel=0.02)


def test_spectral_reflectance_class_acts_on_direct_light(gl):
    red_only = np.where(np.arange(380, 781) > 600, 1.0, 0.0)
    item = replace(floor(), material=Diffuse(reflectance=red_only))
    eye = eye_pass(gl, [item], [Light("lamp", "point", WHITE, position=(0, 0, 1.5))], reflectances=(None, red_only))
    maps = flat_maps(gl, eye.scene, [(-2, -2, 4.0, 0, 0, 4)], white_texels(np.zeros((4, 4))))
    receivers = RECEIVER.zeros(1)
    receivers["reflectance_class"] = 1
    maps.receivers.write(receivers.tobytes())
    eye.run(ABOVE, 17, 17, 1, maps=maps)
    expected = spectrum.xyz_to_rgb709(spectrum.Spectrum(WHITE.density * red_only).xyz()) / np.pi / 1.5**2
    assert expected[0] > 20 * expected[2] > 0 or expected[2] <= 0
    assert eye.read_rgb()[8, 8] == pytest.approx(expected, rel=1e-3)
