"""Which pixels see a surface directly, and not behind glass or in a mirror: where the reference's caustic layer is the
whole caustic."""

from __future__ import annotations

import numpy as np

from ..model.scene import Scene
from .camera_rays import camera_ray
from .compiling import compiled
from .photon_intersect import nearest
from .photon_scene import MIRROR, photon_scene, viewpoint
from .sampling import scratch


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
            ray = camera_ray(camera, column + offset, row + offset)
            _, triangle, _, _ = nearest(scene, *ray, -1, -1, False, np.uint64(0), scratch.stack, scratch.stack_distance)
            hit[row, column] = triangle >= 0 and scene.kind[scene.owner[triangle]] >= MIRROR
