"""How beam polygons are shared out into draws: few of the large ones at a time, all of them in their order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from spectrasplat.passes.beam_records import hull_areas
from spectrasplat.passes.beam_splat import TEXELS, portion_end


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
