"""Progress of a frame is weighted by time, also where the environment's light takes most of it."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.render.frame_progress import PHOTON_S, SAMPLE_S, FrameProgress

PHOTONS, SAMPLES = 100_000, 1_000_000


@pytest.mark.parametrize("environment_s", [0.0, 1.0, 50.0])
def test_progress_is_the_share_of_the_time(environment_s: float) -> None:
    progress = FrameProgress()
    progress.expect_photons(PHOTONS)
    progress.expect_samples(SAMPLES)
    whole = environment_s + PHOTONS * PHOTON_S + SAMPLES * SAMPLE_S
    shares = np.linspace(0.0, 1.0, 5)
    if environment_s:
        asked = [progress.environment(share, share * environment_s) for share in shares[1:]]
        assert asked == pytest.approx(shares[1:] * environment_s / whole)
    traced = [progress.light(share) for share in shares]
    assert traced == pytest.approx((environment_s + shares * PHOTONS * PHOTON_S) / whole)
    assert progress.ends == traced[-1]
    seen = [progress.camera(share) for share in shares]
    assert seen == pytest.approx((environment_s + PHOTONS * PHOTON_S + shares * SAMPLES * SAMPLE_S) / whole)
    assert seen[-1] == 1.0 == progress.ends


def test_progress_never_falls_when_a_part_takes_longer_than_it_seemed() -> None:
    progress = FrameProgress()
    progress.expect_samples(SAMPLES)
    shares = [progress.environment(0.1, 0.1), progress.environment(0.2, 1.0), progress.environment(0.3, 9.0)]
    assert shares == sorted(shares)


def test_a_frame_of_nothing_has_no_progress() -> None:
    progress = FrameProgress()
    assert progress.light(1.0) == 0.0 == progress.camera(1.0)
