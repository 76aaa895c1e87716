"""A beam thinner than a pixel keeps its light in the picture, far below what float32 tells apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Scene
from spectrasplat.stress.rigs.probe import SMALL, probe
from spectrasplat.stress.rigs.scene_parts import FROM_BELOW, solid, stage

CAUSTIC = replace(SMALL, layer="caustic", method="srd")
PIXEL = FROM_BELOW.vertical_extent / SMALL.height
ASLANT = Camera((0.0, -4.0, -5.0), (0.0, 0.0, 0.0), vertical_fov_deg=40.0)


def beam(pixels: float, camera: Camera = FROM_BELOW) -> Scene:
    """One lumen straight down through a block, in a beam so many pixels wide."""
    radius = 0.5 * pixels * PIXEL
    light = CollimatedLight(
        "beam",
        illuminant("D65").scaled_to_luminous(1.0 / (np.pi * radius**2)),
        (0.3137, 0.0711, 6.0),
        (0.0, 0.0, -1.0),
        radius=radius,
    )
    return stage(solid("block", box(), constant(1.5, "n"), (0.3, 0.0, 1.2)), lights=[light], camera=camera)


# Sixteen samples are about as large as texels, and do not tile the pixel: a spot of one texel weighs by where they lie.
@pytest.mark.parametrize(("samples", "within"), [(1, 2e-3), (16, 1e-2)])
def test_the_picture_holds_a_beam_however_thin(gl, samples: int, within: float) -> None:
    settings = replace(CAUSTIC, spp=samples)
    pixels = (10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-12)
    found = [probe(gl, beam(width), settings) for width in pixels]
    sums = np.array([p.picture.sum() for p in found])
    np.testing.assert_allclose(sums, sums[0], rtol=within, err_msg=str(pixels))
    for p in found:
        assert p.map_error < 2e-3 and p.nonfinite == 0


def test_aslant_too(gl) -> None:
    """Where a pixel is a slanting patch, its samples weigh a spot in it by where they happen to lie."""
    sums = [probe(gl, beam(width, ASLANT), CAUSTIC).picture.sum() for width in (10.0, 0.1, 1e-6)]
    np.testing.assert_allclose(sums, sums[0], rtol=0.15)
