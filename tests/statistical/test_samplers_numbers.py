"""Random numbers, lattices and roulette's draws: uniform alone, in pairs and over passes.

The numpy references stand for the shaders here; tests/gpu holds them equal bit for bit. Independent draws are
judged by chi² (a tilt of `tilt` is seen with probability 0.99), low-discrepancy ones by their discrepancy too, against
bounds a few times what golden-ratio lattices reach and a tenth of what random numbers of that count have.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from reference.samplers import mirrored_lattice_point, radical_inverse
from scipy.spatial import KDTree
from spectrasplat.base import paths
from spectrasplat.base.random_words import PASS_GENERATORS
from spectrasplat.gpu.records import LATTICE_BIT, trace_parameters
from spectrasplat.passes.sample_spread import cells_of, pixel_lattice
from spectrasplat.reference.emission import GOLDEN, PLASTIC, lattice_point
from spectrasplat.reference.random_numbers import hash_combine, hash_pcg, kronecker, unit_float
from spectrasplat.stress.rigs.glsl_function import evaluate

from tests.statistical.chi_square import (
    ALPHA,
    box_discrepancy,
    chi_square,
    smallest_tilt,
    star_discrepancy,
)

COUNT = 1 << 18
WORD = 2**32
TILT = 0.035


def even(*coordinates: np.ndarray, bins: int = 64) -> float:
    """p-value of coordinates in [0, 1) being even over `bins` cells in all."""
    each = round(bins ** (1.0 / len(coordinates)))
    counts, _ = np.histogramdd(np.column_stack(coordinates), bins=each, range=[(0.0, 1.0)] * len(coordinates))
    assert smallest_tilt(counts.sum(), counts.size) < TILT
    return chi_square(counts, np.ones(counts.shape)).p_value


def test_hashes_are_uniform_and_neighbours_independent() -> None:
    i = np.arange(COUNT, dtype=np.uint32)
    hashed = hash_pcg(i)
    low = (hashed & np.uint32(0xFFFF)) / 65536.0
    assert (
        min(
            even(unit_float(hashed)),
            even(low),
            even(unit_float(hashed[:-1]), unit_float(hashed[1:])),
            even(unit_float(hashed), low),
        )
        > ALPHA
    )
    # As the camera uses them: keys of pixels, then of lights.
    x, y = i % 512, i // 512
    pixel = hash_combine(hash_combine(np.uint32(1), x), y)
    right = hash_combine(hash_combine(np.uint32(1), x + 1), y)
    below = hash_combine(hash_combine(np.uint32(1), x), y + 1)
    for other in (right, below, hash_combine(pixel, 0), hash_combine(pixel, 1)):
        assert even(unit_float(pixel), unit_float(other)) > ALPHA
    assert len(np.unique(pixel)) > COUNT - 20  # birthday: 8 pairs of 2^18 in 2^32
    # Mutants: the generator without its output permutation, and a bit that is stuck half the time.
    raw = (i.astype(np.uint64) * np.uint64(747796405) + np.uint64(2891336453)) % np.uint64(WORD)
    assert even(unit_float(raw[:-1]), unit_float(raw[1:])) < 1e-3 * ALPHA
    stuck = np.where(low < 0.05, hashed & np.uint32(0x7FFFFFFF), hashed)
    assert even(unit_float(stuck)) < 1e-3 * ALPHA


def test_a_random_shift_makes_every_lattice_point_uniform() -> None:
    rng = np.random.default_rng(1)
    i, shift = rng.integers(0, 1000, COUNT), rng.integers(0, WORD, (2, COUNT))
    point = lattice_point(i, 1000, (shift[0], shift[1]))
    assert even(point[:, 0], point[:, 1]) > ALPHA
    # One point of the lattice alone is even along its second axis, and along its own thousandth of the first.
    alone = lattice_point(np.full(COUNT, 7), 1000, (shift[0], shift[1]))
    assert even(alone[:, 0] * 1000.0 - 7.0, alone[:, 1]) > ALPHA
    # Mutant: two shifts that are not independent.
    biased = lattice_point(np.full(COUNT, 7), 1000, (shift[0], shift[1] & (shift[0] | 0x7FFFFFFF)))
    assert even(biased[:, 0] * 1000.0 - 7.0, biased[:, 1]) < 1e-3 * ALPHA


@pytest.mark.parametrize("count", [1000, 4096, 65_536])
def test_lattices_are_far_more_even_than_chance(count: int) -> None:
    i = np.arange(count)
    bound = 3.0 * np.log(count) / count
    for shift in ((0, 0), (123456789, 987654321)):
        points = lattice_point(i, count, shift)
        assert star_discrepancy(points[:, 1]) < bound
        assert box_discrepancy(points) < bound
    assert box_discrepancy(np.random.default_rng(2).random((count, 2))) > 3.0 * bound if count > 60_000 else True
    rational = np.column_stack([i / count, i * 0.625 % 1.0])
    assert box_discrepancy(rational) > 3.0 * bound


def test_shifts_are_even_over_passes() -> None:
    """Where a given lattice point comes to lie from pass to pass, alone and for each pair of dimensions."""
    passes = 1024
    shift = np.column_stack([kronecker(np.arange(1, passes + 1), g, 0) for g in PASS_GENERATORS.values()])
    for first in range(len(PASS_GENERATORS)):
        assert star_discrepancy(shift[:, first]) < 3.0 * np.log(passes) / passes
        for second in range(first):
            assert box_discrepancy(shift[:, [second, first]], 16) < 0.02
    # Two generators this was built with once: three times the second is within 4.5e-4 of the first.
    related = np.column_stack([kronecker(np.arange(1, passes + 1), g, 0) for g in (2447445414, 2246822519)])
    assert box_discrepancy(related, 16) > 0.03


def test_sub_lattices_of_bands_and_places_are_shifted_evenly() -> None:
    sub = np.arange(1024)
    points = np.column_stack([kronecker(sub, g, 0) for g in PLASTIC])
    assert box_discrepancy(points, 16) < 0.02


@pytest.mark.parametrize("count", [2, 4, 6, 16, 64, 256])
def test_places_on_a_lamp_have_their_mean_in_its_middle_and_are_even(count: int) -> None:
    """What few places light is blurred, not moved; over many passes every place is as likely as any other."""
    shift = hash_combine(np.arange(512), 17), hash_combine(np.arange(512), 18)
    places = np.stack(
        [mirrored_lattice_point(np.arange(count), count, (int(a), int(b))) for a, b in zip(*shift, strict=True)]
    )
    assert ((places >= 0.0) & (places <= 1.0)).all()
    assert np.abs(places.mean(axis=1) - 0.5).max() < 1e-6
    # Each column of the square cut into `count` holds one.
    assert (np.sort(places[..., 0] * count, axis=1).astype(int) == np.arange(count)).mean() > 0.999
    assert box_discrepancy(places.reshape(-1, 2), 16) < 0.05 / np.sqrt(count)


@pytest.mark.parametrize("light_points", [1, 3, 16, 256, 4096, 8192])
def test_one_wavelength_a_photon_is_even_whatever_the_number_of_places(light_points: int) -> None:
    """`stochastic-even`: with every number of places on a light the wavelengths of a pass are even, alone, with the
    lattice, and of each place in each quarter of its lattice."""
    points = 65_536 // light_points
    photon = np.arange(points * light_points)
    point, place = photon // light_points, photon % light_points
    colour = kronecker(point, 3774877043, place * 2447445414)
    assert star_discrepancy(colour) < 3.0 * np.log(len(photon)) / len(photon)
    for part in np.array_split(colour[place == light_points // 2], 4) if points > 64 else []:
        assert star_discrepancy(part) < 2.0 * np.log(len(part)) / len(part)
    on_light = mirrored_lattice_point(place, light_points, (0, 0))
    for other in (
        ([point / points] if points > 64 else [])
        + [kronecker(point, GOLDEN, 0)] * (points > 64)
        + [on_light[:, 0], on_light[:, 1]] * (light_points > 64)
    ):
        assert box_discrepancy(np.column_stack([colour, other]), 16) < 0.02


def test_places_in_a_pixel_are_even_in_one_launch_and_over_many() -> None:
    for samples in (1, 2, 4, 16, 64):
        places = pixel_lattice(samples, 0)
        assert ((places >= 0.0) & (places < 1.0)).all()
        # Each column of the pixel cut into `samples` holds one.
        assert sorted((places[:, 0] * samples).astype(int)) == list(range(samples))
        assert star_discrepancy(places[:, 1]) <= 1.9 / samples
    # The viewer adds four samples at a time.
    launches = np.concatenate([pixel_lattice(4, 4 * k) for k in range(1024)])
    assert box_discrepancy(launches) < 0.01
    single = np.concatenate([pixel_lattice(1, k) for k in range(4096)])
    assert box_discrepancy(single) < 0.01
    still = np.concatenate([pixel_lattice(4, 0) for _ in range(1024)])
    assert box_discrepancy(still) > 0.05


def test_single_wavelengths_are_even_over_the_places_in_a_pixel() -> None:
    """Of camera samples: with a ratio of their own a height in the pixel had colours of its own (2.5 to 3 at 64 and 256
    samples), and with the places' ratio all heights did, however many samples. Powers of two are a net with them."""
    for samples in (64, 100, 204, 256, 1000, 1024):
        places, index = pixel_lattice(samples, 0), np.arange(samples)
        for colour, even in ((radical_inverse(index, 0), True), (kronecker(index, GOLDEN, 0), False)):
            worst = max(box_discrepancy(np.column_stack([colour, places[:, axis]])) for axis in range(2))
            if even or cells_of(samples) == (0, 0):
                assert (worst < 1.25 * samples**-0.75) is even, (samples, worst)
    places, colour = pixel_lattice(64, 0), radical_inverse(np.arange(64), 0x9E3779B9)
    for cells, bands in ((4, 4), (2, 16), (8, 1)):
        boxes = np.column_stack([np.floor(places * cells), np.floor(colour * bands)])
        assert len(np.unique(boxes, axis=0)) == 64


