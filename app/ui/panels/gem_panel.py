"""The selected stone in figures and pictures: light return, fire, scintillation, windows, ASET."""

from __future__ import annotations

from ...base.errors import UserError
from ...edit.requests import JudgeStone
from ...edit.state import State
from ...model.gems.in_scene import chosen_stone
from ..view_model import ViewModel
from . import widgets
from .solve_panel import draw_found


def draw_gem_panel(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    selected = state.scene.objects[state.selection.index] if state.selection.kind == "object" else None
    try:
        item = chosen_stone(state.scene, None if selected is None or selected.material.receives else selected.name)
    except UserError as error:
        widgets.hint(f"{str(error)[:1].upper()}{str(error)[1:]}.")
        return state
    tip = "Alone in the air, seen from above its table (its own z): figures, ASET, ideal-scope, brightness, fire."
    if widgets.button(f"Judge {item.name}###judge", tip=tip, enabled=view_model.job is None, width=-1):
        state = state.asking(JudgeStone(item.name))
    draw_found(view_model.found.get("gem"), item)
    return state
