"""From photon records to splat records: the place of each photon's light in the caustic maps.

One thread a photon, slots in photon order. Their lists are in that order too, but for GPUs, so that the sum of
floating-point splats, and with it the picture, depends on nothing but the photons. What the vertex and the fragment
shaders need is worked out here once a splat, not once a vertex.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..features.program_switches import Defines, switched
from ..gpu import shader
from ..gpu.growing import filled
from ..gpu.records import GAIN_BOX, PLACEMENT, RECEIVER, photon_record_of
from ..gpu.schema import Field, Struct
from .light_programs import footprint_defines, image_slots

if TYPE_CHECKING:
    import moderngl

    from ..features.features import Features
    from ..gpu.gain_buffers import GainBuffers
    from ..gpu.reindex import ReindexBuffer
    from ..gpu.splat_tables import SplatTables
    from .map_atlas import MapAtlas

WORKGROUP, LIST_WORKGROUP = 64, 256
_MOST_FOOTPRINT_GROUPS = 4096
"""Work groups that make splats where their order does not matter: as many as fill a GPU. Each then makes several."""
NARROWED = 0.4 / 0.45
"""Share of `smoothing` with which footprints are drawn, where splats take off the ripple that this leaves: 0.7 % at
most stay on an even plane, for a fifth less blur."""
_WIDEST_NARROWED = 0.5
"""Smoothing, lattice spacings: wider Gaussians leave no ripple, and are used as they are given."""
VERTICES = (3, 6, 6, 6)
"""Per splat of kinds 1 to 4."""
EXTENT_LIMIT = 8192.0
"""Texels. A footprint axis or a sweep beyond twice the largest map is a numerical accident."""
MOST_GROUPS = 65535
"""Work groups that add splats of a kind: what OpenGL promises in one dimension. Each then adds several."""
_FIRST_ROOM = 1 << 14
"""Photons that there is room for before many are given."""
TEAM, TEAMS = 8, 8
"""Invocations that add a piece of a splat together, and such teams of a work group."""
PIECE_TEXELS = 16 * TEAM
"""Texels that a piece has at most."""
ENTRIES_A_SLOT = 4
"""Pieces that there is room for in the list, for every splat; where there are more, an entry stands for several."""
KIND_WORDS = 8
"""Words a kind of what pieces are counted and added by: see `light/splat_pieces.glsl`."""
UNIT_CONTACT = 1
"""Texture unit of the words of `contact_lines`, in all programs that splat."""
UNIT_BORDERS = 2
"""Texture unit of receivers' borders (`borders`), in the program that makes footprints."""

_Y_EDGE = "3.0 * sqrt(0.5 + value.y_box * value.y_box / 3.0)"
_INVERSE_SIGMA_XI = "2.1213203 / max(1.0 - value.xi_half, 1e-3)"
SPLAT = Struct(
    "SplatRecord",
    (
        Field(
            "kind",
            "uint",
            "0 nothing, 1 small, 2 swept, 3 swept with a cut band, 4 swept over a line or fanning out; where compute "
            "shaders add it, bit 3: lines are columns; from bit 4 on: pieces",
        ),
        Field("images", "uint", "a photon's first: of so many splats behind its own, its images beyond borders"),
        Field("centre", "vec2", "middle of the swept chord, atlas texels"),
        Field("along", "vec2", "swept: texels per unit of xi; small: half extents in texels", 1, "columns 19"),
        Field("across", "vec2", "swept: texels per unit of eta; small: 1 / (sqrt(2) sigma) of x, y", 1, "columns 19"),
        Field("amplitude", "float", "swept: 1/texel², all normalisation; small: mean throughput", 1, "float 27"),
        Field("table_row", "float", "swept: texture coordinate of sigma over sweep length", 1, "unit 16"),
        Field("y_edge", "float", "swept: half extent across, sqrt(2) deviations", 1, f"= {_Y_EDGE}"),
        Field("y_box", "float", "swept: half width of the texel across, same units", 1, "float 27"),
        Field("layer", "uint", "first layer of the spectral tables; bits 30, 31: side of a line of contact"),
        Field("lit", "float", "kind 4 with `LIGHT_EDGES`: lit share of a texel at the centre", 1, "float 25"),
        Field("x_range", "vec2", "the photon's band, spectral coordinate; with `lit`: its change per xi and eta"),
        Field("throughput", "vec4", "anchor, value there, slopes below and above; by xi, or by x", 1, "float 26"),
        Field("xi_half", "float", "half of the band in xi (small: 1 where the band was cut, else 0)", 1, "unit 20"),
        Field("inverse_sigma_xi", "float", "1 / (sqrt(2) standard deviations along)", 1, f"= {_INVERSE_SIGMA_XI}"),
        Field("fan", "vec2", "swept: change per xi and eta of the W that divides places, 1 amid", 1, "columns 14"),
        Field("waves", "vec4", "swept: cycles per unit of xi and of eta of two waves of its lattice", 1, "columns 14"),
        Field("ripple", "vec4", "swept: what is taken off by those and, z, by their sum", 1, "columns 14 xyz"),
        Field("rect", "vec4", "x0, y0, x1, y1: nothing is drawn outside, atlas texels", 1, "whole 16"),
    ),
    texels=True,
)
"""A splat, ready to be drawn. xi runs over [-1, 1] from end to end of the whole band's smeared sweep."""

