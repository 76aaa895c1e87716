"""What the window tells of an engine's work: seconds of this frame, photons a second of the last."""

from __future__ import annotations

import time

import pytest
from spectrasplat.render.light_stats import LightStats
from spectrasplat.render.viewer.work_tally import WorkTally, light_counts


def test_seconds_are_of_one_frame_and_the_rate_is_of_the_last_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    tally, stats = WorkTally(), LightStats()
    for _ in range(2):
        before = light_counts(stats)
        stats.trace_seconds, stats.splat_seconds = stats.trace_seconds + 0.03, stats.splat_seconds + 0.01
        stats.photons += 1000
        tally.note_light(before, stats)
    assert tally.seconds == pytest.approx({"trace": 0.06, "splat": 0.02, "camera": 0.0})
    assert tally.photons_per_second == pytest.approx(2000 / 0.08)
    tally.begin_frame()
    assert not any(tally.seconds.values()) and tally.photons_per_second > 0.0
    # Counts that were set back (passes began anew) are no negative work; what is old is forgotten.
    now[0] += 2.0
    tally.note_light((stats.trace_seconds + 1.0, 0.0, stats.photons + 1), stats)
    assert tally.seconds["trace"] == 0.0 and tally.photons_per_second == 0.0
