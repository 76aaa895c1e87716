"""The emission order covers a batch once and keeps neighbours together, at every shift."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.passes.lattice_order import GOLDEN, morton_order


@pytest.mark.parametrize(
    ("points", "stride", "lattice"),
    [(1, 1, 1), (1000, 1, 1000), (4096, 3, 12_288), (777, 5, 3885), (20_000, 1, 65_536)],
)
def test_every_point_once(points: int, stride: int, lattice: int) -> None:
    order = morton_order(points, stride, lattice)
    assert order.dtype == np.uint32
    np.testing.assert_array_equal(np.sort(order), np.arange(points))


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

    assert spread(morton_order(points, stride, lattice)) < 5.0
    assert spread(np.arange(points)) > 20.0
