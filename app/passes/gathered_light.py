"""What finding the environment's light and the light of other receivers have in common: the places of a scene's
receivers, for all of which a few directions are followed at a time, the sums of what was found, and the texture that
the camera looks up."""

from __future__ import annotations

import moderngl
import numpy as np

from ..features.program_switches import Defines, switched
from ..gpu import bindings, shader
from ..gpu.context import Context
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from ..gpu.schema import Field, Struct
from ..model.environment_light import spectral_taps
from ..model.materials import Grating
from .environment_places import PLACE, EnvironmentPlaces

PER_FOLLOWED = 4
"""Straight ones for each that is followed through glass and over mirrors, which takes as long as many of them."""
FIRST_DIRECTIONS = 16
"""Directions after which the light can be shown."""
MAX_EVENTS = 40
"""Surfaces of glass and mirrors on one path; what is left then is lost and counted."""
ANCHOR_NM = 587.56
"""Wavelength whose index bends what is followed: this light is not dispersed by glass."""
RGB_NM = (612.0, 549.0, 465.0)
"""Wavelengths at which glass and mirrors tint linear red, green and blue."""
SMOOTHING = 1.5
"""Texels over which what came by glass and mirrors is averaged: neighbours follow other paths."""
TAPS = 12
"""Wavelengths that a path of the environment's light represents where glass disperses it; three at a time."""
_GROUP = 64
_BIND_PLACES, _BIND_ASKED, _BIND_SUMS, _UNIT = 8, 9, 10, 0

SUM = Struct(
    "GatheredSum",
    (
        Field("all", "vec3", "of all directions (the environment's)"),
        Field("lost", "float", "paths given up"),
        Field("straight", "vec3", "what arrived straight: of that, or irradiance, linear Rec.709"),
        Field("reserved", "float", ""),
        Field("specular", "vec3", "by way of glass and mirrors"),
        Field("reserved_too", "float", ""),
    ),
)
PARAMETERS = Struct(
    "GatherParameters",
    (
        Field("sky_x", "vec4", "column of the rotation from the world to the environment's frame"),
        Field("sky_y", "vec4"),
        Field("sky_z", "vec4"),
        Field("specular", "vec4", "sphere that holds all glass and mirrors: centre and radius, GPU space"),
        Field("x_of_rgb", "vec4", "spectral coordinates at which glass tints red, green, blue; of the index"),
        Field("level_narrow", "uvec4", "environment's level: first row, width, height; for directions to the sphere"),
        Field("level_wide", "uvec4", "for directions anywhere"),
        Field("count", "uint", "places"),
        Field("straight", "uint", "of the directions, how many are straight"),
        Field("followed", "uint", "and how many after them are followed"),
        Field("by_cosine", "uint", "receivers: of the straight ones, how many are drawn by the cosine"),
        Field("aims", "uint", "receivers: 1 where places are drawn as well"),
        Field("reserved", "uint", ""),
        Field("reserved_too", "vec2", ""),
        Field(
            "taps", "vec4", "of each three: the share of the environment's red, green, blue that it is; its ends", 36
        ),
    ),
)
DIRECTION = Struct(
    "GatherDirection",
    (
        Field("target", "vec3", "unit direction, or place on a receiver; by the cosine or followed: two of 0 to 1"),
        Field("key", "uint", "of a place its object; of one that is followed the key of its choices"),
        Field("weight", "vec3", "environment: radiance over probability"),
        Field("density", "float", "of a place: with which it was drawn, per GPU unit²"),
        Field("normal", "vec3", "of a place: of the side that shines there"),
        Field("reserved", "uint", ""),
        Field("within", "vec2", "place within a texel"),
        Field("reserved_too", "vec2", ""),
    ),
)