PARAMETERS = Struct(
    "FootprintParameters",
    (
        Field("first_photon", "uint", "index in the photon buffer of the group's first record"),
        Field("photon_count", "uint", "records in the group"),
        Field("classes", "uint", "reflectance classes of the tables"),
        Field("bands", "uint", "bands per light of the tables"),
        Field("var_samples", "uint", "samples per spectral group"),
        Field("table_rows", "uint", "rows of the spectral tables"),
        Field("smoothing", "float", "standard deviation of a footprint in lattice spacings"),
        Field("extent_limit", "float", "texels; anything larger is a numerical accident"),
        Field("traced_row", "uint", "first row of the variables by which photons were traced"),
        Field("x_reference", "float", "spectral coordinate whose landing point a local gain leaves alone"),
        Field("stride", "uint", "step from one photon to the next that is splatted"),
        Field("first_power", "uint", "where powers below x begin in the buffer of bands"),
        Field("y_scale", "float", "reindexed: coordinate of the tables = y_offset + y_scale · the path's variable"),
        Field("y_offset", "float", ""),
        Field("narrowed", "float", "least share of `smoothing` that a footprint of an even lattice is drawn with"),
        Field("records", "uint", "how many the photon buffer holds; what is behind them is none"),
    ),
)

ALL_RECORDS = 0xFFFFFFFF
_RECORDS_AT = PARAMETERS.stride - 4


