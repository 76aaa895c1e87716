"""Where paths start that carry on what camera beams hand over: unbiased, whatever polygons are drawn by."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from spectrasplat.beams.drawn_starts import drawn_starts
from spectrasplat.beams.screen_polygons import ScreenPolygons

SIZE = (12, 9)
GRID = np.linspace(0.0, 1.0, 65)
BRIGHTNESS = GRID**2


def triangles(count: int) -> ScreenPolygons:
    """Triangles that move over their band, with a throughput that varies over it."""
    rng = np.random.default_rng(3)
    edges, hulls = [], []
    for _ in range(count):
        corners = rng.uniform(1.0, 8.0, (3, 2))
        first, second = corners[1] - corners[0], corners[2] - corners[0]
        corners = corners if first[0] * second[1] > first[1] * second[0] else corners[::-1]
        along = np.roll(corners, -1, axis=0) - corners
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
        line = np.column_stack([normal, -np.einsum("ij,ij->i", normal, corners)])
        # To the right by half a pixel at the end of the band.
        edges.append(np.concatenate([line, line - 0.5 * np.outer(normal[:, 0], [0, 0, 1])], axis=1))
        box = np.concatenate([corners, corners + [0.5, 0.0]])
        low, high = box.min(axis=0), box.max(axis=0)
        hulls.append([low, [high[0], low[1]], high, [low[0], high[1]]])
    blank = {field.name: np.zeros(count) for field in fields(ScreenPolygons)}
    shapes = {
        "edges": np.concatenate(edges),
        "edge_start": np.arange(0, 3 * count + 1, 3),
        "hulls": np.concatenate(hulls),
        "hull_start": np.arange(0, 4 * count + 1, 4),
        "x_lo": rng.uniform(0.0, 0.4, count),
        "x_hi": rng.uniform(0.5, 1.0, count),
        "throughput": rng.uniform(0.01, 0.4, (count, 3)),
        "slope": np.zeros((count, 2)),
        "centre": np.zeros((count, 2)),
    }
    return ScreenPolygons(**blank | shapes)


def expected(polygons: ScreenPolygons, fine: int = 24, steps: int = 64) -> np.ndarray:
    """(9, 12): what each pixel has of light whose spectrum is what looks bright, by a fine grid of places and x."""
    at = (np.arange(12 * fine) + 0.5) / fine
    x, y = np.meshgrid(at, at[: 9 * fine])
    total = np.zeros((9 * fine, 12 * fine))
    for i in range(len(polygons)):
        bright = np.interp([polygons.x_lo[i], polygons.x_hi[i]], GRID, BRIGHTNESS)
        borders = np.interp(np.linspace(*bright, steps + 1), BRIGHTNESS, GRID)
        lo, middle, hi = polygons.throughput[i]
        for k in range(steps):
            t = (0.5 * (borders[k] + borders[k + 1]) - polygons.x_lo[i]) / (polygons.x_hi[i] - polygons.x_lo[i])
            lines = polygons.edges[3 * i : 3 * i + 3]
            line = lines[:, :3] + t * (lines[:, 3:] - lines[:, :3])
            inside = np.all(
                line[:, 0, None, None] * x + line[:, 1, None, None] * y + line[:, 2, None, None] >= 0, axis=0
            )
            through = lo + t * (4 * middle - 3 * lo - hi + t * 2 * (lo + hi - 2 * middle))
            total += inside * max(through, 0.0) * (bright[1] - bright[0]) / steps
    return total.reshape(9, fine, 12, fine).mean(axis=(1, 3))


def drawn(polygons: ScreenPolygons, share: float) -> tuple[np.ndarray, int, float]:
    starts = drawn_starts(polygons, SIZE, BRIGHTNESS, share, seed=1)
    pixel = np.floor(starts.place).astype(int)
    picture = np.zeros(SIZE[::-1])
    np.add.at(picture, (pixel[:, 1], pixel[:, 0]), starts.weight)
    return picture, len(starts), float(starts.weight.max())


def test_every_pixel_gets_what_its_polygons_hold():
    polygons = triangles(20)
    picture, count, largest = drawn(polygons, 1e-4)
    wanted = expected(polygons)
    assert count > 10_000 and largest < 33e-4
    assert picture.sum() == pytest.approx(wanted.sum(), rel=2e-3)
    assert np.sqrt(((picture - wanted) ** 2).sum() / (wanted**2).sum()) < 0.02


def test_it_would_not_be_so_with_another_throughput():
    """What the first test tells apart."""
    polygons = triangles(20)
    polygons.throughput[:, 2] *= 1.1
    assert drawn(polygons, 1e-4)[0].sum() > 1.01 * expected(triangles(20)).sum()


def test_few_paths_stand_for_many_weak_polygons():
    """As many as their light has shares, however many they are."""
    polygons = triangles(200)
    polygons.throughput[:] *= 1e-3
    picture, count, largest = drawn(polygons, 0.05)
    total = expected(polygons, fine=8, steps=16).sum()
    assert count == pytest.approx(total / 0.05, abs=2 + 0.2 * total / 0.05)
    assert picture.sum() == pytest.approx(total, rel=0.3) and largest < 33 * 0.05


def test_nothing_handed_is_nothing():
    assert len(drawn_starts(triangles(3).take(np.zeros(0, int)), SIZE, BRIGHTNESS, 0.1, 1)) == 0
