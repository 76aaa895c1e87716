"""The same seed gives the same picture, bit for bit: whichever pixels a path has for neighbours, and wherever it halts.

The smallest fault these tests see is one bit of one pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.dispatch_budget import DispatchBudget
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import camera_programs, listed_pixels
from spectrasplat.passes.camera import CameraPass
from spectrasplat.passes.caustic_maps import CausticMaps
from spectrasplat.render.device_scene import spectral_axis

from tests.gpu.camera_rig import released

SCENES = sorted(Path("assets/scenes").glob("*.toml"))
SIZE = 96, 54


class Shuffled(CameraPass):
    """Its pixels that see glass are followed in an order of chance, as on a device where atomics come in any order."""

    order = 0

    def _portions(self, parameters: np.ndarray, maps: CausticMaps) -> Iterator[float]:
        assert self.listed is not None
        pixels = self.listed._list
        count = int(np.frombuffer(pixels.read(4, offset=listed_pixels._LISTED_AT), "u4")[0])
        if count:
            begins = listed_pixels._NOTHING.nbytes
            listed = np.frombuffer(pixels.read(4 * count, offset=begins), "u4")
            pixels.write(np.random.default_rng(self.order).permutation(np.sort(listed)).tobytes(), offset=begins)
        yield from super()._portions(parameters, maps)


def shuffled(gl: Context, scene: Scene) -> Shuffled:
    features = Features.of(scene, RenderSettings())
    return Shuffled(gl, SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features)))


def pictures(camera_pass: Shuffled, scene: Scene, orders: int, samples: int) -> list[np.ndarray]:
    """One of each order of the pixels, in portions of different sizes."""
    taken = []
    for camera_pass.order in range(orders):
        camera_pass.run(scene.camera, *SIZE, 1)  # which learns how fast this device is
        camera_pass.dispatch_seconds = (0.15, 0.0, 0.02)[camera_pass.order % 3]
        if camera_pass.order % 3 == 1:
            camera_pass.listed.budget, camera_pass.listed.resumed = (
                DispatchBudget(64 * 7, 64, 1 << 20),
                DispatchBudget(64 * 3, 64, 1 << 20),
            )
        camera_pass.run(scene.camera, *SIZE, samples)
        taken.append(camera_pass.read_rgb())
    return taken


@pytest.mark.slow
@pytest.mark.parametrize("name", ["default", "wine_glass"])
def test_a_path_knows_nothing_of_its_neighbours(gl: Context, name: str) -> None:
    scene = load_scene(Path(f"assets/scenes/{name}.toml"))
    camera_pass = shuffled(gl, scene)
    first, *others = pictures(camera_pass, scene, 3, 2)
    assert camera_pass.fallbacks["loops_ended"] == 0
    for other in others:
        np.testing.assert_array_equal(other, first)
    released(camera_pass)


def picture_halting_after(gl: Context, scene: Scene, rounds: int, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    monkeypatch.setattr(camera_programs, "HALT_ROUNDS", rounds)
    camera_pass = shuffled(gl, scene)
    [picture] = pictures(camera_pass, scene, 1, 2)
    released(camera_pass)
    return picture


@pytest.mark.slow
def test_where_a_sample_halts_changes_no_bit(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene(Path("assets/scenes/prism.toml"))
    rarely, often = (picture_halting_after(gl, scene, rounds, monkeypatch) for rounds in (1 << 14, 1))
    np.testing.assert_array_equal(often, rarely)
