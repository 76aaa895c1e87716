"""What lies at a point of the picture: the first surface there, and what is seen through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.camera_rays import camera_frame
from ..model.optics.glass import LINE_D_NM
from ..model.scene import Camera, Vec3
from .ray_paths import Path, RayPaths


@dataclass(frozen=True)
class PickHit:
    """A surface under the cursor."""

    object_index: int
    position: Vec3
    """World."""
    normal: Vec3
    """Unit, geometric, towards where the ray came from."""
    distance: float
    """From the camera along the ray, scene units (along all its segments, where it was refracted)."""
    is_receiver: bool


class Picker:
    """Answers for one scene; `pick` waits for the device (one ray)."""

    def __init__(self, context: Context, scene: SceneBuffers, paths: RayPaths | None = None) -> None:
        """`paths`: the tracer of the same scene to share; it is then its owner's to release."""
        self._scene = scene.scene
        self._owns = paths is None
        self._paths = paths or RayPaths(context, scene)

    def pick(self, camera: Camera, width: int, height: int, x: float, y: float) -> PickHit | None:
        """First surface at (x, y), 0..1 from the top left of a picture of width × height; glass is not looked
        through."""
        path = self._path(camera, width / height, x, y)
        return None if path.first_object is None else self._hit(path, 1, path.first_object, path.first_normal)

    def pick_receiver(self, camera: Camera, width: int, height: int, x: float, y: float) -> PickHit | None:
        """The diffuse surface that is seen at (x, y), through glass (refracted at the d line) and in mirrors, as the
        camera draws it."""
        path = self._path(camera, width / height, x, y)
        if path.last_object is None or not self._scene.objects[path.last_object].material.receives:
            return None
        return self._hit(path, len(path.points) - 1, path.last_object, path.last_normal)

    def release(self) -> None:
        """Free what it owns."""
        if self._owns:
            self._paths.release()

    def _path(self, camera: Camera, aspect: float, x: float, y: float) -> Path:
        origin, direction = picture_ray(camera, aspect, x, y)
        return self._paths.trace(origin[None], direction[None], np.array([LINE_D_NM]), 1.0)[0]

    def _hit(self, path: Path, point: int, index: int, normal: np.ndarray) -> PickHit:
        steps = np.linalg.norm(np.diff(path.points[: point + 1], axis=0), axis=1)
        is_receiver = self._scene.objects[index].material.receives
        return PickHit(index, _vec3(path.points[point]), _vec3(normal), float(steps.sum()), is_receiver)


def picture_ray(camera: Camera, aspect: float, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Origin and unit direction (3,), world, through (x, y) of a picture, 0..1 from its top left."""
    right, up, forward = camera_frame(camera)
    across = (2.0 * x - 1.0) * aspect * right + (1.0 - 2.0 * y) * up
    position = np.asarray(camera.position, float)
    if camera.kind == "orthographic":
        return position + 0.5 * camera.vertical_extent * across, forward
    direction = forward + np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * across
    return position, direction / np.linalg.norm(direction)


def _vec3(values: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
