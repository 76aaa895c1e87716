"""Light on its way through thin haze, as the camera sees it: single scattering, drawn beam by beam.

Every stretch of a traced path is a photon beam [Jarosz et al. 2011], estimated with a blur in one dimension, along the
common perpendicular of beam and camera ray: its width there is the footprint that the photon's columns say, which
grows along the beam, and the sweep of its band. Beams are quads of the picture, added up by blending in the order of
the photons. What the camera sees directly hides what lies behind it.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from ..gpu import bindings, shader
from ..gpu.context import Context
from ..gpu.framebuffers import adding, park
from ..gpu.records import FLIGHT
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Field, Struct
from ..model.scene import Camera, Scene
from .camera_records import CAMERA_PARAMETERS, camera_parameters
from .first_surfaces import FirstSurfaces
from .flights import MOST_EVENTS, PHOTONS, Flights, trace_flights
from .picture_channels import Channels
from .picture_sums import PictureSums

_BIND_FLIGHTS, _BIND_HAZE_COLOURS, _BIND_HAZE = 8, 9, 10
"""The last is of uniform blocks."""
_UNIT_DISTANCES = 0
SMOOTHING = 0.6
"""Standard deviation of a footprint, lattice spacings."""
BAND_BLUR = 0.5
"""Standard deviation of a band's blur, sweeps: neighbours together have no steps."""
MIN_PIXELS = 0.6
"""Standard deviation of the narrowest beam, pixels."""
SUBPIXELS = 2
"""Distances to what is seen directly are known so many times in a pixel, both ways, as `haze.frag` has it."""
COARSE = 32
"""In motion, so many times fewer beams are drawn."""
HAZE_PARAMETERS = Struct(
    "HazeParameters",
    (
        Field("strength", "float", "scattering coefficient, 1/scene unit, times GPU units per scene unit"),
        Field("extinction", "float", "1/GPU unit"),
        Field("anisotropy", "float", "g of Henyey and Greenstein"),
        Field("pixel", "float", "least standard deviation: GPU units, pinhole: at distance one"),
        Field("smoothing", "float", "standard deviation of a footprint, lattice spacings"),
        Field("band_blur", "float", "of a band's sweep, sweeps"),
        Field("reserved", "vec2", ""),
    ),
)


class AddedPicture(PictureSums):
    """A picture that is drawn once for a view and added to the camera's sums with every sample."""

    def __init__(self, ctx: moderngl.Context, targets: int) -> None:
        """`targets`: textures, made when a size is known."""
        super().__init__(ctx, targets)
        self._program = shader.program(
            ctx, "camera/add_picture.vert", "camera/add_picture.frag", {"TARGETS": targets}, ()
        )
        self._triangle = ctx.vertex_array(self._program, [])

    def add(self, sums: Sequence[moderngl.Texture], first_row: int, rows: int) -> None:
        """Add what was drawn to these rows of other textures of the same size."""
        framebuffer = self._ctx.framebuffer(list(sums))
        framebuffer.use()
        framebuffer.scissor = 0, first_row, framebuffer.size[0], rows
        for unit, texture in enumerate(self.textures):
            texture.use(unit)
        with adding(self._ctx):
            self._triangle.render(moderngl.TRIANGLES, 3)
        park(self._ctx)
        framebuffer.release()

    def release(self) -> None:
        """Free everything."""
        super().release()
        shader.release(self._triangle, self._program)


