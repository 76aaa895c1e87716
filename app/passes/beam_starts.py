"""Camera paths that carry on what camera beams hand over (`beams.screen_starts`): each starts at the facet that its
beam left last, at one wavelength, and is followed as the samples of single wavelengths are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import moderngl
import numpy as np

from ..beams.polarised_arrays import across, bounded
from ..beams.polygons import parabola_at
from ..beams.screen_polygons import ScreenPolygons
from ..beams.screen_starts import ScreenStarts
from ..gpu import shader
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Field, Struct
from .listed_pixels import Dispatch, ListedPixels
from .variants import BIND_BEAM_ENTRIES, BIND_BEAM_FOUND, Defines

BEAM_START = Struct(
    "BeamStart",
    (
        Field("position", "vec3", "GPU space"),
        Field("pixel", "uint", "row by row"),
        Field("direction", "vec3", "unit"),
        Field("x", "float", "its wavelength"),
        Field("dposition_x", "vec3", "per pixel to the right"),
        Field("weight", "float", "as of `beams.screen_starts`"),
        Field("dposition_y", "vec3", "per pixel downwards"),
        Field("key", "uint", "random numbers"),
        Field("ddirection_x", "vec3"),
        Field("depth", "uint", "specular events so far"),
        Field("ddirection_y", "vec3"),
        Field("last_object", "uint", "that it left"),
        Field("last_primitive", "uint", "facet of that"),
        Field("is_inside", "uint", "on the inner side of that"),
        Field("inside_mask", "uint", "medium stack"),
        Field("inside_object", "uint", "solid outside the stack, or NONE"),
    ),
)

POLARISED_START = Struct(
    "BeamStart",
    (
        *BEAM_START.fields,
        Field("axis", "vec3", "across the direction"),
        Field("stokes_q", "float", "from the axis, as in `RayRecord`"),
        Field("stokes_u", "float"),
        Field("stokes_v", "float"),
        Field("reserved", "uvec2"),
    ),
)
"""With the state of polarisation."""


class BeamStarts:
    """Owns the program and the starts of one portion."""

    def __init__(self, ctx: moderngl.Context, defines: Defines, structs: Sequence[Struct], room: int) -> None:
        """`defines`: `start_defines` of the camera's; `room`: paths of a portion."""
        self._struct = POLARISED_START if "POLARISED" in defines else BEAM_START
        self._program = shader.compute(ctx, "camera/camera.comp", defines, (*structs, self._struct))
        self._buffer = ctx.buffer(reserve=self._struct.stride * room)
        self._room = room
        self._records = self._struct.zeros(0)

    def take(self, starts: ScreenStarts, polygons: ScreenPolygons, scene: SceneBuffers, width: int) -> None:
        """Pack paths of these polygons of a picture so wide."""
        self._records = packed(starts, polygons, scene, width, self._struct)

    def follow(
        self,
        listed: ListedPixels,
        parameters: np.ndarray,
        dispatch: Callable[[moderngl.ComputeShader, int], float],
        found: moderngl.Buffer,
        gather: Callable[[np.ndarray], None],
        seconds: float,
    ) -> Iterator[float]:
        """Follow all paths, pausing with the share done after every portion. What each finds is in `found`, where
        `gather` adds it to the pixels given."""
        room = min(self._room, listed.room)
        for first in range(0, len(self._records), room):
            part = self._records[first : first + room]
            self._buffer.write(part.tobytes())
            listed.fill(len(part))

            def dispatched(count: int) -> float:
                self._buffer.bind_to_storage_buffer(BIND_BEAM_ENTRIES)
                found.bind_to_storage_buffer(BIND_BEAM_FOUND)
                return dispatch(self._program, count)

            follow: Dispatch = dispatched
            for share in listed.follow(parameters, follow, seconds):
                yield (first + share * len(part)) / len(self._records)
            gather(part["pixel"])
            yield (first + len(part)) / len(self._records)

    def release(self) -> None:
        """Free everything."""
        shader.release(self._program, self._buffer)


def packed(
    starts: ScreenStarts, polygons: ScreenPolygons, scene: SceneBuffers, width: int, struct: Struct = BEAM_START
) -> np.ndarray:
    """Records of `struct`."""
    records = struct.zeros(len(starts))
    of = starts.polygon
    off = starts.place - polygons.centre[of]
    for name in ("position", "direction"):
        # About the polygon's centre: value and columns at the path's own wavelength.
        at = parabola_at(getattr(polygons, name)[of], starts.t)
        records[name] = at[:, 0] + off[:, :1] * at[:, 1] + off[:, 1:] * at[:, 2]
        records[f"d{name}_x"], records[f"d{name}_y"] = at[:, 1], at[:, 2]
    direction = records["direction"].astype(float)
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    records["direction"] = direction = direction / length
    for name in ("ddirection_x", "ddirection_y"):
        column = records[name] / length
        records[name] = column - np.einsum("si,si->s", column, direction)[:, None] * direction
    pixel = np.floor(starts.place).astype(np.uint32)
    records["pixel"] = pixel[:, 1] * np.uint32(width) + pixel[:, 0]
    records["x"], records["weight"] = starts.x, starts.weight
    records["key"] = polygons.key[of] ^ (np.arange(len(starts), dtype=np.uint32) * np.uint32(2654435769))
    records["depth"], records["is_inside"] = polygons.depth[of], polygons.is_inside[of]
    records["last_object"] = polygons.last_object[of]
    records["last_primitive"] = scene.primitive_of(polygons.last_object[of], polygons.last_triangle[of])
    mask, inside_object = scene.media_of(polygons.inside)
    records["inside_mask"], records["inside_object"] = mask[of], inside_object[of]
    if struct is POLARISED_START:
        records["axis"] = across(polygons.state[of, 1, 3:], direction)
        stokes = bounded(parabola_at(polygons.state[of, :, :3], starts.t))
        records["stokes_q"], records["stokes_u"], records["stokes_v"] = stokes.T
    return records
