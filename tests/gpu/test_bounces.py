"""Diffuse surfaces light each other: closed forms of rooms and plates, a furnace, colours, what the viewer redoes."""

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
from spectrasplat.model.environment import constant
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight, DirectionalLight, PointLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Mirror, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Texture
from spectrasplat.passes.bounce_light import BounceLightPass
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.viewer.engine import LiveEngine

CAMERA = Camera((0.0, -2.0, 0.8), (0.0, 0.5, 0.3))
SETTINGS = RenderSettings(width=48, height=32, spp=4, photons=2000)
LUX = 100.0
DAYLIGHT = illuminant("D65").scaled_to_luminous(LUX)
CROWN = from_abbe(1.5168, 64.2)
UPRIGHT = rotation_about((1.0, 0.0, 0.0), math.radians(90.0))
WALL_Y = 0.5


def place(mesh, material, at=(0.0, 0.0, 0.0), name: str = "thing", turn: np.ndarray | None = None) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if turn is None else turn
    matrix[:3, 3] = at
    return SceneObject(name, mesh, material, matrix)


def scene_of(*objects: SceneObject, lights=(), bounces: int = 1, **more) -> Scene:
    return Scene("bounces", CAMERA, tuple(lights), objects, render=RenderDefaults(bounces=bounces), **more)


def corner(floor=(0.8, 0.8, 0.8), wall=(0.5, 0.5, 0.5), bounces: int = 1) -> Scene:
    """A floor in light straight from above, which the upright wall at its edge gets none of."""
    things = (
        place(primitives.plane(2.0, 1.0), Diffuse(floor), name="floor"),
        place(primitives.plane(2.0, 1.0), Diffuse(wall), (0.0, WALL_Y, 0.5), "wall", UPRIGHT),
    )
    return scene_of(*things, lights=[DirectionalLight("above", DAYLIGHT, direction=(0.0, 0.0, -1.0))], bounces=bounces)


def found(gl: Context, scene: Scene, directions: int, finer: float = 0.1, uniform: bool = False):
    """(places in the world, normals, objects, radiosity by other light, irradiance by bounces); `uniform`: as if all
    sent out a radiance of 1 instead."""
    buffers = scene_buffers(gl, scene, SETTINGS)
    light = BounceLightPass(gl, buffers, None, directions=directions, finer=finer)
    try:
        if uniform:
            light.sources.radiosity = lambda *_: np.full((len(light.places.places), 3), math.pi)  # type: ignore[method-assign]
        light.take(scene)
        for _ in light.steps():
            pass
        places = light.places.places
        own = light.sources.radiosity(scene, None)
        return (
            buffers.space.to_world(places["position"]),
            light.places.normals,
            places["object"],
            own,
            light.irradiance(),
        )
    finally:
        light.release()
        buffers.release()


@pytest.mark.parametrize("bounces", [1, 3])
def test_an_integrating_sphere_gives_every_bounce_once_more(gl: Context, bounces: int) -> None:
    """A lamp in the middle of a sphere: the same light falls everywhere, and after each bounce ρ times as much."""
    rho = np.array([0.9, 0.5, 0.2])
    room = place(primitives.sphere(1.0, 1280), Diffuse(tuple(rho)), name="room")
    lamp = PointLight("lamp", DAYLIGHT, (0.0, 0.0, 0.0))
    at, normal, _, own, light = found(gl, scene_of(room, lights=[lamp], bounces=bounces), 64, finer=1.0)
    inside = (normal * at).sum(axis=1) < 0.0
    assert inside.sum() > 200
    np.testing.assert_allclose(own[inside].mean(axis=0), LUX * rho, rtol=6e-3)  # facets lie inside the sphere
    expected = own[inside].mean(axis=0) * sum(rho**k for k in range(bounces))
    np.testing.assert_allclose(light[inside].mean(axis=0), expected, rtol=1e-3)
    assert light[~inside].max() < 1e-6 * light.max()


