"""The dispersion brush on the GPU: every receiver's grid of local gains, and the place they leave alone.

Photons are displaced about where their path's light of the reference wavelength (the d line) lands, so all
spectral bands of a path grow together and no gap opens between them.
"""

from __future__ import annotations

import moderngl
import numpy as np

from ..model.local_dispersion import GainGrid
from ..model.optics.glass import LINE_D_NM
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene, SceneObject
from .gpu_space import GpuSpace
from .growing import filled
from .records import GAIN_BOX

_BIND_BOXES, _BIND_GAINS = 9, 10


class GainBuffers:
    """Owns the buffers; `update` takes new dabs and computes only what they touch."""

    def __init__(
        self, ctx: moderngl.Context, scene: Scene, receivers: list[int], space: GpuSpace, axis: SpectralAxis
    ) -> None:
        """`receivers`: object indices, as in `SceneBuffers`."""
        self._ctx = ctx
        self._receivers = receivers
        self._space = space
        self._grids: dict[int, GainGrid] = {}
        self._boxes = ctx.buffer(reserve=max(1, len(receivers)) * GAIN_BOX.stride)
        self._gains = ctx.buffer(reserve=4)
        self.x_reference = float(axis.x_of_nm(LINE_D_NM))
        self.update(scene)

    def update(self, scene: Scene) -> None:
        """Follow the dabs and places of `scene`'s receivers."""
        boxes = GAIN_BOX.zeros(max(1, len(self._receivers)))
        parts: list[np.ndarray] = []
        first = 0
        for record, index in zip(boxes, self._receivers, strict=False):
            item = scene.objects[index]
            if not item.local_dispersion:
                self._grids.pop(index, None)
                continue
            grid = self._grids[index] = _followed(self._grids.get(index), item)
            to_voxel = _object_to_voxel(grid) @ np.linalg.inv(item.object_to_world) @ self._gpu_to_world()
            record["row_x"], record["row_y"], record["row_z"] = to_voxel[:3]
            record["voxels"] = (*grid.dims, first)
            parts.append(grid.gains.ravel())
            first += parts[-1].size
        self._boxes.write(boxes.tobytes())
        gains = np.concatenate(parts) if parts else np.ones(1, np.float32)
        self._gains = filled(self._ctx, self._gains, gains)

    def bind(self) -> None:
        """To the places that footprint.comp reads."""
        self._boxes.bind_to_storage_buffer(_BIND_BOXES)
        self._gains.bind_to_storage_buffer(_BIND_GAINS)

    def release(self) -> None:
        """Free both buffers."""
        self._boxes.release()
        self._gains.release()

    def _gpu_to_world(self) -> np.ndarray:
        matrix = np.diag([1.0 / self._space.scale] * 3 + [1.0])
        matrix[:3, 3] = self._space.centre
        return matrix


def _followed(grid: GainGrid | None, item: SceneObject) -> GainGrid:
    dabs = item.local_dispersion
    if grid is not None and len(dabs) > len(grid.dabs) and dabs[: len(grid.dabs)] == grid.dabs:
        return grid.extended(dabs[len(grid.dabs) :])
    return grid if grid is not None and grid.dabs == dabs else GainGrid.of(item)


def _object_to_voxel(grid: GainGrid) -> np.ndarray:
    """(4, 4): object space to voxel numbers, centres at integers."""
    steps = np.array(grid.dims) / np.maximum(grid.high - grid.low, 1e-30)
    matrix = np.diag([*steps, 1.0])
    matrix[:3, 3] = -grid.low * steps - 0.5
    return matrix
