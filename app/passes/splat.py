"""Draws splat records into the caustic maps: additive blending, a program a class, fixed order.

Small splats, swept ones and those of a cut band have a program each because a software renderer runs both sides of a
branch. A group of photons is made into splats and drawn before the next, so the splat records of a few ten thousand
photons are all that exists at a time, and the order of all sums is the photons' own order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import DeviceError
from ..gpu import shader
from ..gpu.context import device_sentence
from ..gpu.schema import Field, Struct
from .footprint import (
    SPLAT,
    UNIT_CONTACT,
    VERTICES,
    Footprints,
    SpectralVariables,
)
from .variants import SplatFeatures, draw_variants, splat_defines

if TYPE_CHECKING:
    import moderngl

    from ..gpu.gain_buffers import GainBuffers
    from ..gpu.reindex import ReindexBuffer
    from ..gpu.splat_tables import SplatTables
    from .map_atlas import MapAtlas

GROUP = 1 << 15
"""Photons turned to splats and drawn at a time."""
CHUNK, SMALLEST_CHUNK = 1 << 18, 1 << 11
"""Photons between two flushes of the scratch textures, at most and at least. The fewer, the less a sum's rounding
depends on the order in which batches bring the photons."""
FLUSH_SHARE = 16
"""Texels of the atlas per photon of a chunk: what flushing may cost, in texels a photon."""
EXTENT_LIMIT = 8192.0
"""Texels. A footprint axis or a sweep beyond twice the largest map is a numerical accident."""

PARAMETERS = Struct(
    "DrawParameters",
    (
        Field("atlas_size", "vec2", "texels"),
        Field("table_u", "vec2", "texture u = x * xi + y"),
        Field("bands", "uint", ""),
        Field("density_cells", "uint", ""),
        Field("cumulative_samples", "uint", ""),
        Field("reserved", "uint", ""),
    ),
)


class Splatter:
    """The splat pass of one scene's features."""

    def __init__(self, ctx: moderngl.Context, features: SplatFeatures) -> None:
        self._ctx = ctx
        self._features = features
        self.group = GROUP
        self._footprints = Footprints(ctx, features, GROUP)
        defines = splat_defines(features)
        slots = GROUP * self._footprints.slots_per_photon
        corners = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(slots, dtype=np.uint32)[:, None]
        self._indices = ctx.buffer(corners)
        self._draws: dict[int, moderngl.VertexArray] = {}
        for kind, (fragment, chosen) in draw_variants(features).items():
            program = shader.program(
                ctx,
                "light/splat.vert",
                fragment,
                defines | chosen | {"FIRST_OF_KIND": f"{(kind - 1) * self._footprints.capacity}u"},
                (SPLAT,),
            )
            corners_shared = VERTICES[kind - 1] == 6
            self._draws[kind] = ctx.vertex_array(program, [], index_buffer=self._indices if corners_shared else None)
        self._parameters = ctx.buffer(reserve=PARAMETERS.stride)

    def run(
        self,
        photons: moderngl.Buffer,
        count: int,
        variables: SpectralVariables,
        tables: SplatTables,
        atlas: MapAtlas,
        receivers: moderngl.Buffer,
        smoothing: float = 0.6,
        gains: GainBuffers | None = None,
        start: int = 0,
        stride: int = 1,
        reindex: ReindexBuffer | None = None,
    ) -> None:
        """Deposit the `count` photons start, start + stride, … of `photons` (photon_record(groups)).

        `variables`: each group's variable at equally spaced x; `receivers`: RECEIVER records; `smoothing`: standard
        deviation of a footprint in lattice spacings; `gains`: the brush's, `reindex`: which wavelengths the paths
        carry, where the features have them.
        """
        chunk = int(np.clip(atlas.size[0] * atlas.size[1] // FLUSH_SHARE, SMALLEST_CHUNK, CHUNK))
        group = min(GROUP, chunk)
        for done in range(0, count, group):
            part = min(group, count - done)
            first = start + done * stride
            self._ctx.memory_barrier()
            self._footprints.run(
                photons,
                first,
                part,
                variables,
                tables,
                atlas,
                receivers,
                smoothing,
                EXTENT_LIMIT,
                gains,
                stride,
                reindex,
            )
            self._ctx.memory_barrier()
            self.draw(tables, atlas)
            atlas.pending += part
            if atlas.pending >= chunk:
                atlas.flush()
        error = self._ctx.error
        if error != "GL_NO_ERROR":
            where = f"splatting {count} photons into a {atlas.size[0]} x {atlas.size[1]} atlas"
            raise DeviceError(device_sentence(error, where))

    def draw(self, tables: SplatTables, atlas: MapAtlas) -> None:
        """Add the splats of the last group of photons to the atlas's scratch textures."""
        import moderngl

        from ..gpu.splat_tables import CUMULATIVE_SAMPLES, DENSITY_CELLS

        ctx = self._ctx
        values = PARAMETERS.zeros(1)
        values[0] = (atlas.size, (0.5, 0.5), tables.bands, DENSITY_CELLS, CUMULATIVE_SAMPLES, 0)
        self._parameters.write(values.tobytes())
        self._parameters.bind_to_uniform_block(0)
        curve = tables.density_buffer if self._features.point_spectrum else tables.cumulative_buffer
        for binding, buffer in (
            (1, self._footprints.splats),
            (5, tables.band_buffer),
            (6, tables.integral_buffer),
            (7, curve),
            (8, self._footprints.lists),
        ):
            buffer.bind_to_storage_buffer(binding)
        tables.texture.use(0)
        if atlas.contact_words is not None:
            atlas.contact_words.use(UNIT_CONTACT)
        atlas.framebuffer.use()
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        ctx.blend_func = moderngl.ONE, moderngl.ONE
        # A kind that no splat of the group is of has no vertices.
        for kind, vertex_array in self._draws.items():
            vertex_array.render_indirect(self._footprints.commands, moderngl.TRIANGLES, 1, first=kind - 1)
        ctx.enable_only(moderngl.NOTHING)

    def counts(self) -> dict[str, float]:
        """Of `Footprints`, since the last reset."""
        return self._footprints.counts()

    def reset_counts(self) -> None:
        self._footprints.reset_counts()

    @property
    def bytes(self) -> int:
        """Device memory of splat records and their lists."""
        return self._indices.size + self._footprints.bytes

    def release(self) -> None:
        for vertex_array in self._draws.values():
            shader.release(vertex_array.program)
            vertex_array.release()
        self._indices.release()
        self._parameters.release()
        self._footprints.release()
