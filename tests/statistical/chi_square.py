"""Chi² tests of samplers with a stated power: what they accept, and the smallest error that they would not.

Lattices are more even than independent draws, so their statistic is too small and only the upper tail counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ALPHA = 1e-4
"""Chance that a right sampler of independent draws is refused."""
POWER = 0.99
"""Chance that an error of the stated size is seen."""
SMALLEST_EXPECTED = 8.0
"""Cells with fewer expected counts are pooled."""


@dataclass(frozen=True)
class ChiSquare:
    """One test's outcome."""

    statistic: float
    freedom: int
    p_value: float

    @property
    def accepted(self) -> bool:
        """Whether the counts may be of the expected density."""
        return self.p_value > ALPHA


def chi_square(counts: np.ndarray, expected: np.ndarray) -> ChiSquare:
    """Pearson's test of counts against expected shares of any shape (scaled to the same total)."""
    from scipy.stats import chi2

    counts, expected = np.asarray(counts, np.float64).ravel(), np.asarray(expected, np.float64).ravel()
    assert not counts[expected <= 0.0].any(), "counts in cells of no density"
    counts, expected = counts[expected > 0.0], expected[expected > 0.0]
    expected = expected * counts.sum() / expected.sum()
    counts, expected = _pooled(counts, expected)
    statistic = float(np.sum((counts - expected) ** 2 / expected))
    freedom = len(counts) - 1
    return ChiSquare(statistic, freedom, float(chi2.sf(statistic, freedom)))


def smallest_tilt(total: float, cells: int) -> float:
    """Amplitude a of a tilt 1 + a t, t linear from -1 to 1 over the density, that `cells` equal cells with `total`
    counts detect at `ALPHA` with `POWER`: the non-centrality is total a² / 3."""
    from scipy.optimize import brentq
    from scipy.stats import chi2, ncx2

    critical = chi2.isf(ALPHA, cells - 1)
    needed = brentq(lambda noncentral: ncx2.sf(critical, cells - 1, noncentral) - POWER, 1e-3, 1e4)
    return float(np.sqrt(3.0 * needed / total))


def thinned(weights: np.ndarray, largest: float, seed: int) -> np.ndarray:
    """bool: weighted samples made into counted ones, each kept with the chance weight / largest."""
    assert weights.max() <= largest * (1.0 + 1e-5)
    return np.random.default_rng(seed).random(len(weights)) * largest < weights


def star_discrepancy(values: np.ndarray) -> float:
    """Exact star discrepancy of numbers in [0, 1)."""
    ordered = np.sort(values)
    rank = np.arange(len(ordered))
    return float(np.maximum((rank + 1) / len(ordered) - ordered, ordered - rank / len(ordered)).max())


def box_discrepancy(points: np.ndarray, grid: int = 32) -> float:
    """Largest error of the share in boxes from the origin to a `grid`² of corners: a lower bound of the 2D star
    discrepancy."""
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=grid, range=((0, 1), (0, 1)))
    share = counts.cumsum(axis=0).cumsum(axis=1) / len(points)
    edge = np.arange(1, grid + 1) / grid
    return float(np.abs(share - edge[:, None] * edge).max())


def _pooled(counts: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(expected, kind="stable")
    small = int(np.count_nonzero(expected < SMALLEST_EXPECTED))
    if small == 0:
        return counts, expected
    # The smallest cells together, and with the next ones until the pool is large enough.
    running = np.cumsum(expected[order])
    size = max(small, int(np.searchsorted(running, SMALLEST_EXPECTED)) + 1)
    pool, rest = order[:size], order[size:]
    return np.append(counts[rest], counts[pool].sum()), np.append(expected[rest], expected[pool].sum())
