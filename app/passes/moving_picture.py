"""The picture while something moves: what is seen directly at full resolution, glass and mirrors coarser.

What is seen directly costs a software renderer little where the rasteriser says what it is, direct light is looked up
on a lattice of pixels where it varies slowly, and only the caustic maps are looked up by every pixel. Of what is seen
by way of glass or mirrors one pixel of each block is followed, with the footprint of the whole block, and its
neighbours on the same surface share what it found.
"""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np

from ..features.program_switches import switched
from ..gpu import shader
from ..gpu.schema import Field, Struct
from ..model.scene import Camera
from .camera import CameraPass
from .camera_programs import direct_defines
from .caustic_maps import CausticMaps
from .first_surfaces import FirstSurfaces

MOVING_PARAMETERS = Struct(
    "MovingParameters",
    (
        Field("lattice", "uvec2", "points of the lattice of direct light"),
        Field("blocks", "uvec2", "of pixels of which one is followed through glass"),
        Field("lattice_step", "uint", "pixels"),
        Field("glass_step", "uint", "side of a block, pixels"),
        Field("lists_cells", "uint", "the lattice's program reads listed cells, not points"),
        Field("pad", "uint", "unused"),
    ),
)
LATTICE_STEP = 4
"""Pixels between two lookups of direct light where it varies slowly."""
COARSE = 6
"""Side in pixels of blocks of glass from which on `COARSE_SPLIT` holds: their shapes are far coarser than what their
paths leave out."""
COARSE_SPLIT = 0.004
"""Share of its power above which both parts of a path are followed in coarse blocks: five times that of others."""
BIND_MOVING = 10
"""Uniform block."""
BIND_MOVING_LISTS = 22
"""Storage buffer; no other program of the camera has this one."""
IMAGE_PICTURE, IMAGE_VISIBLE, IMAGE_PLACES, IMAGE_LIGHT, IMAGE_CHOSEN, IMAGE_FOUND, IMAGE_CELLS, IMAGE_MARKS = range(8)
IMAGE_FACING = IMAGE_PLACES
"""Devices promise eight images: programs for glass read no lattice."""
_GROUP = 8, 8
_CELLS_GROUP = 32, 8
"""Many: a software renderer dispatches groups one by one, each of which takes as long as thirty cells."""
_LISTED_GROUP = 64
_EMPTY = np.array([0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0], "u4").tobytes()
"""Head of the lists (shaders/camera/moving_lists.glsl): counts, and work groups of either list."""
_UNEVEN, _SPECULAR = 16, 32
"""Where those groups are, bytes."""


