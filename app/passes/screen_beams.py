"""Draws screen polygons (`beams.screen_polygons`): what a picture shows by way of flat glass and mirrors.

A polygon's hull is a triangle fan, and its fragments look up what lies behind; they are blended in order, so the sums
do not depend on timing. The picture is drawn once for a view and added with every sample of what is seen directly:
progress, stops and what reads the sums know nothing of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..beams.screen_polygons import ScreenPolygons
from ..gpu import shader
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.records import NONE
from ..gpu.scene_texels import ROW_TEXELS
from ..gpu.schema import Field, Struct
from .map_atlas import park
from .pixel_lattice import MOST_SHARED
from .variants import BIND_BEAM_VIEW, IMAGE_POLYGONS, UNIT_POLYGONS, Defines

if TYPE_CHECKING:
    from ..gpu.scene_buffers import SceneBuffers

FINE_PARTS, COARSE_PARTS = 16, 4
"""Parts of a pixel that are looked at one by one, where a polygon is strong, and where it is not weak …"""
FINE_ABOVE, COARSE_ABOVE = 0.2, 0.05
"""… which is said by its share of what the pixel sees."""
_FIRST = 64
REACH = 0.6
"""Pixels from a pixel's middle to the farthest of its points, a little more: primary samples reach over its border."""

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
        Field("reserved", "uint", ""),
        Field("position", "vec4", "coefficients of 1, t, t²: value at the centre, its two columns per pixel", 9),
        Field("direction", "vec4", "likewise", 9),
    ),
    texels=True,
)
_VIEW = Struct(
    "BeamView",
    (
        Field("places", "vec4", "points of a pixel about its middle, two each, neighbours together", MOST_SHARED // 2),
        Field("size", "vec2", "pixels"),
        Field("points", "uint", "how many"),
        Field("first_edge_texel", "uint", "where edges begin"),
        Field("fine_parts", "uint", "of a pixel that are looked at one by one"),
        Field("coarse_parts", "uint"),
        Field("fine_above", "float", "strength of a polygon"),
        Field("coarse_above", "float"),
        Field("reach", "float", "from a pixel's middle to its outermost points, pixels"),
        Field("reserved", "float", "", 3),
    ),
)


class ScreenBeams:
    """Owns the programs, what the polygons are packed in and the picture of them."""

    def __init__(self, ctx: moderngl.Context, defines: Defines, structs: Sequence[Struct], targets: int) -> None:
        """`defines`: `view_beam_defines` of the camera's; `structs`: the camera's records."""
        self._ctx = ctx
        self._targets = targets
        self._program = shader.program(
            ctx, "camera/beam.vert", "camera/beam.frag", defines, (*structs, SCREEN_POLYGON, _VIEW)
        )
        self._sum_program = shader.program(
            ctx, "camera/beam_sum.vert", "camera/beam_sum.frag", {"TARGETS": targets}, ()
        )
        self._triangle = ctx.vertex_array(self._sum_program, [])
        self._view = ctx.buffer(reserve=_VIEW.stride)
        self._drawn: list[moderngl.Buffer | moderngl.VertexArray | moderngl.Texture] = []
        self._fans: moderngl.VertexArray | None = None
        self._first_corner = np.zeros(1, int)
        self._texels: moderngl.Texture | None = None
        self._pictures: list[moderngl.Texture] = []
        self._budget = DispatchBudget(_FIRST, 1, 1)
        self._first_edge_texel = 0

    def take(self, polygons: ScreenPolygons, scene: SceneBuffers, brightness: np.ndarray | None) -> None:
        """Pack and upload; `brightness`: how much of what looks bright lies below each of equally spaced x."""
        self._forget()
        records = packed(polygons, scene, brightness)
        edges = np.zeros((len(polygons.edges), 2, 4), np.float32)
        edges[:, 0, :3], edges[:, 1, :3] = _about_centres(polygons)
        words = np.concatenate([records.view(np.uint32).ravel(), edges.view(np.uint32).ravel()])
        self._first_edge_texel = len(records) * SCREEN_POLYGON.stride // 16
        rows = max(1, -(-len(words) // (4 * ROW_TEXELS)))
        image = np.zeros(rows * ROW_TEXELS * 4, np.uint32)
        image[: len(words)] = words
        self._texels = self._ctx.texture((ROW_TEXELS, rows), 4, image, dtype="u4")
        self._texels.filter = moderngl.NEAREST, moderngl.NEAREST
        places, owners, triangles, self._first_corner = fans(polygons)
        vertices = np.zeros(len(places), [("place", "f4", 2), ("polygon", "u4")])
        vertices["place"], vertices["polygon"] = places, owners
        corners, indices = (
            self._ctx.buffer(vertices.tobytes() or bytes(12)),
            self._ctx.buffer(triangles.tobytes() or bytes(4)),
        )
        self._fans = self._ctx.vertex_array(
            self._program, [(corners, "2f4 1u4", "in_place", "in_polygon")], index_buffer=indices
        )
        self._drawn = [self._fans, corners, indices, self._texels]
        self._budget = DispatchBudget(_FIRST, 1, max(1, len(polygons)))

    def draw(self, size: tuple[int, int], places: np.ndarray, as_image: bool, bind, seconds: float) -> Iterator[float]:
        """Draw all polygons into the beams' own picture, yielding the share done after every portion.

        `places`: (points, 2) of a pixel, 0 to 1, at which its edges are told; `bind`: binds what the camera's programs
        read, and returns what finishes a portion and says how long it took."""
        self._resize(size)
        view = _VIEW.zeros(1)
        places = ordered(places)
        view["places"][0].reshape(-1, 2)[: len(places)] = places - 0.5
        view["size"], view["points"], view["first_edge_texel"] = size, len(places), self._first_edge_texel
        fine, coarse = (largest_divisor(len(places), parts) for parts in (FINE_PARTS, COARSE_PARTS))
        view["fine_parts"], view["coarse_parts"] = fine, coarse
        view["fine_above"], view["coarse_above"] = FINE_ABOVE, COARSE_ABOVE
        view["reach"] = np.abs(places - 0.5).max() + 1e-4
        self._view.write(view.tobytes())
        assert self._fans is not None and self._texels is not None
        framebuffer = self._ctx.framebuffer(self._pictures)
        framebuffer.clear()
        count, done = len(self._first_corner) - 1, 0
        while done < count:
            portion = min(self._budget.units, count - done)
            timed = bind()
            self._view.bind_to_uniform_block(BIND_BEAM_VIEW)
            if as_image:
                self._texels.bind_to_image(IMAGE_POLYGONS, read=True, write=False)
            else:
                self._texels.use(UNIT_POLYGONS)
            framebuffer.use()
            self._blend()
            first, last = self._first_corner[done], self._first_corner[done + portion]
            self._fans.render(moderngl.TRIANGLES, int(last - first), first=int(first))
            self._ctx.enable_only(moderngl.NOTHING)
            self._budget.learn(portion, timed(), seconds)
            done += portion
            yield done / count
        park(self._ctx)
        framebuffer.release()

    def add(self, sums: Sequence[moderngl.Texture], first_row: int, rows: int) -> None:
        """Add what was drawn to these rows of the camera's sums."""
        framebuffer = self._ctx.framebuffer(list(sums))
        framebuffer.use()
        framebuffer.scissor = 0, first_row, framebuffer.size[0], rows
        for unit, picture in enumerate(self._pictures):
            picture.use(unit)
        self._blend()
        self._triangle.render(moderngl.TRIANGLES, 3)
        self._ctx.enable_only(moderngl.NOTHING)
        framebuffer.scissor = None
        park(self._ctx)
        framebuffer.release()

    def _blend(self) -> None:
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE

    def _resize(self, size: tuple[int, int]) -> None:
        if self._pictures and self._pictures[0].size == size:
            return
        for picture in self._pictures:
            picture.release()
        self._pictures = [self._ctx.texture(size, 4, dtype="f4") for _ in range(self._targets)]

    def _forget(self) -> None:
        for owned in self._drawn:
            owned.release()
        self._drawn, self._fans, self._texels = [], None, None

    def release(self) -> None:
        """Free everything."""
        self._forget()
        self._triangle.release()
        shader.release(self._program, self._sum_program)
        for owned in (self._view, *self._pictures):
            owned.release()
        self._pictures = []


def packed(polygons: ScreenPolygons, scene: SceneBuffers, brightness: np.ndarray | None) -> np.ndarray:
    """SCREEN_POLYGON records."""
    records = SCREEN_POLYGON.zeros(len(polygons))
    for name in ("centre", "x_lo", "x_hi", "key", "last_object"):
        records[name] = getattr(polygons, name)
    records["first_edge"], records["end_edge"] = polygons.edge_start[:-1], polygons.edge_start[1:]
    records["throughput"] = _powers(polygons.throughput, 1)
    for name in ("position", "direction"):
        records[name][:, :, :3] = _powers(getattr(polygons, name), 1).reshape(-1, 9, 3)
    share = polygons.x_hi - polygons.x_lo
    if brightness is not None:
        x = np.linspace(0.0, 1.0, len(brightness))
        share = np.interp(polygons.x_hi, x, brightness) - np.interp(polygons.x_lo, x, brightness)
    records["strength"] = polygons.throughput.max(axis=1, initial=0.0) * share
    records["flags"] = polygons.is_inside.astype(np.uint32) | (polygons.depth.astype(np.uint32) << 8)
    records["inside_object"] = NONE
    bits = {number: bit for bit, number in enumerate(scene.stack_objects)}
    for number in range(len(scene.scene.objects)):
        inside = (polygons.inside >> np.uint64(number)) & np.uint64(1) > 0
        if number in bits:
            records["inside_mask"] |= np.where(inside, 1 << bits[number], 0).astype(np.uint32)
        else:
            records["inside_object"][inside] = number
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


def fans(polygons: ScreenPolygons) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Hulls grown by `REACH` to all sides, as triangles: corners (C, 2) in pixels, the polygon of each, uint32
    indices of triangles' corners, and (N + 1,) where each polygon's indices begin.

    Grown: the Minkowski sum with a pixel. Each corner moves along with both of its edges, and to the corner of the
    pixel that lies between where these move apart."""
    counts = np.diff(polygons.hull_start)
    owner = np.repeat(np.arange(len(polygons)), counts)
    corner = np.arange(len(polygons.hulls))
    following = np.where(corner + 1 == polygons.hull_start[1:][owner], polygons.hull_start[:-1][owner], corner + 1)
    previous = np.empty_like(following)
    previous[following] = corner
    places = polygons.hulls
    x, y = places.T
    area = np.zeros(len(polygons))
    np.add.at(area, owner, x * y[following] - x[following] * y)
    along = (places[following] - places) * np.where(area < 0.0, -1.0, 1.0)[owner][:, None]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    moved = np.where(outward >= 0.0, REACH, -REACH)
    # Where these lie opposite each other, the corner between them on the way round.
    before = moved[previous]
    spin = np.where(area < 0.0, -1.0, 1.0)[owner]
    quarter = np.column_stack([-before[:, 1], before[:, 0]]) * spin[:, None]
    between = np.where(np.all(before != moved, axis=1)[:, None], quarter, moved)
    grown = np.stack([places + before, places + between, places + moved], axis=1).reshape(-1, 2)
    owners = np.repeat(owner, 3).astype(np.uint32)
    triangles_of = np.maximum(3 * counts - 2, 0)
    starts = np.concatenate([[0], np.cumsum(3 * triangles_of)])
    which = np.repeat(np.arange(len(polygons)), triangles_of)
    number = np.arange(len(which)) - np.repeat(starts[:-1] // 3, triangles_of)
    base = 3 * polygons.hull_start[:-1][which]
    triangles = np.column_stack([base, base + number + 1, base + number + 2]).astype(np.uint32)
    return grown, owners, triangles, starts


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
