"""The command that measures the viewer: its phases do what they say."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.bench import viewer_speed
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Camera, Scene
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.render.viewer.stats import LiveStats


@pytest.mark.slow
def test_walking_round_and_dragging_the_dispersion_trace_nothing(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_speed, "NUDGES", 1)
    bench = viewer_speed._Bench(gl, assets_dir() / "scenes" / "ball.toml", (640, 400))
    assert abs(bench.viewport[0] - 640) <= 2 and abs(bench.viewport[1] - 400) <= 2
    bench.wait_for_picture()
    bench.wait_for_whole()
    resting = bench.phase(2.0, bench.rest)  # the first of it goes into finer maps
    camera = bench.session.state.camera
    orbiting = bench.phase(0.3, bench.orbit, bench.holding_middle_button)
    assert bench.session.state.camera != camera
    dragging = bench.phase(0.9, bench.drag_gain, bench.holding_gain)
    # What is seen directly has every pixel in motion too, and all of the picture has once it rests.
    assert orbiting["glass_side"] < orbiting["direct_side"]
    assert orbiting["whole_s"] > 0.0 < orbiting["whole_processor_s"]
    gain = bench.session.state.scene.objects[bench._glass].material.dispersion.gain
    assert gain != 1.0
    assert resting["photons_per_s"] > 0.0
    assert orbiting["photons_per_s"] == dragging["photons_per_s"] == 0.0
    assert 0.0 < orbiting["processor_ms"] < 60_000.0
    assert dragging["frames"] > 2 and dragging["median_ms"] > 0.0
    seen = bench.latency(bench.nudge_camera)
    assert seen["missed"] == 0 and 0.0 < seen["answered_ms"] < 1e3 * viewer_speed.ANSWER_S
    monkeypatch.setattr(viewer_speed, "ANSWER_S", 0.0)
    assert bench.latency(bench.nudge_camera) == {"answered_ms": 0.0, "missed": 1}
    bench.release()


def test_an_input_that_is_never_answered_is_missed_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """It used to be waited for through sixty frames, each as long as the machine took, and as long for rest before."""

    class Deaf(LiveEngine):
        inputs = None
        picture_version = camera_samples = 0

        def __init__(self) -> None:
            pass

    frames = []

    def frame() -> None:
        frames.append(time.perf_counter())
        time.sleep(0.005)

    empty = Scene("none", Camera((0, -1, 0), (0, 0, 0)), (), ())
    bench = object.__new__(viewer_speed._Bench)
    picture = SimpleNamespace(engine=Deaf(), stats=LiveStats(converged=False), radiance=object())
    bench.session = SimpleNamespace(state=State(empty, empty.camera), picture=picture, frame_ms=[5.0])
    bench.interface = SimpleNamespace(frame=frame)
    bench._sampler = SimpleNamespace(run=lambda _radiance: np.zeros(3))
    monkeypatch.setattr(viewer_speed, "REST_S", 0.02)
    monkeypatch.setattr(viewer_speed, "ANSWER_S", 0.03)
    found = bench.latency(lambda: None)
    assert found == {"answered_ms": 30.0, "missed": viewer_speed.NUDGES}
    assert frames[-1] - frames[0] < 1.0
