"""Pictures side by side: this one, in which all works as ever, the one it is compared with and the error between them,
all of the same view at half the size, with a cross where the cursor is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from ..edit.state import State
from . import item_rects, theme
from .view_model import ViewModel

_GAP_EM = 0.3
_CROSS_EM = 0.6
DrawOwn = Callable[[State, ViewModel, ImVec2], State]


def draw_beside(state: State, view_model: ViewModel, room: ImVec2, draw_own: DrawOwn) -> State:
    """Fill `room` of the present window; `draw_own` draws this picture at a size."""
    corner, gap = imgui.get_cursor_screen_pos(), theme.em(_GAP_EM)
    pane = ImVec2(max(0.5 * (room.x - gap), 1.0), max(0.5 * (room.y - gap), 1.0))
    state = draw_own(state, view_model, pane)
    middle = ImVec2(corner.x + 0.5 * (room.x - pane.x), corner.y + pane.y + gap)
    # Another glass is no reference: what differs is no error.
    title = "Difference" if state.compare.method in ("glass", "file") else "Error map"
    titles = (view_model.compare_label or "The other picture", title)
    for index, at in enumerate((ImVec2(corner.x + pane.x + gap, corner.y), middle)):
        imgui.set_cursor_screen_pos(at)
        if view_model.beside is None:
            imgui.dummy(pane)
            has_none = state.compare.method == "file" and state.compare.file is None
            tag(at, pane, "No picture chosen yet" if has_none else f"{titles[index]}: on its way")
            continue
        imgui.image(imgui.ImTextureRef(view_model.beside[index]), pane)
        item_rects.note(f"Beside: {index + 1}")
        tag(at, pane, titles[index])
        if state.hover is None and imgui.is_item_hovered():
            # Whose values are asked for does not matter: all show the same place.
            mouse = imgui.get_mouse_pos()
            state = replace(state, hover=((mouse.x - at.x) / pane.x, (mouse.y - at.y) / pane.y))
    if state.hover is not None:
        crossed = (ImVec2(corner.x + pane.x + gap, corner.y), middle) if view_model.beside is not None else ()
        for at in crossed:
            _cross(ImVec2(at.x + state.hover[0] * pane.x, at.y + state.hover[1] * pane.y))
    return state


def tag(corner: ImVec2, pane: ImVec2, text: str) -> None:
    """Words at the lower right of a pane, clear of tools and badges."""
    drawing, size, pad = imgui.get_window_draw_list(), imgui.calc_text_size(text), theme.em(0.35)
    x, y = corner.x + pane.x - size.x - 2.0 * pad, corner.y + pane.y - size.y - 2.0 * pad
    low, high = ImVec2(x - pad, y - 0.5 * pad), ImVec2(x + size.x + pad, y + size.y + 0.5 * pad)
    drawing.add_rect_filled(low, high, theme.packed(theme.palette().window, 0.88), 4.0)
    drawing.add_text(ImVec2(x, y), theme.packed(theme.palette().text), text)


def _cross(at: ImVec2) -> None:
    drawing, reach = imgui.get_window_draw_list(), theme.em(_CROSS_EM)
    for colour, thickness in ((theme.packed((0.0, 0.0, 0.0, 0.7)), 3.0), (theme.packed((1.0, 1.0, 1.0, 0.9)), 1.0)):
        drawing.add_line(ImVec2(at.x - reach, at.y), ImVec2(at.x + reach, at.y), colour, thickness)
        drawing.add_line(ImVec2(at.x, at.y - reach), ImVec2(at.x, at.y + reach), colour, thickness)
