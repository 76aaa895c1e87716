"""Lattices: the emission's order, places of samples in a pixel, dispatches and passes that take as much as they
should."""

from __future__ import annotations

from itertools import islice, pairwise

import numpy as np
import pytest
from spectrasplat.gpu.dispatch_budget import DispatchBudget
from spectrasplat.passes.beam_records import hull_areas
from spectrasplat.passes.beam_splat import TEXELS, portion_end
from spectrasplat.passes.lattice_slice import GOLDEN, LatticeSlice, block_of, block_orders, morton_order
from spectrasplat.passes.sample_spread import LOOKS, cells_of, looks_lattice, pixel_lattice
from spectrasplat.render.pass_sizes import (
    ALPHA,
    FIRST_PHOTONS,
    GROWTH,
    LARGEST_PHOTONS,
    PASS_PHOTONS,
    WEIGHT_POWER,
    emphasis,
    endless_passes,
    kernel_scale,
    pass_sizes,
)


@pytest.mark.parametrize(
    ("points", "stride", "lattice"),
    [(1, 1, 1), (1000, 1, 1000), (4096, 3, 12_288), (777, 5, 3885), (20_000, 1, 65_536)],
)
def test_every_point_once(points: int, stride: int, lattice: int) -> None:
    order = morton_order(points, stride, lattice)
    assert order.dtype == np.uint32
    np.testing.assert_array_equal(np.sort(order), np.arange(points))


@pytest.mark.parametrize(("points", "rounds"), [(1000, 7), (4096, 12), (33_333, 22)])
def test_a_point_stands_in_the_middle_of_its_row(points: int, rounds: int) -> None:
    """Rows of neighbours as long as there are rounds hold every point of the lattice once, and whatever length of them
    one point stands for, it has their mean place and their spread."""

    def places(piece: LatticeSlice) -> np.ndarray:
        index = piece.first + piece.stride * np.arange(piece.points)
        across = (index * GOLDEN + piece.shift[1]) % 2**32 / 2**32
        return np.stack([(index + piece.shift[0] / 2**32) / points, across], axis=1) * points**0.5

    whole = LatticeSlice(0, (), points, 0, 1, points, (3_000_000_000, 123_456_789), (0, 0), 0, 0)
    single = [whole.row_of(rounds, j, 1, 0.5) for j in range(rounds)]
    numbers = np.concatenate([piece.first + rounds * np.arange(piece.points) for piece in single])
    np.testing.assert_array_equal(np.sort(numbers), np.arange(points))
    for first, length in ((0, 2), (1, 3), (2, rounds - 2)):
        piece = whole.row_of(rounds, first, length, 0.5)
        step = np.array(piece.row) * 0.5 / ((length**2 - 1) / 12) ** 0.5
        assert piece.stands_for == length and 0.5 < np.hypot(*step) < 1.3
        for nth in range(length):
            row = places(single[first + nth])
            for at in places(piece)[:20] + (nth - 0.5 * (length - 1)) * step:
                away = (row - at) / points**0.5
                nearest = np.abs(away - np.round(away)).max(axis=1).min() * points**0.5
                assert nearest < 1e-3 or not 1.0 < at[0] < points**0.5 - 1.0


@pytest.mark.parametrize(("shift", "stride"), [((0.0, 0.0), 1), ((0.37, 0.81), 1), ((0.123, 0.456), 4)])
def test_eight_in_a_row_are_close(shift: tuple[float, float], stride: int) -> None:
    points = 16_384
    lattice = points * stride
    index = np.arange(points) * stride + 1
    place = np.stack([index / lattice + shift[0], index * GOLDEN % 2**32 / 2**32 + shift[1]], axis=1)

    def spread(order: np.ndarray) -> float:
        """Typical extent of a group of eight on the torus, in spacings."""
        groups = place[order].reshape(-1, 8, 2)
        apart = groups - groups[:, :1]
        apart -= np.round(apart)
        return float(np.median(np.linalg.norm(apart, axis=2).max(axis=1)) * np.sqrt(points))

    block = block_of(points)
    of_block = block_orders(stride)[block : 2 * block]
    np.testing.assert_array_equal(np.sort(of_block), np.arange(block))
    assert spread((np.arange(0, points, block)[:, None] + of_block).ravel()) < 6.0
    assert spread(morton_order(points, stride, lattice)) < 5.0
    assert spread(np.arange(points)) > 20.0


