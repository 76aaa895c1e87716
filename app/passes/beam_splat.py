"""Draws beam polygons into the flat windows of the caustic maps, swept along the spectrum in closed form.

A texel's share of a polygon is its covered area, summed over the band: exact where edges meet, a difference of two
values of the light's running spectrum where the texel is all inside. Additive blending in the polygons' own order.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import nullcontext

import moderngl
import numpy as np

from ..beams.polygons import BeamPolygons
from ..features.program_switches import Defines, switched
from ..gpu import shader
from ..gpu.beam_tables import BeamTables
from ..gpu.context import check_device
from ..gpu.dispatch_budget import DISPATCH_S, DispatchBudget
from ..gpu.framebuffers import adding
from ..gpu.pass_timers import PassTimers
from ..gpu.records import NONE
from ..gpu.schema import Field, Struct
from .beam_records import BEAM, PackedBeams, hull_areas, hull_boxes, levels, packed, texel_hulls
from .map_atlas import MapAtlas
from .map_layout import MapLayout
from .plane_frame import PlaneFrame, TexelMap

GROUP = 1 << 11
"""Polygons that are uploaded and drawn at a time: a software renderer sorts all of them into tiles before it draws."""
_SMALLEST_GROUP = 16
TEXELS = 1 << 19
"""Texels that the polygons drawn at a time cover in all, so that a window on a software renderer waits for a tenth of a
second at most. Counted, not timed: sums must not depend on the machine's load."""
UNIT_CONTACT = 2
"""Texture unit of the words of `contact_lines`."""
FLUSH = 1 << 14
"""Polygons between two flushes of the scratch textures."""

PARAMETERS = Struct(
    "BeamDrawParameters",
    (
        Field("atlas_size", "vec2", "texels"),
        Field("texels", "uint", "of a polygon"),
        Field("per_row", "uint", "polygons in a row of their texture"),
    ),
)


