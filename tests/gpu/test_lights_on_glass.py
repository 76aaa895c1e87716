"""A light that lies on glass stands outside of it: what it sends into the glass is reflected and refracted there like
any other light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.lights import AreaLight, PointLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Light, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render
from spectrasplat.stress.cases.contact_cases import plates
from spectrasplat.stress.rigs.scene_parts import BEAM, solid, stage

TOP = 1.0
HEIGHTS = (0.0, 1e-7)
"""Above the glass; float32 knows its places to 1e-7."""
SETTINGS = RenderSettings(width=32, height=18, photons=4096, spp=1, layer="caustic")
WHITE = illuminant("D65").scaled_to_luminous(10.0)


def on_block(light: Light) -> Scene:
    return stage(solid("block", box((1.6, 1.6, 0.6)), constant(1.5, "n 1.5"), (0.0, 0.0, TOP - 0.3)), lights=[light])


def beam_at(height: float) -> Scene:
    return on_block(replace(BEAM, position=(0.0, 0.0, TOP + height), radius=0.3))


@pytest.mark.parametrize("method", ["srd", "srd-photons"])
@pytest.mark.parametrize("height", HEIGHTS)
def test_a_beam_from_the_face_of_a_plate_passes_both_faces(gl, method: str, height: float) -> None:
    tally = render(beam_at(height), replace(SETTINGS, method=method), context=gl).stats.light.tally
    assert tally.ended["deposited"] / tally.emitted == pytest.approx(plates([1.5]), abs=2e-3)


@pytest.mark.parametrize("method", ["srd", "srd-photons"])
def test_a_point_on_a_face_lights_what_one_just_above_does(gl, method: str) -> None:
    landed = []
    for height in (1e-5, 0.0):
        scene = on_block(PointLight("lamp", WHITE, (0.1, 0.1, TOP + height)))
        ended = render(scene, replace(SETTINGS, method=method), context=gl).stats.light.tally.ended
        assert ended["lost_depth"] < 1e-3 * ended["deposited"]
        landed.append(ended["deposited"])
    # So few beams know it to some per cent; a lamp that shines within the glass as well lands a fifth more.
    assert landed[1] == pytest.approx(landed[0], rel=0.05)


def test_the_tail_of_glass_without_dispersion_stays_in_the_bands_of_photons(gl) -> None:
    """Beams from an area light close to a face end with corners that rounding decides; a band halved for that had no
    photons to carry it."""
    scene = on_block(AreaLight("panel", WHITE, (0.0, 0.0, TOP + 1e-3), (0.0, 0.0, -1.0), radius=0.3))
    result = render(scene, replace(SETTINGS, photons=1024), context=gl)
    assert np.isfinite(result.rgb).all() and result.stats.light.tally.handed > 0.0
