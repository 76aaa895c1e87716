"""Draws splat records into the caustic maps: additive blending, a program a class. On devices whose rasteriser blends
slowly (`gpu/splat_way.py`) compute shaders add them instead, with atomics.

Small splats, swept ones and those of a cut band have a program each because a software renderer runs both sides of a
branch. There a group of a few ten thousand photons is made into splats and drawn before the next, and the order of all
sums is the photons' own. A GPU takes all of a pass at once, in any order.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from ..features.features import Features
from ..features.program_switches import Defines, switched
from ..gpu import shader
from ..gpu.context import check_device
from ..gpu.framebuffers import adding
from ..gpu.schema import Field, Struct
from ..gpu.splat_tables import CUMULATIVE_SAMPLES, SplatTables
from ..gpu.splat_way import way_of
from .footprint import (
    KIND_WORDS,
    SPLAT,
    TEAM,
    TEAMS,
    UNIT_CONTACT,
    VERTICES,
    Footprints,
    Photons,
    SplatSpectra,
    slots_per_photon,
)
from .light_programs import draw_variants, sum_defines
from .map_atlas import MapAtlas
from .splat_sums import BIND_SUMS

GROUP, BULK_GROUP = 1 << 15, 1 << 22
"""Photons that are turned into splats and drawn at a time; on GPUs, each group of which costs the time of its
dispatches."""
BULK_BYTES = 512 << 20
"""What splat records may take there."""
CHUNK, SMALLEST_CHUNK, BULK_CHUNK = 1 << 18, 1 << 11, 1 << 21
"""Photons between two flushes of the scratch textures, at most and at least, and on GPUs, where a flush costs as much
as a picture. The fewer, the less a sum's rounding depends on the order in which batches bring the photons."""
FLUSH_SHARE = 16
"""Texels of the atlas per photon of a chunk: what flushing may cost, in texels a photon."""
BIND_COMMANDS = 3

PARAMETERS = Struct(
    "DrawParameters",
    (
        Field("atlas_size", "vec2", "texels"),
        Field("table_u", "vec2", "texture u = x * xi + y"),
        Field("bands", "uint", ""),
        Field("capacity", "uint", "slots that are listed of each kind"),
        Field("cumulative_samples", "uint", ""),
        Field("tables", "uint", "layers of the texture; from bit 16 on: tables that lie one below the other in each"),
    ),
)


