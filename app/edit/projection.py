"""From the world to the picture and to the screen, in float64: what overlays, gizmos and camera moves share.

Picture coordinates are x, y in 0..1 from the top left corner, as `PickHit` and `SelectAt` use them.
Matrices are for column vectors and OpenGL's clip space.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..model.scene import Camera
from ..model.scene_camera import camera_frame


@lru_cache(64)
def fitted(camera: Camera, frame_aspect: float, aspect: float) -> Camera:
    """The camera of a picture `aspect` times as wide as high that shows all of a frame `frame_aspect` times as wide as
    high: with more above and below where the picture is narrower, at the sides where it is wider."""
    wider = max(frame_aspect / aspect, 1.0)
    if wider == 1.0:
        return camera
    half = wider * np.tan(np.radians(0.5 * camera.vertical_fov_deg))
    fov_deg = float(np.degrees(2.0 * np.arctan(half)))
    return replace(camera, vertical_fov_deg=fov_deg, vertical_extent=wider * camera.vertical_extent)


@dataclass(frozen=True)
class View:
    """A camera's frame with the picture's proportions."""

    camera: Camera
    aspect: float
    """Width over height."""
    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    """Unit, float64 (3,)."""
    half_height: float
    """Tangent of half the vertical field of view (pinhole), or half the picture's height in scene units."""

    @staticmethod
    def of(camera: Camera, aspect: float) -> View:
        """The view of a picture `aspect` times as wide as high."""
        right, up, forward = camera_frame(camera)
        half = (
            0.5 * camera.vertical_extent
            if camera.kind == "orthographic"
            else float(np.tan(np.radians(0.5 * camera.vertical_fov_deg)))
        )
        return View(camera, aspect, right, up, forward, half)

    @property
    def is_orthographic(self) -> bool:
        return self.camera.kind == "orthographic"

    @property
    def position(self) -> np.ndarray:
        """float64 (3,)."""
        return np.asarray(self.camera.position, float)

    @property
    def target_distance(self) -> float:
        """From the camera to its target, scene units."""
        return float(np.linalg.norm(np.asarray(self.camera.target, float) - self.position))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance ahead of the camera along its axis, scene units."""
        return (np.asarray(points, float) - self.position) @ self.forward

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World (..., 3) → picture (..., 2) and depth (...). Points at or behind a pinhole's plane give NaN."""
        points = np.asarray(points, float)
        relative = points - self.position
        depth = relative @ self.forward
        scale = np.full(depth.shape, self.half_height)
        if not self.is_orthographic:
            scale = np.where(depth > 0.0, depth * self.half_height, np.nan)
        x = relative @ self.right / (scale * self.aspect)
        y = relative @ self.up / scale
        return np.stack([0.5 + 0.5 * x, 0.5 - 0.5 * y], axis=-1), depth

    def ray(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Origin and unit direction through a point of the picture."""
        across = (2.0 * x - 1.0) * self.aspect * self.half_height * self.right + (
            1.0 - 2.0 * y
        ) * self.half_height * self.up
        if self.is_orthographic:
            return self.position + across, self.forward
        direction = self.forward + across
        return self.position, direction / np.linalg.norm(direction)

    def on_plane(self, x: float, y: float, point: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
        """Where the ray through (x, y) meets a plane; None where it is parallel to it or the plane is behind."""
        origin, direction = self.ray(x, y)
        facing = float(direction @ normal)
        if abs(facing) < 1e-6:
            return None
        distance = float((np.asarray(point, float) - origin) @ normal) / facing
        return origin + distance * direction if distance > 0.0 or self.is_orthographic else None

    def height_at(self, depth: float) -> float:
        """Height of what the picture shows at a depth, scene units."""
        return 2.0 * self.half_height * (1.0 if self.is_orthographic else depth)

    def view_matrix(self, origin: np.ndarray | None = None) -> np.ndarray:
        """World to camera space (x right, y up, z backwards), (4, 4). `origin`: where the world's zero is put, so that
        float32 loses nothing."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([self.right, self.up, -self.forward])
        matrix[:3, 3] = -matrix[:3, :3] @ (self.position - (0.0 if origin is None else np.asarray(origin, float)))
        return matrix

    def projection_matrix(self, near: float, far: float) -> np.ndarray:
        """Camera space to OpenGL's clip space, (4, 4)."""
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = 1.0 / (self.half_height * self.aspect), 1.0 / self.half_height
        if self.is_orthographic:
            matrix[2, 2], matrix[2, 3], matrix[3, 3] = -2.0 / (far - near), -(far + near) / (far - near), 1.0
        else:
            matrix[2, 2], matrix[2, 3], matrix[3, 2] = (
                -(far + near) / (far - near),
                -2.0 * far * near / (far - near),
                -1.0,
            )
        return matrix
