"""Beams against rays by chance: what polygons of one index hold, cell by cell and in all.

The rays are the float64 reference's photons, which share no code with the search. With N of them landed, a missing or
doubled share of all light of 5 / sqrt(N) is detected, and in a cell of n one of 5 / sqrt(n): with 4e5 photons sent,
about 1.5 % of all light and 16 % of a cell of 1,000.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference.beam_scenes import BRILLIANT, CASES, EXTREMES, NEAR, SUN, step_cut
from reference.beam_sums import cells
from reference.beam_worlds import Rig, at_index, grid_about, landed, scene_of, scores
from spectrasplat.beams.facets import convex_hull
from spectrasplat.beams.polygons import joined
from spectrasplat.beams.search import SUM_DEPOSITED, SUM_ENTERED, SUM_NUMERIC, SUM_ROULETTE

X = 0.4
CELL_SCORE, TOTAL_SCORE = 5.0, 4.5
POINT_BALANCE = 0.02


def found_by_beams(rig: Rig, threshold: float, x: float = X):
    """All polygons of a lamp at one index."""
    return joined([rig.polygons(at_index(emission, x), threshold)[0] for emission in rig.emissions()])


def compare(text: str, rays: int, threshold: float, texel: float, side: int = 40) -> tuple[float, np.ndarray]:
    """Scores of the total and of the cells."""
    rig = Rig(scene_of(text), texel)
    polygons = found_by_beams(rig, threshold)
    grid = grid_about(rig, polygons, side)
    exact, outside, each = cells(polygons, 0, grid, from_hulls=True)
    # A faint piece of a cone's rim holds what its slope says, not what its middle does.
    assert each.sum() == pytest.approx(polygons.flux.sum(), rel=1e-4)
    rays_found = landed(rig, X, grid, rays)
    total = (rays_found.total - exact.sum() - outside) / np.sqrt(rays_found.total_variance)
    return total, scores(rays_found.flux, exact, rays_found.variance, rays_found.weight, 50.0)


def agree(total: float, by_cell: np.ndarray) -> bool:
    """Whether scores are those of chance."""
    excess = (np.sum(by_cell**2) - len(by_cell)) / np.sqrt(2.0 * len(by_cell))
    return abs(total) < TOTAL_SCORE and np.abs(by_cell).max() < CELL_SCORE and excess < 5.0


@pytest.mark.parametrize("name", CASES)
def test_polygons_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(CASES[name], 400_000, 1e-7, 1e-3)
    assert agree(total, by_cell), (total, by_cell)


LONG = ("point brilliant",)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in NEAR])
def test_polygons_of_points_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(NEAR[name], 400_000, 1e-6, 4e-3, 24)
    assert agree(total, by_cell), (total, by_cell)


@pytest.mark.parametrize("name", [name for name in EXTREMES if name != "same"])
def test_polygons_of_extremes_hold_what_rays_find(name: str) -> None:
    total, by_cell = compare(EXTREMES[name], 400_000, 1e-7, 1e-3, 24)
    assert agree(total, by_cell), (total, by_cell)


def test_of_two_solids_in_one_place_the_later_counts() -> None:
    """To rounding: photons would meet one face after the other."""
    lamp, one, other = EXTREMES["same"].split("[[objects]]")
    both, later = (Rig(scene_of("[[objects]]".join(parts))) for parts in ((lamp, one, other), (lamp, other)))
    nm = both.axis.nm_of_x(X)
    polygons = [found_by_beams(rig, 1e-7, float(rig.axis.x_of_nm(nm))) for rig in (both, later)]
    grid = grid_about(later, polygons[1], 24)
    found, alone = (cells(each, 0, grid)[0] for each in polygons)
    assert alone.sum() > 0.1
    np.testing.assert_allclose(found, alone, rtol=0.0, atol=1e-6 * alone.max())


@pytest.mark.parametrize("name", {**CASES, **EXTREMES})
def test_no_light_is_lost_or_doubled(name: str) -> None:
    """What enters is what leaves, at single indices to rounding: facets of a solid tile every beam inside it."""
    rig = Rig(scene_of((CASES | EXTREMES)[name]))
    entered = ended = lost = 0.0
    for emission in rig.emissions():
        _, sums = rig.polygons(at_index(emission, 0.0, X, 1.0), 1e-5)
        entered, ended, lost = (
            entered + sums[SUM_ENTERED],
            ended + sums[: SUM_ROULETTE + 1].sum(),
            lost + sums[SUM_NUMERIC],
        )
    # Absorption is that of a piece's middle.
    tolerance = 1e-3 if name == "tinted" else 1e-12
    assert ended == pytest.approx(entered, rel=tolerance)
    assert lost <= 1e-12 * entered


@pytest.mark.parametrize("name", NEAR)
def test_little_light_of_a_point_is_lost_or_doubled(name: str) -> None:
    """The same to first order: rays of a piece are affine to a quarter of a texel."""
    rig = Rig(scene_of(NEAR[name]), 4e-3)
    all_sums = sum(rig.polygons(at_index(emission, X), 1e-5)[1] for emission in rig.emissions())
    assert all_sums[: SUM_ROULETTE + 1].sum() == pytest.approx(all_sums[SUM_ENTERED], rel=POINT_BALANCE)
    assert all_sums[SUM_NUMERIC] <= 1e-5 * all_sums[SUM_ENTERED]


def test_what_enters_is_the_silhouette() -> None:
    """Of a convex stone in parallel light: the hull of its corners across the light."""
    for text in (SUN + BRILLIANT, SUN + step_cut()):
        rig = Rig(scene_of(text))
        emission = rig.emissions()[0]
        right, up, _ = rig.scene.lights[0].axes().T
        flat = rig.meshes[0].vertices @ np.stack([right, up], axis=1)
        hull = flat[convex_hull(flat)]
        u, v = hull.T
        area = 0.5 * abs(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1)))
        for x in (0.0, X, 1.0):
            _, sums = rig.polygons(at_index(emission, x), 1e-2)
            assert sums[SUM_ENTERED] == pytest.approx(area, rel=1e-9)


def test_roulette_keeps_the_mean_and_follows_its_seed() -> None:
    """Of 200 seeds, by what lands: to 4.5 standard errors, which are 0.6 % of it."""
    rig = Rig(scene_of(CASES["L"]))
    emission = at_index(rig.emissions()[0], X)
    exact = rig.find(emission, 1e-9)[1][SUM_DEPOSITED]
    found = np.array([rig.find(emission, 3e-2, seed)[1][SUM_DEPOSITED] for seed in range(200)])
    error = found.std() / np.sqrt(len(found))
    assert 0.0 < error < 1e-2 * exact
    assert abs(found.mean() - exact) < 4.5 * error