@dataclass(frozen=True)
class SpectralVariables:
    """Each spectral group's variable over x, as it is shown and as the photons were traced."""

    buffer: moderngl.Buffer
    """float32 rows of `samples`: the shown ones by group, then the traced ones where they differ."""
    samples: int
    traced_row: int = 0
    """First row of the traced ones."""
    base: tuple[float, ...] = ()
    """What is subtracted from each group's rows: only differences count, and they keep more digits."""

    @classmethod
    def build(
        cls,
        ctx: moderngl.Context,
        shown: np.ndarray,
        traced: np.ndarray | None = None,
        into: SpectralVariables | None = None,
    ) -> SpectralVariables:
        """`shown`, `traced`: float64 (groups, samples), `traced` None where the photons' glass is the one shown.
        `into`: variables that are of no use any more, whose buffer becomes these'."""
        if not shown.size:
            return into or cls(ctx.buffer(reserve=16), 2)
        buffer = None if into is None else into.buffer
        base = (shown if traced is None else traced)[:, shown.shape[1] // 2, None]
        if into is not None and traced is not None and into.traced_row:  # which stay
            into.buffer.write((shown - base).astype(np.float32))
            return into
        rows = shown - base if traced is None else np.concatenate([shown - base, traced - base])
        row = 0 if traced is None else len(shown)
        return cls(filled(ctx, buffer, rows.astype(np.float32)), shown.shape[1], row, tuple(base[:, 0].tolist()))

    def release(self) -> None:
        self.buffer.release()


@dataclass(frozen=True)
class Photons:
    """Photon records `start`, start + stride, … of a buffer, `count` of them, or as many of these as `held` tells."""

    buffer: moderngl.Buffer
    count: int
    start: int = 0
    stride: int = 1
    held: tuple[moderngl.Buffer, int] | None = None
    """Buffer and offset, bytes, of a uint: the records that the photon buffer holds. The device reads it, nothing waits
    for it. None: all that are asked for."""

    def part(self, first: int, count: int) -> Photons:
        """`count` of them from the `first` on."""
        return replace(self, count=count, start=self.start + first * self.stride)


@dataclass(frozen=True)
class SplatSpectra:
    """The spectra by which photons are splatted."""

    variables: SpectralVariables
    tables: SplatTables
    gains: GainBuffers | None = None
    """The brush's, where the features have it."""
    reindex: ReindexBuffer | None = None
    """Which wavelengths the paths carry, where the features have it."""


def slots_per_photon(features: Features) -> int:
    """Splats that a photon may become."""
    return 1 + features.nested_windows + image_slots(features)


class Footprints:
    """Owns the splat record buffer, the sum of what is drawn and the counts of what could not be drawn as it should."""

    def __init__(
        self,
        ctx: moderngl.Context,
        features: Features,
        group: int,
        by_compute: bool = False,
        in_bulk: bool = False,
        packs: bool = False,
    ) -> None:
        """`group`: the most photons one dispatch covers. `by_compute`: compute shaders add the splats. `in_bulk`: in
        any order, as they also do; there is room for as many photons as were given at once, and not for all before.
        `packs`: `DeviceTraits.packs_records`."""
        self._ctx = ctx
        self.photon, self.splat = photon_record_of(features, packs), replace(SPLAT, packs=packs)
        kinds = len(VERTICES)
        pieces = switched(IN_PIECES=by_compute) | {"KINDS": f"{kinds}u", "PIECE_TEXELS": PIECE_TEXELS}
        defines = footprint_defines(features) | pieces | {"WORKGROUP": WORKGROUP}
        structs = (self.photon, PLACEMENT, RECEIVER, self.splat, GAIN_BOX)
        self._program = shader.compute(ctx, "light/footprint.comp", defines, structs)
        self._parameters = ctx.buffer(reserve=PARAMETERS.stride)
        self._by_compute, self._in_any_order = by_compute, by_compute or in_bulk
        if by_compute:
            self._no_commands = np.array([[0, 1, 1, 0, 0, 0, 0, 0]] * kinds, np.uint32)
        elif in_bulk:
            self._no_commands = np.array([[0, 1, 0, 0, 0]] * kinds, np.uint32)
        else:
            self._no_commands = np.array([[vertices, 1, 0, 0, 0] for vertices in VERTICES], np.uint32)
        sums = np.zeros((min(group, _MOST_FOOTPRINT_GROUPS * WORKGROUP), 4), np.float32)
        # Counts of pieces stand before the sums, as a compute shader has eight storage blocks.
        self._sums_at = self._no_commands.nbytes if by_compute else 0
        self._sums = ctx.buffer(reserve=self._sums_at + sums.nbytes)
        self.commands = self._sums if by_compute else ctx.buffer(reserve=self._no_commands.nbytes)
        """Indirect draws of all kinds, five words each; or indirect dispatches, `KIND_WORDS` each."""
        self._no_sums = ctx.buffer(sums)
        self.reset_counts()
        self.slots_per_photon = slots_per_photon(features)
        self._group = group
        self.capacity = 0
        """Splats of a kind that the lists have room for."""
        self.splats: moderngl.Buffer
        """Records, `slots_per_photon` a photon."""
        self.lists: moderngl.Buffer
        """Slots of each kind, `capacity` each; or the pieces of all."""
        self.make_room(_FIRST_ROOM if in_bulk else group)
        counts: Defines = {"WORKGROUP": LIST_WORKGROUP} | pieces
        counts |= {name: defines[name] for name in ("SLOTS", "IMAGE_SLOTS", "BORDER_IMAGES") if name in defines}
        if by_compute:
            counts |= {"MOST_GROUPS": f"{MOST_GROUPS}u", "TEAMS": TEAMS}
        list_shader = "light/splat_list_any.comp" if self._in_any_order else "light/splat_list.comp"
        self._list = shader.compute(ctx, list_shader, counts, (self.splat,))

    def make_room(self, photons: int) -> None:
        """For the splats of so many; what there was of others' is forgotten where there was none."""
        needed = min(photons, self._group) * self.slots_per_photon
        if needed <= self.capacity:
            return
        if self.capacity:
            shader.release(self.splats, self.lists)
            needed = min(max(needed, 2 * self.capacity), self._group * self.slots_per_photon)
        self.capacity = needed
        self.splats = self._ctx.buffer(reserve=needed * self.splat.stride)
        self.lists = self._ctx.buffer(reserve=needed * (8 * ENTRIES_A_SLOT if self._by_compute else 4 * len(VERTICES)))

    @property
    def entries(self) -> int:
        """Pieces of splats that the list has room for."""
        return self.lists.size // 8

    def run(
        self, photons: Photons, spectra: SplatSpectra, atlas: MapAtlas, receivers: moderngl.Buffer, smoothing: float
    ) -> None:
        """Fill the slots of `photons`, `slots_per_photon` each, and list them by kind."""
        self.make_room(photons.count)
        variables, tables, gains, reindex = spectra.variables, spectra.tables, spectra.gains, spectra.reindex
        values = PARAMETERS.zeros(1)
        x_reference = gains.x_reference if gains is not None else 0.0
        scale, offset = 1.0, 0.0
        if reindex is not None:
            scale, x_reference = reindex.reindexing.scale, reindex.reindexing.y_reference
            offset = reindex.reindexing.y(variables.base[0])
            reindex.bind()
        narrowed = NARROWED if smoothing < _WIDEST_NARROWED else 1.0
        sizes = photons.start, photons.count, tables.classes, tables.bands, variables.samples, tables.rows
        widths = smoothing, EXTENT_LIMIT, variables.traced_row, x_reference, photons.stride, tables.first_power
        values[0] = (*sizes, *widths, scale, offset, narrowed, ALL_RECORDS)
        self._parameters.write(values.tobytes())
        if photons.held is not None:
            held, offset_bytes = photons.held
            self._ctx.copy_buffer(self._parameters, held, 4, read_offset=offset_bytes, write_offset=_RECORDS_AT)
        self._parameters.bind_to_uniform_block(0)
        buffers = photons.buffer, self.splats, atlas.placements, receivers, variables.buffer, tables.band_buffer
        for binding, buffer in enumerate((*buffers, self._sums)):
            buffer.bind_to_storage_buffer(binding)
        if gains is not None:
            gains.bind()
        if atlas.contact_words is not None:
            atlas.contact_words.use(UNIT_CONTACT)
        if atlas.borders is not None:
            atlas.borders.use(UNIT_BORDERS)
        self.commands.write(self._no_commands)
        self._program.run(min(-(-photons.count // WORKGROUP), _MOST_FOOTPRINT_GROUPS))
        self._ctx.memory_barrier()
        self.commands.bind_to_storage_buffer(7)
        self.lists.bind_to_storage_buffer(8)
        room, name = (self.entries, "entries_room") if self._by_compute else (self.capacity, "capacity")
        self._list[name].value = room
        self._list.run(-(-photons.count // LIST_WORKGROUP) if self._in_any_order else 1)

    def counts(self) -> dict[str, float]:
        """Since the last reset: `splats_w` (power of all splats over their bands, W), `outside_map_w` (that of photons
        whose centre no window holds, W), `footprints_dropped` (number of photons), `dropped_w` (their power, W)."""
        records = np.frombuffer(self._sums.read(offset=self._sums_at), np.float32).reshape(-1, 4)
        outside, dropped_w, dropped, splats_w = records.sum(axis=0, dtype=np.float64)
        return {
            "splats_w": float(splats_w),
            "outside_map_w": float(outside),
            "footprints_dropped": int(dropped),
            "dropped_w": float(dropped_w),
        }

    @property
    def bytes(self) -> int:
        """Device memory of splat records and their lists."""
        return self.splats.size + self.lists.size + self._sums.size

    def reset_counts(self) -> None:
        self._ctx.copy_buffer(self._sums, self._no_sums, self._no_sums.size, write_offset=self._sums_at)

    def release(self) -> None:
        shader.release(self._program, self._list, self.lists, self._parameters, self._sums, self._no_sums, self.splats)
        shader.release(None if self._by_compute else self.commands)
