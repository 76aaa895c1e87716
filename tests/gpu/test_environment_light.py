"""The environment lights what is diffuse: closed forms, a furnace, invariance, and what the viewer keeps of it."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from reference.form_factors import form_factor, rectangle
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.parameters import Stage
from spectrasplat.gpu.context import Context
from spectrasplat.model.environment import constant, gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives import sphere
from spectrasplat.model.materials import Absorption
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Black, Camera, Dielectric, Diffuse, Material, Mirror, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.passes.environment_light import EnvironmentLightPass
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.render.viewer.live_camera import LiveCamera
from spectrasplat.render.viewer.schedule import Schedule

CAMERA = Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.3))
WHITE = constant((1.0, 1.0, 1.0))
SETTINGS = RenderSettings(width=48, height=32, spp=4, photons=2000)
CROWN = from_abbe(1.5168, 64.2)


def place(mesh, material: Material, at=(0.0, 0.0, 0.0), name: str = "thing", turn: np.ndarray | None = None):
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return SceneObject(name, mesh, material, matrix if turn is None else turn @ matrix)


def scene_of(
    *objects: SceneObject, environment: Environment | None = WHITE, lights=(), camera: Camera = CAMERA
) -> Scene:
    return Scene("lit", camera, tuple(lights), objects, environment=environment)


def floor(side: float = 6.0, material: Material | None = None, turn: np.ndarray | None = None) -> SceneObject:
    return place(primitives.plane(side, side), material or Diffuse((0.5, 0.5, 0.5)), name="floor", turn=turn)


def asked(gl: Context, scene: Scene, directions: int = 512, portion: int | None = None, finer: float = 1.0):
    """(places in the world, normals, irradiance over π) of a scene's receivers."""
    buffers = scene_buffers(gl, scene, SETTINGS)
    light = EnvironmentLightPass(gl, buffers, directions=directions, finer=finer)
    try:
        if portion is not None:
            light._budget.units = light._budget.most = portion
        for _ in light.steps():
            pass
        places = light.places.places
        position = buffers.space.to_world(places["position"])
        return position, light.places.normals, places["object"], light.irradiance() / math.pi
    finally:
        light.release()
        buffers.release()


@pytest.fixture(scope="module")
def under_ball(gl: Context):
    """A black ball above a floor under a uniform sky."""
    return asked(gl, scene_of(place(sphere(0.5, 8000), Black(), (0.0, 0.0, 1.0)), floor()), 2048)


def test_a_balls_shadow_is_one_minus_its_form_factor(under_ball) -> None:
    position, normal, _, light = under_ball
    above = normal[:, 2] > 0.5
    distance = np.linalg.norm(position[above] - [0.0, 0.0, 1.0], axis=1)
    expected = 1.0 - (0.5 / distance) ** 2 / distance  # (r/d)² cos θ, wholly above the horizon
    error = light[above, 0] - expected
    assert abs(error.mean()) < 5e-4
    assert np.sqrt((error**2).mean()) < 2.5e-3 and abs(error).max() < 0.02
    assert expected.min() < 0.76  # the shadow is deep


def test_a_side_that_sees_nothing_dark_sees_all_of_the_sky(under_ball) -> None:
    _, normal, _, light = under_ball
    np.testing.assert_allclose(light[normal[:, 2] < -0.5], 1.0, atol=5e-4)


def test_a_closed_room_is_dark_and_an_open_convex_thing_unshadowed(gl: Context) -> None:
    room = place(primitives.box((4.0, 4.0, 4.0)), Black(), name="room")
    _, _, _, inside = asked(gl, scene_of(room, floor(1.0)), 64)
    assert inside.max() == 0.0
    _, _, _, alone = asked(gl, scene_of(place(sphere(0.5, 320), Diffuse((1.0, 1.0, 1.0)))), 64)
    np.testing.assert_allclose(alone, 1.0, atol=5e-4)