@pytest.fixture(scope="module")
def two_bounces(gl: Context):
    """Of the corner."""
    return found(gl, corner(bounces=2), 1024)


def test_a_lit_floor_lights_the_wall_by_its_form_factor(gl: Context) -> None:
    at, normal, thing, own, light = found(gl, corner(), 1024)
    np.testing.assert_allclose(own[(thing == 0) & (normal[:, 2] > 0.5)], 0.8 * LUX, rtol=1e-4)
    facing = (thing == 1) & (normal[:, 1] < -0.5)
    floor = rectangle((-1.0, -0.5, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    expected = 0.8 * LUX * form_factor(at[facing], normal[facing], floor)
    error = light[facing, 1] / expected - 1.0
    assert abs(error.mean()) < 1e-3 and np.sqrt((error**2).mean()) < 4e-3
    assert light[thing == 0].max() < 1e-6 * LUX  # the wall is dark before
    behind = (thing == 1) & ~facing
    assert light[behind].max() < 1e-6 * LUX


def test_the_wall_lights_the_floor_in_turn(two_bounces) -> None:
    at, normal, thing, _, light = two_bounces
    above = (thing == 0) & (normal[:, 2] > 0.5) & (at[:, 1] < 0.4)
    floor = rectangle((-1.0, -0.5, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    expected, side = np.zeros(above.sum()), 0.05
    for x in np.arange(-1.0, 1.0 - 1e-9, side):
        for z in np.arange(0.0, 1.0 - 1e-9, side):
            part = rectangle((x, WALL_Y, z), (side, 0.0, 0.0), (0.0, 0.0, side))
            middle = np.array([[x + 0.5 * side, WALL_Y, z + 0.5 * side]])
            arrived = 0.8 * LUX * form_factor(middle, np.array([[0.0, -1.0, 0.0]]), floor)
            expected += 0.5 * arrived * form_factor(at[above], normal[above], part)
    error = light[above, 1] / expected - 1.0
    assert abs(error.mean()) < 2e-3 and np.sqrt((error**2).mean()) < 1e-2


def test_the_floor_colours_the_wall(gl: Context) -> None:
    grey, red = (found(gl, corner(floor), 64)[4] for floor in ((0.5, 0.5, 0.5), (0.5, 0.25, 0.0)))
    np.testing.assert_allclose(red, grey * [1.0, 0.5, 0.0], atol=1e-3 * grey.max())


@pytest.mark.parametrize(
    "material",
    [Dielectric(CROWN), Dielectric(CROWN, roughness=0.7), Mirror((1.0, 1.0, 1.0))],
    ids=["glass", "ground glass", "mirror"],
)
def test_in_a_furnace_everything_gets_the_same(gl: Context, material) -> None:
    """Walls of radiance 1 all round: what lossless glass and mirrors hide of them they show elsewhere, so that every
    place gets π, once."""
    room = place(primitives.box((2.0, 2.0, 2.0)), Diffuse((1.0, 1.0, 1.0)), name="room")
    ball = place(primitives.sphere(0.45, 5000), material, (0.2, 0.1, -0.1), "ball")
    plate = place(primitives.plane(0.8, 0.8), Diffuse((1.0, 1.0, 1.0)), (-0.3, 0.0, -0.7), "plate")
    lamp = PointLight("lamp", DAYLIGHT, (0.0, 0.0, 0.8))
    at, normal, thing, _, light = found(gl, scene_of(room, ball, plate, lights=[lamp]), 256, finer=0.05, uniform=True)
    inside = (thing != 0) | ((normal * at).sum(axis=1) < 0.0)
    assert abs(light[inside].mean() / math.pi - 1.0) < 2e-3
    assert abs(light[inside] / math.pi - 1.0).max() < 0.2


@pytest.mark.slow
def test_a_ball_that_stands_on_the_floor_changes_little_when_it_is_raised(gl: Context) -> None:
    """A curved solid in contact has rules of its own for what rays cross there."""

    def on_the_wall(height: float) -> float:
        ball = place(primitives.sphere(0.2, 5000), Dielectric(CROWN), (0.0, 0.1, 0.2 + height), "ball")
        _, _, thing, _, light = found(gl, scene_of(*corner().objects, ball, lights=corner().lights), 256)
        return light[thing == 1].mean()

    assert on_the_wall(0.0) == pytest.approx(on_the_wall(0.01), rel=5e-3)


def by_a_mirror() -> Scene:
    """A beam goes by way of a mirror to a patch of the floor."""
    beam = CollimatedLight(
        "beam", DAYLIGHT, (0.0, -3.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), "rectangle", 1.0, 0.4, 0.2
    )
    tilt = rotation_about((1.0, 0.0, 0.0), math.radians(135.0))
    mirror = place(primitives.plane(0.6, 0.6), Mirror((1.0, 1.0, 1.0)), (0.0, 0.0, 1.0), "mirror", tilt)
    return scene_of(*corner((0.8, 0.6, 0.4)).objects, mirror, lights=[beam])


def test_maps_in_bins_hand_on_the_same_light(gl: Context) -> None:
    """Of a rendering in spectral bins, too, surfaces send out what the maps hold, in colour."""
    scene, found = by_a_mirror(), []
    for bins in (None, 32):
        renderer = FrameRenderer(gl, replace(SETTINGS, photons=20_000, bins=bins), [Stage(scene, scene.camera)])
        try:
            renderer.run(Stage(scene, scene.camera))
            assert renderer.traced.bounces is not None
            found.append(
                (renderer.traced.bounces.sources.radiosity(scene, None).sum(axis=0), renderer.picture.rgb.sum())
            )
        finally:
            renderer.release()
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=0.02)
    assert found[1][1] == pytest.approx(found[0][1], rel=0.03)


def test_what_a_mirror_throws_on_a_floor_lights_the_wall(gl: Context) -> None:
    """Through the caustic maps, and from there on."""
    scene = by_a_mirror()
    renderer = FrameRenderer(gl, replace(SETTINGS, photons=40_000), [Stage(scene, scene.camera)])
    try:
        renderer.run(Stage(scene, scene.camera))
        bounces = renderer.traced.bounces
        assert bounces is not None
        at, normal = renderer.light.buffers.space.to_world(bounces.places.places["position"]), bounces.places.normals
        own = bounces.sources.radiosity(scene, None)
        light, thing, areas = bounces.irradiance(), bounces.places.places["object"], bounces.places.areas
    finally:
        renderer.release()
    floor = (thing == 0) & bounces.places.on_top & (normal[:, 2] > 0.5)
    share = (own[floor, 1] * areas[floor]).sum() / areas[floor].sum()
    assert share * 2.0 == pytest.approx(0.6 * LUX * 0.08, rel=0.01)  # the floor is 2 unit², the patch 0.08
    assert own[(thing == 0) & (normal[:, 2] < -0.5)].max() == 0.0  # its underside has none of it
    facing = (thing == 1) & (normal[:, 1] < -0.5)
    patch = rectangle((-0.2, -0.1, 0.0), (0.4, 0.0, 0.0), (0.0, 0.2, 0.0))
    straight = 0.6 * LUX * form_factor(at[facing], normal[facing], patch)
    # The mirror hides nothing of the patch from the lower part of the wall, and shows it the floor's dark rest.
    low = at[facing, 2] < 0.3
    error = light[facing, 1][low] / straight[low] - 1.0
    assert abs(error.mean()) < 0.02 and np.sqrt((error**2).mean()) < 0.03


def test_a_picture_that_is_worn_counts(gl: Context) -> None:
    rgb = np.zeros((8, 16, 3), np.float32)
    rgb[:, :8, 0], rgb[:, 8:, 2] = 1.0, 0.5
    scene = corner()
    worn = replace(scene.objects[0], material=Diffuse((1.0, 1.0, 1.0), texture=Texture(rgb)))
    at, normal, thing, own, _ = found(gl, replace(scene, objects=(worn, scene.objects[1])), 4)
    above = (thing == 0) & (normal[:, 2] > 0.5)
    left, right = (own[above & (side * at[:, 0] > 0.3) & (abs(at[:, 0]) < 0.7)] for side in (-1.0, 1.0))
    if left[:, 2].mean() > right[:, 2].mean():
        left, right = right, left
    assert left[:, 0].mean() == pytest.approx(LUX, rel=0.02) and left[:, 2].max() < 0.02 * LUX
    assert right[:, 2].mean() == pytest.approx(0.5 * LUX, rel=0.02) and right[:, 0].max() < 0.02 * LUX


def test_the_environments_light_bounces_too(gl: Context) -> None:
    """Under a white sky the wall gets of the floor what that has got of the sky, patch by patch."""
    scene = replace(corner((1.0, 1.0, 1.0), (1.0, 1.0, 1.0)), lights=(), environment=constant((1.0, 1.0, 1.0)))
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, SETTINGS, [stage])
    try:
        renderer.run(stage)
        bounces, environment = renderer.traced.bounces, renderer.traced.environment
        assert bounces is not None and environment is not None and bounces.places is environment.places
        straight, more = environment.irradiance(), bounces.irradiance()
        space = renderer.light.buffers.space
    finally:
        renderer.release()
    at, normal = space.to_world(bounces.places.places["position"]), bounces.places.normals
    thing, areas = bounces.places.places["object"], bounces.places.areas / space.scale**2
    floor = np.flatnonzero((thing == 0) & (normal[:, 2] > 0.5) & bounces.places.on_top)
    wall = np.flatnonzero((thing == 1) & (normal[:, 1] < -0.5) & (at[:, 2] > 0.2))[::97]
    way = at[floor][None] - at[wall][:, None]
    distance2 = (way**2).sum(axis=2)
    gives = -way[..., 2] * -way[..., 1] / (math.pi * distance2**2) * areas[floor]
    expected = gives @ straight[floor, 1]
    error = more[wall, 1] / expected - 1.0
    # 256 directions, the same for all places, leave 1.6 % that varies from one to the next.
    assert abs(error.mean()) < 2e-3 and np.sqrt((error**2).mean()) < 2.5e-2
    assert expected.max() > 0.3


def test_the_viewer_asks_again_where_light_or_things_change(gl: Context) -> None:
    scene = corner()
    engine = LiveEngine(gl)
    engine.target_photons, engine.camera_samples = 1000, 2

    def shown(scene: Scene, camera: Camera = CAMERA):
        engine.set(LiveInputs(scene, camera, 48, 32))
        until = time.monotonic() + 120.0
        while not engine.is_idle and time.monotonic() < until:
            engine.advance(0.05)
        assert engine.is_idle and engine.problem is None and engine._shown is not None
        bounces = engine._shown.light.bounces
        picture = np.frombuffer(engine.picture.read(), "f4").reshape(engine.picture.height, -1, 4)[..., :3]
        return bounces, (0.0 if bounces is None else bounces.seconds), picture

    try:
        first, seconds, before = shown(scene)
        assert first is not None and first.asked == first.shown == first.total
        again, after, _ = shown(scene, replace(CAMERA, position=(0.3, -2.0, 0.8)))
        assert again is first and after == seconds  # walking round asks nothing
        red = replace(scene.objects[0], material=Diffuse((0.8, 0.1, 0.1)))
        coloured, after, seen = shown(replace(scene, objects=(red, scene.objects[1])))
        assert coloured is first and after > seconds
        # The wall, in the upper half, has only what the floor gives it.
        wall = seen[: len(seen) // 3].reshape(-1, 3).sum(axis=0)
        assert wall[0] > 4.0 * wall[1] > 0.0
        moved, _, _ = shown(replace(scene, lights=(replace(scene.lights[0], direction=(0.0, 0.3, -0.95)),)))
        assert moved is not first
        without, _, dark = shown(replace(scene, render=RenderDefaults()))
        assert without is None and dark.sum() < before.sum()
    finally:
        engine.release()
