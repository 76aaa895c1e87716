"""Seeds are independent repeats: the words they are hashed to, the lattices those shift, and the maps that come of it.

With shifts that are the seed times a number near the lattice's own generator (`near_copies`, as this was built once),
another seed moved a lattice by 4e-4 of a cell, and bands over seeds, bias and variance were those of near-copies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
import pytest
from spectrasplat.base import random_words
from spectrasplat.base.paths import assets_dir
from spectrasplat.base.random_words import PASS_GENERATORS, Dimension, random_word
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.emission import GOLDEN
from spectrasplat.render import light_plan
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.render.light_pass import LightPass

from tests.statistical.chi_square import ALPHA, chi_square, smallest_tilt

WORD = 2**32
TILT = 0.07
"""Tilt of a density that is seen with probability 0.99."""
LATTICE_DIMENSIONS = (Dimension.LATTICE_U, Dimension.LATTICE_V)
Shift = Callable[[int, int, int, Dimension], int]


def near_copies(seed: int, light: int, number: int, dimension: Dimension) -> int:
    """What the shifts were once."""
    return (seed * 0x9E3779B1 + light * 0x85EBCA6B + (number + 1) * PASS_GENERATORS[dimension]) % WORD


def words(seeds: int = 64, lights: int = 16, passes: int = 16, dimensions: int = len(Dimension)) -> np.ndarray:
    """Words of small arguments in [0, 1), one axis each."""
    shape = seeds, lights, passes, dimensions
    return np.array([random_word(*at) for at in product(*map(range, shape))]).reshape(shape) / WORD


def even(*coordinates: np.ndarray, bins: int = 64) -> float:
    """p-value of coordinates in [0, 1) being even over `bins` cells in all."""
    each = round(bins ** (1.0 / len(coordinates)))
    counts, _ = np.histogramdd(
        np.column_stack([c.ravel() for c in coordinates]), bins=each, range=[(0.0, 1.0)] * len(coordinates)
    )
    assert smallest_tilt(counts.sum(), counts.size) < TILT
    return chi_square(counts, np.ones(counts.shape)).p_value


def test_words_of_small_numbers_are_uniform_and_independent_of_their_neighbours() -> None:
    found = words()
    assert len(np.unique(found)) > found.size - 10  # birthday: one pair of 98,304 in 2^32
    low = found * 65536.0 % 1.0
    p_values = [even(found), even(low), even(found, low)]
    for axis in range(4):
        for step in (1, 2):
            here, there = (
                np.take(found, range(*of), axis) for of in ((0, found.shape[axis] - step), (step, found.shape[axis]))
            )
            p_values += [even(here, there), even((there - here) % 1.0)]
    assert min(p_values) > ALPHA / len(p_values)
    # Mutants: a word that does not depend on the light, and one that is a product and a sum.
    assert even(found[:, :1] + 0.0 * found[:, 1:], found[:, 1:]) < 1e-3 * ALPHA
    at = np.indices(found.shape)
    summed = (at[0] * 0x9E3779B1 + at[1] * 0x85EBCA6B + at[3] * 0xC2B2AE35) % WORD / WORD
    assert even((summed[1:] - summed[:-1]) % 1.0) < 1e-3 * ALPHA


def test_passes_of_one_seed_keep_their_sequence() -> None:
    """What is random is where it starts: from pass to pass every shift moves by its own irrational."""
    for dimension, generator in PASS_GENERATORS.items():
        steps = {
            (random_words.shift(5, 1, k + 1, dimension) - random_words.shift(5, 1, k, dimension)) % WORD
            for k in range(64)
        }
        assert steps == {generator}
    # Roulette is new in every pass, and no seed's pass is another seed's.
    keys = {random_word(seed, 0, number, Dimension.BRANCH) for seed in (1, 2, 7920, 7921) for number in range(64)}
    assert len(keys) == 256


def cell_vectors(points: int) -> np.ndarray:
    """(2, 2) rows: the two shortest vectors of the lattice (i / points, i GOLDEN / 2³² mod 1)."""
    short, long = np.array([1.0 / points, GOLDEN / WORD]), np.array([0.0, 1.0])
    while True:  # Lagrange's reduction
        if short @ short > long @ long:
            short, long = long, short
        factor = round(float(short @ long / (short @ short)))
        if factor == 0:
            return np.array([short, long])
        long = long - factor * short


def displacements(shift: Shift, points: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(pairs, 2) in [-½, ½): how far two seeds move the lattice against each other, in its cell vectors."""
    place = [
        np.array([[shift(seed, 0, 0, d) / WORD for d in LATTICE_DIMENSIONS] for seed in seeds.tolist()]) / [points, 1.0]
        for seeds in (first, second)
    ]
    return (np.linalg.solve(cell_vectors(points).T, (place[1] - place[0]).T).T + 0.5) % 1.0 - 0.5


