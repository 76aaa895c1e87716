"""The command that measures the viewer: its phases do what they say."""

from __future__ import annotations

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.bench import viewer_speed
from spectrasplat.gpu.context import Context


@pytest.mark.slow
def test_walking_round_and_dragging_the_dispersion_trace_nothing(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_speed, "NUDGES", 1)
    bench = viewer_speed._Bench(gl, assets_dir() / "scenes" / "ball.toml", (640, 400))
    assert abs(bench.viewport[0] - 640) <= 2 and abs(bench.viewport[1] - 400) <= 2
    bench.wait_for_picture()
    bench.wait_for_whole()
    resting = bench.phase("accumulating", 2.0, bench.rest)  # the first of it goes into finer maps
    camera = bench.session.state.camera
    orbiting = bench.phase("orbiting", 0.3, bench.orbit, bench.holding_middle_button)
    assert bench.session.state.camera != camera
    dragging = bench.phase("dragging dispersion", 0.4, bench.drag_gain, bench.holding_gain)
    # What is seen directly has every pixel in motion too, and all of the picture has once it rests.
    assert orbiting.glass < orbiting.direct and orbiting.whole_s > 0.0 < orbiting.whole_processor_s
    gain = bench.session.state.scene.objects[bench._glass].material.dispersion.gain
    assert gain != 1.0
    assert resting.rays_traced > 0
    assert orbiting.rays_traced == dragging.rays_traced == 0
    assert 0.0 < orbiting.processor_ms < 60_000.0
    assert len(dragging.frame_ms) > 2 and "ms" in dragging.line
    assert 0 < bench.latency(bench.nudge_camera) < 5000
    bench.release()
