"""A beam thinner than a pixel keeps its light in the picture, far below what float32 tells apart; so does one that a
border of its receiver divides. One as wide as a pane falls off as its lamp's light does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Scene
from spectrasplat.stress.rigs.probe import SMALL, picture_error, probe
from spectrasplat.stress.rigs.scene_parts import UNDER_GLASS, at, solid, stage

CAUSTIC = replace(SMALL, layer="caustic", method="srd")
PIXEL = UNDER_GLASS.vertical_extent / SMALL.height
ASLANT = Camera((0.0, -5.0, 5.0), (0.0, 0.0, 0.0), vertical_fov_deg=36.0)


def beam(pixels: float, camera: Camera = UNDER_GLASS) -> Scene:
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


@pytest.mark.parametrize("seam", [0.313, 0.3291])
def test_a_floor_in_two_parts_has_no_seam(gl, seam: float) -> None:
    """Were polygons cut at borders, their texels would lack half of their light on average: 6 % here."""
    whole = beam(10.0)
    *others, table = whole.objects
    half = 0.5 * float(np.ptp(table.mesh.vertices[:, 0]))
    halves = [
        replace(table, name=side, object_to_world=at(seam + way * half) @ table.object_to_world)
        for side, way in (("left", -1.0), ("right", 1.0))
    ]
    found, base = (probe(gl, scene, CAUSTIC) for scene in (replace(whole, objects=(*others, *halves)), whole))
    assert picture_error(found.picture, base.picture) < 3e-3


def test_a_pane_under_a_lamp_is_lit_as_snell_and_fresnel_say() -> None:
    """Straight below the lamp the density's slope is 0 and its second order everything: up to 1.8 times too bright
    without that. Beyond 45° the lamp's light is that of other tiles: what two of them light is 1.6 times too bright.
    Pieces of beams are off by 3 %."""
    lamp = {"kind": "point", "position": [0, 0, 2], "intensity_cd": 1000}
    floor = {"name": "floor", "shape": "plane", "width": 6, "height": 6, "material": {"kind": "diffuse", "colour": 1}}
    pane = {"shape": "slab", "width": 20, "height": 20, "position": [0, 0, 1], "material": {"n_d": 1.5}}
    camera = {"position": [0, -4, 4]}
    scene = ss.load({"objects": [floor, pane], "lights": [lamp], "camera": camera})
    found = ss.caustic(scene, "floor", size=(16, 16), photons=20_000).rgb @ (0.2126, 0.7152, 0.0722)
    angle = np.linspace(0.0, 1.5, 20_001)
    inside = np.arcsin(np.sin(angle) / 1.5)
    cosines, bent = np.cos(angle), np.cos(inside)
    reflected = [((a - b) / (a + b)) ** 2 for a, b in ((cosines, 1.5 * bent), (1.5 * cosines, bent))]
    passed = 0.5 * sum((1 - r) / (1 + r) for r in reflected)  # all orders where the first one lands
    radius = 1.9 * np.tan(angle) + 0.1 * np.tan(inside)
    flux = np.append(0.0, np.cumsum(0.5 * (passed[1:] + passed[:-1]) * -np.diff(cosines)))
    lux = 1000.0 * np.diff(flux) / (0.5 * np.diff(radius**2))
    u = 3.0 * ((np.arange(64) + 0.5) / 32.0 - 1.0)
    wanted = np.interp(np.hypot(u, u[:, None]), 0.5 * (radius[1:] + radius[:-1]), lux)
    wanted = wanted.reshape(16, 4, 16, 4).mean(axis=(1, 3))
    assert found.mean() == pytest.approx(wanted.mean(), rel=4e-3)
    np.testing.assert_allclose(found, wanted, rtol=0.04)
