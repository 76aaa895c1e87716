"""Draws screen polygons (`beams.screen_polygons`): what a picture shows by way of flat glass and mirrors.

Pixels that a polygon touches are listed polygon by polygon, looked at side by side, and added up pixel by pixel in the
order of the list, so that sums do not depend on timing. (Triangle fans whose fragments do the looking took a software
renderer ten times as long: most of their lanes slept.) The picture is drawn once for a view and added with every sample
of what is seen directly: progress, stops and what reads the sums know nothing of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..beams.screen_polygons import PIXEL_BITS, ScreenPolygons
from ..gpu import shader
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.scene_texels import ROW_TEXELS
from ..gpu.schema import Field, Struct
from ..model.scene import Scene
from .added_picture import AddedPicture
from .pixel_lattice import MOST_SHARED
from .variants import (
    BIND_BEAM_ENTRIES,
    BIND_BEAM_FOUND,
    BIND_BEAM_ORDER,
    BIND_BEAM_RUNS,
    BIND_BEAM_VIEW,
    GATHER_DEFINES,
    IMAGE_POLYGONS,
    UNIT_POLYGONS,
    Defines,
)

if TYPE_CHECKING:
    from ..gpu.scene_buffers import SceneBuffers

FINE_PARTS, COARSE_PARTS = 16, 4
"""Parts of a pixel that are looked at one by one, where a polygon is strong, and where it is not weak …"""
FINE_ABOVE, COARSE_ABOVE = 0.05, 0.01
"""… which is said by its share of what the pixel sees."""
MOST_ENTRIES = 1 << 16
"""That are looked at together."""
MOST_LISTED = 1 << 22
"""Entries that are listed before they are looked at."""
_FIRST = 1024
_GROUP = 64

SCREEN_POLYGON = Struct(
    "ScreenPolygon",
    (
        Field("centre", "vec2", "pixels"),
        Field("x_lo", "float", "band of the spectrum"),
        Field("x_hi", "float"),
        Field("throughput", "vec3", "coefficients of 1, t, t²"),
        Field("strength", "float", "throughput times the band's share of what looks bright"),
        Field("key", "uint", "random numbers"),
        Field("first_edge", "uint"),
        Field("end_edge", "uint"),
        Field("flags", "uint", "bit 0: on the inner side of the last object; from bit 8: depth"),
        Field("last_object", "uint", "that the ray left"),
        Field("inside_mask", "uint", "medium stack"),
        Field("inside_object", "uint", "solid outside the stack, or NONE"),
        Field("parts", "uint", "of a pixel that are looked at one by one"),
        Field("slope", "vec2", "relative change of the throughput per pixel"),
        Field("reserved", "vec2", ""),
        Field("position", "vec4", "coefficients of 1, t, t²: value at the centre, its two columns per pixel", 9),
        Field("direction", "vec4", "likewise", 9),
    ),
    texels=True,
)
_VIEW = Struct(
    "BeamView",
    (
        Field("places", "vec4", "points of a pixel about its middle, two each, neighbours together", MOST_SHARED // 2),
        Field("points", "uint", "how many"),
        Field("first_edge_texel", "uint", "where edges begin"),
        Field("entry_count", "uint", "of this dispatch"),
        Field("reach", "float", "from a pixel's middle to its outermost points, pixels"),
    ),
)


class ScreenBeams:
    """Owns the programs, what the polygons are packed in and the picture of them."""

    def __init__(self, ctx: moderngl.Context, defines: Defines, structs: Sequence[Struct], targets: int) -> None:
        """`defines`: `screen_beam_defines` of the camera's; `structs`: the camera's records."""
        self._ctx = ctx
        self._look = shader.compute(ctx, "camera/beam.comp", defines, (*structs, SCREEN_POLYGON, _VIEW))
        self._gather = shader.compute(ctx, "camera/beam_gather.comp", {"TARGETS": targets} | GATHER_DEFINES, ())
        self._picture = AddedPicture(ctx, targets)
        self._view = ctx.buffer(reserve=_VIEW.stride)
        words = {BIND_BEAM_ENTRIES: 2, BIND_BEAM_RUNS: 4, BIND_BEAM_ORDER: 1, BIND_BEAM_FOUND: 4 * targets}
        self._lists = {binding: ctx.buffer(reserve=4 * count * MOST_ENTRIES) for binding, count in words.items()}
        self._polygons: ScreenPolygons | None = None
        self._sees_edges = True
        self._records = SCREEN_POLYGON.zeros(0)
        self._texels: moderngl.Texture | None = None
        self._budget = DispatchBudget(_FIRST, _GROUP, MOST_ENTRIES)

    def take(self, polygons: ScreenPolygons, scene: SceneBuffers, brightness: np.ndarray | None) -> None:
        """Pack; `brightness`: how much of what looks bright lies below each of equally spaced x."""
        self._polygons = polygons
        self._sees_edges = sees_edges(scene.scene)
        self._records = packed(polygons, scene, brightness)

    def draw(
        self, size: tuple[int, int], places: np.ndarray, as_image: bool, bind: Callable[[], None], seconds: float
    ) -> Iterator[float]:
        """Draw all polygons into the beams' own picture, pausing with the share done after every portion.

        `places`: (points, 2) of a pixel, 0 to 1, at which its edges are told; `bind`: binds what the camera's programs
        read; `seconds`: what a portion should take."""
        # Machine code, whose import costs a picture without beams 0.7 s.
        from ..beams.screen_pairs import pixel_parts, portions

        assert self._polygons is not None
        self._picture.clear(size)
        places = ordered(places)
        view = self._view_of(size, places)
        parts = self._records["parts"].astype(np.int64)
        listed = portions(self._polygons, size, parts, MOST_LISTED)
        for number, which in enumerate(listed):
            entries = pixel_parts(self._polygons, size, float(view["reach"][0]), parts, which)
            for share in self._draw_listed(entries, view, as_image, bind, seconds):
                yield (number + share) / len(listed)

    def _draw_listed(
        self, entries: np.ndarray, view: np.ndarray, as_image: bool, bind: Callable[[], None], seconds: float
    ) -> Iterator[float]:
        """Draw these entries, pausing with the share done after every portion."""
        done = 0
        while done < len(entries):
            part = entries[done : done + self._budget.units]
            self._lists[BIND_BEAM_ENTRIES].write(part.tobytes())
            view["entry_count"] = len(part)
            self._view.write(view.tobytes())
            bind()
            self._view.bind_to_uniform_block(BIND_BEAM_VIEW)
            for binding in (BIND_BEAM_ENTRIES, BIND_BEAM_FOUND):
                self._lists[binding].bind_to_storage_buffer(binding)
            assert self._texels is not None
            if as_image:
                self._texels.bind_to_image(IMAGE_POLYGONS, read=True, write=False)
            else:
                self._texels.use(UNIT_POLYGONS)
            start = time.perf_counter()
            self._look.run(-(-len(part) // _GROUP))
            self._ctx.memory_barrier()
            self.gather(part[:, 1] & ((1 << PIXEL_BITS) - 1))
            self._budget.learn(len(part), time.perf_counter() - start, seconds)
            done += len(part)
            yield done / len(entries)

    @property
    def found(self) -> moderngl.Buffer:
        """What was found, for up to `MOST_ENTRIES` at a time."""
        return self._lists[BIND_BEAM_FOUND]

    def gather(self, pixels: np.ndarray) -> None:
        """Add what was found to these pixels of the picture."""
        order, runs = by_pixel(pixels)
        for binding, values in ((BIND_BEAM_RUNS, runs), (BIND_BEAM_ORDER, order)):
            self._lists[binding].write(values.tobytes())
        for binding in (BIND_BEAM_RUNS, BIND_BEAM_ORDER, BIND_BEAM_FOUND):
            self._lists[binding].bind_to_storage_buffer(binding)
        for unit, picture in enumerate(self._picture.textures):
            picture.bind_to_image(unit, read=True, write=True)
        self._gather["run_count"].value = len(runs)
        self._gather.run(-(-len(runs) // _GROUP))
        self._ctx.memory_barrier()
        self._ctx.finish()

    def _view_of(self, size: tuple[int, int], places: np.ndarray) -> np.ndarray:
        """Upload the polygons for so many points of a pixel."""
        assert self._polygons is not None
        self._records["parts"] = parts_of(self._records["strength"], len(places), self._sees_edges)
        edges = np.zeros((len(self._polygons.edges), 2, 4), np.float32)
        edges[:, 0, :3], edges[:, 1, :3] = _about_centres(self._polygons)
        words = np.concatenate([self._records.view(np.uint32).ravel(), edges.view(np.uint32).ravel()])
        rows = max(1, -(-len(words) // (4 * ROW_TEXELS)))
        image = np.zeros(rows * ROW_TEXELS * 4, np.uint32)
        image[: len(words)] = words
        if self._texels is not None:
            self._texels.release()
        self._texels = self._ctx.texture((ROW_TEXELS, rows), 4, image, dtype="u4")
        self._texels.filter = moderngl.NEAREST, moderngl.NEAREST
        view = _VIEW.zeros(1)
        view["places"][0].reshape(-1, 2)[: len(places)] = places - 0.5
        view["points"], view["first_edge_texel"] = len(places), len(self._records) * SCREEN_POLYGON.stride // 16
        view["reach"] = np.abs(places - 0.5).max() + 1e-4
        return view

    def add(self, sums: Sequence[moderngl.Texture], first_row: int, rows: int) -> None:
        """Add what was drawn to these rows of the camera's sums."""
        self._picture.add(sums, first_row, rows)

    def release(self) -> None:
        """Free everything."""
        shader.release(self._look, self._gather)
        for owned in (self._picture, self._view, *self._lists.values(), self._texels):
            if owned is not None:
                owned.release()
        self._lists, self._texels = {}, None


