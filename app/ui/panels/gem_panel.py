"""The selected stone in figures: light return, fire, scintillation, windows."""

from __future__ import annotations

from imgui_bundle import imgui

from ...base.not_yet import NotYet
from ...edit.state import State
from .. import item_rects
from ..view_model import ViewModel
from . import widgets


def draw_gem_panel(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    found = view_model.gem
    if isinstance(found, NotYet):
        widgets.hint("Not yet: the stone's figures are being found.")
        return state
    if isinstance(found, str):
        widgets.hint(f"{found[:1].upper()}{found[1:]}.")
        return state
    name, figures = found
    imgui.text_wrapped(f"{name}, alone in the air, seen from above its table (its own z).")
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.scroll_y
    if imgui.begin_table("##gem", 3, flags):
        for title, value, meaning in figures.rows():
            imgui.table_next_row()
            for text in (title, value, meaning):
                imgui.table_next_column()
                imgui.text_unformatted(text)
                item_rects.note(f"Gem: {title}")
        imgui.end_table()
    return state
