"""The automatic exposure of the viewer: at once for a new scene, smooth after that, still in the end."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.tone_map import auto_exposure
from spectrasplat.ui.auto_exposure import ARRIVED_EV, DEADBAND_EV, MEASURE_S, AutoExposure

GREY = np.full((9, 16, 3), 0.5, np.float32)


def run(exposure: AutoExposure, picture: np.ndarray, start_s: float, seconds: float) -> list[float]:
    """Exposures of every frame at 60 Hz."""
    return [exposure.follow(lambda: picture, start_s + i / 60, 1 / 60) for i in range(int(60 * seconds))]


def test_first_picture_is_exposed_at_once() -> None:
    assert AutoExposure().follow(lambda: GREY, 0.0, 1 / 60) == pytest.approx(auto_exposure(GREY))


def test_a_brighter_picture_is_followed_smoothly_and_then_stands_still() -> None:
    exposure = AutoExposure()
    before = run(exposure, GREY, 0.0, 1.0)[-1]
    values = np.array(run(exposure, 8 * GREY, 1.0, 4.0))
    assert np.abs(np.diff(values, prepend=before)).max() < 0.25  # stops a frame: no jump
    assert values[-1] == pytest.approx(before - 3.0, abs=ARRIVED_EV)
    assert not exposure.is_moving
    assert len(set(values[-30:])) == 1


def test_noise_is_not_followed() -> None:
    exposure = AutoExposure()
    before = run(exposure, GREY, 0.0, 0.5)[-1]
    assert set(run(exposure, GREY * 2 ** (0.5 * DEADBAND_EV), 1.0, 2.0)) == {before}


def test_black_is_waited_for_and_another_scene_taken_at_once() -> None:
    exposure = AutoExposure()
    assert exposure.follow(lambda: 0 * GREY, 0.0, 1 / 60) == 0.0
    assert exposure.follow(lambda: GREY, 2 * MEASURE_S, 1 / 60) == pytest.approx(auto_exposure(GREY))
    exposure.restart()
    assert exposure.follow(lambda: 4 * GREY, 2.1 * MEASURE_S, 1 / 60) == pytest.approx(auto_exposure(4 * GREY))
