"""Surfaces that light each other against float64 paths, which know neither maps nor shaders, in three scenes. What is
bounded is the error of the mean of 6 × 6 pixels; the reference's own noise is a part of it, and so are colours, which
it multiplies wavelength by wavelength and the renderer as linear red, green and blue."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.edit.parameters import Stage
from spectrasplat.gpu.context import Context
from spectrasplat.model.environment import gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight, PointLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Material, Mirror, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.camera_reference import render_camera_reference
from spectrasplat.reference.spectral_caustic import CausticPlan, build_caustic
from spectrasplat.render.frames import FrameRenderer

SIZE, BLOCK = (96, 54), 6
CAMERA = Camera((0.2, -3.6, 1.1), (0.0, 0.3, 0.6), vertical_fov_deg=38.0)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
GREY = Diffuse((0.7, 0.7, 0.7))
UPRIGHT = rotation_about((1.0, 0.0, 0.0), math.radians(90.0))
SIDEWAYS = rotation_about((0.0, 1.0, 0.0), math.radians(90.0))


def thing(name: str, mesh, material: Material, at=(0.0, 0.0, 0.0), turn: np.ndarray | None = None) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if turn is None else turn
    matrix[:3, 3] = at
    return SceneObject(name, mesh, material, matrix)


def walls(side: Material) -> tuple[SceneObject, ...]:
    return (
        thing("floor", primitives.plane(3.0, 3.0), GREY),
        thing("back", primitives.plane(3.0, 2.0), GREY, (0.0, 1.5, 1.0), UPRIGHT),
        thing("side", primitives.plane(2.0, 3.0), side, (-1.5, 0.0, 1.0), SIDEWAYS),
    )


def scene_of(bounces: int, *objects: SceneObject, light=None, environment=None) -> Scene:
    lights = () if light is None else (light,)
    return Scene("room", CAMERA, lights, objects, environment=environment, render=RenderDefaults(bounces=bounces))


def room() -> tuple[Scene, float]:
    """A lamp among three walls, one of them tinged, with a white ball."""
    ball = thing("ball", primitives.sphere(0.4, 5000), Diffuse((0.9, 0.9, 0.9)), (-0.4, 0.3, 0.4))
    lamp = PointLight("lamp", illuminant("D65").scaled_to_luminous(50.0), (0.5, -0.3, 1.6))
    return scene_of(3, *walls(Diffuse((0.7, 0.5, 0.4))), ball, light=lamp), 0.0


def under_a_sky() -> tuple[Scene, float]:
    """Light from all round, with glass and a mirror through and over which surfaces see each other."""
    things = (
        thing("glass", primitives.sphere(0.4, 8000), Dielectric(from_abbe(1.6, math.inf)), (0.3, 0.2, 0.45)),
        thing("mirror", primitives.plane(0.8, 0.8), Mirror((0.9, 0.9, 0.9)), (-0.7, 0.8, 0.5), UPRIGHT),
    )
    sky = gradient((1.0, 1.2, 1.6), (1.0, 0.9, 0.8), (0.2, 0.2, 0.2))
    return scene_of(2, *walls(GREY), *things, environment=sky), 0.0


def a_mirrors_light() -> tuple[Scene, float]:
    """All light comes by way of a mirror to a part of the floor."""
    turn = rotation_about((1.0, 0.0, 0.0), math.radians(135.0))
    mirror = thing("mirror", primitives.plane(1.4, 1.6), Mirror((1.0, 1.0, 1.0)), (0.2, 0.2, 1.6), turn)
    beam = CollimatedLight(
        "beam",
        illuminant("D65").scaled_to_luminous(100.0),
        (0.2, -4.0, 1.6),
        (0.0, 1.0, 0.0),
        (1.0, 0.0, 0.0),
        "rectangle",
        1.0,
        1.2,
        1.0,
    )
    return scene_of(2, *walls(GREY), mirror, light=beam), 0.02


BOUNDS = {room: (0.012, 0.1), under_a_sky: (0.02, 0.08), a_mirrors_light: (0.05, 0.25)}
"""Root mean square and largest error of a block's luminance, relative to it and a twentieth of the mean."""


def blocks(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    return picture.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean(axis=(1, 3)) @ LUMINANCE


@pytest.mark.slow
@pytest.mark.parametrize("make", BOUNDS, ids=lambda make: make.__name__)
def test_surfaces_light_each_other_as_in_the_reference(gl: Context, make) -> None:
    scene, texel = make()
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, RenderSettings(*SIZE, spp=16, photons=20_000), [stage])
    try:
        shown = blocks(renderer.run(stage).astype(float))
    finally:
        renderer.release()
    caustic = build_caustic(scene, *SIZE, CausticPlan(photons=1 << 18, bins=8, texel_size=texel)) if texel else None
    expected = blocks(render_camera_reference(scene, *SIZE, samples=1024, caustic=caustic).rgb)
    found = (shown - expected) / (expected + 0.05 * expected.mean())
    print(make.__name__, "rms", np.sqrt((found**2).mean()), "max", abs(found).max(), "mean", found.mean())
    assert abs(found.mean()) < 5e-3
    assert np.sqrt((found**2).mean()) < BOUNDS[make][0] and abs(found).max() < BOUNDS[make][1]
    # What is bounded is a small part of what bounces bring.
    without = Scene(**{**vars(scene), "render": RenderDefaults()})
    dark = blocks(render_camera_reference(without, *SIZE, samples=64, caustic=caustic).rgb)
    assert (expected - dark).mean() > 0.1 * expected.mean()
