"""The lattice of pixels read back for the exposure is the picture's own."""

from __future__ import annotations

import numpy as np
from spectrasplat.gpu.context import Context
from spectrasplat.passes.sample_picture import LATTICE, SamplePicture


def test_lattice_takes_the_middles_of_its_cells(gl: Context) -> None:
    width, height = 320, 270
    rgba = np.random.default_rng(1).uniform(0, 9, (height, width, 4)).astype("f4")
    texture = gl.ctx.texture((width, height), 4, rgba.tobytes(), dtype="f4")
    sampler = SamplePicture(gl)
    columns, rows = LATTICE
    assert np.array_equal(sampler.run(texture), rgba[1::3, 1::2, :3])
    assert sampler.run(texture).shape == (rows, columns, 3)
    sampler.release()
    texture.release()


def test_a_picture_smaller_than_the_lattice(gl: Context) -> None:
    texture = gl.ctx.texture((2, 1), 4, np.array([1, 2, 3, 0, 4, 5, 6, 0], "f4").tobytes(), dtype="f4")
    sampler = SamplePicture(gl)
    pixels = sampler.run(texture)
    assert np.array_equal(pixels[0, 0], [1, 2, 3]) and np.array_equal(pixels[-1, -1], [4, 5, 6])
    sampler.release()
    texture.release()
