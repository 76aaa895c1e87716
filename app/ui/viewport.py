"""The picture with everything that is done in it: tools, camera, gizmo, brush, pulling, overlays.

`draw_viewport` fills the window it is drawn in. It knows the picture only as a texture number and what is under
the cursor only from `ViewModel`; wishes that need the renderer are requests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from ..edit.state import State
from . import item_rects, overlay, theme
from .gizmo import Gizmo
from .measure_marks import draw_measure
from .overlay import Canvas
from .panels.spectrum_strip import colour_of_nm
from .panels.status_bar import preparing_words
from .ray_readings import RayReading
from .view_model import ViewModel
from .viewport_input import Mouse, ViewportInput
from .viewport_marks import draw_axes, draw_lights, draw_magnifier, draw_marks, draw_wipe
from .viewport_tools import MARGIN_EM, badges, draw_badges, draw_toolbar

MOST_LABELS = 5
"""With more wavelengths only some, the first and the last among them."""
_BORDER_EM = 0.6


def draw_ray_labels(canvas: Canvas, readings: Sequence[RayReading]) -> None:
    """Labels in a column next to the ends of the rays that are read, none over another; a small cross at each focus."""
    for reading in readings:
        place = np.full(2, np.nan) if reading.focus is None else canvas.pixels(np.asarray(reading.focus))
        if np.isfinite(place).all():
            at, reach = ImVec2(float(place[0]), float(place[1])), 5.0 * canvas.scale
            overlay.draw_cross(canvas, at, reach, colour_of_nm(reading.wavelength_nm), 1.6)
    chosen = [readings[i] for i in labelled(len(readings))]
    line = imgui.get_text_line_height() + theme.em(0.25)
    places = [(_end_of(canvas, reading.path), reading) for reading in chosen]
    lowest = -np.inf
    for (x, y), reading in sorted((each for each in places if np.isfinite(each[0]).all()), key=lambda each: each[0][1]):
        text = f"{reading.wavelength_nm:.0f} nm  {reading.deviation_deg:.2f}°"
        size, border = imgui.calc_text_size(text), theme.em(_BORDER_EM)
        left = min(max(x + border, canvas.left + border), canvas.left + canvas.width - size.x - border)
        top = max(min(max(y - 0.5 * size.y, canvas.top + border), canvas.top + canvas.height - size.y - border), lowest)
        lowest = top + line
        low, high = ImVec2(left - theme.em(0.2), top), ImVec2(left + size.x + theme.em(0.2), top + size.y)
        canvas.drawing.add_rect_filled(low, high, theme.packed((0.05, 0.05, 0.06, 0.78)), 3.0)
        canvas.drawing.add_rect_filled(low, ImVec2(low.x + theme.em(0.12), high.y), colour_of_nm(reading.wavelength_nm))
        canvas.drawing.add_text(ImVec2(left, top), theme.packed((0.95, 0.95, 0.95, 1.0)), text)


def labelled(count: int) -> list[int]:
    """Which of `count` wavelengths have a label."""
    if count <= MOST_LABELS:
        return list(range(count))
    return sorted({round(i * (count - 1) / 2) for i in range(3)})


def _end_of(canvas: Canvas, path: np.ndarray) -> np.ndarray:
    """Where a ray ends on the screen, as far as it is in the picture; NaN where none of it is."""
    segments = canvas.segments(path)
    if not len(segments):
        return np.full(2, np.nan)
    start, way = segments[-1, 0], segments[-1, 1] - segments[-1, 0]  # which reaches beyond the picture's borders
    low = np.array([canvas.left, canvas.top])
    border = np.where(way > 0.0, low + [canvas.width, canvas.height], low)
    share = (border - start) / np.where(way == 0.0, np.inf, way)
    return np.asarray(start + float(np.min(share, where=share > 0.0, initial=1.0)) * way)


MIN_SIDE = 64
"""Pixels of the picture, however small the window."""
_FLAGS = (
    imgui.WindowFlags_.no_scrollbar
    | imgui.WindowFlags_.no_scroll_with_mouse
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_nav
)

viewport_input = ViewportInput()
"""What the mouse holds."""
gizmo = Gizmo()


def reset() -> None:
    """Forget every drag: another interface begins."""
    global viewport_input, gizmo
    viewport_input, gizmo = ViewportInput(), Gizmo()


def draw_viewport(state: State, view_model: ViewModel) -> State:
    """Draw the picture into the present window and carry out what is done in it."""
    size = imgui.get_content_region_avail()
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    imgui.begin_child("picture", ImVec2(max(size.x, 1.0), max(size.y, 1.0)), 0, _FLAGS)
    imgui.pop_style_var()
    state = _draw_inside(state, view_model)
    imgui.end_child()
    return state


def picture_size(width: float, height: float, scale: float) -> tuple[int, int]:
    """Pixels of a picture that fills `width` × `height` interface pixels: even, and not too small to trace."""
    wide, high = (max(MIN_SIDE, 2 * round(0.5 * side * scale)) for side in (width, height))
    return wide, high


def _draw_inside(state: State, view_model: ViewModel) -> State:
    corner, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    width, height = max(size.x, 1.0), max(size.y, 1.0)
    state = replace(state, viewport_size=picture_size(width, height, view_model.framebuffer_scale))
    _draw_picture(state, view_model, corner, ImVec2(width, height))
    drawing, scale = imgui.get_window_draw_list(), theme.em(1.0) / theme.FONT_SIZE
    canvas = Canvas(drawing, state.view, corner.x, corner.y, width, height, scale)
    drawing.push_clip_rect(corner, ImVec2(corner.x + width, corner.y + height), True)
    if state.display.ray_overlay:
        overlay.draw_rays(canvas, view_model.rays)
        if state.display.ray_labels:
            draw_ray_labels(canvas, view_model.readings)
    draw_marks(canvas, state, view_model, viewport_input.grip == "brush")
    state = draw_lights(canvas, state)
    state = gizmo.draw(state, canvas.view, (corner.x, corner.y, width, height))
    draw_wipe(canvas, state, view_model)
    state = draw_toolbar(state, gizmo, corner.x, corner.y)
    inset = theme.em(MARGIN_EM)
    if height > theme.em(9.0) and width > theme.em(12.0):
        state = draw_axes(state, canvas.view, corner.x + width - inset, corner.y + inset)
    draw_badges(badges(state, view_model), corner.x, corner.y + height)
    mouse = _mouse(canvas)
    if state.tool == "measure":
        draw_measure(canvas, state, view_model, (mouse.x, mouse.y) if mouse.is_over else None)
    state = viewport_input.act(state, view_model, canvas, mouse)
    state = _with_hover(state, mouse)
    if state.display.magnifier and mouse.is_over:
        draw_magnifier(canvas, view_model)
    drawing.pop_clip_rect()
    return state


def _draw_picture(state: State, view_model: ViewModel, corner: ImVec2, size: ImVec2) -> None:
    if view_model.picture is not None:
        imgui.image(imgui.ImTextureRef(view_model.picture), size)
        item_rects.note("Picture")
        return
    imgui.dummy(size)
    item_rects.note("Picture")
    text = preparing_words(view_model.stats)
    extent = imgui.calc_text_size(text)
    at = ImVec2(corner.x + 0.5 * (size.x - extent.x), corner.y + 0.5 * (size.y - extent.y))
    imgui.get_window_draw_list().add_text(at, theme.packed(theme.palette().muted), text)


def _mouse(canvas: Canvas) -> Mouse:
    io = imgui.get_io()
    position, delta = io.mouse_pos, io.mouse_delta
    known = abs(position.x) < 1e30 and abs(position.y) < 1e30
    x, y = (
        ((position.x - canvas.left) / canvas.width, (position.y - canvas.top) / canvas.height)
        if known
        else (-1.0, -1.0)
    )
    inside = 0.0 <= x < 1.0 and 0.0 <= y < 1.0
    busy = imgui.is_any_item_hovered() or imgui.is_any_item_active() or gizmo.is_in_the_way()
    is_over = inside and imgui.is_window_hovered() and not busy
    return Mouse(x, y, is_over, delta.x / canvas.height, delta.y / canvas.height)


def _with_hover(state: State, mouse: Mouse) -> State:
    """With the place that the host looks up; while the camera is dragged that is not needed."""
    dragging = viewport_input.grip in ("brush", "pull", "click", "measure", "wipe")
    inside = 0.0 <= mouse.x < 1.0 and 0.0 <= mouse.y < 1.0
    hovers = (mouse.is_over and viewport_input.is_free) or (dragging and inside)
    return replace(
        state, hover=(float(np.clip(mouse.x, 0.0, 1.0)), float(np.clip(mouse.y, 0.0, 1.0))) if hovers else None
    )