class MovingPicture:
    """Owns programs and textures for one `CameraPass`, whose scene, lights and tables it shares."""

    def __init__(self, view: CameraPass, surfaces: FirstSurfaces) -> None:
        """`surfaces`: of the same geometry, the caller's."""
        self._view, self._surfaces = view, surfaces
        self._ctx = view.context.ctx
        shown, structs = view.source
        defines = direct_defines(shown) | {
            **switched(IN_MOTION=True),
            "NUMBER_BITS": 27,
            "LATTICE_MAPS": "0xffffu",
            "LATTICE_OBJECTS": "0x10000u",
            "BIND_MOVING": BIND_MOVING,
            "BIND_MOVING_LISTS": BIND_MOVING_LISTS,
            "IMAGE_PICTURE": IMAGE_PICTURE,
            "IMAGE_VISIBLE": IMAGE_VISIBLE,
            "IMAGE_PLACES": IMAGE_PLACES,
            "IMAGE_LIGHT": IMAGE_LIGHT,
            "IMAGE_CHOSEN": IMAGE_CHOSEN,
            "IMAGE_FOUND": IMAGE_FOUND,
            "IMAGE_CELLS": IMAGE_CELLS,
            "IMAGE_MARKS": IMAGE_MARKS,
            "IMAGE_FACING": IMAGE_FACING,
            "CELLS_LISTED": f"{_CELLS_GROUP[0] * _CELLS_GROUP[1]}u",
            "PIXELS_LISTED": f"{_LISTED_GROUP}u",
        }
        names = "lattice", "cells", "direct", "uneven", *(("clear", "blocks", "list", "glass") if view.follows else ())
        self._programs = {
            name: shader.compute(self._ctx, f"camera/moving_{name}.comp", defines, (*structs, MOVING_PARAMETERS))
            for name in names
        }
        self.follows = view.follows
        """Something is seen by way of glass or mirrors."""
        self._parameters = self._ctx.buffer(reserve=MOVING_PARAMETERS.stride)
        self._lattice: list[moderngl.Texture] = []
        self._chosen: moderngl.Texture | None = None
        self._facing: moderngl.Texture | None = None
        self._lists: moderngl.Buffer | None = None

    @property
    def specular(self) -> int:
        """Pixels that see glass, mirrors or coats first; asking waits for the device."""
        assert self._lists is not None
        return int(np.frombuffer(self._lists.read(4, offset=4), "u4")[0])

    def direct(self, picture: moderngl.Texture, camera: Camera, maps: CausticMaps, max_taps: int) -> None:
        """What is seen directly, into `picture` (RGBA32F, of the size that is seen); where glass or mirrors are seen it
        is black."""
        width, height = picture.size
        self._camera = self._view.moving_parameters(camera, width, height, maps, max_taps)
        self._view.bind(maps, self._camera)
        self._visible = self._surfaces.run(self._camera)
        cells = tuple(-(-side // LATTICE_STEP) for side in picture.size)
        lattice = cells[0] + 1, cells[1] + 1
        if not self._lattice or self._lattice[0].size != lattice:
            shader.release(*self._lattice)
            self._lattice = [self._ctx.texture(lattice, 4, dtype="f4") for _ in range(2)]
            self._lattice += [self._ctx.texture(size, 1, dtype="u4") for size in (cells, lattice)]
        # A pixel that sees a coat may be on both lists.
        room = len(_EMPTY) + 4 * width * height * (2 if "COATS" in self._view.source[0] else 1)
        if self._lists is None or self._lists.size != room:
            shader.release(self._lists)
            self._lists = self._ctx.buffer(reserve=room)
        self._set_step(1)
        self._bind(picture)
        self._run("lattice", lattice, _CELLS_GROUP)
        self._lists.write(_EMPTY)
        self._run("cells", cells, _CELLS_GROUP)
        self._set_step(1, lists_cells=True)
        self._run_listed("lattice", _UNEVEN)
        self._lists.write(_EMPTY)
        self._run("direct", cells, _CELLS_GROUP)
        self._run_listed("uneven", _UNEVEN)

    def glass(self, picture: moderngl.Texture, maps: CausticMaps, step: int) -> Iterator[float]:
        """What is seen by way of glass and mirrors, one path for each block of `step`² pixels, added to what `direct`
        drew; pauses with the share done after every dispatch but the last."""
        if not self.follows:
            return
        blocks = self._set_step(step)
        if self._chosen is None or self._chosen.size != picture.size:  # room for blocks of any side
            shader.release(self._chosen, self._facing)
            self._chosen = self._ctx.texture(picture.size, 1, dtype="u4")
            self._facing = self._ctx.texture(picture.size, 4, dtype="f4")
        self._camera["pixel_width"] = self._camera["pixel_height"] = step
        least = self._view.split_threshold
        self._camera["split_threshold"] = max(least, COARSE_SPLIT) if step >= COARSE else least
        self._view.bind(maps, self._camera)
        self._bind(self._view.sums[0], glass=True)
        self._run("clear", blocks)
        self._run_listed("blocks", _SPECULAR)
        self._view.listed.clear()
        self._run("list", blocks)
        yield 0.0
        yield from self._view.follow(self._camera, maps)
        self._view.bind(maps, self._camera)
        self._bind(picture, glass=True)
        self._run_listed("glass", _SPECULAR)

    def _set_step(self, step: int, *, lists_cells: bool = False) -> tuple[int, int]:
        """Write the parameters for blocks of this side; how many there are."""
        width, height = (int(side) for side in self._camera["size"][0])
        values = MOVING_PARAMETERS.zeros(1)
        values["lattice"], values["lattice_step"], values["glass_step"] = self._lattice[0].size, LATTICE_STEP, step
        values["lists_cells"] = lists_cells
        blocks = -(-width // step), -(-height // step)
        values["blocks"] = blocks
        self._parameters.write(values.tobytes())
        return blocks

    def _bind(self, picture: moderngl.Texture, *, glass: bool = False) -> None:
        """What programs that run one after the other read and write besides the view's; `glass`: of glass and
        mirrors."""
        self._parameters.bind_to_uniform_block(BIND_MOVING)
        assert self._lists is not None
        self._lists.bind_to_storage_buffer(BIND_MOVING_LISTS)
        places, light, cells, marks = self._lattice
        for unit, texture in (
            (IMAGE_PICTURE, picture),
            (IMAGE_VISIBLE, self._visible),
            (IMAGE_LIGHT, light),
            (IMAGE_CELLS, cells),
            (IMAGE_MARKS, marks),
            *(
                ((IMAGE_FACING, self._facing), (IMAGE_CHOSEN, self._chosen), (IMAGE_FOUND, self._view.sums[0]))
                if glass
                else ((IMAGE_PLACES, places),)
            ),
        ):
            assert texture is not None
            texture.bind_to_image(unit, read=True, write=True)

    def _run_listed(self, name: str, groups: int) -> None:
        assert self._lists is not None
        self._programs[name].run_indirect(self._lists, groups)
        self._ctx.memory_barrier()

    def _run(self, name: str, size: tuple[int, ...], group: tuple[int, int] = _GROUP) -> None:
        self._programs[name].run(-(-size[0] // group[0]), -(-size[1] // group[1]))
        self._ctx.memory_barrier()

    def release(self) -> None:
        """Free programs, buffers and textures."""
        shader.release(*self._programs.values(), self._parameters, *self._lattice)
        shader.release(self._chosen, self._facing, self._lists)
