"""Which surface every pixel sees first, by the rasteriser: on a software renderer a hundredth of what rays cost."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import bindings, shader
from ..gpu.records import NONE
from ..gpu.scene_buffers import SceneBuffers
from .camera_records import CAMERA_PARAMETERS

_CORNER = np.dtype([("position", "f4", 3), ("primitive", "u4"), ("object", "u4")])
_BEYOND = np.array([((x, y, 0.0), NONE, NONE) for x, y in ((-1.0, -1.0), (3.0, -1.0), (-1.0, 3.0))], _CORNER)
"""Drawn behind everything: all of the picture, in its own coordinates."""
FAR = 1e30
_NEAREST = 1e-4
"""Share of the farthest corner's depth at which what is drawn begins, however near the camera."""


class FirstSurfaces:
    """Owns a scene's corners and a texture of primitives and objects, (H, W) RG32UI, row 0 on top, NONE beyond all; or
    one of distances along the camera's rays, R32F, GPU units, FAR beyond all."""

    def __init__(self, ctx: moderngl.Context, scene: SceneBuffers, distances: bool = False) -> None:
        self._ctx = ctx
        self._places = scene.places
        self._distances = distances
        self._program = shader.program(
            ctx,
            "camera/visible.vert",
            "camera/visible.frag",
            bindings.SCENE_DEFINES | ({"DISTANCES": 1} if distances else {}),
            (CAMERA_PARAMETERS,),
        )
        corners = self._corners_of(scene)
        self._corners = ctx.buffer(corners.tobytes())
        read = ("3f 4x 1u", "position", "object") if distances else ("3f 1u 1u", "position", "primitive", "object")
        self._draw = ctx.vertex_array(self._program, [(self._corners, *read)])
        self._target: moderngl.Framebuffer | None = None
        self.texture: moderngl.Texture | None = None

    def _corners_of(self, scene: SceneBuffers) -> np.ndarray:
        counts = [len(mesh.triangles) for mesh in scene.world_meshes.packed]
        corners = np.zeros(3 * sum(counts), _CORNER)
        if counts:
            places = [scene.space.to_gpu(mesh.corners()).reshape(-1, 3) for mesh in scene.world_meshes.packed]
            corners["position"] = np.concatenate(places)
            corners["object"] = np.repeat(np.arange(len(counts)), 3 * np.array(counts))
            self._bounds = np.stack([[p.min(axis=0), p.max(axis=0)] for p in places])
        corners["primitive"] = np.repeat(scene.primitives, 3)
        return np.concatenate([_BEYOND, corners])

    def run(self, parameters: np.ndarray) -> moderngl.Texture:
        """Draw what the camera of `parameters` (CAMERA_PARAMETERS, bound already) sees, in a picture of its size."""
        width, height = (int(side) for side in parameters["size"][0])
        target = self._of_size(width, height)
        target.use()
        target.viewport = (0, 0, width, height)
        assert self.texture is not None
        target.clear(FAR, depth=1.0)
        self._ctx.enable_only(moderngl.NOTHING)
        if not self._distances:  # integers cannot be cleared
            self._draw.render(moderngl.TRIANGLES, vertices=len(_BEYOND))
        if self._draw.vertices > len(_BEYOND):
            self._program["depths"] = self._depths(parameters)
            self._places.bind()
            self._ctx.enable_only(moderngl.DEPTH_TEST)
            self._ctx.depth_func = "<"
            self._draw.render(moderngl.TRIANGLES, vertices=self._draw.vertices - len(_BEYOND), first=len(_BEYOND))
            self._ctx.enable_only(moderngl.NOTHING)
        self._ctx.memory_barrier()
        return self.texture

    def _depths(self, parameters: np.ndarray) -> tuple[float, float]:
        """Depths of the nearest and the farthest corner of all boxes."""
        low, high = self._bounds[:, 0], self._bounds[:, 1]
        forward, matrices = parameters["forward"][0].astype(float), self._places.matrices
        middle = (matrices[..., :3] @ (0.5 * (low + high))[..., None])[..., 0] + matrices[..., 3]
        middle = (middle - parameters["position"][0]) @ forward
        reach = (np.abs(matrices[..., :3]) @ (0.5 * (high - low))[..., None])[..., 0] @ np.abs(forward)
        margin = 1e-3 * float(np.ptp(np.concatenate([middle - reach, middle + reach]))) + 1e-6
        nearest, farthest = float((middle - reach).min()) - margin, float((middle + reach).max()) + margin
        if parameters["orthographic"][0]:
            return max(nearest, 0.0), max(farthest, nearest + 1e-6)
        return max(nearest, _NEAREST * max(farthest, 1.0)), max(farthest, 2.0 * _NEAREST * max(farthest, 1.0))

    def _of_size(self, width: int, height: int) -> moderngl.Framebuffer:
        if self._target is None or self._target.size != (width, height):
            self._release_target()
            self.texture = (
                self._ctx.texture((width, height), 1, dtype="f4")
                if self._distances
                else self._ctx.texture((width, height), 2, dtype="u4")
            )
            self._target = self._ctx.framebuffer([self.texture], self._ctx.depth_texture((width, height)))
        return self._target

    def _release_target(self) -> None:
        if self._target is not None:
            # moderngl binds again what was bound, whenever it makes a framebuffer: that must still be there.
            self._ctx.detect_framebuffer(0).use()
            depth = self._target.depth_attachment
            shader.release(self._target, depth, self.texture)
        self._target = self.texture = None

    def release(self) -> None:
        """Free everything."""
        self._release_target()
        shader.release(self._draw, self._corners, self._program)
