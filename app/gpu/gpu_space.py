"""GPU space: everything is moved and scaled into it first, so that float32 resolves the glass equally well in a scene
of micrometres and in one ten kilometres off the origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.scene import Scene


@dataclass(frozen=True)
class GpuSpace:
    """p_gpu = (p_world - centre) * scale, scale a power of two."""

    centre: np.ndarray
    scale: float

    @staticmethod
    def of(scene: Scene) -> GpuSpace:
        """The space in which the specular objects (else everything) have about unit radius."""
        chosen = [o for o in scene.objects if o.material.is_specular] or list(scene.objects)
        bounds = np.stack([o.world_bounds for o in chosen])
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        radius = 0.5 * float(np.linalg.norm(high - low))
        return GpuSpace(0.5 * (low + high), 2.0 ** -float(np.round(np.log2(radius))) if radius > 0 else 1.0)

    def to_gpu(self, points: np.ndarray) -> np.ndarray:
        """World positions (..., 3) → GPU space, float64."""
        return (np.asarray(points, float) - self.centre) * self.scale

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """GPU space positions (..., 3) → world, float64."""
        return np.asarray(points, float) / self.scale + self.centre
