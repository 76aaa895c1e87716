"""The two sides of receivers (`SceneBuffers.receivers`): what lands on one does not show on the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..model.scene_camera import camera_frame
from .landings import Landings

if TYPE_CHECKING:
    from ..gpu.scene_buffers import SceneBuffers
    from ..model.scene import Camera


def is_back(receiver: int) -> bool:
    """Whether number `receiver` is a back."""
    return receiver % 2 == 1


def faces_camera(camera: Camera, buffers: SceneBuffers, receiver: int) -> bool:
    """Whether this side of a flat receiver is turned to the camera."""
    mesh = buffers.world_meshes[buffers.receivers[receiver]]
    normal = mesh.face_normals()[int(np.argmax(mesh.areas()))]
    if camera.kind == "orthographic":
        towards = -camera_frame(camera)[2]
    else:
        towards = np.asarray(camera.position, float) - mesh.vertices[0]
    return bool(towards @ normal < 0.0) == is_back(receiver)


def on_both(landings: Mapping[int, Landings]) -> dict[int, Landings]:
    """Each side with what landed on either."""
    found: dict[int, Landings] = {}
    for front in {receiver - is_back(receiver) for receiver in landings}:
        parts = [landings[side] for side in (front, front + 1) if side in landings]
        both = Landings(*(np.concatenate([getattr(one, name) for one in parts]) for name in ("positions", "flux_w")))
        found |= {front: both, front + 1: both}
    return found
