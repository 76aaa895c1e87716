"""What lights give to a place straight on, past everything that is in the way: for numbers that are read off a picture.

Glass and mirrors are in the way too, for what they hand on is the caustic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Scene
from .camera_kernel import gain_of_light
from .camera_lights import CameraLights, camera_lights
from .compiling import compiled
from .photon_intersect import nearest, normal_at
from .photon_scene import PhotonScene, photon_scene
from .sampling import scratch

_SAMPLES = 256
"""Of a light of some extent."""
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
    dx, dy, dz = -normal[0], -normal[1], -normal[2]
    distance, triangle, _, _ = nearest(
        scene,
        start[0],
        start[1],
        start[2],
        dx,
        dy,
        dz,
        -1,
        -1,
        False,
        np.uint64(0),
        scratch.stack,
        scratch.stack_distance,
    )
    if triangle < 0 or distance > 100.0 * height:
        return
    px, py, pz = start[0] + distance * dx, start[1] + distance * dy, start[2] + distance * dz
    nx, ny, nz = normal_at(scene, triangle, px, py, pz)
    side = 0 if nx * normal[0] + ny * normal[1] + nz * normal[2] > 0.0 else 1
    for i in range(lights.kind.shape[0]):
        total = 0.0
        for j in range(_SAMPLES):
            a, b = (j + 0.5) / _SAMPLES, j * 0.6180339887498949
            total += gain_of_light(scene, lights, i, triangle, side, px, py, pz, a, b - math.floor(b), scratch.stack)
        found[i] = total / _SAMPLES
