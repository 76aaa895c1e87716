"""How the seconds of a still picture are planned: what a camera sample costs is found out on a small picture, and on a
larger one only where that costs little."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from spectrasplat.render.time_budget import TimeBudget

SIZE = 320, 160


class SlowCamera:
    """A camera pass whose samples take a time by the pixel."""

    def __init__(self, sample_s: float) -> None:
        self.pixel_s = sample_s / (SIZE[0] * SIZE[1])
        self.sizes: list[tuple[int, int]] = []

    def samples(self, _camera: Any, width: int, height: int, *_rest: Any) -> Iterator[float]:
        self.sizes.append((width, height))
        time.sleep(self.pixel_s * width * height)
        yield 1.0


@pytest.mark.parametrize(("seconds", "probed"), [(2.0, [(80, 40)]), (60.0, [(80, 40), (160, 80)])])
def test_a_sample_is_measured_on_as_large_a_picture_as_the_time_allows(
    seconds: float, probed: list[tuple[int, int]]
) -> None:
    budget, camera = TimeBudget(seconds, time.perf_counter()), SlowCamera(1.0)
    for _ in budget.measuring(camera, None, *SIZE):  # type: ignore[arg-type]
        pass
    assert camera.sizes == probed
    assert budget.sample_s == pytest.approx(1.0, rel=0.5)


def test_what_compiling_takes_is_told_from_the_sample() -> None:
    budget, camera = TimeBudget(2.0, time.perf_counter()), SlowCamera(1.0)
    for _ in budget.measuring(camera, None, *SIZE, first=True):  # type: ignore[arg-type]
        pass
    assert camera.sizes == [(80, 40)] * 2
    assert abs(budget.compile_s) < 0.1
