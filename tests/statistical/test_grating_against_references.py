"""Light and camera pass against the float64 references where a grating is in the way.

Smallest error this can detect: totals are known to about 1 %; a row of pixels across the spectra to a few per cent of
the brightest block. A mutant (another line spacing) stands out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import AreaLight, CollimatedLight
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Diffuse, Grating, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render

WIDTH, HEIGHT = 96, 48
UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Its normal turned to -y, its own y axis up."""


def placed(mesh, material, at, matrix=UPRIGHT) -> SceneObject:
    matrix = matrix.copy()
    matrix[:3, 3] = at
    return SceneObject(mesh.name, mesh, material, matrix)


def slit_seen_through(lines: float = 600.0) -> Scene:
    """A bright slit in the dark, and a grating before the camera."""
    grating = Grating(lines, (-1, 0, 1), (0.3, 0.2, 0.4))
    slit = AreaLight(
        "slit",
        illuminant("D65").scaled_to_luminous(100.0),
        (0.0, 5.0, 0.0),
        (0.0, -1.0, 0.0),
        shape="rectangle",
        width=0.3,
        height=1.6,
        tangent=(1.0, 0.0, 0.0),
    )
    floor = placed(primitives.plane(20.0, 20.0), Diffuse((0.5, 0.5, 0.5)), (0.0, 0.0, -3.0), np.eye(4))
    objects = (placed(primitives.plane(8.0, 8.0, "grating"), grating, (0.0, 1.0, 0.0)), floor)
    return Scene("slit", Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=26.0), (slit,), objects)


def spectra_on_a_wall(lines: float = 600.0, reflects: bool = False) -> Scene:
    """A beam through (or off) a slanted grating onto a wall."""
    grating = Grating(lines, (-1, 0, 1, 2), (0.3, 0.1, 0.4, 0.1), reflects)
    beam = CollimatedLight(
        "beam",
        illuminant("A").scaled_to_luminous(1000.0),
        position=(-0.4, -1.0, 0.0),
        direction=(0.4, 1.0, 0.0),
        radius=0.12,
    )
    y = -2.0 if reflects else 2.0
    wall = placed(primitives.plane(9.0, 3.0, "wall"), Diffuse((0.8, 0.8, 0.8)), (1.0, y, 0.0))
    camera = Camera((1.0, 0.5 * y, 0.2), (1.0, y, 0.0), vertical_fov_deg=100.0)
    return Scene("wall", camera, (beam,), (placed(primitives.plane(1.0, 1.0, "grating"), grating, (0, 0, 0)), wall))


def blocks(picture: np.ndarray) -> np.ndarray:
    return picture.reshape(HEIGHT // 8, 8, WIDTH // 4, 4, 3).mean(axis=(1, 3))


def error(picture: np.ndarray, reference: np.ndarray) -> float:
    """nRMSE of blocks."""
    a, b = blocks(picture), blocks(reference)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


SETTINGS = RenderSettings(width=WIDTH, height=HEIGHT, photons=120_000, spp=96)


@pytest.mark.slow
def test_the_camera_sees_the_slits_spectra() -> None:
    reference = cached_camera_reference(slit_seen_through(), WIDTH, HEIGHT, samples=1500).rgb
    found = {m: render(slit_seen_through(), replace(SETTINGS, method=m)).rgb for m in ("srd", "stochastic-even")}
    for method, picture in found.items():
        assert picture.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.02), method
        assert error(picture, reference) < 0.04, method
    other = render(slit_seen_through(615.0), SETTINGS).rgb
    assert error(other, reference) > 0.08


@pytest.mark.slow
@pytest.mark.parametrize("reflects", [False, True])
def test_light_lands_in_the_same_spectra(reflects: bool) -> None:
    scene = spectra_on_a_wall(reflects=reflects)
    reference = cached_reference(scene, WIDTH, HEIGHT, photons=400_000).rgb
    picture = render(scene, replace(SETTINGS, layer="caustic")).rgb
    assert picture.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=0.02)
    assert error(picture, reference) < 0.05
    other = render(spectra_on_a_wall(620.0, reflects), replace(SETTINGS, layer="caustic")).rgb
    assert error(other, reference) > 0.08
