"""The glare pass of the window against the float64 transform of written pictures."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.glare import OCTAVES, with_glare
from spectrasplat.edit.state import Display as Settings
from spectrasplat.gpu.context import Context
from spectrasplat.passes.display import Display
from spectrasplat.passes.glare import Glare

SHARE = 0.2


def scattered(context: Context, rgb: np.ndarray, share: float, *, in_motion: bool = False) -> np.ndarray:
    """What the pass makes of `rgb` (H, W, 3)."""
    height, width = rgb.shape[:2]
    texels = np.concatenate([rgb, np.ones((height, width, 1), np.float32)], axis=-1)
    texture = context.ctx.texture((width, height), 4, texels.tobytes(), dtype="f4")
    glare = Glare(context)
    try:
        made = glare.run(texture, share, in_motion=in_motion)
        assert (made is texture) == (share == 0.0)
        return np.frombuffer(made.read(), np.float32).reshape(height, width, 4)[..., :3].copy()
    finally:
        glare.release()
        texture.release()


@pytest.mark.parametrize("height, width", [(180, 320), (540, 960)])
def test_a_halo_is_that_of_written_pictures(gl: Context, height: int, width: int) -> None:
    """Octaves of texels are no Gaussians; an octave too few or too wide misses these bounds."""
    rgb = np.zeros((height, width, 3), np.float32)
    rgb[height // 3, width // 3] = 1e4, 2e4, 5e3
    ours, wanted = scattered(gl, rgb, SHARE), with_glare(rgb, SHARE)
    assert ours.sum() == pytest.approx(wanted.sum(), rel=0.01)
    for share in (0.02, 0.04, 0.08, 0.16):
        place = height // 3, width // 3 + int(share * height)
        assert ours[place] == pytest.approx(wanted[place], rel=0.2)


@pytest.mark.parametrize("height, width", [(180, 320), (541, 963)])
def test_in_motion_only_the_narrowest_halo_is_missing(gl: Context, height: int, width: int) -> None:
    rgb = np.zeros((height, width, 3), np.float32)
    rgb[height // 3, width // 3] = 1e4, 2e4, 5e3
    moving, wanted = scattered(gl, rgb, SHARE, in_motion=True), with_glare(rgb, SHARE)
    assert moving.sum() == pytest.approx(wanted.sum(), rel=0.01)
    # What is not scattered stays where it is.
    place = height // 3, width // 3
    assert moving[place] == pytest.approx((1.0 - SHARE * (OCTAVES - 1) / OCTAVES) * rgb[place], rel=0.01)
    for share in (0.04, 0.08, 0.16):
        place = height // 3, width // 3 + int(share * height)
        assert moving[place] == pytest.approx(wanted[place], rel=0.2)


def test_nothing_scattered_costs_nothing(gl: Context) -> None:
    rgb = np.random.default_rng(1).random((8, 12, 3), np.float32)
    assert np.array_equal(scattered(gl, rgb, 0.0), rgb)


def test_a_halo_added_on_the_way_to_the_screen_is_the_same(gl: Context) -> None:
    size = 97, 61
    rgb = np.random.default_rng(2).random((size[1], size[0], 4), np.float32) ** 8 * 20.0
    texture = gl.ctx.texture(size, 4, rgb.tobytes(), dtype="f4")
    glare, display = Glare(gl), Display(gl)
    try:
        shown = []
        for joined in (True, False):
            picture = glare.run(texture, SHARE, in_motion=True) if joined else texture
            halo = None if joined else glare.halo(texture, SHARE, in_motion=True)
            made = display.run(picture, Settings(), 0.0, size, halo=halo)
            shown.append(np.frombuffer(made.read(), np.uint8).astype(int))
        plain = np.frombuffer(display.run(texture, Settings(), 0.0, size).read(), np.uint8).astype(int)
        assert np.abs(shown[0] - shown[1]).max() <= 1 and np.abs(shown[0] - plain).max() > 20
        with pytest.raises(ValueError, match="pixel for pixel"):
            display.run(texture, Settings(), 0.0, (50, 30), halo=glare.halo(texture, SHARE))
    finally:
        glare.release()
        display.release()
        texture.release()
