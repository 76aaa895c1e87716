"""The dispersion brush's dabs: how they add up, and that the grid the GPU samples is that."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.local_dispersion import MAX_FLAT_SIDE, MAX_VOLUME_SIDE, GainGrid, dab_weight, gain_at, plane_of
from spectrasplat.model.scene import Dab, Diffuse, SceneObject


def strokes(count: int, seed: int = 3, spread: float = 1.0, flat: bool = True) -> tuple[Dab, ...]:
    rng = np.random.default_rng(seed)
    dabs = []
    for i in range(count):
        x, y, z = (float(v) for v in rng.uniform(-spread, spread, 3))
        erase = 0.6 if i % 5 == 4 else 0.0
        radius, falloff = float(rng.uniform(0.1, 0.4)), float(rng.uniform(0.3, 1.0))
        dabs.append(Dab((x, y, 0.0 if flat else z), radius, float(rng.uniform(-1.5, 1.5)), falloff, erase))
    return tuple(dabs)


# -- the definition -----------------------------------------------------------------------


def test_one_dab_is_full_inside_and_nothing_from_its_radius_on() -> None:
    dab = Dab((1.0, 0.0, 0.0), 2.0, 1.0, falloff=0.5)
    at = np.array([(1.0, 0, 0), (2.0, 0, 0), (2.5, 0, 0), (3.0, 0, 0), (9.0, 0, 0)])
    np.testing.assert_allclose(np.log2(gain_at([dab], at)), [1.0, 1.0, 0.5, 0.0, 0.0], atol=1e-12)


def test_a_hard_edge_and_a_full_fade() -> None:
    hard, soft = Dab((0, 0, 0), 1.0, 1.0, falloff=0.0), Dab((0, 0, 0), 1.0, 1.0, falloff=1.0)
    np.testing.assert_array_equal(dab_weight(hard, np.array([0.0, 0.999, 1.0, 1.001])), [1.0, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(dab_weight(soft, np.array([0.0, 0.25, 0.5])), [1.0, 0.84375, 0.5])


def test_the_fade_is_smooth_at_both_ends() -> None:
    dab = Dab((0, 0, 0), 1.0, 1.0, falloff=0.4)
    at = np.array([0.6, 1.0])
    slope = (dab_weight(dab, at + 1e-5) - dab_weight(dab, at - 1e-5)) / 2e-5
    np.testing.assert_allclose(slope, 0.0, atol=1e-3)


def test_dabs_add_up_in_order_and_erasing_takes_back_its_share() -> None:
    here = np.zeros((1, 3))
    widen, erase = Dab((0, 0, 0), 1.0, 2.0), Dab((0, 0, 0), 1.0, 77.0, erase=0.25)
    assert gain_at([widen, erase], here)[0] == pytest.approx(2.0**1.5)
    assert gain_at([erase, widen], here)[0] == pytest.approx(2.0**2.0)
    assert gain_at([widen, Dab((0, 0, 0), 1.0, 0.0, erase=1.0)], here)[0] == 1.0


def test_gain_stays_between_a_64th_and_10_and_comes_back_at_once() -> None:
    up, down = Dab((0, 0, 0), 1.0, 2.0), Dab((0, 0, 0), 1.0, -2.0)
    here = np.zeros((1, 3))
    assert gain_at([up] * 9, here)[0] == pytest.approx(10.0)
    assert gain_at([up] * 9 + [down], here)[0] == pytest.approx(2.5)
    assert gain_at([down] * 9, here)[0] == 2.0**-6


# -- the grid -----------------------------------------------------------------------------


def test_a_flat_grid_has_one_layer_and_is_the_gain_at_its_voxels() -> None:
    dabs = strokes(40)
    grid = GainGrid.build(dabs, flat=True)
    assert grid.dims[2] == 1 and max(grid.dims) <= MAX_FLAT_SIDE
    nx, ny, _ = grid.dims
    x = grid.low[0] + (np.arange(nx) + 0.5) * (grid.high[0] - grid.low[0]) / nx
    y = grid.low[1] + (np.arange(ny) + 0.5) * (grid.high[1] - grid.low[1]) / ny
    xs, ys = np.meshgrid(x, y)
    exact = gain_at(dabs, np.stack([xs, ys, np.zeros_like(xs)], axis=-1).reshape(-1, 3)).reshape(ny, nx)
    np.testing.assert_array_equal(grid.gains[0], exact.astype(np.float32))


@pytest.mark.parametrize(("flat", "worst", "typical"), [(True, 0.05, 0.002), (False, 0.35, 0.01)])
def test_between_voxels_the_gain_is_near(flat: bool, worst: float, typical: float) -> None:
    dabs = strokes(25, spread=0.4, flat=flat)
    grid = GainGrid.build(dabs, flat)
    assert max(grid.dims) <= (MAX_FLAT_SIDE if flat else MAX_VOLUME_SIDE)
    at = np.random.default_rng(1).uniform(-0.8, 0.8, (4000, 3)) * (1.0, 1.0, 0.0 if flat else 1.0)
    error = np.abs(np.log2(grid.sample(at)) - np.log2(gain_at(dabs, at)))
    assert error.max() < worst and error.mean() < typical
    assert np.ptp(gain_at(dabs, at)) > 1.0  # there was something to get wrong


def test_outside_the_box_the_gain_is_one() -> None:
    grid = GainGrid.build(strokes(10), flat=True)
    assert (grid.sample(np.array([(99.0, 0, 0), (0, -99.0, 0), (0, 0, 99.0)])) == 1.0).all()
    nothing = GainGrid.build((), flat=True)
    assert nothing.dims == (1, 1, 1) and nothing.gains[0, 0, 0] == 1.0
    assert (nothing.sample(np.array([(0.0, 0, 0), (1, 2, 3)])) == 1.0).all()


@pytest.mark.parametrize("flat", [True, False])
def test_a_growing_grid_is_bit_for_bit_the_one_built_anew(flat: bool) -> None:
    dabs = strokes(60, flat=flat)
    grown = GainGrid.build(dabs[:3], flat)
    for i in range(3, len(dabs), 3):
        grown = grown.extended(dabs[i : i + 3])
        anew = GainGrid.build(dabs[: i + 3], flat)
        assert grown.dims == anew.dims and grown.first == anew.first and grown.dabs == anew.dabs
        np.testing.assert_array_equal(grown.low, anew.low)
        np.testing.assert_array_equal(grown.high, anew.high)
        np.testing.assert_array_equal(grown.log2, anew.log2)


def test_a_stroke_inside_the_box_computes_only_what_it_touches(monkeypatch: pytest.MonkeyPatch) -> None:
    from spectrasplat.model import local_dispersion

    grid = GainGrid.build(strokes(30), flat=True)
    count = 0
    original = local_dispersion._touched

    def counted(log2: np.ndarray, dab: Dab, distance: np.ndarray) -> np.ndarray:
        nonlocal count
        count += log2.size
        return original(log2, dab, distance)

    monkeypatch.setattr(local_dispersion, "_touched", counted)
    grid.extended((Dab((0.0, 0.0, 0.0), 0.2, 0.5),))
    assert 0 < count <= (0.4 / grid.voxel + 2) ** 2
    assert count < grid.log2.size / 4


def test_a_tilted_wall_is_sampled_on_its_own_plane() -> None:
    turn = math.radians(35.0)
    rotation = np.array([(1, 0, 0), (0, math.cos(turn), -math.sin(turn)), (0, math.sin(turn), math.cos(turn))])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = (0.0, 0.0, 3.0)
    wall = SceneObject("wall", primitives.plane(4.0, 4.0).transformed(matrix), Diffuse())
    on_plane = strokes(20, spread=0.8)
    dabs = tuple(
        Dab(tuple(float(v) for v in rotation @ d.position + matrix[:3, 3]), d.radius, d.log2_gain, d.falloff, d.erase)
        for d in on_plane
    )
    plane = plane_of(wall)
    grid = GainGrid.build(dabs, plane)
    assert min(grid.dims) == 1
    local = np.random.default_rng(2).uniform(-1.2, 1.2, (3000, 3)) * (1, 1, 0)
    error = np.log2(grid.sample(local @ rotation.T + matrix[:3, 3])) - np.log2(gain_at(on_plane, local))
    assert np.abs(error).max() < 0.05


def test_the_layer_of_a_floor_that_faces_y_lies_across_y() -> None:
    mesh = primitives.plane(2.0, 2.0)
    turned = np.eye(4)[[0, 2, 1, 3]]
    floor = SceneObject(
        "floor", mesh.transformed(turned), Diffuse(), local_dispersion=(Dab((0.3, 0.0, -0.2), 0.4, 1.0),)
    )
    grid = GainGrid.of(floor)
    assert grid.dims[1] == 1 and min(grid.dims[0], grid.dims[2]) > 8
    assert grid.sample(np.array([(0.3, 0.0, -0.2)]))[0] == pytest.approx(2.0, rel=1e-3)
    ball = SceneObject("ball", primitives.sphere(0.5), Diffuse())
    assert plane_of(ball) is None