def rows_and_columns(places: np.ndarray) -> tuple[list[int], list[int]]:
    cells = np.floor(places * len(places) + 1e-9).astype(int)
    return sorted(cells[:, 0]), sorted(cells[:, 1])


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 7, 16])
def test_all_looks_together_tell_outlines_apart(samples):
    """One in each of as many columns and rows as there are: an upright or level edge is known to one of them. (Four
    about each of sixteen samples, all turned alike, fell on seventeen columns.)"""
    looks = looks_lattice(samples, 0)
    assert looks.shape == (samples, LOOKS, 2)
    columns, rows = rows_and_columns(looks.reshape(-1, 2))
    assert columns == rows == list(range(LOOKS * samples))


@pytest.mark.parametrize("offset", [0, 16, 48])
def test_looks_lie_about_their_sample(offset):
    """So that where all of them meet glass, the sample does."""
    off = looks_lattice(16, offset) - pixel_lattice(16, offset)[:, None]
    off = (off + 0.5) % 1.0 - 0.5
    assert np.linalg.norm(off, axis=-1).max() < 0.3
    assert np.linalg.norm(off.mean(axis=1), axis=-1).max() < 0.2


@pytest.mark.parametrize("samples", [4, 8, 16, 32, 64])
@pytest.mark.parametrize("offset", [0, 5, 64])
def test_powers_of_two_have_a_cell_each_and_so_have_their_bands(samples: int, offset: int) -> None:
    """All samples, and every second or fourth of them, which see one band of the spectrum. (Hammersley's order puts
    each band's samples into a quarter of the pixel.)"""
    places = pixel_lattice(samples, offset)
    for bands in (1, 2, 4):
        for first in range(bands):
            of_band = places[first::bands]
            columns, rows = cells_of(len(of_band))
            cells = np.floor(of_band * (columns, rows)).astype(int)
            assert len(np.unique(cells @ (1, 1000))) == len(of_band), (bands, first)


@pytest.mark.parametrize("unit_s", [1e-7, 3e-5, 2e-3])
def test_dispatches_come_to_take_what_they_should(unit_s: float) -> None:
    dispatch_budget = DispatchBudget(16, 8, 1 << 16)
    for _ in range(20):
        dispatch_budget.learn(dispatch_budget.units, 2e-4 + dispatch_budget.units * unit_s, 0.01)
    wanted = min(max(0.01 / unit_s, 8), 1 << 16)
    assert 0.8 * wanted - 8 <= dispatch_budget.units <= wanted + 8
    assert dispatch_budget.units % 8 == 0


def test_it_grows_carefully_and_shrinks_at_once() -> None:
    dispatch_budget = DispatchBudget(64, 64, 1 << 20)
    dispatch_budget.learn(64, 1e-6, 0.1)
    assert dispatch_budget.units == 256
    dispatch_budget.learn(256, 1.0, 0.1)
    assert dispatch_budget.units == 64


def test_a_small_rest_says_nothing_but_that_it_took_too_long() -> None:
    dispatch_budget = DispatchBudget(1024, 64, 1 << 20)
    dispatch_budget.learn(64, 0.009, 0.01)
    assert dispatch_budget.units == 1024
    dispatch_budget.learn(64, 0.02, 0.01)
    assert dispatch_budget.units == 64


def test_hull_areas_far_from_the_window_keep_their_digits() -> None:
    square, triangle = (
        np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]),
        np.array([[0.0, 0.0], [1.0, 0], [0, 3]]),
    )
    for away in (0.0, 1e9):
        hulls = np.concatenate([square, triangle[::-1]]) + away
        np.testing.assert_allclose(hull_areas(hulls, np.array([0, 4])), [4.0, 1.5])