@pytest.mark.parametrize("points", [1 << 10, 1 << 16, 1 << 22])
def test_seeds_shift_a_lattice_by_anything_within_its_cell(points: int) -> None:
    """A shift by a lattice vector renumbers the points and moves none: what is left of it is what tells two seeds
    apart."""

    def p_value(shift: Shift) -> float:
        seeds = np.arange(1 << 15).reshape(-1, 2)  # each in one pair, so that pairs are independent
        counts, _, _ = np.histogram2d(
            *displacements(shift, points, *seeds.T).T, bins=8, range=((-0.5, 0.5), (-0.5, 0.5))
        )
        assert smallest_tilt(counts.sum(), counts.size) < 0.14
        return chi_square(counts, np.ones(counts.shape)).p_value

    def copies(shift: Shift) -> int:
        """Pairs of the first 64 seeds that lie within the thousandth of the cell round a lattice vector."""
        first, second = np.triu_indices(64, 1)
        near = np.abs(displacements(shift, points, first, second)).max(axis=1) < 0.5 * np.sqrt(1e-3)
        return int(near.sum())

    assert p_value(random_words.shift) > ALPHA
    assert copies(random_words.shift) < 12  # of 2016; 2 expected, 12 by chance once in 10^6
    assert p_value(near_copies) < 1e-3 * ALPHA
    assert copies(near_copies) > 12


PHOTONS, SEEDS = 60_000, 12
TOLERANCE = 0.1
"""Of the ratio: four of its standard deviations, as five such sets had them (2 % each noise)."""


def noise(light: LightPass, first: int) -> float:
    """Root mean square over texels of what differs between `SEEDS` seeds, in shares of the mean map's."""
    maps = []
    for seed in range(first, first + SEEDS):
        light.begin(PHOTONS, seed)
        light.run_pass(0, PHOTONS, lambda _: True)
        maps.append(light.maps.receiver(0)[..., :3].astype(float) * light.maps.scale)
    return float(np.sqrt(np.var(maps, axis=0, ddof=1).mean() / np.mean(np.mean(maps, axis=0) ** 2)))


def drawn_shifts(rng: np.random.Generator) -> Shift:
    """Shifts from another generator of random numbers, for a rendering of one pass."""
    drawn: dict[tuple[int, int, int], int] = {}
    return lambda seed, light, number, dimension: drawn.setdefault((seed, light, dimension), int(rng.integers(WORD)))


@pytest.fixture(params=["prism_case", "rod"])
def light(gl: Context, request: pytest.FixtureRequest) -> Iterator[LightPass]:
    scene = load_scene(assets_dir() / "scenes" / f"{request.param}.toml")
    settings = RenderSettings(
        width=96, height=96, layer="caustic", max_depth=scene.render.max_depth, method="srd-photons"
    )
    features = Features.of(scene, settings)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    half = LightPass(gl, scene, settings, features, buffers)
    half.prepare()
    yield half
    half.release()
    buffers.release()


@pytest.mark.slow
def test_seeds_differ_as_independent_shifts_do(light: LightPass, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ratio of both noises, each of twelve maps: 1. Of near-copies it was 0.16 in one scene, 0.49 in the other."""
    found = {}
    for name, shift in (
        ("ours", random_words.shift),
        ("independent", drawn_shifts(np.random.default_rng(1))),
        ("copies", near_copies),
    ):
        monkeypatch.setattr(light_plan, "shift", shift)
        found[name] = noise(light, 1)
    assert found["ours"] / found["independent"] == pytest.approx(1.0, abs=TOLERANCE)
    assert found["copies"] / found["independent"] < 0.6