@pytest.mark.parametrize("material", [Dielectric(CROWN), Mirror((1.0, 1.0, 1.0))], ids=["glass", "mirror"])
def test_in_a_furnace_lossless_things_cast_no_shadow(gl: Context, material: Material) -> None:
    """White light from everywhere: what glass and mirrors take from one direction they bring from another. The receiver
    is so small that hardly any of it is itself what they show."""
    thing = place(sphere(0.5, 8000), material, (0.0, 0.0, 0.7))
    _, normal, _, light = asked(gl, scene_of(thing, floor(0.02)), 4096, finer=0.02)
    above = light[normal[:, 2] > 0.5]
    assert abs(above.mean() - 1.0) < 1e-3


def test_tinted_glass_takes_its_share(gl: Context) -> None:
    """A slab over all of the sky but a rim: what comes through lost what Beer's law says."""
    half = Absorption(np.full(401, math.log(2.0) / 0.1))
    clear, tinted = Dielectric(CROWN), Dielectric(CROWN, half)
    lit = []
    for material in (clear, tinted):
        slab = place(primitives.box((40.0, 40.0, 0.1)), material, (0.0, 0.0, 0.2))
        _, normal, _, light = asked(gl, scene_of(slab, floor(0.02)), 4096, finer=0.02)
        lit.append(light[normal[:, 2] > 0.5].mean())
    # Refracted into the critical cone, light goes up to a third farther than straight through.
    assert lit[0] == pytest.approx(1.0, abs=2e-3)
    assert 0.42 < lit[1] / lit[0] < 0.5


def picture(gl: Context, scene: Scene, settings: RenderSettings = SETTINGS) -> np.ndarray:
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, settings, [stage])
    try:
        return renderer.run(stage).astype(float)
    finally:
        renderer.release()


SKY = gradient((0.2, 0.5, 2.0), (1.0, 0.9, 0.8), (0.3, 0.1, 0.1))


def test_a_white_thing_vanishes_in_a_white_furnace(gl: Context) -> None:
    camera = replace(CAMERA, target=(0.0, 0.0, 0.0), vertical_fov_deg=12.0)
    ball = place(sphere(0.5, 1280), Diffuse((1.0, 1.0, 1.0)))
    shown = picture(gl, scene_of(ball, camera=camera))
    np.testing.assert_allclose(shown, 1.0, atol=1e-3)


@pytest.mark.slow
def test_turning_everything_changes_nothing(gl: Context) -> None:
    angle = math.radians(50.0)
    turn = np.eye(4)
    turn[:3, :3] = rotation_about((0.0, 0.0, 1.0), angle)
    ball = sphere(0.4, 1280)

    def lit(matrix: np.ndarray) -> np.ndarray:
        around = replace(SKY, world_to_local=SKY.world_to_local @ matrix[:3, :3].T)
        camera = replace(CAMERA, position=tuple(matrix[:3, :3] @ CAMERA.position))
        things = place(ball, Diffuse((0.7, 0.6, 0.2)), (0.6, 0.1, 0.5), turn=matrix), floor(turn=matrix)
        return picture(gl, scene_of(*things, environment=around, camera=camera))

    before, after = lit(np.eye(4)), lit(turn)
    assert np.abs(before - after).mean() / before.mean() < 0.004


def test_how_many_directions_are_asked_at_once_changes_nothing(gl: Context) -> None:
    scene = scene_of(place(sphere(0.3, 320), Dielectric(CROWN), (0.0, 0.0, 0.5)), floor(), environment=SKY)
    one, other = (asked(gl, scene, 64, portion)[3] for portion in (4, 16))
    np.testing.assert_array_equal(one, other)


def test_a_scene_says_whether_its_environment_lights(gl: Context) -> None:
    scene = scene_of(floor(), environment=SKY)
    dark = picture(gl, replace(scene, environment=replace(SKY, lights=False)))
    below = slice(24, 32)  # where the floor is
    assert dark[below].max() < 1e-5
    lit = picture(gl, scene)[below]
    # ∫ over the upper half of the blend s²(3 − 2s), cosine-weighted: 2 ∫ s (s²(3 − 2s)) ds = 7/10.
    expected = 0.5 * (0.7 * np.array([0.2, 0.5, 2.0]) + 0.3 * np.array([1.0, 0.9, 0.8]))
    np.testing.assert_allclose(lit.mean(axis=(0, 1)), expected, rtol=3e-3)


