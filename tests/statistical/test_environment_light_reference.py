"""Surfaces in the light of an environment against float64 paths, which know neither maps nor shaders, in four scenes.
What is bounded is the error of the mean of 6 × 6 pixels; the reference's own noise is a part of it."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.edit.parameters import Stage
from spectrasplat.gpu.context import Context
from spectrasplat.model.environment import constant, gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.materials import Absorption
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.scene_defaults import studio_environment
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.render.frames import FrameRenderer

SIZE, BLOCK = (96, 54), 6
CAMERA = Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.3))
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
CROWN, FLINT = from_abbe(1.5168, 64.2), from_abbe(1.7847, 25.7)


def thing(name: str, mesh, material, at=(0.0, 0.0, 0.0), turn_deg: float = 0.0, axis=(0.0, 0.0, 1.0)) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_about(axis, np.radians(turn_deg))
    matrix[:3, 3] = at
    return SceneObject(name, mesh, material, matrix)


FLOOR = thing("floor", primitives.plane(6.0, 6.0), Diffuse((0.7, 0.7, 0.7)))
BALL = primitives.sphere(0.5, 5000)


def uniform() -> Scene:
    """A coloured ball and one of glass under a white sky."""
    things = (
        thing("ball", BALL, Diffuse((0.8, 0.2, 0.2)), (-0.6, 0.0, 0.5)),
        thing("glass", BALL, Dielectric(CROWN), (0.6, 0.0, 0.55)),
    )
    return Scene("uniform", CAMERA, (), (*things, FLOOR), environment=constant((1.0, 1.0, 1.0)))


def coloured() -> Scene:
    """A box and tinted glass between a blue zenith and an orange horizon."""
    tint = Absorption(np.interp(VISIBLE_NM, [380.0, 560.0, 640.0, 780.0], [3.0, 2.0, 0.3, 0.3]))
    things = (
        thing("box", primitives.box((0.7, 0.7, 0.7)), Diffuse((0.6, 0.6, 0.6)), (-0.7, 0.2, 0.36), 25.0),
        thing("tinted", primitives.box((0.8, 0.8, 0.5)), Dielectric(CROWN, tint), (0.6, 0.0, 0.3), 40.0),
    )
    return Scene(
        "coloured",
        CAMERA,
        (),
        (*things, FLOOR),
        environment=gradient((0.1, 0.3, 2.0), (2.0, 1.0, 0.3), (0.1, 0.1, 0.1)),
    )


def studio() -> Scene:
    """Windows and soft boxes through a lens and over a mirror."""
    things = (
        thing("box", primitives.box((0.6, 0.6, 0.6)), Diffuse((0.2, 0.5, 0.8)), (-0.9, 0.3, 0.31), 20.0),
        thing("lens", primitives.sphere(0.4, 8000), Dielectric(FLINT), (0.2, -0.3, 0.45)),
        thing("mirror", primitives.plane(1.5, 0.8), Mirror((0.9, 0.8, 0.5)), (0.0, 1.0, 0.45), 80.0, (1.0, 0.0, 0.0)),
    )
    return Scene("studio", CAMERA, (), (*things, FLOOR), environment=studio_environment())


def sun() -> Scene:
    """A panorama with a sun, whose light goes as a light of its own; the reference finds it in the picture."""
    height, width = 256, 512
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    rgb = np.ones((height, width, 3)) * np.array([0.3, 0.4, 0.6])
    rgb[(np.abs(u - 0.2) < 0.004) & (np.abs(v - 0.3) < 0.008)] = 2500.0
    things = (thing("ball", BALL, Diffuse((0.8, 0.6, 0.2)), (-0.3, 0.0, 0.55)),)
    return Scene("sun", CAMERA, (), (*things, FLOOR), environment=Environment(rgb.astype(np.float32), lights=True))


BOUNDS = {uniform: (0.006, 0.03), coloured: (0.006, 0.04), studio: (0.018, 0.09), sun: (0.006, 0.03)}
"""Root mean square and largest error of a block's luminance, relative."""


def blocks(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    return picture.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean(axis=(1, 3)) @ LUMINANCE


def error(gl: Context, scene: Scene) -> np.ndarray:
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, RenderSettings(*SIZE, spp=16, photons=2000), [stage])
    try:
        shown = blocks(renderer.run(stage).astype(float))
    finally:
        renderer.release()
    expected = blocks(cached_camera_reference(scene, *SIZE, samples=2048).rgb)
    return (shown - expected) / (expected + 0.05 * expected.mean())


@pytest.mark.slow
@pytest.mark.parametrize("make", BOUNDS, ids=lambda make: make.__name__)
def test_lit_surfaces_agree_with_the_reference(gl: Context, make) -> None:
    found = error(gl, make())
    print(make.__name__, "rms", np.sqrt((found**2).mean()), "max", abs(found).max(), "mean", found.mean())
    assert abs(found.mean()) < 4e-3
    assert np.sqrt((found**2).mean()) < BOUNDS[make][0] and abs(found).max() < BOUNDS[make][1]
