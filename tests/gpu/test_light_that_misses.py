"""A light that throws nothing on glass, though it lies within the rectangle about all of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

from tests.unit.scene_texts import load

SCENE = """
[camera]
position = [0.0, -6.0, 4.0]
target = [0.0, 0.0, 0.0]
[[lights]]
kind = "collimated"
position = [{x}, 0.0, 5.0]
target = [{x}, 0.0, 0.0]
illuminance_lx = 10000.0
shape = "{shape}"
{extent}
[[objects]]
shape = "sphere"
radius = 0.4
position = [-1.5, 0.0, 0.6]
glass = "N-SF11"
[[objects]]
shape = "{other}"
position = [1.5, 0.0, 0.6]
glass = "N-BK7"
[[objects]]
shape = "plane"
width = 8.0
height = 8.0
material = "diffuse"
"""


@pytest.mark.parametrize(
    ("shape", "extent", "other"), [("disc", "radius = 0.1", "box"), ("rectangle", "size = [0.2, 0.2]", "sphere")]
)
def test_a_beam_between_two_solids_lights_the_table_alone(
    gl, tmp_path: Path, shape: str, extent: str, other: str
) -> None:
    """Before: a traceback. No part of the emission's rectangle was on glass, and its share of it was divided by."""
    found = {}
    for x in (0.0, -1.5):
        settings = RenderSettings(64, 36, layer="caustic", photons=4000)
        found[x] = render(
            load(tmp_path, SCENE.format(shape=shape, extent=extent, other=other, x=x)), settings, context=gl
        )
    assert found[0.0].stats.photons == 0 and not np.any(found[0.0].rgb)
    assert found[-1.5].rgb.sum() > 0.0
