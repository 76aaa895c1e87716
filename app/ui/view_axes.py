"""The axes in the viewport's corner: which way the world lies, and a click to look along an axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from ..edit.camera_controls import look_along
from ..edit.projection import View
from ..edit.state import State
from . import item_rects, theme
from .panels.rows import tooltip

RADIUS_EM = 2.7
"""Of the whole ornament, text heights."""
_BALL_EM = 0.56
_COLOURS = ((0.88, 0.36, 0.36, 1.0), (0.50, 0.74, 0.32, 1.0), (0.36, 0.56, 0.90, 1.0))
_NAMES = "XYZ"


def draw_axes(state: State, view: View, right: float, top: float) -> State:
    """Draw it with its upper right corner at (right, top), pixels."""
    radius, ball = theme.em(RADIUS_EM), theme.em(_BALL_EM)
    centre = np.array([right - radius, top + radius])
    ends = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            way = sign * np.eye(3)[axis]
            place = centre + (radius - ball) * np.array([way @ view.right, -(way @ view.up)])
            ends.append((float(way @ view.forward), axis, sign, place))
    ends.sort(key=lambda end: end[0])  # nearest first: it gets the mouse
    hovered = None
    for _, axis, sign, place in ends:
        name = f"{'+' if sign > 0 else '−'}{_NAMES[axis]}"
        imgui.set_cursor_screen_pos(ImVec2(place[0] - ball, place[1] - ball))
        pressed = imgui.invisible_button(f"##view {name}", ImVec2(2 * ball, 2 * ball))
        item_rects.note(f"View from {name}")
        tooltip(f"View from {name}: look at the target along this axis, from the same distance.")
        if imgui.is_item_hovered():
            hovered = (axis, sign)
        if pressed:
            state = replace(state, camera=look_along(state.camera, -sign * np.eye(3)[axis]))
    _draw(ends, centre, ball, hovered)
    return state


def _draw(
    ends: list[tuple[float, int, float, np.ndarray]], centre: np.ndarray, ball: float, hovered: tuple[int, float] | None
) -> None:
    drawing, scale = imgui.get_window_draw_list(), theme.em(1.0) / theme.FONT_SIZE
    dark = theme.packed((0.06, 0.06, 0.06, 0.9))
    if hovered is not None:
        ground = theme.packed((0.0, 0.0, 0.0, 0.28))
        drawing.add_circle_filled(ImVec2(*centre), theme.em(RADIUS_EM), ground, 48)
    for depth, axis, sign, place in reversed(ends):
        opacity = 0.95 - 0.35 * (depth + 1.0) / 2.0
        colour = theme.packed(_COLOURS[axis], opacity)
        at = ImVec2(*place)
        if sign > 0:
            drawing.add_line(ImVec2(*centre), at, colour, 2.0 * scale)
            drawing.add_circle_filled(at, ball, colour, 24)
        else:
            drawing.add_circle_filled(at, 0.72 * ball, theme.packed(_COLOURS[axis], 0.30 * opacity), 24)
            drawing.add_circle(at, 0.72 * ball, colour, 24, 1.2 * scale)
        if sign > 0 or hovered == (axis, sign):
            text = _NAMES[axis] if sign > 0 else f"−{_NAMES[axis]}"
            size = imgui.calc_text_size(text)
            drawing.add_text(
                ImVec2(at.x - 0.5 * size.x, at.y - 0.5 * size.y),
                dark if sign > 0 else theme.packed((0.92, 0.92, 0.92, 1.0)),
                text,
            )
        if hovered == (axis, sign):
            drawing.add_circle(at, ball + 1.0 * scale, theme.packed((0.95, 0.95, 0.95, 0.9)), 24, 1.4 * scale)
