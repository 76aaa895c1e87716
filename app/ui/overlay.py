"""What is drawn over the picture in scene coordinates: rays, lines, boxes, labels.

Drawn with imgui's draw list, so it costs the renderer nothing and is no part of the picture.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from imgui_bundle import ImVec2, imgui

from ..edit.projection import View
from ..passes.ray_line import RayLine
from . import theme
from .panels.spectrum_strip import spectral_srgb

Colour = tuple[float, float, float, float]
NEAR = 1e-3
"""Nearest depth that is drawn, as a share of the target's distance."""
_BORDER = 0.5
"""How far beyond the picture lines are kept, picture widths: beyond, float32 coordinates break."""
_HALO, _CORE = ((6.0, 0.06), (3.2, 0.12)), (1.3, 0.85)
"""Widths (logical pixels) and opacities of a ray's glow and of its core: added up, they look like light."""


@dataclass(frozen=True)
class Canvas:
    """The picture on the screen."""

    drawing: imgui.ImDrawList
    view: View
    left: float
    top: float
    width: float
    height: float
    scale: float = 1.0
    """Interface pixels per logical pixel."""

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """World (..., 3) → screen (..., 2); NaN behind a pinhole."""
        place, _ = self.view.project(points)
        return place * [self.width, self.height] + [self.left, self.top]

    def segments(self, points: np.ndarray, closed: bool = False) -> np.ndarray:
        """A world polyline (n, 3) as screen segments (m, 2, 2)."""
        points = np.asarray(points, float)
        ends = np.roll(points, -1, axis=0) if closed else points[1:]
        return self.cut(np.stack([points if closed else points[:-1], ends], axis=1))[0]

    def cut(self, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World segments (n, 2, 3) as screen segments (m, 2, 2), cut at the near plane and a little outside the
        picture, and which (m,) of the n each was."""
        index = np.arange(len(pairs))
        if not self.view.is_orthographic:
            pairs, kept = _cut_near(pairs, self.view.depth(pairs), NEAR * self.view.target_distance)
            index = index[kept]
        if not len(pairs):
            return np.zeros((0, 2, 2)), index
        place, kept = _cut_border(self.view.project(pairs)[0])
        return place * [self.width, self.height] + [self.left, self.top], index[kept]


def _cut_near(pairs: np.ndarray, depth: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """Segments (n, 2, 3) without what is nearer than `near`, and which are left."""
    ahead = depth > near
    kept = np.asarray(ahead.any(axis=1))
    pairs, depth, ahead = pairs[kept], depth[kept], ahead[kept]
    crossing = ahead[:, 0] != ahead[:, 1]
    share = np.where(crossing, (near - depth[:, 0]) / np.where(crossing, depth[:, 1] - depth[:, 0], 1.0), 0.0)[:, None]
    at = pairs[:, 0] + share * (pairs[:, 1] - pairs[:, 0])
    start = np.where((crossing & ~ahead[:, 0])[:, None], at, pairs[:, 0])
    end = np.where((crossing & ~ahead[:, 1])[:, None], at, pairs[:, 1])
    return np.stack([start, end], axis=1), kept


def _cut_border(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Picture segments (n, 2, 2) clipped to a box around the picture [Liang and Barsky 1984], and which are left."""
    start, way = place[:, 0], place[:, 1] - place[:, 0]
    enter, leave = np.zeros(len(place)), np.ones(len(place))
    for axis in range(2):
        safe = np.where(np.abs(way[:, axis]) < 1e-12, 1e-12, way[:, axis])
        low, high = (-_BORDER - start[:, axis]) / safe, (1.0 + _BORDER - start[:, axis]) / safe
        enter, leave = np.maximum(enter, np.minimum(low, high)), np.minimum(leave, np.maximum(low, high))
    kept = enter < leave
    cut = np.stack([start + enter[:, None] * way, start + leave[:, None] * way], axis=1)
    return cut[kept], kept


def lines(canvas: Canvas, segments: Iterable[np.ndarray], colour: int, width: float) -> None:
    """Draw screen segments."""
    for (x0, y0), (x1, y1) in segments:
        canvas.drawing.add_line(ImVec2(x0, y0), ImVec2(x1, y1), colour, width * canvas.scale)


def draw_rays(canvas: Canvas, rays: Iterable[RayLine]) -> None:
    """The ray overlay: every path in the colour of its wavelength, glowing softly; where several run together, in their
    mixture."""
    rays = tuple(rays)
    if not rays:
        return
    pairs = np.concatenate([np.stack([ray.points[:-1], ray.points[1:]], axis=1) for ray in rays])
    nm_of = np.repeat([ray.wavelength_nm for ray in rays], [len(ray.points) - 1 for ray in rays])
    segments, index = canvas.cut(pairs)
    together: dict[tuple[int, ...], tuple[np.ndarray, set[float]]] = {}
    for segment, key, nm in zip(
        segments, np.round(2.0 * segments.reshape(-1, 4)).astype(int).tolist(), nm_of[index].tolist(), strict=True
    ):
        together.setdefault(tuple(key), (segment, set()))[1].add(nm)
    all_nm = tuple(sorted({ray.wavelength_nm for ray in rays}))
    coloured = [(segment, mixed_srgb(tuple(sorted(nm)), all_nm)) for segment, nm in together.values()]
    for width, opacity in (*_HALO, _CORE):
        for segment, colour in coloured:
            lines(canvas, [segment], imgui.color_convert_float4_to_u32((*colour, opacity)), width)


@lru_cache(4096)
def mixed_srgb(wavelengths_nm: tuple[float, ...], all_nm: tuple[float, ...]) -> tuple[float, float, float]:
    """The colour of some wavelengths together, sRGB, where all those of the overlay make white."""
    colours = spectral_srgb()[np.clip(np.round(all_nm).astype(int) - 380, 0, 400)]
    if len(wavelengths_nm) == 1 or len(all_nm) == 1:
        red, green, blue = colours[all_nm.index(wavelengths_nm[0])]
        return float(red), float(green), float(blue)
    chosen = np.isin(all_nm, wavelengths_nm)
    mixture = (colours[chosen] ** 2.2).sum(axis=0) / np.maximum((colours**2.2).sum(axis=0), 1e-6)
    red, green, blue = (mixture / mixture.max()) ** (1.0 / 2.2)
    return float(red), float(green), float(blue)


def draw_outlined(canvas: Canvas, points: np.ndarray, colour: Colour, width: float = 1.5, closed: bool = True) -> None:
    """A world polyline that is seen over any picture: a dark seam under a coloured line."""
    _outlined(canvas, canvas.segments(points, closed), colour, width)


def _outlined(canvas: Canvas, segments: np.ndarray, colour: Colour, width: float) -> None:
    lines(canvas, segments, imgui.color_convert_float4_to_u32((0.0, 0.0, 0.0, 0.55 * colour[3])), width + 2.0)
    lines(canvas, segments, imgui.color_convert_float4_to_u32(colour), width)


def draw_label(canvas: Canvas, x: float, y: float, text: str, is_kept: bool = False) -> None:
    """Text on a plate, its upper left corner at a place of the screen; `is_kept`: within the picture."""
    size, pad = imgui.calc_text_size(text), theme.em(0.35)
    if is_kept:
        x = min(max(x, canvas.left + pad), canvas.left + canvas.width - size.x - pad)
        y = min(max(y, canvas.top + pad), canvas.top + canvas.height - size.y - pad)
    low, high = ImVec2(x - pad, y - 0.5 * pad), ImVec2(x + size.x + pad, y + size.y + 0.5 * pad)
    canvas.drawing.add_rect_filled(low, high, theme.packed(theme.palette().window, 0.88), 4.0)
    canvas.drawing.add_text(ImVec2(x, y), theme.packed(theme.palette().text), text)


def draw_cross(canvas: Canvas, at: ImVec2, reach: float, colour: int, width: float) -> None:
    """A cross with a dark seam, seen over any picture."""
    for tint, thickness in ((theme.packed((0.0, 0.0, 0.0, 0.65)), width + 2.0), (colour, width)):
        canvas.drawing.add_line(ImVec2(at.x - reach, at.y), ImVec2(at.x + reach, at.y), tint, thickness)
        canvas.drawing.add_line(ImVec2(at.x, at.y - reach), ImVec2(at.x, at.y + reach), tint, thickness)


_EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))
_CORNER_SHARE = 0.18
"""Share of every edge of a selection's box that is drawn from each of its ends."""


def draw_box(canvas: Canvas, corners: np.ndarray, colour: Colour) -> None:
    """The corners of a box (8, 3), as brackets: says what is selected and hides little of it."""
    ends = corners[np.array(_EDGES)]
    ends = np.concatenate([ends, ends[:, ::-1]])
    pairs = np.stack([ends[:, 0], ends[:, 0] + _CORNER_SHARE * (ends[:, 1] - ends[:, 0])], axis=1)
    _outlined(canvas, canvas.cut(pairs)[0], colour, 1.2)


def box_corners(vertices: np.ndarray, object_to_world: np.ndarray) -> np.ndarray:
    """World corners (8, 3) of the box round an object's vertices along its own axes."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    own = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return own @ object_to_world[:3, :3].T + object_to_world[:3, 3]
