"""Levels of pictures: exact means over area or solid angle, rows smoothed to round texels at the poles."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from reference.textures import level_by_overlaps
from spectrasplat.gpu import mip_chain

SIZES = [(8, 16), (7, 12), (9, 9), (5, 33), (1, 11), (13, 1), (1, 1)]


def picture(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3), dtype=np.float32)


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_a_level_is_the_mean_of_what_its_texels_cover(size: tuple[int, int]) -> None:
    rgb = picture(*size)
    levels = mip_chain.texture_levels(rgb)
    assert len(levels) == mip_chain.level_count(size[1], size[0]) and levels[-1].shape == (1, 1, 3)
    assert levels[0] is rgb or np.array_equal(levels[0], rgb)
    for k, level in enumerate(levels):
        assert level.dtype == np.float32 and level.shape[1::-1] == mip_chain.level_size(size[1], size[0], k)
        np.testing.assert_allclose(level, level_by_overlaps(rgb, k), rtol=3e-7)


def test_a_checkerboard_becomes_its_mean_and_a_constant_stays() -> None:
    board = np.repeat((np.indices((64, 96)).sum(axis=0) % 2)[..., None], 3, axis=2).astype(np.float32)
    for level in mip_chain.texture_levels(board)[1:6]:
        np.testing.assert_array_equal(level, 0.5)
    for make in (mip_chain.texture_levels, mip_chain.environment_levels):
        for level in make(np.full((37, 75, 3), 0.7, np.float32)):
            np.testing.assert_allclose(level, 0.7, rtol=2e-7)


@pytest.mark.parametrize("size", [(8, 16), (7, 12), (16, 16), (9, 40)], ids=str)
def test_an_environment_is_averaged_over_solid_angle_then_along_its_rows(size: tuple[int, int]) -> None:
    rgb = picture(*size)
    levels = mip_chain.environment_levels(rgb)
    np.testing.assert_array_equal(levels[0], rgb)
    for k, level in enumerate(levels[1:], start=1):
        plain = level_by_overlaps(rgb, k, on_sphere=True)
        rows, columns = plain.shape[:2]
        borders = np.linspace(0.0, np.pi, rows + 1)
        for row in range(rows):
            # Mean sine of the row; a texel is pi / rows high and 2 pi / columns times that wide.
            sine = (np.cos(borders[row]) - np.cos(borders[row + 1])) / (np.pi / rows)
            width = np.clip((np.pi / rows) / (2.0 * np.pi / columns * sine), 1.0, columns)
            # The box of that width about a texel, cut into 4000 points on the closed row.
            points = (np.arange(4000) + 0.5) / 4000 - 0.5
            at = np.floor(np.arange(columns)[:, None] + 0.5 + width * points).astype(int) % columns
            np.testing.assert_allclose(level[row], plain[row][at].mean(axis=1), atol=2e-3)
            np.testing.assert_allclose(level[row].mean(axis=0), plain[row].mean(axis=0), rtol=1e-6)


def test_what_lies_at_a_pole_counts_by_its_solid_angle() -> None:
    cap = np.zeros((64, 128, 3), np.float32)
    cap[:4] = 1.0  # 0 to pi / 16
    (whole,) = mip_chain.environment_levels(cap)[-1][0]
    np.testing.assert_allclose(whole, 0.5 * (1.0 - np.cos(np.pi / 16.0)), rtol=1e-6)
    (by_area,) = mip_chain.texture_levels(cap)[-1][0]
    assert (by_area > 6.0 * whole).all()  # the mutant that averages over the picture is seen


def test_a_single_bright_pixel_keeps_its_light() -> None:
    sun = np.zeros((64, 128, 3), np.float32)
    sun[20, 17] = 6e4
    solid_angle = (np.cos(np.pi * 20 / 64) - np.cos(np.pi * 21 / 64)) / 2.0 / 128.0
    for level in mip_chain.environment_levels(sun)[1:]:
        borders = np.cos(np.pi * np.arange(len(level) + 1) / len(level))
        total = (-np.diff(borders)[:, None] * level[:, :, 0]).sum() / 2.0 / level.shape[1]
        np.testing.assert_allclose(total, 6e4 * solid_angle, rtol=1e-5)


def test_levels_are_kept_as_long_as_their_picture_lives() -> None:
    gc.collect()  # of pictures of other tests
    rgb = picture(8, 8)
    before = len(mip_chain._kept)
    first = mip_chain.kept_levels(rgb, on_sphere=False)
    again = mip_chain.kept_levels(rgb, on_sphere=False)
    assert all(one is other for one, other in zip(first[1:], again[1:], strict=True))
    assert not np.array_equal(mip_chain.kept_levels(rgb, on_sphere=True)[1], first[1])
    assert len(mip_chain._kept) == before + 2
    del rgb, first, again
    gc.collect()
    assert len(mip_chain._kept) == before
