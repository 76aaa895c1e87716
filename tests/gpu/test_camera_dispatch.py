"""The eye's work cut into pieces: the picture knows nothing of them, and stopping leaves whole rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from spectrasplat.gpu.dispatch_budget import Portion
from spectrasplat.model.scene import Camera
from spectrasplat.passes.camera import EyePass
from tests.gpu.eye_rig import eye_pass, floor, released
from tests.gpu.test_eye_furnace import solids

SIZE = 72, 50
CAMERA = Camera((0.4, -2.2, 1.6), (0, 0, 0.1), vertical_fov_deg=40.0)


@pytest.fixture
def eye(gl) -> Iterator[EyePass]:
    eye = eye_pass(gl, [floor(), *solids("prism")], background=(0.9, 0.5, 0.2), camera=CAMERA)
    yield eye
    released(eye)


def begun(eye: EyePass, rows: int, pixels: int) -> EyePass:
    """With dispatches of so many rows, and of so many of their pixels that see glass."""
    eye.run(CAMERA, *SIZE, 1)
    eye.dispatch_seconds = 0.0  # they shall not grow
    eye._rows, eye._pixels = Portion(rows, 8, 56), Portion(pixels, 64, 1 << 20)
    return eye


def test_the_size_of_dispatches_changes_nothing(eye: EyePass) -> None:
    eye.run(CAMERA, *SIZE, 3)
    whole = eye.read_rgb()
    shares = list(begun(eye, 8, 64).samples(CAMERA, *SIZE, 3))
    assert np.array_equal(eye.read_rgb(), whole)
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert len(shares) > 3 * 7 + 10, "no pixels were listed, or all were followed at once"


@pytest.mark.parametrize("after", [2, 9, 30])
def test_a_stop_leaves_whole_rows(gl, after: int) -> None:
    """In a white room clear glass cannot be seen, unless a listed pixel has been begun and left without its further sample."""
    eye = eye_pass(gl, solids("prism"), background=(1.0, 1.0, 1.0), camera=CAMERA, split_threshold=1e-9)
    begun(eye, 8, 64)
    asked: list[int] = []

    def stops() -> bool:
        asked.append(1)
        return len(asked) >= after

    assert not eye.run(CAMERA, *SIZE, 4, sample_offset=1, cancelled=stops)
    samples = eye._samples_of_row
    assert samples.min() < samples.max(), "it stopped between two samples"
    assert np.abs(eye.read_rgb() - 1.0).max() < 0.1  # a sample of one pixel is within 0.04; one too many or too few is a third
    released(eye)
