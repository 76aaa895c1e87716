"""Finished receivers in the viewer: in motion they look as at rest, only coarser, and edits of them are seen."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.objects import set_material
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.environment import gradient
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.render.viewer.invalidation import dirty_level

from tests.gpu.camera_rig import at

SIZE = (96, 54)
CAMERA = Camera((0.0, -4.0, 1.2), (0.0, 0.0, 0.3))
COATED = Diffuse((0.3, 0.2, 0.1), roughness=0.3, coat_index=2.0)


def scene_of(material: Diffuse) -> Scene:
    """A table under a sky that is bright low down, a block of glass on it, a lamp above."""
    table = SceneObject("table", primitives.plane(8.0, 8.0), material)
    block = SceneObject("block", primitives.box((0.8, 0.8, 0.8)), Dielectric(from_abbe(1.5, 60.0)), at(0.4, 0.2, 0.45))
    lamp = PointLight("lamp", illuminant("D65").scaled_to_luminous(4.0), position=(-0.6, 1.4, 1.2))
    sky = gradient((0.2, 0.3, 0.6), (1.6, 1.4, 1.0), (0.1, 0.1, 0.1))
    return Scene("finish", CAMERA, (lamp,), (block, table), environment=sky)


@pytest.fixture
def engine(gl: Context) -> Iterator[LiveEngine]:
    made = LiveEngine(gl, Budget(8192, 1 << 12, 1 << 13, 1 << 24))
    made.target_photons = 1 << 12
    made.refine_when_still = False
    yield made
    made.release()


def settled(engine: LiveEngine, wanted: LiveInputs) -> np.ndarray:
    engine.set(wanted)
    end = time.monotonic() + 300.0
    while not engine.is_idle:
        assert engine.problem is None, engine.problem
        assert time.monotonic() < end, "it took too long"
        engine.advance(0.2)
    return picture(engine)


def picture(engine: LiveEngine) -> np.ndarray:
    texture = engine.picture
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3].astype(float)


def blocks(rgb: np.ndarray, rows: int = 6, columns: int = 8) -> np.ndarray:
    """Mean luminance of parts of the picture, whatever its size."""
    luminance = rgb @ np.array([0.2126, 0.7152, 0.0722])
    parts = [np.array_split(row, columns, axis=1) for row in np.array_split(luminance, rows, axis=0)]
    return np.array([[part.mean() for part in row] for row in parts])


@pytest.mark.slow
def test_a_coat_is_seen_in_motion_as_at_rest(engine: LiveEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts of the picture of a movement against the same view at rest; without the coat they would be another."""
    monkeypatch.setattr("spectrasplat.render.viewer.glass_steps.STEPS", (3,))  # however slow the machine is
    monkeypatch.setattr("spectrasplat.render.viewer.live_camera.SCALES", (1.0,))
    moved = replace(CAMERA, position=(0.05, -4.0, 1.22))
    wanted = LiveInputs(scene_of(COATED), CAMERA, *SIZE)
    settled(engine, wanted)
    engine.set(replace(wanted, camera=moved))
    engine.advance(5.0, interacting=True)
    in_motion = blocks(picture(engine))
    at_rest = blocks(settled(engine, replace(wanted, camera=moved)))
    plain = blocks(settled(engine, LiveInputs(scene_of(Diffuse((0.3, 0.2, 0.1))), moved, *SIZE)))
    table = slice(3, None)
    off = (in_motion / at_rest - 1.0)[table]
    print("rms", np.sqrt((off**2).mean()), "max", abs(off).max())
    assert np.sqrt((off**2).mean()) < 0.08
    assert np.sqrt(((plain / at_rest - 1.0)[table] ** 2).mean()) > 0.2


def test_another_roughness_is_only_looked_at_and_a_coat_is_built() -> None:
    def level(old: Diffuse, new: Diffuse) -> DirtyLevel:
        before = scene_of(old)
        after = set_material(before, 1, new)
        a, b = LiveInputs(before, CAMERA, *SIZE), LiveInputs(after, CAMERA, *SIZE)
        return dirty_level(a, a, b)

    assert level(COATED, replace(COATED, roughness=0.5)) == DirtyLevel.CAMERA
    assert level(COATED, replace(COATED, coat_index=1.6)) == DirtyLevel.CAMERA
    assert level(COATED, replace(COATED, roughness=None)) == DirtyLevel.BUILD
    assert level(Diffuse(), COATED) == DirtyLevel.BUILD
    assert level(Diffuse(), Diffuse(diffuse_roughness=0.5)) == DirtyLevel.BUILD
    assert level(COATED, replace(COATED)) == DirtyLevel.NOTHING
