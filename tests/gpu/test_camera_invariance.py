"""Pictures through dispersive glass that must not change, or only as rounding does: said in other coordinates, other
portions, once more.

The scene has all that the camera's rays meet: a flint prism, a smooth ball, a coloured mirror, lit paper and a sky with
a pattern.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import PointLight
from spectrasplat.model.scene import (
    Camera,
    Diffuse,
    Mirror,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.passes.camera import CameraPass
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.gpu_paths import glass
from spectrasplat.stress.rigs.scene_parts import moved

from tests.gpu.camera_rig import WHITE, at, quad

SIZE, SAMPLES, BANDS = (32, 20), 8, 4
SAME_RAYS = 2e-3
"""Relative root mean square: rays that pass an edge on the other side, in a picture of 640 pixels with 8 samples
each."""


def pattern() -> np.ndarray:
    """A sky of soft coloured blotches, (16, 32, 3)."""
    v, u = np.meshgrid((np.arange(16) + 0.5) / 16 * np.pi, (np.arange(32) + 0.5) / 32 * 2 * np.pi, indexing="ij")
    return np.stack(
        [1.0 + np.cos(3 * u) * np.sin(v), 1.0 + np.sin(2 * u + 1.0) * np.sin(v), 1.0 + np.cos(2 * v)], axis=-1
    ).astype(np.float32)


def scene() -> Scene:
    objects = (
        SceneObject("prism", primitives.prism(60.0, 1.0, 1.2), glass("N-SF11"), at(-0.5, 0.0, 0.1)),
        SceneObject("ball", primitives.sphere(0.45, 1280), glass("F2"), at(0.7, 0.2, 0.0)),
        quad([[-2, 1.5, -1], [2, 1.5, -1], [2, 1.5, 0.4], [-2, 1.5, 0.4]], Diffuse((0.8, 0.6, 0.3)), "paper"),
        quad([[-2, -2, -1], [2, -2, -1], [2, 2, -1], [-2, 2, -1]], Mirror((0.9, 0.8, 0.5)), "mirror"),
    )
    lamp = PointLight("lamp", WHITE.scaled(0.04), position=(1.0, -1.0, 3.0))
    return Scene(
        "invariance",
        Camera((0.2, -3.2, 0.9), (0.0, 0.0, -0.05), vertical_fov_deg=38.0),
        (lamp,),
        objects,
        environment=Environment(pattern()),
    )


def begun(gl, question: Scene) -> CameraPass:
    features = Features.of(question, RenderSettings(any_view=True))
    camera_pass = CameraPass(gl, SceneBuffers(gl.ctx, question, features, spectral_axis(question, features)))
    camera_pass.spectrum = Spectrum(BANDS)
    return camera_pass


def picture(gl, question: Scene, samples: int = SAMPLES, seed: int = 1, **how: float) -> np.ndarray:
    """Linear Rec.709 (H, W, 3), float64."""
    camera_pass = begun(gl, question)
    for name, value in how.items():
        setattr(camera_pass, name, value)
    camera_pass.run(question.camera, *SIZE, samples, seed=seed)
    rgb = camera_pass.read_rgb().astype(float)
    camera_pass.scene.release()
    camera_pass.release()
    return rgb


def difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


@pytest.fixture(scope="module")
def shown(gl) -> np.ndarray:
    return picture(gl, scene())


def rotation() -> np.ndarray:
    turned = np.linalg.qr(np.array([[0.2, 1.0, -0.4], [0.9, -0.3, 0.1], [0.5, 0.3, 1.1]]))[0]
    return turned * np.sign(np.linalg.det(turned))


def test_everything_turned_together_looks_the_same(gl, shown) -> None:
    turn = rotation()
    turned = moved(scene(), rotation=turn)
    assert difference(picture(gl, turned), shown) < SAME_RAYS
    # The mutant: the sky stays where it was.
    assert difference(picture(gl, replace(turned, environment=scene().environment)), shown) > 50 * SAME_RAYS


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_do_not_matter(gl, shown, scale: float) -> None:
    # Radiance does not depend on the unit; intensity follows its square, which `moved` knows.
    larger = moved(scene(), scale)
    assert difference(picture(gl, larger), shown) < SAME_RAYS
    assert difference(picture(gl, replace(larger, lights=scene().lights)), shown) > 10 * SAME_RAYS


def test_the_same_seed_gives_the_same_bits_in_any_portions(gl, shown) -> None:
    """Pixels that meet glass are listed in the order of a race; a picture must not depend on who won it."""
    assert np.array_equal(picture(gl, scene()), shown)
    assert np.array_equal(picture(gl, scene(), dispatch_seconds=0.0), shown)
    assert not np.array_equal(picture(gl, scene(), seed=2), shown)


def test_samples_may_be_taken_in_two_runs(gl, shown) -> None:
    camera_pass, question = begun(gl, scene()), scene()
    pictures = []
    for _ in range(2):
        camera_pass.run(question.camera, *SIZE, SAMPLES)
        assert np.array_equal(camera_pass.read_rgb(), shown.astype(np.float32))
        camera_pass.run(question.camera, *SIZE, SAMPLES, sample_offset=SAMPLES)
        pictures.append(camera_pass.read_rgb().astype(float))
    assert np.array_equal(*pictures)
    # What the second run adds is other samples of the same picture.
    camera_pass.run(question.camera, *SIZE, 64)
    converged = camera_pass.read_rgb().astype(float)
    camera_pass.scene.release()
    camera_pass.release()
    assert difference(pictures[0], converged) < 0.85 * difference(shown, converged)