def test_a_portion_covers_no_more_than_it_may() -> None:
    random = np.random.default_rng(1)
    area = np.where(random.random(500) < 0.1, 0.4, 0.01) * TEXELS
    area[[0, 77, 499]] = 3.0 * TEXELS  # one alone must be drawn all the same
    covered = np.cumsum(area)
    ends, done = [0], 0
    while done < len(area):
        done = portion_end(covered, done)
        ends.append(done)
    assert ends[-1] == 500 and np.all(np.diff(ends) >= 1)
    for start, end in pairwise(ends):
        assert end - start == 1 or area[start:end].sum() <= 1.0001 * TEXELS
        # As many as there is room for: drawing has a price too.
        assert end == 500 or area[start : end + 1].sum() > 0.999 * TEXELS


def test_what_lies_outside_the_window_goes_together() -> None:
    assert portion_end(np.zeros(40), 3) == 40


def test_kernels_follow_the_recursion() -> None:
    """r²ᵢ₊₁ / r²ᵢ = (i + α)/(i + 1), passes counted from 1."""
    scales = np.array([kernel_scale(number) for number in range(200)])
    assert scales[0] == pytest.approx(1.0)
    i = np.arange(1, 200)
    np.testing.assert_allclose((scales[1:] / scales[:-1]) ** 2, (i + ALPHA) / (i + 1), rtol=1e-12)
    # In the end as i^((α − 1)/2): with N photons, N passes, variance and bias² of a density both fall as N^(−2/3).
    late = np.log(kernel_scale(1_000_000) / kernel_scale(10_000)) / np.log(100.0)
    assert late == pytest.approx(0.5 * (ALPHA - 1.0), abs=1e-4)


def test_passes_of_equal_size_add_up() -> None:
    for photons in (1, 500, PASS_PHOTONS, 3 * PASS_PHOTONS // 2 + 1, 1_000_000):
        sizes = pass_sizes("progressive-stochastic", photons)
        assert abs(sum(sizes) - photons) <= len(sizes) and len(set(sizes)) == 1 and sizes[0] < 2 * PASS_PHOTONS
    assert len(pass_sizes("progressive-stochastic", 1_000_000)) == 61
    assert pass_sizes("stochastic", 1_000_000) == pass_sizes("srd", 1_000_000) == [1_000_000]


def test_passes_that_grow_end_with_a_whole_one() -> None:
    for photons in (1, 500, FIRST_PHOTONS, 5 * FIRST_PHOTONS - 1, 5 * FIRST_PHOTONS, 123_457, 10_000_000):
        sizes = pass_sizes("progressive", photons)
        assert sum(sizes) == photons and all(n > 0 for n in sizes)
        growths = np.array(sizes[1:]) / sizes[:-1]
        np.testing.assert_allclose(growths, GROWTH, rtol=1e-3)
        assert sizes[0] == photons or FIRST_PHOTONS <= sizes[0] < (GROWTH + 1.0) * FIRST_PHOTONS + 1
    # A rendering without an end goes through the same sizes, and no further than lattices can be counted.
    endless = list(islice(endless_passes("progressive"), 40))
    assert endless[:4] == pass_sizes("progressive", sum(endless[:4]))
    assert max(endless) == LARGEST_PHOTONS and endless == sorted(endless)


def test_coarse_passes_fade() -> None:
    """Whatever a pass errs by, its share of the sum falls as photons grow: what first passes blur goes with N^-3."""
    shares = []
    for count in (2, 4, 6):
        sizes = list(islice(endless_passes("progressive"), count))
        weights = np.array([n * emphasis(n, sizes[0]) for n in sizes])
        shares.append(weights[0] / weights.sum())
        assert weights[-1] / weights.sum() > 0.9
    slope = np.diff(np.log(shares)) / np.diff(np.log([GROWTH**2, GROWTH**4, GROWTH**6]))
    np.testing.assert_allclose(slope, -WEIGHT_POWER, atol=0.05)
    assert emphasis(5000, 5000) == 1.0