class Splatter:
    """The splat pass of one scene's features."""

    def __init__(self, ctx: moderngl.Context, features: Features, by_compute: bool | None = None) -> None:
        """`by_compute`: whether compute shaders add the splats; None as the context's device likes it."""
        self._ctx = ctx
        self._features = features
        way = way_of(ctx)
        self.by_compute = way.by_compute if by_compute is None else by_compute
        self.in_bulk = way.in_bulk
        self.group = GROUP
        if self.in_bulk:
            slot = replace(SPLAT, packs=way.packs).stride
            self.group = min(BULK_GROUP, min(BULK_BYTES, way.largest_block) // (slot * slots_per_photon(features)))
        self.footprints = Footprints(ctx, features, self.group, self.by_compute, self.in_bulk, way.packs)
        self._indices: moderngl.Buffer | None = None
        self._draws: dict[int, moderngl.VertexArray] = {}
        self._adds: dict[int, moderngl.ComputeShader] = {}
        if self.by_compute:
            self._build_adds()
        else:
            self._build_draws()
        self._parameters = ctx.buffer(reserve=PARAMETERS.stride)

    def _build_draws(self) -> None:
        if not self.in_bulk:
            slots = self.group * self.footprints.slots_per_photon
            corners = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(slots, dtype=np.uint32)[:, None]
            self._indices = self._ctx.buffer(corners)
        for kind, (fragment, chosen) in draw_variants(self._features).items():
            defines = chosen | switched(IN_BULK=self.in_bulk) | {"KIND": kind}
            program = shader.program(self._ctx, "light/splat.vert", fragment, defines, (self.footprints.splat,))
            indices = self._indices if VERTICES[kind - 1] == 6 else None
            self._draws[kind] = self._ctx.vertex_array(program, [], index_buffer=indices)

    def _build_adds(self) -> None:
        way = way_of(self._ctx)
        for kind, (_, chosen) in draw_variants(self._features).items():
            numbers: Defines = {"KIND": kind, "KINDS": f"{len(VERTICES)}u", "TEAM": TEAM, "TEAMS": TEAMS}
            defines = chosen | sum_defines(way) | numbers | {"LANES": TEAM * TEAMS}
            self._adds[kind] = shader.compute(
                self._ctx, "light/splat_add.comp", defines, (self.footprints.splat,), way.extensions
            )

    def run(
        self, photons: Photons, spectra: SplatSpectra, atlas: MapAtlas, receivers: moderngl.Buffer, smoothing: float
    ) -> None:
        """Deposit `photons` (photon_record(groups)). `receivers`: RECEIVER records; `smoothing`: standard deviation of
        a footprint in lattice spacings."""
        chunk = self.chunk(atlas)
        group = min(self.group, chunk)
        for done in range(0, photons.count, group):
            part = photons.part(done, min(group, photons.count - done))
            self._ctx.memory_barrier()
            self.footprints.run(part, spectra, atlas, receivers, smoothing)
            self._ctx.memory_barrier()
            self.draw(spectra.tables, atlas)
            atlas.pending += part.count
            if atlas.pending >= chunk:
                atlas.flush()
        check_device(self._ctx, f"splatting {photons.count} photons into a {atlas.size[0]} x {atlas.size[1]} atlas")

    def chunk(self, atlas: MapAtlas) -> int:
        """Photons between two flushes of these maps, within which a sum is a plain float32's."""
        share = atlas.size[0] * atlas.size[1] // FLUSH_SHARE
        return BULK_CHUNK if self.in_bulk else int(np.clip(share, SMALLEST_CHUNK, CHUNK))

    def draw(self, tables: SplatTables, atlas: MapAtlas) -> None:
        """Add the splats of the last group of photons to the atlas: to its scratch textures, or to its sums."""
        values = PARAMETERS.zeros(1)
        packing = tables.layers | tables.stacked << 16
        values[0] = (atlas.size, (0.5, 0.5), tables.bands, self.footprints.capacity, CUMULATIVE_SAMPLES, packing)
        self._parameters.write(values.tobytes())
        self._parameters.bind_to_uniform_block(0)
        curve = tables.density_buffer if self._features.point_spectrum else tables.cumulative_buffer
        buffers = self.footprints.splats, tables.band_buffer, tables.integral_buffer, curve, self.footprints.lists
        for binding, buffer in zip((1, 5, 6, 7, 8), buffers, strict=True):
            buffer.bind_to_storage_buffer(binding)
        tables.texture.use(0)
        if atlas.contact_words is not None:
            atlas.contact_words.use(UNIT_CONTACT)
        if self.by_compute:
            self._add(atlas)
        else:
            self._draw(atlas)

    def _add(self, atlas: MapAtlas) -> None:
        # Made, where it is the first time, before what it needs is bound.
        sums = atlas.sums
        atlas.is_added = True
        sums.buffer.bind_to_storage_buffer(BIND_SUMS)
        commands = self.footprints.commands
        commands.bind_to_storage_buffer(BIND_COMMANDS)
        for kind, program in self._adds.items():
            program["entries_room"].value = self.footprints.entries
            program.run_indirect(commands, 4 * KIND_WORDS * (kind - 1))

    def _draw(self, atlas: MapAtlas) -> None:
        atlas.framebuffer.use()
        # A kind that no splat of the group is of has no vertices.
        with adding(self._ctx):
            for kind, vertex_array in self._draws.items():
                vertex_array.render_indirect(self.footprints.commands, moderngl.TRIANGLES, 1, first=kind - 1)

    @property
    def bytes(self) -> int:
        """Device memory of splat records and their lists."""
        return (self._indices.size if self._indices is not None else 0) + self.footprints.bytes

    def release(self) -> None:
        for vertex_array in self._draws.values():
            shader.release(vertex_array.program)
            vertex_array.release()
        shader.release(*self._adds.values())
        shader.release(self._indices)
        self._parameters.release()
        self.footprints.release()
