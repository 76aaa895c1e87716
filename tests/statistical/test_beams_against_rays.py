"""Beams against rays by chance: what polygons of one index hold, cell by cell and in all.

The tracer (`reference.facet_rays`) shares no code with the search. With N rays landed, a missing or doubled share of
all light of 5 / sqrt(N) is detected, and in a cell of n rays one of 5 / sqrt(n): quick, 1e6 rays sent, about 1 % of all
light and 10 % of a cell of 2,500; slow, 1e8 rays, 0.1 % and 1 %.
"""

from __future__ import annotations

import numpy as np
import pytest

from reference.beam_worlds import Rig, at_index, grid_about, scene_of, scores
from reference.beam_scenes import CASES, EXTREMES, NEAR
from reference.beam_sums import cells
from reference.facet_rays import landed
from spectrasplat.beams.polygons import joined

X = 0.4
CELL_SCORE, TOTAL_SCORE = 5.0, 4.5


def found_by_beams(rig: Rig, threshold: float):
    """All polygons of a lamp at one index."""
    return joined([rig.polygons(at_index(emission, X), threshold)[0] for emission in rig.emissions()])


def compare(text: str, rays: int, threshold: float, texel: float, side: int = 40) -> tuple[float, np.ndarray]:
    """Scores of the total and of the cells."""
    rig = Rig(scene_of(text), texel)
    polygons = found_by_beams(rig, threshold)
    grid = grid_about(rig, polygons, side)
    exact, outside, each = cells(polygons, 0, grid, from_hulls=True)
    np.testing.assert_allclose(each, polygons.flux, atol=1e-9 * polygons.flux.max())
    rays_found = landed(rig.world(X), rig.lamp(), grid, rays)
    weight = rays_found.total_variance / rays_found.total
    total = (rays_found.total - exact.sum() - outside) / np.sqrt(rays_found.total_variance)
    return total, scores(rays_found.flux, exact, rays_found.variance, weight, 50.0)


def agree(total: float, by_cell: np.ndarray) -> bool:
    """Whether scores are those of chance."""
    excess = (np.sum(by_cell**2) - len(by_cell)) / np.sqrt(2.0 * len(by_cell))
    return abs(total) < TOTAL_SCORE and np.abs(by_cell).max() < CELL_SCORE and excess < 5.0


@pytest.mark.parametrize("name", CASES)
def test_polygons_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(CASES[name], 1_000_000, 1e-7, 1e-3)
    assert agree(total, by_cell), (total, by_cell)


@pytest.mark.parametrize("name", NEAR)
def test_polygons_of_points_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(NEAR[name], 1_000_000, 1e-5, 1e-2, 24)
    assert agree(total, by_cell), (total, by_cell)


@pytest.mark.parametrize("name", EXTREMES)
def test_polygons_of_extremes_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(EXTREMES[name], 400_000, 1e-7, 1e-3, 24)
    assert agree(total, by_cell), (total, by_cell)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["prism", "step cut", "brilliant", "amici", "L", "two stones"])
def test_polygons_hold_what_a_hundred_million_rays_find(name: str) -> None:
    total, by_cell = compare(CASES[name], 100_000_000, 1e-8, 1e-3, 80)
    assert agree(total, by_cell), (total, by_cell)
