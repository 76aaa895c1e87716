"""Single paths through the scene, to be shown: the ray overlay.

Rays in one dispatch, each at a wavelength of its own, refracted at every glass surface (reflected within it where it
must be, or as often as is set), up to the first surface that is neither glass nor mirror. No branching, no
weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu import bindings, shader
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from ..gpu.schema import Field, Struct

MAX_SEGMENTS = 24
_MAX_POINTS = MAX_SEGMENTS + 1
_GROUP = 32
_BIND_STARTS, _BIND_PATHS, _BIND_POINTS = 8, 9, 10

PATH_PARAMETERS = Struct(
    "PathParameters",
    (
        Field("count", "uint", "paths"),
        Field("inside_mask", "uint", "solids that all paths start in, bits of the medium stack"),
        Field("inside_object", "uint", "solid outside the stack that they start in, or NONE"),
        Field("escape", "float", "length of the last segment of a path that leaves the scene, GPU units"),
        Field("reflections", "uint", "inner reflections before a path may leave glass"),
    ),
)
PATH_START = Struct(
    "PathStart",
    (
        Field("position", "vec3", "GPU space"),
        Field("x", "float", "spectral coordinate"),
        Field("direction", "vec3", "unit, propagation"),
        Field("reserved", "float", ""),
    ),
)
PATH_END = Struct(
    "PathEnd",
    (Field("points", "uint", "how many, the start included"),),
)


@dataclass(frozen=True)
class Path:
    """Where one ray went."""

    points: np.ndarray
    """float64 (n, 3), world, from the start on."""


class RayPaths:
    """Owns the program and its buffers; `trace` waits for the answer."""

    def __init__(self, context: Context, scene: SceneBuffers) -> None:
        """Raises `ShaderError` where the program does not compile."""
        self.scene = scene
        self._context = context
        defines = scene.features.defines() | bindings.SCENE_DEFINES | scene.defines
        # Rays of one wavelength carry no columns, and meet ground glass as if it were polished.
        for carried in ("NORMAL_DERIVATIVES", "LOBE_COLUMNS", "ROUGH_SURFACES", "POLARISED"):
            defines.pop(carried, None)
        defines |= {
            "SPECTRAL_GROUPS": 0,
            "BIND_STARTS": _BIND_STARTS,
            "BIND_PATHS": _BIND_PATHS,
            "BIND_POINTS": _BIND_POINTS,
            "MAX_POINTS": _MAX_POINTS,
        }
        structs = (*SCENE_STRUCTS, PATH_PARAMETERS, PATH_START, PATH_END)
        self._program = shader.compute(context.ctx, "camera/ray_paths.comp", defines, structs)
        self._parameters = context.ctx.buffer(reserve=PATH_PARAMETERS.stride)
        self._room = 0
        self._inside: tuple[bytes, int, int] | None = None
        self._reserve(_GROUP)

    def _reserve(self, count: int) -> None:
        if count <= self._room:
            return
        ctx = self._context.ctx
        if self._room:
            self._release_paths()
        self._room = -(-count // _GROUP) * _GROUP
        self._starts = ctx.buffer(reserve=self._room * PATH_START.stride)
        self._paths = ctx.buffer(reserve=self._room * PATH_END.stride)
        self._points = ctx.buffer(reserve=self._room * _MAX_POINTS * 16)

    def trace(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        wavelengths_nm: np.ndarray,
        escape: float,
        reflections: int = 0,
    ) -> list[Path]:
        """Follow rays from `origins` along unit `directions` (n, 3), world, each at a wavelength (n,).

        All start in the medium that the first one starts in. A path that leaves the scene ends `escape` scene units
        beyond its last surface. The first `reflections` times that a path meets glass from within, it is reflected.
        """
        origins = np.asarray(origins, float).reshape(-1, 3)
        count = len(origins)
        if not count:
            return []
        self._reserve(count)
        space = self.scene.space
        starts = PATH_START.zeros(count)
        starts["position"], starts["direction"] = space.to_gpu(origins), directions
        starts["x"] = self.scene.axis.x_of_nm(np.asarray(wavelengths_nm, float))
        parameters = PATH_PARAMETERS.zeros(1)
        parameters[0] = (count, *self._media_at(origins[0]), escape * space.scale, reflections)
        self._parameters.write(parameters.tobytes())
        self._starts.write(starts.tobytes())
        self.scene.bind()
        self._parameters.bind_to_storage_buffer(bindings.PARAMETERS)
        for binding, buffer in ((_BIND_STARTS, self._starts), (_BIND_PATHS, self._paths), (_BIND_POINTS, self._points)):
            buffer.bind_to_storage_buffer(binding)
        self._program.run(-(-count // _GROUP))
        self._context.ctx.memory_barrier()
        self._context.check("tracing single rays")
        return self._read(count, origins)

    def _read(self, count: int, origins: np.ndarray) -> list[Path]:
        ends = np.frombuffer(self._paths.read(count * PATH_END.stride), PATH_END.dtype)
        points = np.frombuffer(self._points.read(count * _MAX_POINTS * 16), np.float32).reshape(count, _MAX_POINTS, 4)
        is_met = np.arange(_MAX_POINTS) < ends["points"][:, None]  # memory may hold anything behind these
        world = self.scene.space.to_world(np.where(is_met[..., None], points[..., :3], 0.0).astype(float))
        world[:, 0] = origins
        return [Path(world[i, : int(end["points"])]) for i, end in enumerate(ends)]

    def _media_at(self, point: np.ndarray) -> tuple[int, int]:
        """`SceneBuffers.media_at`; the last answer is remembered."""
        key = point.tobytes()
        if self._inside is None or self._inside[0] != key:
            self._inside = key, *self.scene.media_at(point)
        return self._inside[1:]

    def _release_paths(self) -> None:
        shader.release(self._starts, self._paths, self._points)

    def release(self) -> None:
        """Free program and buffers."""
        self._release_paths()
        self._parameters.release()
        shader.release(self._program)
