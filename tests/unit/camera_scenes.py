"""Scenes and shorthand that the tests of the references share."""

from __future__ import annotations

import math

import numpy as np
from reference import camera_answers
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, rgb709_to_xyz
from spectrasplat.model.optics.glass import Dispersion, from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Black, Camera, Dielectric, Diffuse, Light, Material, Scene, SceneObject
from spectrasplat.reference import photon_intersect, scattering
from spectrasplat.reference.compiling import compiled

FLINT = from_abbe(1.7, 25.0)
D65 = illuminant("D65").scaled_to_luminous(1.0)
ABOVE = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1.0)
WHITE = rgb709_to_xyz(np.ones(3))


@compiled
def scatter(*event):
    """`scattering.scatter`, which only compiled functions may call."""
    return scattering.scatter(*event)


@compiled
def normal_at(*there):
    """`photon_intersect.normal_at`, which only compiled functions may call."""
    return photon_intersect.normal_at(*there)


def place(mesh, material: Material, at=(0.0, 0.0, 0.0), rotation: np.ndarray | None = None) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if rotation is None else rotation
    matrix[:3, 3] = at
    return SceneObject(mesh.name, mesh, material, matrix)


def scene_of(*things: Light | SceneObject, camera: Camera = ABOVE, **more) -> Scene:
    lights = tuple(t for t in things if isinstance(t, Light))
    return Scene("test", camera, lights, tuple(t for t in things if isinstance(t, SceneObject)), **more)


def plate(material: Material | None = None, size: float = 40.0) -> SceneObject:
    return place(primitives.plane(size, size), material or Diffuse((0.8, 0.8, 0.8)))


THICKNESS, TILT = 1.0, math.radians(45.0)
GRAZING = math.radians(5.0)
"""The light comes in under the slab."""


def slab_scene(glass: Dispersion) -> Scene:
    """White for x > 0, black elsewhere; seen at 45° through a slab, which shades neither."""
    light = DirectionalLight(
        "low", D65.scaled(1.0 / math.sin(GRAZING)), direction=(0.0, math.cos(GRAZING), -math.sin(GRAZING))
    )
    white = place(primitives.plane(4.0, 8.0), Diffuse((1.0, 1.0, 1.0)), (2.0, 0.0, 0.0))
    black = place(primitives.plane(4.0, 8.0), Black(), (-2.0, 0.0, 0.0))
    slab = place(primitives.box((9.0, 2.0, THICKNESS)), Dielectric(glass), (0.0, 0.0, 2.0))
    edge = float(np.mean(camera_answers.slab_displacement(glass.index(VISIBLE_NM), THICKNESS, TILT)))
    camera = Camera(
        (-10.0 + edge, 0.0, 10.0), (edge, 0.0, 0.0), kind="orthographic", up=(1.0, 0.0, 0.0), vertical_extent=0.06
    )
    return scene_of(light, white, black, slab, camera=camera)
