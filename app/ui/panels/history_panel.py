"""Every step that can be undone, by name; a click returns to it."""

from __future__ import annotations

from imgui_bundle import imgui

from ...edit.requests import GoTo
from ...edit.state import State
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets


def draw_history(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    if not view_model.history:
        widgets.hint("Edits appear here, the newest last.")
        return state
    is_undone = False
    clipper = imgui.ListClipper()
    present = next((i for i, entry in enumerate(view_model.history) if entry.is_present), 0)
    clipper.begin(len(view_model.history))
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            entry, is_undone = view_model.history[index], index > present
            with theme.coloured(theme.palette().muted if is_undone else theme.palette().text):
                pressed, _ = imgui.selectable(f"{entry.label}##{index}", entry.is_present)
            item_rects.note(f"Step {index}")
            widgets.tooltip("Undone: click to do it again." if is_undone else "Click to go back to this step.")
            if pressed and not entry.is_present:
                state = state.asking(GoTo(index))
    _follow(present, len(view_model.history))
    return state


def _follow(present: int, length: int) -> None:
    """Keep the newest step in sight while the present is the newest."""
    if present == length - 1 and imgui.get_scroll_y() >= imgui.get_scroll_max_y() - theme.em(3):
        imgui.set_scroll_here_y(1.0)
