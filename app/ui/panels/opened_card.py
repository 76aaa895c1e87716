"""Questions about a file that was just opened, on the picture: which way is up, and what of it is glass."""

from __future__ import annotations

from imgui_bundle import imgui

from ...edit import edits
from ...edit.objects import make_glass
from ...edit.requests import StandUp
from ...edit.state import State
from ...model.materials.dielectric import DEFAULT_GLASS
from .. import item_rects, layout, theme
from ..view_model import ViewModel
from . import widgets

_GLASSES = (DEFAULT_GLASS, "N-SF11", "diamond", "water")
_BORDER_EM = 0.8
_WIDTH_EM = 26.0
_MOST_PARTS = 12
WINDOW = "##opened"

_memory = {"closed": "", "part": "0", "glass": DEFAULT_GLASS, "selected": ""}
"""The file whose questions were closed, and what was last chosen: memory of the interface."""


def draw_opened_card(state: State, view_model: ViewModel, middle_x: float, bottom: float) -> State:
    """This file's questions on the picture, whose lower border has its middle at `middle_x`, `bottom`; nothing where
    there are none or they were closed."""
    parts = [item.name for item in state.scene.objects]
    # What mirrors or diffracts makes caustics too.
    nothing_is_glass = bool(parts) and not any(item.material.is_specular for item in state.scene.objects)
    if view_model.up is None and not nothing_is_glass:
        return state
    if _memory["closed"] == view_model.title:
        return state
    imgui.set_next_window_size((theme.em(_WIDTH_EM), 0.0))
    imgui.set_next_window_pos((middle_x, bottom - theme.em(_BORDER_EM)), imgui.Cond_.always, imgui.ImVec2(0.5, 1.0))
    # Darker than fields and buttons, which must be seen on it whatever the picture.
    imgui.push_style_color(imgui.Col_.window_bg, (*theme.palette().window[:3], 0.97))
    imgui.begin(WINDOW, None, layout.ON_PICTURE)
    item_rects.note("Window: opened")
    if view_model.up is not None:
        state = _up(state, view_model)
    if nothing_is_glass:
        state = _glass(state, parts)
    if widgets.button("Close", tip="Ask no more about this file."):
        _memory["closed"] = view_model.title
    imgui.end()
    imgui.pop_style_color()
    return state


def _up(state: State, view_model: ViewModel) -> State:
    assert view_model.up is not None
    other = "z" if view_model.up == "y" else "y"
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(f"{view_model.title}: {view_model.up} is taken to be up.")
    imgui.same_line()
    tip = "Stand the file up along its other axis. It is remembered for this file."
    if widgets.button(f"{other} is up", tip=tip):
        state = state.asking(StandUp("y" if other == "y" else "z"))
    return state


def _glass(state: State, parts: list[str]) -> State:
    imgui.text_unformatted("Nothing here is glass, so there is no caustic.")
    part = str(min(_asked_part(state), len(parts) - 1))
    shown = {str(i): name for i, name in enumerate(parts) if i < _MOST_PARTS or str(i) == part}
    tip = "What is to be glass; a click on it in the picture chooses it too."
    part = widgets.combo("Part", shown, part, tip=tip)
    glass = widgets.combo("Glass", _GLASSES, _memory["glass"], tip="Others are in the dispersion panel.")
    _memory["part"], _memory["glass"] = part, glass
    if widgets.button("Make glass", tip="Make this part glass; it can be undone."):
        index = int(part)
        state = edits.attempt(state, f"Make {parts[index]} glass", make_glass, index, glass)
    imgui.same_line()
    return state


def _asked_part(state: State) -> int:
    """Index of the part that was chosen last: here, or by selecting it."""
    selected = str(state.selection.index) if state.selection.kind == "object" else ""
    if selected != _memory["selected"]:
        _memory["selected"] = selected
        _memory["part"] = selected or _memory["part"]
    return int(_memory["part"])
