"""Depth of field: the camera's thin lens against the float64 reference, closed forms, and pictures without one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.glass import sellmeier
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from spectrasplat.reference.camera_reference import cached_camera_reference

from tests.gpu.camera_rig import (
    DOWN,
    REFLECTANCE,
    WHITE,
    at,
    flat_maps,
    floor,
    horizontal,
    opened_camera_pass,
    released,
    render,
    white_texels,
)

SIZE = 48, 32
GLASS = Dielectric(sellmeier((1.1,), (0.012,)))
SUN = DirectionalLight("sun", WHITE, direction=(0.2, 0.3, -0.9))
VIEW = Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.3), vertical_fov_deg=35.0, lens_radius=0.3)


def things() -> tuple[SceneObject, ...]:
    """A dark ball before the plane of focus, a light one behind it."""
    near, far = sphere(0.3, 1280), sphere(0.5, 1280)
    return (
        floor(30.0),
        SceneObject("near", near, Diffuse((0.05, 0.2, 0.05)), at(0.6, -2.0, 0.4)),
        SceneObject("far", far, Diffuse((0.9, 0.6, 0.3)), at(-1.0, 2.5, 0.5)),
    )


def relative(picture: np.ndarray, expected: np.ndarray) -> float:
    """Root mean square difference, in means of the expected picture."""
    return float(np.sqrt(np.mean((picture - expected) ** 2)) / expected.mean())


def reference(camera: Camera, objects: tuple[SceneObject, ...], samples: int) -> np.ndarray:
    scene = Scene("lens", camera, (SUN,), objects)
    return cached_camera_reference(scene, *SIZE, samples=samples).rgb


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pinhole", "orthographic"])
def test_the_picture_is_the_references(gl, kind: str) -> None:
    """What is left is noise: a tenth of what a pinhole, half the radius or another plane of focus would leave."""
    camera = replace(VIEW, kind=kind, vertical_extent=3.0)
    expected = reference(camera, things(), 512)
    error = relative(render(gl, things(), (SUN,), SIZE, 256, camera), expected)
    wrong = (
        replace(camera, lens_radius=0.0),
        replace(camera, lens_radius=0.15),
        replace(camera, focus_distance=0.6 * camera.plane_of_focus),
    )
    errors = [relative(render(gl, things(), (SUN,), SIZE, 16, other), expected) for other in wrong]
    assert error < 0.02
    assert min(errors) > 3.0 * error, (error, errors)


@pytest.mark.slow
def test_glass_is_seen_through_all_of_the_lens(gl) -> None:
    """A ball of glass out of focus: paths begin where the look that met it did."""
    objects = (*things(), SceneObject("ball", sphere(0.45, 1280), GLASS, at(0.0, -1.2, 0.6)))
    expected = reference(VIEW, objects, 1024)
    picture = render(gl, objects, (SUN,), SIZE, 128, VIEW)
    # The caustic is in neither: the reference has none, the pass has no maps.
    assert relative(picture, expected) < 0.05


@pytest.mark.slow
def test_more_samples_leave_less(gl) -> None:
    """An edge out of focus, of a picture in a few samples more than in one launch of many."""
    expected = reference(VIEW, things(), 512)
    errors = [relative(render(gl, things(), (SUN,), SIZE, samples, VIEW), expected) for samples in (1, 4, 16, 64)]
    assert all(later < 0.75 * earlier for earlier, later in pairwise(errors)), errors


def test_an_edge_is_blurred_by_the_circle_of_confusion(gl) -> None:
    """Seen from above, the edge of a lit sheet at half the focus distance: its profile is the disc's distribution."""
    radius, focus, height = 0.5, 10.0, 5.0
    camera = Camera((0, 0, 10), (0, 0, 0), up=(0, 1, 0), vertical_fov_deg=8.0, lens_radius=radius, focus_distance=focus)
    sheet = horizontal(0.0, 8.0, -8.0, 8.0, height, Diffuse((0.5,) * 3))
    sun = DirectionalLight("sun", WHITE, direction=DOWN)
    row = render(gl, (sheet,), (sun,), (64, 48), 64, camera)[8:40, :, 1].mean(axis=0)
    half = np.tan(np.radians(4.0)) * 64 / 48
    # A ray through x on the plane of focus and s on the lens passes the sheet at (x + s)/2.
    x = half * focus * (2.0 * (np.arange(64) + 0.5) / 64 - 1.0)
    share = np.clip(x / radius, -1.0, 1.0)
    seen = 0.5 + (np.arcsin(share) + share * np.sqrt(1.0 - share**2)) / np.pi
    assert np.abs(row / row.max() - seen).max() < 0.02


def test_what_is_in_focus_stays_sharp(gl) -> None:
    """An edge in the plane of focus is the pinhole's, at few samples too."""
    camera = Camera((0, 0, 10), (0, 0, 0), up=(0, 1, 0), vertical_fov_deg=20.0)
    sheet = horizontal(0.0, 8.0, -8.0, 8.0, 0.0, Diffuse((0.5,) * 3))
    sun = DirectionalLight("sun", WHITE, direction=DOWN)
    pictures = [render(gl, (sheet,), (sun,), (32, 8), 16, replace(camera, lens_radius=radius)) for radius in (0.0, 0.5)]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-3, atol=1e-3 * pictures[0].max())


def test_a_blurred_map_is_averaged(gl) -> None:
    """A chequered caustic map far out of focus is the mean of its texels in one sample, all over the lens in few."""
    camera = Camera((0, 0, 10), (0, 0, 0), up=(0, 1, 0), vertical_fov_deg=8.0, lens_radius=0.5, focus_distance=4.0)
    camera_pass = opened_camera_pass(gl, (floor(),), camera=camera)
    chequers = (np.indices((256, 256)) // 16).sum(axis=0) % 2
    maps = flat_maps(gl, camera_pass.scene, [(-2.0, -2.0, 4.0, 0, 0, 256)], white_texels(1.0 * chequers))
    spread = []
    for radius in (0.0, 0.5):
        camera_pass.run(replace(camera, lens_radius=radius), 90, 60, 4, maps=maps)
        inner = camera_pass.read_rgb()[25:35, 40:50, 1]
        spread.append(float(inner.std() / inner.mean()))
    released(camera_pass)
    # Half of the texels have 1 lm each.
    assert inner.mean() == pytest.approx(REFLECTANCE / np.pi * 0.5 * 64.0**2, rel=0.02)
    assert spread[1] < 0.05 and spread[0] > 0.5, spread


def test_a_lens_is_opened_and_closed_again(gl) -> None:
    """One pass serves both: what the pinhole shows is what it showed before."""
    camera_pass = opened_camera_pass(gl, things(), (SUN,), camera=VIEW)
    pictures = []
    for radius in (0.0, 0.3, 0.0):
        camera_pass.run(replace(VIEW, lens_radius=radius), *SIZE, 4)
        pictures.append(camera_pass.read_rgb())
    released(camera_pass)
    np.testing.assert_array_equal(pictures[0], pictures[2])
    assert relative(pictures[1], pictures[0]) > 0.05
