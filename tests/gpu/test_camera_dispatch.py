"""The camera's work cut into pieces: the picture knows nothing of them, and stopping leaves whole rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.dispatch_budget import DispatchBudget
from spectrasplat.model.scene import Camera
from spectrasplat.passes.camera import CameraPass

from tests.gpu.camera_rig import floor, opened_camera_pass, released
from tests.gpu.test_camera_furnace import solids

SIZE = 72, 50
CAMERA = Camera((0.4, -2.2, 1.6), (0, 0, 0.1), vertical_fov_deg=40.0)


@pytest.fixture
def camera_pass(gl) -> Iterator[CameraPass]:
    camera_pass = opened_camera_pass(gl, [floor(), *solids("prism")], background=(0.9, 0.5, 0.2), camera=CAMERA)
    yield camera_pass
    released(camera_pass)


def begun(camera_pass: CameraPass, rows: int, pixels: int) -> CameraPass:
    """With dispatches of so many rows, and of so many of their pixels that see glass."""
    camera_pass.run(CAMERA, *SIZE, 1)
    camera_pass.dispatch_seconds = 0.0  # they shall not grow
    camera_pass._rows = DispatchBudget(rows, 8, 56)
    camera_pass.listed.budget = DispatchBudget(pixels, 64, 1 << 20)
    return camera_pass


def test_the_size_of_dispatches_changes_nothing(camera_pass: CameraPass) -> None:
    camera_pass.run(CAMERA, *SIZE, 3)
    whole = camera_pass.read_rgb()
    shares = list(begun(camera_pass, 8, 64).samples(CAMERA, *SIZE, 3))
    assert np.array_equal(camera_pass.read_rgb(), whole)
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert len(shares) > 3 * 7 + 10, "no pixels were listed, or all were followed at once"


def test_how_many_paths_a_group_has_changes_nothing(gl, camera_pass: CameraPass, monkeypatch) -> None:
    camera_pass.run(CAMERA, *SIZE, 3)
    monkeypatch.setattr(gl, "traits", replace(gl.traits, paths_group=72 - gl.traits.paths_group))
    other = opened_camera_pass(gl, [floor(), *solids("prism")], background=(0.9, 0.5, 0.2), camera=CAMERA)
    other.run(CAMERA, *SIZE, 3)
    assert np.array_equal(other.read_rgb(), camera_pass.read_rgb())
    released(other)


@pytest.mark.parametrize("after", [2, 9, 30])
def test_a_stop_leaves_whole_rows(gl, after: int) -> None:
    """In a white room clear glass cannot be seen, unless a listed pixel has been begun and left without its further
    sample."""
    camera_pass = opened_camera_pass(
        gl, solids("prism"), background=(1.0, 1.0, 1.0), camera=CAMERA, split_threshold=1e-9
    )
    begun(camera_pass, 8, 64)
    for pauses, _ in enumerate(camera_pass.samples(CAMERA, *SIZE, 4, sample_offset=1), start=1):
        if pauses >= after and camera_pass.is_even:
            break
    samples = camera_pass._sums.samples_of_row
    assert samples.min() < samples.max(), "it stopped between two samples"
    assert (
        np.abs(camera_pass.read_rgb() - 1.0).max() < 0.1
    )  # a sample of one pixel is within 0.04; one too many or too few is a third
    released(camera_pass)
