"""What controls share: their row, the tooltip that explains them, the text between them.

`widgets.py` is made of this and exports what panels need of it.
"""

from __future__ import annotations

from imgui_bundle import imgui

from .. import item_rects, theme
from .numbers import named

_LABEL_EM, _LABEL_SHARE = 8.4, 0.42
_MIN_FIELD_EM = 4.5
_TIP_EM = 26.0
_TIP_HOVERS = imgui.HoveredFlags_.for_tooltip.value | imgui.HoveredFlags_.allow_when_disabled.value
"""Combined once: it is used a hundred times a frame."""


_frame = {"is_held": False}


def hold(is_held: bool = True) -> None:
    """Note whether a control is held with the mouse or being typed in."""
    _frame["is_held"] |= is_held


def take_held() -> bool:
    """Whether any control was held since the last call."""
    is_held, _frame["is_held"] = _frame["is_held"], False
    return is_held


def begin_row(label: str, needs: float = 0.0) -> bool:
    """Draw the label and give the next item the rest of the row; True when the label was double-clicked.

    A label wider than its column pushes the field aside, or onto a line of its own, as does a field whose text `needs`
    more pixels than it would get: nothing is cut off.
    """
    shown = named(label.split("##")[0])
    room = imgui.get_content_region_avail().x
    column = min(theme.em(_LABEL_EM), _LABEL_SHARE * room)
    gap = imgui.get_style().item_inner_spacing.x
    start, hit = imgui.get_cursor_pos_x(), False
    if room - column - gap < needs:
        column = 0.0
    if shown:
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(shown)
        hit = double_clicked()
        column = max(column, imgui.calc_text_size(shown).x)
        if room - column - gap >= max(theme.em(_MIN_FIELD_EM), needs):
            imgui.same_line()  # its offset would count from a table's column, the cursor's place does not
            imgui.set_cursor_pos_x(start + column + gap)
    elif column:
        imgui.set_cursor_pos_x(start + column + gap)
    imgui.set_next_item_width(-1.0)
    return hit


def beside(label: str) -> None:
    """Put a button of this label behind the last item where there is room, else on the next line."""
    style = imgui.get_style()
    width = imgui.calc_text_size(label.split("##")[0]).x + 2.0 * style.frame_padding.x
    right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    if imgui.get_item_rect_max().x + style.item_spacing.x + width <= right:
        imgui.same_line()


def explain(label: str, tip: str, unit: str = "", how: str = "") -> None:
    """Record the last item in `item_rects` and give it its tooltip: what it does, its unit, how to handle it."""
    item_rects.note(label)
    tooltip(tip, f"Unit: {unit}" if unit else "", how)


def how_to(default: str | None) -> str:
    """The tooltip's line about typing and resetting a number."""
    return "Ctrl+click: type" + (f", double-click: back to {default}" if default else "")


def double_clicked() -> bool:
    """Whether the last item was double-clicked in this frame (with Ctrl a click means typing)."""
    return imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0) and not imgui.get_io().key_ctrl


def is_typed_in(label: str) -> bool:
    """Whether the row's number is (from this frame on) a field to type into."""
    starts = imgui.get_io().key_ctrl and imgui.is_mouse_clicked(0)
    return starts or imgui.internal.temp_input_is_active(imgui.get_id(f"##{label}"))


def tooltip(text: str, *extra: str) -> None:
    """Explain the last item when it is hovered, switched-off ones too; not while it is being dragged or typed in."""
    if not text or imgui.is_item_active() or not imgui.is_item_hovered(_TIP_HOVERS):
        return
    text, extra = named(text), tuple(map(named, extra))
    imgui.begin_tooltip()
    imgui.push_text_wrap_pos(theme.em(_TIP_EM))
    imgui.text_unformatted(text)
    with theme.coloured(theme.palette().muted):
        for line in filter(None, extra):
            imgui.text_unformatted(line)
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()


def words(text: str, colour: theme.Colour) -> None:
    """Text wrapped to the window."""
    imgui.push_text_wrap_pos(0.0)
    with theme.coloured(colour):
        imgui.text_unformatted(named(text))
    imgui.pop_text_wrap_pos()
