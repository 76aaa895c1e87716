"""Glass in motion: what one pixel of each block has found is spread over its neighbours without a trace of blocks."""

from __future__ import annotations

from collections.abc import Iterator
from unittest.mock import patch

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry import primitives
from spectrasplat.model.scene import Dielectric
from spectrasplat.passes.first_surfaces import FirstSurfaces
from spectrasplat.passes.moving_picture import COARSE, COARSE_SPLIT, MovingPicture

from tests.gpu.camera_rig import ABOVE, opened_camera_pass
from tests.unit.camera_scenes import FLINT, place

SIZE, STEP = (96, 72), 12
LAMP = 3, 2
"""Block, column and row, of which the path runs into something bright."""


def shown_in_blocks(gl: Context, found: np.ndarray, columns: int = SIZE[0]) -> np.ndarray:
    """float (H, columns): glass over the first `columns` of the picture, where the path of each block of pixels found
    `found` (rows, columns)."""
    right = (columns - SIZE[0] / 2) * ABOVE.vertical_extent / SIZE[1]
    glass = place(primitives.box((20.0, 9.0, 1.0)), Dielectric(FLINT), (right - 10.0, 0.0, 0.0))
    view = opened_camera_pass(gl, [glass])
    surfaces = FirstSurfaces(gl.ctx, view.scene)
    moving = MovingPicture(view, surfaces)
    picture = gl.ctx.texture(SIZE, 4, dtype="f4")

    def follow(*_of: object) -> Iterator[float]:
        pixels = np.kron(found, np.ones((STEP, STEP)))[..., None] * np.ones(4)
        view.sums[0].write(pixels.astype("f4").tobytes())
        yield 1.0

    maps = view._inputs.no_maps
    moving.direct(picture, ABOVE, maps, 8)
    assert moving.specular == columns * SIZE[1]
    with patch.object(view, "follow", follow):
        for _ in moving.glass(picture, maps, STEP):
            pass
    shown = np.frombuffer(picture.read(), "f4").reshape(SIZE[1], SIZE[0], 4)[..., 0].astype(float)
    for owned in (picture, moving, surfaces, view):
        owned.release()
    return shown[:, :columns]


def jump_at_borders(shown: np.ndarray) -> float:
    """How far neighbours on both sides of a block's border are apart, at most, beyond what a smooth slope there would
    be (a quarter more than the steepest step beside the border)."""
    worst = 0.0
    for rows in (shown, shown.T):
        steps = np.abs(np.diff(rows, axis=1))
        at = np.arange(STEP, rows.shape[1] - 1, STEP) - 1
        worst = max(worst, float((steps[:, at] - 1.25 * np.maximum(steps[:, at - 1], steps[:, at + 1])).max()))
    return worst


@pytest.mark.parametrize("columns", [SIZE[0], STEP * LAMP[0] + 2])
def test_blocks_of_glass_beside_a_bright_lamp_have_no_edges(gl: Context, columns: int) -> None:
    """Also where glass ends within the lamp's block, whose path is then far from its middle. In shares of the lamp's
    brightness; 0.003 and 0.031 where weights end before they are 0, which a lamp that is far brighter than all else
    shows."""
    found = np.zeros((SIZE[1] // STEP, SIZE[0] // STEP))
    found[LAMP[1], LAMP[0]] = 1.0
    shown = shown_in_blocks(gl, found, columns)
    assert jump_at_borders(shown) < 0.001
    if columns < SIZE[0]:
        return
    # It still stands where it was found, and is as bright all together.
    weights = shown / shown.sum()
    y, x = (np.indices(shown.shape) * weights).reshape(2, -1).sum(axis=1)
    assert abs(x - (STEP * (LAMP[0] + 0.5) - 0.5)) < 1.0 and abs(y - (STEP * (LAMP[1] + 0.5) - 0.5)) < 1.0
    assert abs(shown.sum() / STEP**2 - 1.0) < 0.1


def test_only_coarse_blocks_leave_weak_parts_of_paths_to_chance(gl: Context) -> None:
    glass = place(primitives.box((4.0, 3.0, 1.0)), Dielectric(FLINT), (0.0, 0.0, 0.0))
    view = opened_camera_pass(gl, [glass])
    surfaces = FirstSurfaces(gl.ctx, view.scene)
    moving = MovingPicture(view, surfaces)
    picture = gl.ctx.texture(SIZE, 4, dtype="f4")
    followed: list[float] = []

    def follow(parameters: np.ndarray, *_of: object) -> Iterator[float]:
        followed.append(float(parameters["split_threshold"][0]))
        yield 1.0

    moving.direct(picture, ABOVE, view._inputs.no_maps, 8)
    with patch.object(view, "follow", follow):
        for step in (12, COARSE, 3, 1):
            list(moving.glass(picture, view._inputs.no_maps, step))
    least = pytest.approx(view.split_threshold)
    assert followed == [pytest.approx(COARSE_SPLIT), pytest.approx(COARSE_SPLIT), least, least]
    for owned in (picture, moving, surfaces, view):
        owned.release()


def test_blocks_of_one_brightness_show_it_everywhere(gl: Context) -> None:
    """Also beside the picture's border, where neighbours are missing."""
    assert np.allclose(shown_in_blocks(gl, np.full((SIZE[1] // STEP, SIZE[0] // STEP), 0.7)), 0.7, atol=1e-5)
