"""Lamps from photometric files on the GPU: known answers for tables whose light is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from reference.lamps import cosine, ies_text, lamp, lopsided
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics import catalogue
from spectrasplat.model.optics.colorimetry import rgb709_to_xyz
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Light, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.emission_domain import emission_domain
from spectrasplat.render.still import render
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.invalidation import _light

SETTINGS = RenderSettings(width=64, height=48, photons=20_000, spp=4)
POWER = illuminant("D65").scaled_to_luminous(100.0)
PLACE = (0.4, -0.3, 3.0)


def put(mesh: Mesh, material, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return SceneObject(mesh.name, mesh, material, matrix)


def ball_under(light: Light) -> Scene:
    ball = put(primitives.sphere(0.5, 1280), Dielectric(catalogue.find("N-SF11")), (0.0, 0.0, 0.7))
    floor = put(primitives.plane(12.0, 12.0), Diffuse((0.8, 0.8, 0.8)))
    return Scene("ball", Camera((0.0, -4.0, 4.0), (0.0, 0.0, 0.0), vertical_fov_deg=40.0), (light,), (ball, floor))


def picture(gl, light: Light, **settings: object) -> np.ndarray:
    return render(ball_under(light), replace(SETTINGS, **settings), context=gl).rgb.astype(float)


def test_below_a_lambertian_lamp(gl, tmp_path: Path) -> None:
    """Intensity cos θ, distance h/cos θ and incidence cos θ make I₀ cos⁴ θ / h²."""
    height = 2.0
    light = lamp(tmp_path, POWER, cosine(), position=(0.0, 0.0, height))
    floor = put(primitives.plane(12.0, 12.0), Diffuse((1.0, 1.0, 1.0)))
    camera = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=6.0)
    shown = render(Scene("floor", camera, (light,), (floor,)), replace(SETTINGS, spp=16), context=gl)
    rows, columns = np.indices((48, 64))
    pixel = 6.0 / 48
    # The mean square over a pixel is that of its middle and a sixth of its side squared.
    across2 = ((columns - 31.5) * pixel) ** 2 + ((rows - 23.5) * pixel) ** 2 + pixel**2 / 6.0
    cosine_of = height / np.sqrt(height**2 + across2)
    expected = 100.0 * cosine_of**4 / height**2 / np.pi
    np.testing.assert_allclose(rgb709_to_xyz(shown.rgb.astype(float))[..., 1], expected, rtol=2e-3)


def test_dark_directions_get_no_photons(gl, tmp_path: Path) -> None:
    """The cone that holds the light bounds the domain; a lamp that shines away from the glass has none."""
    from spectrasplat.gpu.gpu_space import GpuSpace

    narrow = ies_text(lambda v, h: np.where(v <= 5.0, 100.0, 0.0), [0.0, 5.0, 10.0, 90.0])
    down = lamp(tmp_path, POWER, narrow, position=(0.0, 0.0, 3.0))
    scene = ball_under(down)
    space = GpuSpace.of(scene)
    solid = space.to_gpu(scene.objects[0].mesh.transformed(scene.objects[0].object_to_world).corners())
    domain = emission_domain(down, scene, space, solid)
    wide = emission_domain(PointLight("p", POWER, (0.0, 0.0, 3.0)), scene, space, solid)
    assert domain is not None and wide is not None and domain.measure < 0.8 * wide.measure
    assert emission_domain(replace(down, direction=(0.0, 0.0, 1.0)), scene, space, solid) is None


def test_what_an_edit_costs(tmp_path: Path) -> None:
    one = lamp(tmp_path, POWER, lopsided())
    assert _light(one, replace(one, rotation_deg=3.0)) == DirtyLevel.TRACE
    assert _light(one, lamp(tmp_path, POWER, cosine())) == DirtyLevel.BUILD
    assert _light(one, lamp(tmp_path, POWER, lopsided())) == DirtyLevel.NOTHING
