"""Which pixels see a surface directly, and not behind glass or in a mirror: where the reference's caustic layer is the
whole caustic."""

from __future__ import annotations

import numpy as np

from ..model.scene import Scene
from .photon_intersect import STACK_SIZE, compiled, nearest
from .photon_scene import MIRROR, photon_scene, viewpoint


def seen_directly(scene: Scene, width: int, height: int) -> np.ndarray:
    """bool (height, width), row 0 on top: no corner of the pixel nor its middle meets glass or a mirror first.

    Raises `UserError` where more solids nest than the reference can follow.
    """
    photons, centre = photon_scene(scene)
    camera = viewpoint(scene.camera, width, height, centre)
    corners = np.zeros((height + 1, width + 1), np.bool_)
    middles = np.zeros((height, width), np.bool_)
    _specular(photons, camera, 0.0, corners)
    _specular(photons, camera, 0.5, middles)
    touched = corners[:-1, :-1] | corners[1:, :-1] | corners[:-1, 1:] | corners[1:, 1:]
    return ~(touched | middles)


@compiled
def _specular(scene, camera, offset, hit):
    """Set `hit` where the camera ray at (row + offset, column + offset) pixels meets glass or a mirror first."""
    stack, stack_distance = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    for row in range(hit.shape[0]):
        y = camera.half_height * (1.0 - 2.0 * (row + offset) / camera.height)
        for column in range(hit.shape[1]):
            x = camera.half_width * (2.0 * (column + offset) / camera.width - 1.0)
            ax = x * camera.right[0] + y * camera.up[0]
            ay = x * camera.right[1] + y * camera.up[1]
            az = x * camera.right[2] + y * camera.up[2]
            ox, oy, oz = camera.position[0], camera.position[1], camera.position[2]
            dx, dy, dz = camera.forward[0], camera.forward[1], camera.forward[2]
            if camera.orthographic:
                ox, oy, oz = ox + ax, oy + ay, oz + az
            else:
                dx, dy, dz = dx + ax, dy + ay, dz + az
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                dx, dy, dz = dx / length, dy / length, dz / length
            found = nearest(scene, ox, oy, oz, dx, dy, dz, -1, -1, False, np.uint64(0), stack, stack_distance)
            hit[row, column] = found[1] >= 0 and scene.kind[scene.owner[found[1]]] >= MIRROR