THRESHOLD = 0.3
LATTICES = 3


LATTICE_SHIFT = 123456789


def survives_source(lattice_count: int = 0) -> str:
    """The tracer's roulette with the parameters it reads; `lattice_count` 0: rays lie on no lattice."""
    text = (paths.shaders_dir() / "light/roulette.glsl").read_text()
    values = (
        f"made.split_threshold = {THRESHOLD}; made.lattices = {LATTICES}u; made.lattices_together = 1u; "
        f"made.lattice_bits = {lattice_count << LATTICE_BIT}u; made.lattice_shift = {LATTICE_SHIFT}u;"
    )
    made = f"TraceParameters parameters() {{ TraceParameters made; {values} return made; }}"
    carried = """
struct Walk { float flux_w; float footprint_scale; float survival; uint photon_id; uint branch_key; };
struct Path { vec3 throughput; uint depth; Walk walk; };
float carried_w(Path path) { return path.walk.flux_w; }
"""
    return f"{made}\n#define LATTICE_BIT {LATTICE_BIT}\nTraceParameters p = parameters();\n{carried}\n{text}"


def generators() -> list[int]:
    """Roulette's irrationals, one a depth up to 63: a table for the first, hashed ones below."""
    text = (paths.shaders_dir() / "lib/random.glsl").read_text()
    table = [
        int(g) for g in re.search(r"generators\[\d+\] =\s+uint\[\]\(([^)]*)\)", text)[1].replace("u", "").split(",")
    ]
    return table + [int(hash_pcg(depth)) | 1 for depth in range(len(table), 64)]