class Haze:
    """Owns the programs, the beams of one scene and the picture of them."""

    def __init__(self, context: Context, scene: SceneBuffers, channels: Channels) -> None:
        self._context, self._ctx = context, context.ctx
        self._scene, self._channels = scene, channels
        self._picture = AddedPicture(self._ctx, channels.targets)
        self._program = shader.program(
            self._ctx,
            "camera/haze.vert",
            "camera/haze.frag",
            {
                "TARGETS": channels.targets,
                "BIND_PARAMETERS": bindings.PARAMETERS,
                "BIND_FLIGHTS": _BIND_FLIGHTS,
                "BIND_HAZE_COLOURS": _BIND_HAZE_COLOURS,
                "BIND_HAZE": _BIND_HAZE,
                "UNIT_DISTANCES": _UNIT_DISTANCES,
            },
            (FLIGHT, CAMERA_PARAMETERS, HAZE_PARAMETERS),
        )
        self._draw = self._ctx.vertex_array(self._program, [])
        self._camera = self._ctx.buffer(reserve=CAMERA_PARAMETERS.stride)
        self._values = self._ctx.buffer(reserve=HAZE_PARAMETERS.stride)
        self._surfaces: FirstSurfaces | None = None
        self._beams: dict[int, tuple[moderngl.Buffer, moderngl.Buffer, int]] = {}
        """By photons: FLIGHT records, colours, and how many there are."""
        self._view: object = None
        """What the picture shows."""

    def move(self, scene: SceneBuffers) -> None:
        """Objects or lights have moved."""
        self._scene = scene
        self._forget()

    def take(self, scene: SceneBuffers) -> None:
        """Other colours, glass or lights of the same geometry; beams whose ways are the same stay."""
        before, self._scene, self._view = self._scene, scene, None
        if not _same_ways(before.scene, scene.scene):
            self._forget()

    def draw(self, camera: Camera, width: int, height: int, *, coarse: bool = False) -> None:
        """Draw all beams as `camera` sees them, through the middle of its lens; nothing where that was done last.
        `coarse`: fewer of them."""
        view = camera, width, height, coarse
        if view == self._view:
            return
        flights, colours, count = self._beams_of(PHOTONS // COARSE if coarse else PHOTONS)
        distances = self._distances(camera, width, height)
        parameters = camera_parameters(self._scene, camera, width, height)
        self._camera.write(parameters.tobytes())
        self._values.write(self._parameters(parameters).tobytes())
        self._picture.clear(width, height)
        if count:
            self._camera.bind_to_uniform_block(bindings.PARAMETERS)
            self._values.bind_to_uniform_block(_BIND_HAZE)
            flights.bind_to_storage_buffer(_BIND_FLIGHTS)
            colours.bind_to_storage_buffer(_BIND_HAZE_COLOURS)
            distances.use(_UNIT_DISTANCES)
            framebuffer = self._ctx.framebuffer(self._picture.textures)
            framebuffer.use()
            with adding(self._ctx):
                self._draw.render(moderngl.TRIANGLES, 6 * count)
            park(self._ctx)
            framebuffer.release()
        self._context.check("drawing haze")
        self._view = view

    def add(self, sums: Sequence[moderngl.Texture], first_row: int, rows: int) -> None:
        """Add what was drawn to these rows of the camera's sums."""
        self._picture.add(sums, first_row, rows)

    def release(self) -> None:
        """Free everything."""
        self._forget()
        self._picture.release()
        self._draw.release()
        shader.release(self._program)
        shader.release(self._camera, self._values)

    # ---- private ---------------------------------------------------------------------------

    def _parameters(self, camera: np.ndarray) -> np.ndarray:
        render, scale = self._scene.scene.render, self._scene.space.scale
        values = HAZE_PARAMETERS.zeros(1)
        values["strength"], values["extinction"] = render.haze * scale, render.haze / scale
        values["anisotropy"] = render.haze_anisotropy
        values["pixel"] = MIN_PIXELS * 2.0 * float(np.linalg.norm(camera["half_up"][0])) / float(camera["size"][0, 1])
        values["smoothing"], values["band_blur"] = SMOOTHING, BAND_BLUR
        return values

    def _beams_of(self, photons: int) -> tuple[moderngl.Buffer, moderngl.Buffer, int]:
        if photons not in self._beams:
            scene: Scene = self._scene.scene
            depth = min(scene.render.max_depth, MOST_EVENTS)
            flights = trace_flights(self._context, scene, self._channels.observer(), photons, depth)
            records = self._in_space(flights)
            self._beams[photons] = (
                self._ctx.buffer(records.tobytes() or bytes(FLIGHT.stride)),
                self._ctx.buffer(flights.colours.astype("f4").tobytes() or bytes(16)),
                len(records),
            )
        return self._beams[photons]

    def _in_space(self, flights: Flights) -> np.ndarray:
        """Its records in the GPU space of the scene that is seen, which may have been moved."""
        mine, theirs = self._scene.space, flights.space
        records, ratio = flights.records, mine.scale / theirs.scale
        if ratio == 1.0 and np.array_equal(mine.centre, theirs.centre):
            return records
        records["position"] = mine.to_gpu(theirs.to_world(records["position"]))
        lengths = [name for name in FLIGHT.dtype.names or () if name.startswith(("dposition", "ddirection"))]
        for name in ("distance", "flown", *lengths):
            records[name] *= ratio if not name.startswith("ddirection") else 1.0
        return records

    def _distances(self, camera: Camera, width: int, height: int) -> moderngl.Texture:
        """To what is seen directly, R32F (SUBPIXELS · H, SUBPIXELS · W)."""
        if self._surfaces is None:
            self._surfaces = FirstSurfaces(self._ctx, self._scene, distances=True)
        parameters = camera_parameters(self._scene, camera, SUBPIXELS * width, SUBPIXELS * height)
        self._camera.write(parameters.tobytes())
        self._camera.bind_to_uniform_block(bindings.PARAMETERS)
        return self._surfaces.run(parameters)

    def _forget(self) -> None:
        """What belongs to the places of objects and lights."""
        for flights, colours, _ in self._beams.values():
            flights.release()
            colours.release()
        shader.release(self._surfaces)
        self._beams, self._surfaces, self._view = {}, None, None


def _same_ways(a: Scene, b: Scene) -> bool:
    """Whether light takes the same ways in both."""
    if len(a.objects) != len(b.objects) or len(a.lights) != len(b.lights):
        return False
    return (
        a.render.max_depth == b.render.max_depth
        and all(x is y or x == y for x, y in zip(a.lights, b.lights, strict=True))
        and all(
            x.mesh is y.mesh
            and x.object_to_world is y.object_to_world
            and (x.material is y.material or not (x.material.is_specular or y.material.is_specular))
            for x, y in zip(a.objects, b.objects, strict=True)
        )
    )
