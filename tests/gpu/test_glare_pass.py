"""The glare pass of the window against the float64 transform of written pictures."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.glare import with_glare
from spectrasplat.gpu.context import Context
from spectrasplat.passes.glare import Glare

SHARE = 0.2


def scattered(context: Context, rgb: np.ndarray, share: float) -> np.ndarray:
    """What the pass makes of `rgb` (H, W, 3)."""
    height, width = rgb.shape[:2]
    texels = np.concatenate([rgb, np.ones((height, width, 1), np.float32)], axis=-1)
    texture = context.ctx.texture((width, height), 4, texels.tobytes(), dtype="f4")
    glare = Glare(context)
    try:
        made = glare.run(texture, share)
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


def test_nothing_scattered_costs_nothing(gl: Context) -> None:
    rgb = np.random.default_rng(1).random((8, 12, 3), np.float32)
    assert np.array_equal(scattered(gl, rgb, 0.0), rgb)
