"""What solids the camera of a reference stands in; a path begins with that."""

from __future__ import annotations

import numpy as np

from ..model.scene import Scene
from ..model.scene_checks import contains
from .camera_kernel import Start
from .photon_scene import PhotonScene
from .scattering import AIR


def camera_start(scene: Scene, photons: PhotonScene) -> Start:
    """The medium at the camera's position (of an orthographic camera too: its rays all begin as the middle one
    does)."""
    mask, alone = 0, AIR
    for index, item in enumerate(scene.objects):
        if item.material.is_solid and contains(item, np.array(scene.camera.position)):
            if photons.bit[index] >= 0:
                mask |= 1 << int(photons.bit[index])
            else:
                alone = index
    return Start(np.uint64(mask), alone)
