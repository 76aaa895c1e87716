"""Thin sheets and coloured surfaces of glass against closed forms, through photons, beams, camera and references.

A sheet reflects R' = 2R/(1 + R), R being what one face does, and lets through 1 - R' of its colour; straight on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.optics.colorimetry import rgb_basis
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.scene import Camera, Dielectric, SceneObject
from spectrasplat.reference.camera_reference import cached_camera_reference
from spectrasplat.stress.rigs.camera_probe import (
    PROBE,
    daylight_mean,
    fresnel,
    render_probe,
    resized,
    slope_sky,
    with_sky,
)
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate
from spectrasplat.stress.rigs.probe import blocks

from tests.gpu.camera_rig import at, shares_of_the_sun, sheets_in_a_furnace, tilted

N = 1.5
TINT = (0.9, 0.3, 0.2)
SHEET = Dielectric(constant(N), thin=True, transmittance_rgb=TINT)
SOLID = Dielectric(constant(N), transmittance_rgb=TINT)
CLEAR = Dielectric(constant(N))
FACE = float(fresnel(1.0, N))
BOTH = 2.0 * FACE / (1.0 + FACE)


def pane(material: Dielectric, z: float) -> SceneObject:
    return SceneObject(f"pane {z:g}", plane(1.0, 1.0), material, at(0.0, 0.0, z))


def block(material: Dielectric, z: float) -> SceneObject:
    return SceneObject(f"block {z:g}", box((1.0, 1.0, 0.2)), material, at(0.0, 0.0, z))


def behind_two(first: float, second: float) -> float:
    """Share that gets through two that reflect so much, with all that goes to and fro between them."""
    return (1.0 - first) * (1.0 - second) / (1.0 - first * second)


PATCHES: dict[str, tuple[tuple[SceneObject, ...], np.ndarray]] = {
    # What stands over the floor, and what of the sun gets through to it, by colour.
    "sheet": ((pane(SHEET, 1.5),), (1.0 - BOTH) * np.array(TINT)),
    # Within a tinted solid light is reflected to and fro without crossing a surface: only out of it is another filter.
    "solid": ((block(SOLID, 1.5),), (1.0 - FACE) ** 2 / (1.0 - FACE**2) * np.array(TINT)),
    "sheet before beams": ((pane(SHEET, 1.8), block(CLEAR, 1.2)), behind_two(BOTH, BOTH) * np.array(TINT)),
    "beams before a sheet": ((block(CLEAR, 1.8), pane(SHEET, 1.2)), behind_two(BOTH, BOTH) * np.array(TINT)),
    "sheet in a solid": (
        (
            SceneObject("solid", box((1.0, 1.0, 1.0)), CLEAR, at(0, 0, 1.5)),
            pane(replace(SHEET, dispersion=CLEAR.dispersion), 1.5),
        ),
        (1.0 - BOTH) * np.array(TINT),
    ),
}


def test_patches_of_sun(gl: Context) -> None:
    found = shares_of_the_sun(gl, [stand for stand, _ in PATCHES.values()])
    # What two reflections between a sheet and its tint would add is below a thousandth.
    assert found == pytest.approx(np.array([expected for _, expected in PATCHES.values()]), rel=0.012)


def test_both_faces(gl: Context) -> None:
    one = as_f32(np.random.default_rng(3).uniform(0.0, 0.99, (64, 3)))
    body = (
        "r = both_faces(s); FresnelPair pair = both_faces(FresnelPair(s, s * s, -s, s)); p = pair.p; real = pair.real;"
    )
    libraries = ["lib/optics.glsl", "lib/polarisation.glsl"]
    got = evaluate(gl.ctx, libraries, body, {"s": one}, dict.fromkeys(("r", "p", "real"), "vec3"), {"HAS_SHEET": 1})
    # There and back between the faces, added up.
    sums = [sum(r * (1.0 - r) ** 2 * r ** (2 * k) for k in range(4000)) + r for r in (one, one**2)]
    for name, wanted in (("r", sums[0]), ("p", sums[1]), ("real", -np.sqrt(sums[0] * sums[1]))):
        np.testing.assert_allclose(got[name], wanted, atol=2e-5)


def test_sheets_in_a_furnace(gl: Context) -> None:
    sheets = [(m, degrees) for m in (SHEET, Dielectric(constant(N), thin=True)) for degrees in (0.0, 60.0, 80.0)]
    for (material, degrees), seen in zip(sheets, sheets_in_a_furnace(gl, sheets), strict=True):
        r = float(fresnel(np.cos(np.radians(degrees)), N))
        both = 2.0 * r / (1.0 + r)
        passed = (1.0 - both) * (rgb_basis() @ np.array(material.transmittance_rgb))
        assert seen == pytest.approx(daylight_mean(both + passed), rel=2e-3), (material, degrees)


@pytest.mark.parametrize("polarised", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_sheets_as_the_reference_sees_them(gl: Context, polarised: bool) -> None:
    """Two tilted sheets and a tinted prism of a solid before a sky that changes in every direction."""
    first, second = (
        SceneObject(f"sheet {z}", plane(1.4, 1.4), SHEET, at(0.0, 0.0, z) @ tilted(58.0)) for z in (0.3, -0.3)
    )
    camera = Camera((0.2, -0.3, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=22.0)
    solid = SceneObject("solid", box((0.5, 0.5, 0.5)), SOLID, at(-0.6, 0.2, 1.0) @ tilted(58.0))
    scene = with_sky(first, second, solid, camera=camera, environment=slope_sky())
    scene = replace(scene, render=replace(scene.render, polarisation=polarised))
    found = render_probe(gl, scene, resized(PROBE, 24, 18, 64)).picture
    reference = cached_camera_reference(scene, 24, 18, samples=1024).rgb
    assert found.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=4e-3)
    assert np.abs(blocks(found, 6) - blocks(reference, 6)).max() < 0.03