class BeamSplatter:
    """The pass that draws polygons into maps of `targets` RGBA32F targets."""

    def __init__(
        self, ctx: moderngl.Context, targets: int = 1, is_capped: bool = False, timers: PassTimers | None = None
    ) -> None:
        """`is_capped`: as many polygons at a time as take `dispatch_seconds`, where a device ends what takes long;
        their sums are then rounded otherwise from run to run. `timers` count towards the pass "beams"."""
        self._ctx = ctx
        self.dispatch_seconds = DISPATCH_S
        self._timers = timers
        self._portion = DispatchBudget(GROUP, _SMALLEST_GROUP, GROUP) if is_capped else None
        self._targets = targets
        self._programs: dict[tuple[int, bool, bool], moderngl.Program] = {}
        self._parameters = ctx.buffer(reserve=PARAMETERS.stride)

    def steps(
        self,
        polygons: BeamPolygons,
        frames: Mapping[int, PlaneFrame],
        layout: MapLayout,
        tables: BeamTables,
        atlas: MapAtlas,
        weight: float = 1.0,
    ) -> Iterator[int]:
        """Add the energy of all polygons to `atlas`, times `weight` (what its sums hold per unit of energy:
        `LightMaps.photon_weight` where photons are added too), pausing after every portion with the number of its
        polygons: on a software renderer all of a fine search take seconds, during which a window would not be drawn.

        `frames`: the plane of every receiver that polygons are on. What no window holds is left out."""
        if not len(polygons):
            return
        for placement, receiver, chosen in _windows(polygons, frames, layout):
            record = layout.placements[placement]
            to_texels = TexelMap.of(record, frames[receiver])
            reflectance_class = int(layout.receivers[receiver]["reflectance_class"])
            texel_area = float(record["texel_area"])
            covered = np.cumsum(_covered(polygons, chosen, to_texels, record["rect"]))
            done = 0
            while done < len(chosen):
                if self._portion:
                    end = done + self._portion.units
                else:
                    end = min(portion_end(covered, done), done + GROUP)
                part = chosen[done:end]
                done += len(part)
                curves = tables.parts(polygons.light[part], reflectance_class, polygons.x_lo[part], polygons.x_hi[part])
                all_beams = list(packed(polygons, part, to_texels, texel_area * weight, curves))
                started = time.perf_counter()
                with self._timers.timing("beams") if self._timers else nullcontext():
                    for beams in all_beams:
                        self._draw(beams, tables, atlas, record["rect"])
                # What is drawn later is kept until then.
                self._ctx.finish()
                if self._portion:
                    self._portion.learn(len(part), time.perf_counter() - started, self.dispatch_seconds)
                atlas.pending += len(part)
                if atlas.pending >= FLUSH:
                    atlas.flush()
                yield len(part)
        check_device(self._ctx, f"drawing {len(polygons)} beam polygons")

    def _draw(self, beams: PackedBeams, tables: BeamTables, atlas: MapAtlas, rect: np.ndarray) -> None:
        ctx = self._ctx
        rows, per_row, texels, _ = beams.texels.shape
        values = PARAMETERS.zeros(1)
        values[0] = (atlas.size, texels, per_row)
        self._parameters.write(values.tobytes())
        self._parameters.bind_to_uniform_block(0)
        texture = ctx.texture((per_row * texels, rows), 4, beams.texels, dtype="u4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        vertices, indices = ctx.buffer(beams.vertices), ctx.buffer(beams.indices)
        array = ctx.vertex_array(
            self._program(beams.edges, beams.is_still, atlas.contact_words is not None),
            [(vertices, "2f4 1u4", "in_position", "in_polygon")],
            indices,
        )
        texture.use(0)
        tables.texture.use(1)
        if atlas.contact_words is not None:
            atlas.contact_words.use(UNIT_CONTACT)
        x0, y0, x1, y1 = (int(v) for v in rect)
        atlas.framebuffer.use()
        ctx.scissor = x0, y0, x1 - x0, y1 - y0
        with adding(ctx):
            array.render(moderngl.TRIANGLES)
        ctx.scissor = None
        shader.release(array, vertices, indices, texture)

    def _program(self, edges: int, is_still: bool, contact_lines: bool) -> moderngl.Program:
        """Compiled when it is first needed."""
        kind = edges, is_still, contact_lines
        if kind not in self._programs:
            defines: Defines = {"TARGETS": self._targets, "EDGES": edges}
            defines |= switched(STILL=is_still, CONTACT_LINES=contact_lines)
            self._programs[kind] = shader.program(self._ctx, "light/beam.vert", "light/beam.frag", defines, (BEAM,))
        return self._programs[kind]

    def release(self) -> None:
        """Free program and buffers."""
        shader.release(*self._programs.values(), self._parameters)


def portion_end(covered: np.ndarray, done: int) -> int:
    """Where a portion ends that begins with polygon `done`: one polygon at least, and no more than `TEXELS` texels in
    all, of which polygons up to each (n,) have `covered` so many."""
    before = covered[done - 1] if done else 0.0
    return max(int(np.searchsorted(covered, before + TEXELS, "right")), done + 1)


def _covered(polygons: BeamPolygons, chosen: np.ndarray, to_texels: TexelMap, rect: np.ndarray) -> np.ndarray:
    """Texels (n,) that each of the `chosen` is drawn over, about: of its hull, within the window `rect`."""
    _, hulls, first = texel_hulls(polygons, chosen, to_texels)
    low, high = hull_boxes(hulls, first)
    sides = np.clip(np.minimum(high, rect[2:]) - np.maximum(low, rect[:2]), 0.0, None)
    return np.minimum(hull_areas(hulls, first), sides.prod(axis=1))


def _windows(
    polygons: BeamPolygons, frames: Mapping[int, PlaneFrame], layout: MapLayout
) -> Iterator[tuple[int, int, np.ndarray]]:
    """(placement, receiver, polygons to draw there): those that touch its rectangle, and in a coarser window only what
    is not all inside the finer one, as for splats."""
    for receiver in np.unique(polygons.receiver):
        frame = frames[int(receiver)]
        chosen = np.flatnonzero(polygons.receiver == receiver)
        placement = int(layout.receivers[receiver]["placement"])
        while placement != NONE and len(chosen):
            record = layout.placements[placement]
            to_texels = TexelMap.of(record, frame)
            found, hulls, first = texel_hulls(polygons, chosen, to_texels)
            low, high = hull_boxes(hulls, first) if len(found) else (np.zeros((0, 2)), np.zeros((0, 2)))
            rect = record["rect"]
            touches = np.all((high > rect[:2]) & (low < rect[2:]), axis=1)
            if touches.any():
                for at, part in _by_width(polygons, found[touches], placement, frame, layout):
                    yield at, int(receiver), part
            following = int(record["next"])
            if following != NONE:
                # The coarse map is read outside the fine window: up to its border, plus what a bilinear lookup reaches.
                corners = to_texels.points(rect[[[0, 1], [2, 1], [0, 3], [2, 3]]])
                corners = corners[np.isfinite(corners).all(axis=1)]
                coarse = TexelMap.of(layout.placements[following], frame).longest_step(corners).min()
                margin = 3.0 * to_texels.longest_step(corners).max() / coarse
                inside = np.all((low - margin > rect[:2]) & (high + margin < rect[2:]), axis=1)
                chosen = np.setdiff1d(chosen, found[inside], assume_unique=True)
            placement = following


def _by_width(
    polygons: BeamPolygons, chosen: np.ndarray, placement: int, frame: PlaneFrame, layout: MapLayout
) -> Iterator[tuple[int, np.ndarray]]:
    """(placement, polygons): those with broad penumbrae go to the same window's wider texels, for a fraction of the
    fragments."""
    record = layout.placements[placement]
    level = levels(polygons, chosen, TexelMap.of(record, frame))
    while len(chosen):
        areas, wider = layout.placements["texel_area"], int(layout.placements[placement]["blurred"])
        doublings = 0 if wider == NONE else int(np.ceil(0.5 * np.log2(areas[wider] / areas[placement]) - 0.01))
        is_here = (level < doublings) | (wider == NONE)
        if is_here.any():
            yield placement, chosen[is_here]
        chosen, level, placement = chosen[~is_here], level[~is_here] - doublings, wider
