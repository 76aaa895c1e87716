"""Edges of what is overexposed: as a larger picture made smaller would show them, and nothing else is touched."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from spectrasplat.base.image_io import read_image, write_image
from spectrasplat.base.tone_map import srgb_oetf, to_display, tone_map_8bit

FINE = 16
"""Points along a pixel's side."""


def drawn(colour_at: Callable[[np.ndarray, np.ndarray], np.ndarray], size=(64, 48)) -> tuple[np.ndarray, np.ndarray]:
    """A picture (H, W, 3) whose pixels are means of `colour_at(x, y)`, and linear display values of the same, tone
    mapped before the mean."""
    width, height = size
    y, x = (np.mgrid[0 : FINE * height, 0 : FINE * width] + 0.5) / FINE
    points = colour_at(x, y).astype(np.float32)

    def means(values: np.ndarray) -> np.ndarray:
        return values.reshape(height, FINE, width, FINE, 3).mean(axis=(1, 3)).astype(np.float32)

    return means(points), means(to_display(points, 0.0))


def beam(slope: float, colour: tuple[float, float, float]) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """A beam with sharp edges across grey paper."""

    def colour_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        inside = np.abs(y - 12.3 - slope * x) < 3.0
        return np.where(inside[..., None], np.array(colour), 0.15)

    return colour_at


def error(display: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Per pixel, codes."""
    return 255 * np.abs(srgb_oetf(np.clip(display, 0, 1)) - srgb_oetf(truth)).max(axis=-1)


@pytest.mark.parametrize("slope", [0.0, 0.07, 0.31, 0.6, 1.0])
@pytest.mark.parametrize("colour", [(16.0, 16.0, 16.0), (200.0, 200.0, 200.0), (4.0, 12.0, 30.0)])
def test_edges_of_beams_have_no_steps(slope: float, colour: tuple[float, float, float]) -> None:
    """Of all pixels at the edges the error's root mean square falls to two fifths at the most; mostly to a tenth."""
    picture, truth = drawn(beam(slope, colour))
    before, after = error(to_display(picture, 0.0), truth), error(to_display(picture, 0.0, antialias=True), truth)
    edge = before > 3.0
    assert edge.mean() > 0.02
    assert np.sqrt(np.mean(after[edge] ** 2)) < 0.4 * np.sqrt(np.mean(before[edge] ** 2))
    assert (after[~edge] <= before[~edge] + 3.0).all()


def test_steepest_change_of_a_tilted_edge() -> None:
    """Along an edge that climbs a pixel in eight, shown values climb evenly: no jump of more than a third of the way,
    where a clipped edge jumps more than half."""
    picture, _ = drawn(beam(0.125, (50.0, 50.0, 50.0)))
    row = slice(8, 56)
    jumps = []
    for antialias in (False, True):
        shown = srgb_oetf(to_display(picture, 0.0, antialias))[18, row, 0]
        jumps.append(np.abs(np.diff(shown)).max() / np.ptp(shown))
    assert jumps[0] > 0.5 and jumps[1] < 0.35


def test_nothing_changes_where_nothing_is_overexposed() -> None:
    rng = np.random.default_rng(1)
    picture = rng.uniform(-0.3, 1.0, (40, 60, 3)).astype(np.float32)
    assert (to_display(picture, 0.0, antialias=True) == to_display(picture, 0.0)).all()


def test_only_pixels_beside_overexposed_ones_change() -> None:
    rng = np.random.default_rng(2)
    picture = rng.uniform(0.0, 0.9, (40, 60, 3)).astype(np.float32)
    picture[20, 30] = 40.0
    changed = (to_display(picture, 0.0, antialias=True) != to_display(picture, 0.0)).any(axis=-1)
    rows, columns = np.nonzero(changed)
    assert changed.sum() <= 4 and (np.abs(rows - 20) + np.abs(columns - 30) == 1).all()


@pytest.mark.parametrize("width", [2.0, 4.0, 8.0])
def test_slopes_stay_slopes(width: float) -> None:
    """A glow eight times white, and a spectrum beside black: three codes at most, one on average."""

    def glow(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r2 = (x - 32.2) ** 2 + (y - 23.7) ** 2
        return 0.15 + 8.0 * np.exp(-r2 / (2 * width**2))[..., None] * np.array([1.0, 0.7, 0.3])

    picture, truth = drawn(glow)
    plain, antialiased = (error(to_display(picture, 0.0, antialias), truth) for antialias in (False, True))
    lit = picture[..., 0] > 0.3
    assert antialiased[lit].mean() < plain[lit].mean() + 1.0
    assert (antialiased - plain).max() < 20.0 / width


def test_broken_pixels_are_seen_and_spoil_no_others() -> None:
    picture = np.full((9, 9, 3), 0.2, np.float32)
    picture[4, 5:] = 1e30
    picture[4, 4] = np.nan
    shown = tone_map_8bit(picture, 0.0, antialias=True)
    assert (shown[4, 4] == (255, 0, 255)).all()
    assert (shown[3, :4] == shown[0, 0]).all()


def test_linear_files_never_have_it_and_pictures_as_asked(tmp_path) -> None:
    picture, _ = drawn(beam(0.31, (16.0, 16.0, 16.0)))
    for antialias in (True, False):
        for suffix in (".npy", ".exr", ".png"):
            write_image(tmp_path / f"{antialias}{suffix}", picture, antialias=antialias)
    for suffix in (".npy", ".exr"):
        assert (read_image(tmp_path / f"True{suffix}").rgb == picture).all()
    shown = [read_image(tmp_path / f"{antialias}.png").rgb for antialias in (True, False)]
    assert 0.01 < (shown[0] != shown[1]).any(axis=-1).mean() < 0.2