def sees_edges(scene: Scene) -> bool:
    """Whether what is looked up may have edges within a pixel. A sky alone is filtered as it is looked up."""
    return any(not item.material.is_specular for item in scene.objects) or any(
        light.has_extent for light in scene.lights
    )


def parts_of(strength: np.ndarray, points: int, has_edges: bool) -> np.ndarray:
    """int (N,): parts of a pixel of so many points that are looked at one by one, by the polygons' strength."""
    parts = [largest_divisor(points, most) for most in (FINE_PARTS, COARSE_PARTS, 1)]
    strength = strength if has_edges else np.zeros(len(strength))
    return np.select([strength > FINE_ABOVE, strength > COARSE_ABOVE], parts[:2], parts[2])


def strength_of(polygons: ScreenPolygons, brightness: np.ndarray | None) -> np.ndarray:
    """(N,): throughput times the band's share of what looks bright."""
    share = polygons.x_hi - polygons.x_lo
    if brightness is not None:
        x = np.linspace(0.0, 1.0, len(brightness))
        share = np.interp(polygons.x_hi, x, brightness) - np.interp(polygons.x_lo, x, brightness)
    return polygons.throughput.max(axis=1, initial=0.0) * share


def packed(polygons: ScreenPolygons, scene: SceneBuffers, brightness: np.ndarray | None) -> np.ndarray:
    """SCREEN_POLYGON records."""
    records = SCREEN_POLYGON.zeros(len(polygons))
    for name in ("centre", "x_lo", "x_hi", "key", "last_object", "slope"):
        records[name] = getattr(polygons, name)
    records["first_edge"], records["end_edge"] = polygons.edge_start[:-1], polygons.edge_start[1:]
    records["throughput"] = _powers(polygons.throughput, 1)
    for name in ("position", "direction"):
        records[name][:, :, :3] = _powers(getattr(polygons, name), 1).reshape(-1, 9, 3)
    records["strength"] = strength_of(polygons, brightness)
    records["flags"] = polygons.is_inside.astype(np.uint32) | (polygons.depth.astype(np.uint32) << 8)
    records["inside_mask"], records["inside_object"] = scene.media_of(polygons.inside)
    return records


