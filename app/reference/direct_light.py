"""What reaches a place or the camera straight on: for numbers that are read off a picture.

Glass and mirrors are in the way of direct light too, for what they pass on is the caustic; where a pixel sees a surface
directly, and not behind glass or in a mirror, the reference's caustic layer is the whole caustic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Scene
from .camera_kernel import gain_of_light
from .camera_lights import CameraLights, camera_lights
from .compiling import NO, NONE, compiled
from .photon_intersect import nearest, normal_at
from .photon_scene import MIRROR, PhotonScene, photon_scene
from .sampling import scratch
from .vectors import dot, moved, negated
from .viewpoint import camera_ray, viewpoint

_SAMPLES = 256
"""Samples of a light with extent."""
_HOVER = 1e-6
"""Height over a place from which its facet is looked for, of the scene's size."""


class DirectLight(NamedTuple):
    """A scene as this reads it."""

    photons: PhotonScene
    lights: CameraLights
    centre: np.ndarray
    size: float

    @staticmethod
    def of(scene: Scene) -> DirectLight:
        """Raises UserError where more solids nest than the reference can follow."""
        photons, centre = photon_scene(scene)
        meshes = [item.mesh.transformed(item.object_to_world) for item in scene.objects]
        size = max(float(np.abs(mesh.vertices - centre).max()) for mesh in meshes)
        return DirectLight(photons, camera_lights(scene.lights, centre), centre, size)

    def gains(self, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Irradiance at a world `place` (3,), on the side that unit `normal` (3,) points to, by each light per unit of
        its quantity: float64 (L,)."""
        found = np.zeros(len(self.lights.kind))
        start = np.asarray(place, float) - self.centre + _HOVER * self.size * np.asarray(normal, float)
        _gather(self.photons, self.lights, start, np.asarray(normal, float), _HOVER * self.size, found, scratch())
        return found


@compiled
def _gather(scene, lights, start, normal, height, found, scratch):
    """Set `found` (L,) to means over places on the lights."""
    distance, triangle, _, _ = nearest(scene, start, negated(normal), NONE, NO, np.uint64(0), scratch)
    if triangle < 0 or distance > 100.0 * height:
        return
    place = moved(start, distance, negated(normal))
    side = 0 if dot(normal_at(scene, triangle, place), normal) > 0.0 else 1
    for i in range(lights.kind.shape[0]):
        total = 0.0
        for j in range(_SAMPLES):
            a, b = (j + 0.5) / _SAMPLES, j * 0.6180339887498949
            gain, _ = gain_of_light(scene, lights, i, triangle, side, place, a, b - math.floor(b), scratch.stack)
            total += gain
        found[i] = total / _SAMPLES


def seen_directly(scene: Scene, width: int, height: int) -> np.ndarray:
    """bool (height, width), row 0 on top: no corner of the pixel nor its middle meets glass or a mirror first.

    Raises `UserError` where more solids nest than the reference can follow.
    """
    photons, centre = photon_scene(scene)
    camera = viewpoint(scene.camera, width, height, centre)
    corners = np.zeros((height + 1, width + 1), np.bool_)
    middles = np.zeros((height, width), np.bool_)
    _specular(photons, camera, 0.0, corners, scratch())
    _specular(photons, camera, 0.5, middles, scratch())
    touched = corners[:-1, :-1] | corners[1:, :-1] | corners[:-1, 1:] | corners[1:, 1:]
    return ~(touched | middles)


@compiled
def _specular(scene, camera, offset, hit, scratch):
    """Set `hit` where the camera ray at (row + offset, column + offset) pixels meets glass or a mirror first."""
    for row in range(hit.shape[0]):
        for column in range(hit.shape[1]):
            place, d = camera_ray(camera, column + offset, row + offset)
            _, triangle, _, _ = nearest(scene, place, d, NONE, NO, np.uint64(0), scratch)
            hit[row, column] = triangle >= 0 and scene.kind[scene.owner[triangle]] >= MIRROR
