"""Which beams light a place: intervals of the spectrum against trying every wavelength."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.beam_polygons import covered, polygon, regular
from spectrasplat.beams.lookup import irradiance_at
from spectrasplat.beams.polygons import joined


def lines_at(one, t: float) -> np.ndarray:
    return one.edges[:, :3] + t * (one.edges[:, 4:7] - one.edges[:, :3])


@pytest.mark.parametrize("seed", range(8))
def test_the_interval_is_where_single_indices_light_the_place(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = regular(5, (10.0, 10.0), 4.0, rng.uniform(0.0, 6.0))
    one = polygon(start, start + rng.uniform(-6.0, 6.0, 2), (0.25, 0.75))
    t = (np.arange(2000) + 0.5) / 2000
    lit_somewhere = 0
    for place in rng.uniform(4.0, 16.0, (40, 2)):
        lit = np.array([np.all(lines_at(one, at)[:, :2] @ place + lines_at(one, at)[:, 2] >= 0.0) for at in t])
        found = irradiance_at(one, 0, place)
        assert (found.x_hi - found.x_lo).sum() == pytest.approx(0.5 * lit.mean(), abs=5e-4)
        if lit.any():
            lit_somewhere += 1
            assert found.x_lo[0] == pytest.approx(0.25 + 0.5 * t[lit][0], abs=5e-4)
    assert lit_somewhere > 5


def test_density_follows_band_and_place() -> None:
    square = regular(4, (10.0, 10.0), 5.0)
    one = polygon(square, band=(0.0, 1.0), density=(1.0, 3.0, 2.0), slope=(0.1, 0.0))
    found = irradiance_at(one, 0, np.array([11.0, 10.0]))
    assert found.density == pytest.approx([3.0 * 1.1])
    line = polygon(square, square + 40.0, band=(0.5, 0.5), density=(1.0, 3.0, 2.0))
    found = irradiance_at(replace(line, centre=np.array([[10.0, 10.0]])), 0, np.array([10.0, 10.0]))
    assert found.density == pytest.approx([1.0])
    assert found.x_lo == found.x_hi == pytest.approx([0.5])


def test_only_the_receiver_s_polygons_in_their_order() -> None:
    square = regular(4, (10.0, 10.0), 5.0)
    many = joined([polygon(square, receiver=1), polygon(square), polygon(square + 20.0), polygon(square)])
    assert irradiance_at(many, 0, np.array([10.0, 10.0])).polygon.tolist() == [1, 3]
    assert len(irradiance_at(many, 2, np.array([10.0, 10.0]))) == 0


def test_half_of_the_light_on_a_soft_edge() -> None:
    box = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    one = polygon(box)
    edges = one.edges.copy()
    edges[:, [3, 7]] = 2.0
    soft = replace(one, edges=edges, hulls=one.hulls + 2.0 * np.sign(one.hulls - 10.0))
    for x, share in ((0.0, 0.5), (-1.0, 0.25), (-3.0, 0.0), (2.5, 1.0)):
        assert irradiance_at(soft, 0, np.array([x, 10.0])).density.sum() == pytest.approx(share)


def test_the_reference_covers_what_a_polygon_covers() -> None:
    corners = regular(7, (8.3, 7.9), 5.0, 0.4)
    share = covered(polygon(corners).edges[:, :3], 16, 16)
    x, y = corners.T
    assert share.sum() == pytest.approx(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    assert share.max() == pytest.approx(1.0)
