"""Windows of the camera reference's caustic: fine where the camera looks, not where light or a stray look happens to
go."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.reference.caustic_windows import Landed, Planes, VisiblePoints, _shared, fit_windows

RNG = np.random.default_rng(4)
PAGE, FLOOR = 0, 1
TEXEL = 0.01


def planes() -> Planes:
    """The front of a page from −1 to 1 and that of a floor from −20 to 20."""
    frame = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    extent = np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-20.0, -20.0], [20.0, 20.0]]])
    return Planes(
        np.array([[0, -1], [1, -1]], np.int32), np.arange(2), np.stack([frame, frame]), extent, np.ones(2, bool)
    )


def points(count: int, half: float) -> np.ndarray:
    flat = RNG.uniform(-half, half, (count, 3))
    flat[:, 2] = 0.0
    return flat


def looks(stray: int) -> VisiblePoints:
    """3000 at the page, 1000 at the floor's middle, `stray` anywhere on the floor."""
    where = np.concatenate([points(3000, 1.0), points(1000, 1.5), points(stray, 20.0)])
    return VisiblePoints(where, np.ones(len(where)), np.repeat(np.array([PAGE, FLOOR], np.int32), [3000, 1000 + stray]))


def light() -> Landed:
    """As much on the page as on all the floor."""
    side = np.repeat(np.array([PAGE, FLOOR], np.int32), 20_000)
    return Landed(
        np.concatenate([points(20_000, 1.0), points(20_000, 20.0)]),
        np.ones(40_000),
        np.stack([side, *np.zeros((3, 40_000), np.int32)], axis=1),
    )


@pytest.mark.parametrize("stray", [0, 5])
def test_stray_looks_do_not_spread_the_texels(stray: int) -> None:
    tables, wanted = fit_windows(planes(), looks(stray), light(), 4, lambda _: TEXEL, 1 << 18)
    assert wanted.all()
    span = tables.size / tables.texels_per_unit
    assert (span[FLOOR, 1] < 4.0).all() and (span[PAGE, 1] > 1.9).all()
    assert (1.0 / tables.texels_per_unit[:, 1] < 1.01 * TEXEL).all()
    assert (span[FLOOR, 0] > (10.0 if stray else 2.0)).all()  # what is seldom seen is in the coarse one


def test_where_looks_and_light_are_apart_the_light_is_covered() -> None:
    beside = light()
    beside.points[beside.ends[:, 0] == FLOOR] = (18.0, 18.0, 0.0)
    tables, wanted = fit_windows(planes(), looks(400), beside, 4, lambda _: TEXEL, 1 << 18)
    assert wanted[FLOOR]
    high = tables.low[FLOOR, 1] + tables.size[FLOOR, 1] / tables.texels_per_unit[FLOOR, 1]
    assert (tables.low[FLOOR, 1] <= 18.0).all() and (high >= 18.0 - 1e-6).all()


def test_too_many_texels_are_shared_by_looks() -> None:
    most = 1 << 14
    tables, _ = fit_windows(planes(), looks(0), light(), 4, lambda _: TEXEL, most)
    texels = np.prod(tables.size[:, 1], axis=1)
    assert texels.sum() == pytest.approx(most, rel=0.05)
    assert texels[PAGE] / texels[FLOOR] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("asked", "weight", "most", "got"),
    [
        ((3.0, 4.0), (1.0, 9.0), 8.0, (3.0, 4.0)),
        ((6.0, 6.0), (1.0, 3.0), 8.0, (2.0, 6.0)),
        ((1.0, 20.0, 20.0), (5.0, 1.0, 3.0), 9.0, (1.0, 2.0, 6.0)),
        ((0.0, 20.0, 5.0, 4.0), (0.0, 1.0, 1.0, 6.0), 12.0, (0.0, 4.0, 4.0, 4.0)),
    ],
)
def test_sharing(asked: tuple[float, ...], weight: tuple[float, ...], most: float, got: tuple[float, ...]) -> None:
    np.testing.assert_allclose(_shared(np.array(asked), np.array(weight), most), got)