ANGLES = 2.0 * np.pi * np.arange(96) / 96
COIN = primitives.disc(1.0), 0.0, np.stack([np.cos(ANGLES), np.sin(ANGLES), 0.0 * ANGLES], axis=1)
BLOCK = primitives.box((2.0, 2.0, 1.0)), 1.0, rectangle((-1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))


@pytest.mark.parametrize(
    ("thing", "gap", "side"),
    [(COIN, 0.001, 200.0), (BLOCK, 0.0, 30.0), (BLOCK, -0.01, 200.0)],
)
def test_no_halo_is_about_what_stands_on_a_wide_floor_or_just_above(gl: Context, thing, gap, side) -> None:
    (mesh, height, foot), view, size, rows = thing, 8.0, 160, 8
    fov = math.degrees(2.0 * math.atan(view / 120.0 * rows / size))
    camera = Camera((0.0, 0.0, 60.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), vertical_fov_deg=fov)
    item = place(mesh, Diffuse((0.9,) * 3), (0.0, 0.0, gap + 0.5 * height))
    scene = scene_of(item, floor(side, Diffuse((1.0, 1.0, 1.0))), camera=camera)
    shown = picture(gl, scene, replace(SETTINGS, width=size, height=rows))[rows // 2, :, 1]
    x = ((np.arange(size) + 0.5) / size - 0.5) * view
    beside = x > 1.06
    at, up, low = np.c_[x, 0.0 * x, 0.0 * x][beside], np.array([[0.0, 0.0, 1.0]]), max(gap, 0.0)
    expected = np.ones(len(at)) - (form_factor(at, up, foot + [0.0, 0.0, gap]) if gap > 0.0 else 0.0)
    if height:
        expected -= form_factor(at, up, rectangle((1.0, -1.0, low), (0.0, 2.0, 0.0), (0.0, 0.0, gap + height - low)))
    np.testing.assert_allclose(shown[beside], expected, atol=0.022)
    assert abs((shown[beside] - expected)[-size // 4 :].mean()) < 4e-3  # no window's border shows


@pytest.mark.parametrize("hurries", ["is_becoming_whole", "is_paused"])
def test_the_rest_of_it_waits_for_a_picture_that_becomes_whole(
    gl: Context, monkeypatch: pytest.MonkeyPatch, hurries: str
) -> None:
    """Each time that more was known the picture began anew, and had two thirds of the frames in between."""
    scene = scene_of(place(sphere(0.4, 320), Diffuse((0.5, 0.5, 0.5)), (0.0, 0.0, 0.5)), floor(), environment=SKY)
    engine = LiveEngine(gl)
    engine.target_photons, engine.camera_samples = 1000, 2
    does = {"hurry": True}
    try:
        truly = getattr(LiveCamera, hurries).fget
        monkeypatch.setattr(LiveCamera, hurries, property(lambda camera: does["hurry"] or truly(camera)))
        if hurries == "is_paused":
            # Maps are awaited as long as photons for them are.
            monkeypatch.setattr(Schedule, "has_photon_work", property(lambda _: does["hurry"]))
        engine.set(LiveInputs(scene, CAMERA, 48, 32))
        until = time.monotonic() + 60.0
        while engine._shown is None and time.monotonic() < until:
            engine.advance(0.05)
        assert engine._shown is not None
        light = engine._shown.light.environment
        known = light.asked
        assert 0 < light.shown <= known < light.total
        for _ in range(5):
            engine.advance(0.05)
        assert light.asked == known and not engine.is_idle
        # Another one is asked for its first light all the same, and all of it once nothing hurries any more.
        engine.set(LiveInputs(replace(scene, environment=gradient(*[(1.0, 0.0, 0.0)] * 3)), CAMERA, 48, 32))
        for _ in range(5):
            engine.advance(0.05)
        if hurries == "is_becoming_whole":
            assert 0 < light.shown <= light.asked < light.total
        does["hurry"] = False
        while not engine.is_idle and time.monotonic() < until:
            engine.advance(0.05)
        assert light.is_done and light.shown == light.total
    finally:
        engine.release()