def _powers(values: np.ndarray, axis: int) -> np.ndarray:
    """Values at t = 0, 1/2, 1 along `axis` → coefficients of 1, t, t²."""
    at_lo, middle, at_hi = np.moveaxis(values, axis, 0)
    return np.stack([at_lo, 4.0 * middle - 3.0 * at_lo - at_hi, 2.0 * (at_lo + at_hi) - 4.0 * middle], axis=axis)


def _about_centres(polygons: ScreenPolygons) -> tuple[np.ndarray, np.ndarray]:
    """Lines (E, 3) at either end of the band, about their polygons' centres, which leaves float32 its digits."""
    centres = np.repeat(polygons.centre, np.diff(polygons.edge_start), axis=0)
    lines = polygons.edges.reshape(-1, 2, 3).copy()
    lines[:, :, 2] += np.einsum("nki,ni->nk", lines[:, :, :2], centres)
    return lines[:, 0], lines[:, 1]


def by_pixel(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """uint32 (n,): entries sorted by their pixels, in order within each; (m, 4): pixel, first and end of its
    entries."""
    order = np.argsort(pixels, kind="stable").astype(np.uint32)
    ranked = pixels[order]
    starts = np.flatnonzero(np.diff(ranked, prepend=np.uint32(0xFFFFFFFF)) != 0)
    runs = np.zeros((len(starts), 4), np.uint32)
    runs[:, 0], runs[:, 1], runs[:, 2] = ranked[starts], starts, np.append(starts[1:], len(ranked))
    return order, runs


def largest_divisor(number: int, most: int) -> int:
    """Of `number`, up to `most`."""
    return max(d for d in range(1, most + 1) if number % d == 0)


def ordered(places: np.ndarray) -> np.ndarray:
    """Points of the unit square along a Z-shaped curve, so that a quarter of them in order lies in about a quarter of
    it."""
    cells = np.clip((np.asarray(places) * 256.0).astype(np.int64), 0, 255)
    code = np.zeros(len(cells), np.int64)
    for bit in range(8):
        code |= ((cells[:, 0] >> bit) & 1) << (2 * bit) | ((cells[:, 1] >> bit) & 1) << (2 * bit + 1)
    return np.asarray(places)[np.argsort(code, kind="stable")]