class GatheredLight:
    """Owns the program, the places, the sums of each bounce and the texture of one scene's receivers."""

    def __init__(
        self,
        context: Context,
        buffers: SceneBuffers,
        places: EnvironmentPlaces,
        seed: int,
        total: int,
        most_asked: int,
        budget: DispatchBudget,
        bounces: int = 0,
    ) -> None:
        """`bounces`: of other receivers' light; 0: of the environment's."""
        self._context, self._ctx, self._buffers = context, context.ctx, buffers
        self._seed, self.total, self.places, self._budget = seed, total, places, budget
        self.asked = 0
        """Directions followed so far."""
        self.shown = 0
        """Those of them that the texture holds."""
        self.seconds = 0.0
        """Spent on it."""
        self.texture = self._texture()
        """What the camera looks up."""
        self._read: list[moderngl.Texture] = []
        """What light is looked up in, its own."""
        self._places = self._ctx.buffer(places.places.tobytes() or bytes(PLACE.stride))
        size = max(1, len(places.places)) * SUM.stride
        self._sums = [self._ctx.buffer(bytes(size)) for _ in range(max(bounces, 1))]
        self._asked_buffer = self._ctx.buffer(reserve=most_asked * DIRECTION.stride)
        self._parameters = self._ctx.buffer(reserve=PARAMETERS.stride)
        disperses = buffers.features.environment_spectrum and not bounces
        self._sphere = specular_sphere(buffers, with_gratings=disperses)
        edges_x, shares = spectral_taps(buffers.axis, TAPS)
        ends = np.stack([edges_x[:-1], edges_x[1:], edges_x[1:]], axis=1)[..., None]
        self._taps = np.concatenate([shares, ends], axis=2).reshape(3 * TAPS, 4)
        defines: Defines = {**buffers.features.defines(), **bindings.SCENE_DEFINES, **buffers.defines}
        defines |= {"BIND_PLACES": _BIND_PLACES, "BIND_ASKED": _BIND_ASKED, "BIND_SUMS": _BIND_SUMS}
        defines |= {"UNIT_RADIANCE": _UNIT, "MOST_ASKED": most_asked, "MAX_EVENTS": MAX_EVENTS}
        defines |= switched(FOLLOWS_SPECULAR=self._sphere is not None, OF_RECEIVERS=bounces > 0)
        defines |= switched(GATHERED_SPECTRUM=disperses, CAMERA_SPECULAR=True) | {"GATHER_TAPS": TAPS}
        defines.pop("LOBE_COLUMNS", None)
        if not disperses:  # rays of one index carry no columns
            defines["SPECTRAL_GROUPS"] = 0
            defines.pop("NORMAL_DERIVATIVES", None)
        structs = (*SCENE_STRUCTS, PLACE, PARAMETERS, DIRECTION, SUM)
        self._program = shader.compute(self._ctx, "light/gather.comp", defines, structs)

    def _texture(self) -> moderngl.Texture:
        texture = self._ctx.texture(self.places.size, 4, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def _dispatch(
        self, parameters: np.ndarray, asked: np.ndarray, texture: moderngl.Texture, timer: str, bounce: int = 0
    ) -> None:
        """Follow directions at all places; `parameters` lack what all have in common."""
        if self._sphere is not None:
            parameters["specular"] = self._sphere
        parameters["x_of_rgb"] = self._buffers.axis.x_of_nm(np.array([*RGB_NM, ANCHOR_NM]))
        parameters["taps"] = self._taps
        parameters["count"] = len(self.places.places)
        self._parameters.write(parameters.tobytes())
        self._asked_buffer.write(asked.tobytes())
        self._buffers.bind()
        self._parameters.bind_to_uniform_block(bindings.PARAMETERS)
        self._asked_buffer.bind_to_uniform_block(_BIND_ASKED)
        self._places.bind_to_storage_buffer(_BIND_PLACES)
        self._sums[bounce].bind_to_storage_buffer(_BIND_SUMS)
        texture.use(_UNIT)
        with self._context.timers.timing(timer):
            self._program.run(-(-len(self.places.places) // _GROUP))
            self._ctx.memory_barrier()
        self._ctx.finish()

    def _found(self, bounce: int = 0) -> np.ndarray:
        """Sums of all places, records (n,)."""
        return np.frombuffer(self._sums[bounce].read(), SUM.dtype)[: len(self.places.places)]

    def _specular(self, sums: np.ndarray, asked: int) -> np.ndarray:
        """Irradiance by way of glass and mirrors, float64 (n, 3)."""
        specular = sums["specular"].astype(float)
        if specular.any():
            specular = self.places.smoothed(specular, SMOOTHING)
        return specular / max(asked // PER_FOLLOWED, 1)

    @property
    def lost(self) -> float:
        """Share of followed paths that were given up after `MAX_EVENTS`, in all bounces."""
        if not len(self.places.places) or self.asked < PER_FOLLOWED:
            return 0.0
        lost = [self._found(bounce)["lost"].mean(dtype=float) for bounce in range(len(self._sums))]
        return float(np.mean(lost) / (self.asked // PER_FOLLOWED))

    @property
    def bytes(self) -> int:
        """Device memory held."""
        sizes = [16 * t.width * t.height for t in (self.texture, *self._read)]
        return self._places.size + sum(sums.size for sums in self._sums) + sum(sizes)

    def release(self) -> None:
        """Free everything."""
        shader.release(self._places, self._asked_buffer, self._parameters, self._program, self.texture, *self._sums)
        shader.release(*self._read)


def specular_sphere(buffers: SceneBuffers, with_gratings: bool = False) -> np.ndarray | None:
    """What holds all glass and mirrors that rays are followed by: centre and radius, float64 (4,), GPU space; None
    where there are none."""
    corners = [
        buffers.space.to_gpu(mesh.vertices)
        for mesh, item in zip(buffers.world_meshes, buffers.scene.objects, strict=True)
        if item.material.is_specular and (with_gratings or not isinstance(item.material, Grating))
    ]
    if not corners:
        return None
    points = np.concatenate(corners)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return np.append(centre, 1.0001 * np.linalg.norm(points - centre, axis=1).max())
