"""What the camera asks of a GPU: dispatches of a sample, and no wait for any (design item 1 and 5 of issue 40)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits, assumed
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.camera import CameraPass
from spectrasplat.render.device_scene import scene_buffers

from tests.gpu.camera_rig import released
from tests.gpu.gl_counts import Counts, counted

SIZE = 96, 54


@pytest.fixture(scope="module")
def gpu() -> Iterator[Context]:
    """A software renderer that is taken for a GPU."""
    with assumed(DeviceTraits(splats_by_compute=True)), create_context() as context:
        yield context


def opened(context: Context, name: str) -> CameraPass:
    scene = load_scene(shipped_scenes()[name])
    return CameraPass(context, scene_buffers(context, scene, RenderSettings()))


def taken(camera_pass: CameraPass, samples: int, offset: int = 0) -> Counts:
    """What samples ask once the pass knows how long one takes."""
    camera_pass.dispatch_seconds = 1e6  # of a GPU
    with counted() as counts:
        camera_pass.run(camera_pass.scene.scene.camera, *SIZE, samples, offset)
    return counts


@pytest.mark.parametrize("name", ["default", "brilliant"])
def test_a_sample_is_two_dispatches_and_no_wait(gpu: Context, name: str) -> None:
    camera_pass = opened(gpu, name)
    taken(camera_pass, 1)
    counts = taken(camera_pass, 1)
    released(camera_pass)
    assert counts.dispatches <= 3
    assert counts.waits == 0
    assert counts.made == []


def test_a_survey_is_not_waited_for(gpu: Context) -> None:
    camera_pass = opened(gpu, "prism")
    taken(camera_pass, 1)
    counts = taken(camera_pass, 4)
    released(camera_pass)
    assert counts.dispatches == 2 + 1 + 4 * 3
    assert counts.waits == 0


def test_rows_are_cut_up_after_samples_that_took_long(gpu: Context) -> None:
    camera_pass = opened(gpu, "prism")
    whole = taken(camera_pass, 2)
    camera_pass.dispatch_seconds = 1e-9
    camera_pass.run(camera_pass.scene.scene.camera, *SIZE, 2)
    expected = camera_pass.read_rgb()
    with counted() as cut:
        camera_pass.run(camera_pass.scene.scene.camera, *SIZE, 2)
    assert cut.dispatches >= 2 * 2 * (SIZE[1] // 8) > whole.dispatches
    np.testing.assert_array_equal(camera_pass.read_rgb(), expected)
    released(camera_pass)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["prism", "default"])
def test_a_gpu_shows_what_a_software_renderer_does(gl: Context, gpu: Context, name: str) -> None:
    """Paths wait elsewhere, lists are followed whole, and places are taken again by others, where there are few: not so
    few that llvmpipe would end their loops."""
    pictures = []
    few = replace(gpu.traits, camera_paths=256)
    with assumed(few), create_context() as narrow:
        for context in (gl, gpu, narrow):
            camera_pass = opened(context, name)
            camera_pass.run(camera_pass.scene.scene.camera, *SIZE, 2)
            pictures.append(camera_pass.read_rgb())
            released(camera_pass)
    software, wide, few_places = pictures
    np.testing.assert_array_equal(few_places, wide)
    assert np.sqrt(np.mean((wide - software) ** 2)) < 1e-4 * software.mean()  # rounded otherwise here and there