TABLE = 8
"""Depths whose irrationals were chosen."""


def draws(depth: int, key: np.ndarray | int, photon: np.ndarray, irrationals: list[int]) -> np.ndarray:
    """CPU reference of roulette's number."""
    shift = (np.asarray(key, np.uint64) + (photon % LATTICES).astype(np.uint64) * np.uint64(GOLDEN)) % np.uint64(WORD)
    return kronecker(photon // LATTICES, irrationals[depth], shift)


def play(
    gl,
    photon: np.ndarray,
    depth: np.ndarray,
    key: np.ndarray,
    survival: np.ndarray,
    share: np.ndarray,
    scale: float = 1.0,
    lattice_count: int = 0,
) -> dict[str, np.ndarray]:
    body = """
    Path path;
    path.throughput = vec3(survival * share); path.depth = depth;
    path.walk = Walk(survival * share, scale, survival, photon, key);
    float roulette = 0.0;
    alive = survives(path, roulette, share, 2u) ? 1u : 0u;
    flux = path.walk.flux_w; taken = roulette; left = path.walk.survival; next_key = path.walk.branch_key;
    throughput = path.throughput.y; wide = path.walk.footprint_scale;
    """
    inputs = {
        "photon": photon.astype(np.uint32),
        "depth": depth.astype(np.uint32),
        "key": key.astype(np.uint32),
        "survival": survival,
        "share": share,
        "scale": np.full(len(photon), scale),
    }
    outputs = {
        "alive": "uint",
        "flux": "float",
        "taken": "float",
        "left": "float",
        "next_key": "uint",
        "throughput": "float",
        "wide": "float",
    }
    return evaluate(
        gl.ctx,
        ["lib/lattice.glsl"],
        body,
        inputs,
        outputs,
        structs=[trace_parameters()],
        declarations=survives_source(lattice_count),
    )


def test_survivors_of_roulette_have_the_power_and_the_place_of_those_that_died(gl) -> None:
    """Footprints are as wide as the thinned lattice is, whose spacing grows as 1/sqrt(chance)."""
    photon = np.arange(COUNT)
    survival, share = np.full(COUNT, 0.5), np.full(COUNT, 0.15)
    got = play(gl, photon, np.full(COUNT, 4), np.full(COUNT, 77), survival, share)
    alive, chance = got["alive"] == 1, 0.5 * 0.15 / THRESHOLD
    assert alive.mean() == pytest.approx(chance, abs=0.01)
    np.testing.assert_allclose(got["throughput"][alive], 0.5 * 0.15 / chance, rtol=1e-5)
    np.testing.assert_allclose(got["wide"][alive], 1.0 / np.sqrt(chance), rtol=1e-5)


def test_roulette_lets_the_right_share_live_and_keeps_the_flux(gl) -> None:
    rng = np.random.default_rng(3)
    photon, depth = rng.integers(0, 1 << 22, COUNT), rng.integers(2, 20, COUNT)
    key = rng.integers(0, WORD, COUNT)
    survival, share = (
        np.float32(rng.uniform(0.05, 1.0, COUNT)).astype(float),
        np.float32(rng.uniform(0.01, 1.0, COUNT)).astype(float),
    )
    got = play(gl, photon, depth, key, survival, share)
    np.testing.assert_array_equal(got["next_key"], hash_combine(key, np.uint32(2)))
    chance = np.minimum(survival * share / THRESHOLD, 1.0)
    drawn = np.concatenate(
        [draws(int(d), got["next_key"][depth == d], photon[depth == d], generators()) for d in np.unique(depth)]
    )
    alive = np.concatenate([got["alive"][depth == d] for d in np.unique(depth)])
    chances = np.concatenate([chance[depth == d] for d in np.unique(depth)])
    np.testing.assert_array_equal(alive == 1, (drawn < chances) | (chances >= 1.0))
    # Counts by chance: each of twenty classes against the binomial of its rays, keys being random.
    plays = chance < 1.0
    classes = np.minimum((chance[plays] * 20).astype(int), 19)
    rays, living = np.bincount(classes, minlength=20), np.bincount(classes, got["alive"][plays], 20)
    expected, variance = (
        np.bincount(classes, chance[plays], 20),
        np.bincount(classes, chance[plays] * (1 - chance[plays]), 20),
    )
    z = (living - expected) / np.sqrt(variance)
    assert (rays > 1000).all() and np.abs(z).max() < 4.5
    wrong = (living * 1.03 - expected) / np.sqrt(variance)  # a bias of 3 % of the chance is seen
    assert np.abs(wrong).max() > 4.5
    # Flux: what lives weighs as much more as it is rarer, and the balance is kept ray by ray.
    before = survival * share
    np.testing.assert_allclose(np.where(got["alive"] == 1, got["flux"], 0.0) + got["taken"], before, rtol=0, atol=2e-6)
    living_rays = plays & (got["alive"] == 1)
    np.testing.assert_allclose(got["flux"][living_rays], THRESHOLD, rtol=1e-5)
    np.testing.assert_allclose(got["throughput"][living_rays], got["flux"][living_rays], rtol=1e-6)
    np.testing.assert_allclose(got["left"][living_rays], THRESHOLD, rtol=1e-6)


def test_survivors_of_roulette_are_a_coarser_lattice(gl) -> None:
    """Every second point of every second row, and of those every third: steps are as many times as long. Each of the 36
    parts that leaves of the lattice has its turn as often, over all keys. A draw of its own for every point leaves
    neighbours."""
    count, sub, keys = 1000, 2, 720
    point = np.arange(count)
    shift = (LATTICE_SHIFT + sub * PLASTIC[1]) % WORD
    position = lattice_point(point, count, (0, shift)) * np.sqrt(count)
    shortest = KDTree(position).query(position, k=2)[0][:, 1].min()
    photon, depth = np.tile(point * LATTICES + sub, keys), np.full(keys * count, 4)
    key, survival = np.repeat(np.arange(keys) * 7919, count), np.full(keys * count, 0.5)
    lives, every = np.ones((keys, count), bool), 1
    for chance, steps in ((1.0 / 4.2, 2), (1.0 / 8.7, 3)):
        share = np.full(keys * count, 2.0 * chance * THRESHOLD)
        got = play(gl, photon, depth, key + every, survival, share, float(every), count)
        lives &= got["alive"].reshape(keys, count) == 1
        every *= steps
        np.testing.assert_allclose(got["flux"][lives.ravel()], steps**2 * chance * THRESHOLD, rtol=1e-5)
        np.testing.assert_allclose(got["left"][lives.ravel()], steps**2 * chance * THRESHOLD, rtol=1e-5)
        np.testing.assert_allclose(got["wide"][lives.ravel()], every, rtol=1e-6)
        nearest = [KDTree(position[alive]).query(position[alive], k=2)[0][:, 1] for alive in lives[:20]]
        assert min(away.min() for away in nearest) > 0.999 * every * shortest
        assert max(np.median(away) for away in nearest) < 1.001 * every * shortest
        assert lives.mean() == pytest.approx(every**-2.0, rel=0.02)
    turns = np.unique(lives, axis=1).sum(axis=0)
    assert len(turns) == every**2 and chi_square(turns.astype(float), np.ones(every**2)).p_value > ALPHA


def test_a_first_surface_splits_and_never_plays(gl) -> None:
    count = 1000
    got = play(gl, np.arange(count), np.full(count, 1), np.arange(count), np.full(count, 1.0), np.full(count, 0.01))
    assert got["alive"].all() and not got["taken"].any()


def test_roulettes_draws_are_even_in_one_pass_alone_and_against_the_lattice() -> None:
    count = 1 << 15
    photon = np.arange(count * LATTICES)
    one = photon[photon % LATTICES == 1]
    place = lattice_point(one // LATTICES, count, (0, 0))
    irrationals = generators()
    for depth in range(len(irrationals)):
        drawn = draws(depth, 12345, one, irrationals)
        # Hashed irrationals are what chance makes of them: some lie near fractions (depth 22: 3/5).
        assert star_discrepancy(drawn) < (6.0 if depth < TABLE else 25.0) * np.log(count) / count
        for axis in (0, 1):  # survivors of any part of the picture are as many as anywhere
            assert box_discrepancy(np.column_stack([place[:, axis], drawn]), 16) < (0.004 if depth < TABLE else 0.03)
    golden = kronecker(one // LATTICES, GOLDEN, 12345)
    assert box_discrepancy(np.column_stack([place[:, 1], golden]), 16) > 0.05


def test_roulettes_draws_are_even_jointly_over_bounces() -> None:
    """A path that plays at two depths lives with the product of the chances: pairs of draws fill the square."""
    count = 1 << 15
    photon = np.arange(count) * LATTICES
    irrationals = generators()
    drawn = [draws(depth, depth + 1, photon, irrationals) for depth in range(32)]
    for first in range(len(drawn)):
        for second in range(max(first - TABLE, 0), first):
            pair = np.column_stack([drawn[first], drawn[second]])
            assert box_discrepancy(pair, 16) < (0.006 if first < TABLE else 0.08), (first, second)
    same = np.column_stack([drawn[2], draws(2, 2, photon, irrationals)])
    assert box_discrepancy(same, 16) > 0.1


def test_draws_of_one_photon_are_uniform_over_passes() -> None:
    """Keys differ from pass to pass: over many the draws of any two depths are even, those of the same irrational
    too."""
    passes = 1 << 18
    key = hash_combine(np.arange(passes), np.uint32(0))
    deeper = key
    for _ in range(8):
        deeper = hash_combine(deeper, np.uint32(1))
    photon = np.full(passes, 3 * 777)
    irrationals = generators()
    first, eighth = draws(2, key, photon, irrationals), draws(10, deeper, photon, irrationals)
    assert min(even(first), even(eighth), even(first, eighth)) > ALPHA
    assert even(first, draws(2, key, photon + 3, irrationals)) < 1e-3 * ALPHA  # neighbours are a lattice
