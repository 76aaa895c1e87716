"""Energy of random splats of every size, angle and place on the grid.

Smallest error this can detect: over 3,000 splats of 0.3 % scatter the mean is known to 0.006 %, so a bias of 0.05 % is
eight standard errors; the mutant below (the cut not given back, 0.27 %) must fail.
"""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.stress.rigs.splat_rig import Rig, photons

FEATURES = Features(spectral_groups=1)
TILES, SIDE = 15, 96
"""Splats are drawn in a grid of TILES², SIDE texels apart, and summed one by one."""
BIAS_LIMIT = 5e-4


def random_splats(rng: np.random.Generator, widest: float) -> np.ndarray:
    count = TILES * TILES
    cells = np.stack(np.meshgrid(np.arange(TILES), np.arange(TILES)), axis=-1).reshape(-1, 2)
    centre = cells * SIDE + SIDE / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    long = np.exp(rng.uniform(np.log(0.02), np.log(widest), count))
    short = long * np.exp(rng.uniform(np.log(0.02), 0.0, count))
    sweep = np.exp(rng.uniform(np.log(0.01), np.log(24.0), count))
    direction, heading = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    along = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    axis_t = np.stack([-along[:, 1], along[:, 0]], axis=1) * short[:, None]
    chord = np.stack([np.cos(heading), np.sin(heading)], axis=1) * sweep[:, None]
    return photons(FEATURES, centre, along * long[:, None], axis_t, chord)


def energies(rig: Rig, records: np.ndarray) -> np.ndarray:
    """Deposited over carried, per splat."""
    image = rig.draw(records)[..., 3]
    return image.reshape(TILES, SIDE, TILES, SIDE).sum(axis=(1, 3)).reshape(-1) / rig.light.power_w()


@pytest.fixture(scope="module")
def sample(gl) -> np.ndarray:
    rig = Rig(gl.ctx, FEATURES, size=(TILES * SIDE, TILES * SIDE))
    rng = np.random.default_rng(11)
    return np.concatenate([energies(rig, random_splats(rng, widest)) for widest in np.geomspace(0.3, 8.0, 14)])


def test_energy_is_exact_on_average(sample: np.ndarray) -> None:
    assert abs(sample.mean() - 1.0) < BIAS_LIMIT
    assert sample.std() / np.sqrt(len(sample)) < BIAS_LIMIT / 4.0


def test_ripple_over_the_grid_is_small(sample: np.ndarray) -> None:
    assert np.abs(sample - 1.0).max() < 0.06
    assert np.sqrt(np.mean((sample - 1.0) ** 2)) < 0.008


def test_the_mean_would_show_a_cut_that_is_not_given_back(sample: np.ndarray) -> None:
    assert abs((sample * 0.9973).mean() - 1.0) > BIAS_LIMIT


def test_footprints_that_fan_out_keep_their_energy(gl) -> None:
    """W changes by up to 0.3 a spacing, along the longer axis. 1,350 splats know their mean to about 0.05 %; while
    footprints shorter than a texel fanned too, single ones were off by a fifth, the mean of 675 by 1 %."""
    side, widest = 1024, (2.0, 4.0, 8.0)
    rig = Rig(gl.ctx, FEATURES, size=(side, side))
    rng = np.random.default_rng(12)
    sums = {False: 0.0, True: 0.0}
    for width in np.repeat(widest, 2):
        records = random_splats(rng, float(width))
        records["position"][:, :2] = rng.uniform(0.3 * side, 0.7 * side, (len(records), 2))
        fan = np.zeros((len(records), 2), np.float16)
        fan[:, 0] = rng.uniform(-0.3, 0.3, len(records))
        for fans in sums:
            records["fan"] = fan.view(np.uint32).reshape(-1) if fans else 0
            sums[fans] += rig.draw(records)[..., 3].sum()
    assert sums[True] != sums[False]
    assert sums[True] / sums[False] == pytest.approx(1.0, abs=1.5e-3)
