"""A pass that runs out of time traces what it lacks coarsely: no gaps, and all of the light."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.sampling import LightSampling
from spectrasplat.render.still import RenderResult, render

PHOTONS = 60_000


@pytest.mark.parametrize(
    ("name", "method"),
    [("ball_caustic", "srd"), pytest.param("lens", "srd", marks=pytest.mark.slow), ("prism", "stochastic-point")],
)
def test_what_there_is_no_time_for_is_traced_coarsely(gl, name: str, method: str) -> None:
    """From the middle of a pass on there is time for a third of what is left. (Gaps: half of the mean and more.)"""
    settings = RenderSettings(width=128, height=72, photons=PHOTONS, spp=4, layer="caustic", batch=4096, method=method)

    def rendered(after: float) -> RenderResult:
        def fill(light: LightPass, sampling: LightSampling, stop: Callable[[], bool]) -> Iterator[float]:
            light.begin(PHOTONS, 0)
            planned, traced, begun = light.pass_of(0, PHOTONS), 0, time.perf_counter()

            def seconds_left() -> float:
                nonlocal traced
                traced += 1
                rounds = planned.count / 6 - (traced - after * planned.count) if traced >= after * planned.count else 99
                return rounds * (time.perf_counter() - begun) / traced

            for step in planned.steps(seconds_left=seconds_left):
                yield step.fraction

        return render(load_scene(shipped_scenes()[name]), settings, context=gl, fill=fill)

    whole, cut = rendered(2.0), rendered(0.5)
    assert cut.stats.photons < 0.75 * whole.stats.photons
    assert cut.rgb.sum() == pytest.approx(whole.rgb.sum(), rel=0.01)
    assert method != "srd" or np.sqrt(np.mean((cut.rgb - whole.rgb) ** 2)) < 0.25 * whole.rgb.mean()
    assert cut.stats.light.tally.imbalance < 1e-6
