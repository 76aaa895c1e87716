"""Sentences from the host in the picture's corner, over no button; shader errors in a window."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit.requests import DismissMessage, ReloadShaders
from ...edit.state import State
from .. import item_rects, layout, theme
from ..message_box import broken
from ..view_model import Message, ViewModel
from . import opened_card, widgets

_FADE_S = 1.5
_WIDTH_EM, _TOOLS_EM, _BADGES_EM = 28.0, 3.2, 2.6
"""Widths of a message and of the tools at the picture's left, height of the badges at its lower border."""
_SHADER_WINDOW = "Shader error"

_closed_shader_error = {"text": ""}
"""The shader error whose window was closed: it comes back with the next, different one."""

end_on_start_page = {"y": 0.0}
"""Where messages at the top of the window end, pixels: its buttons begin below."""


def draw_messages(state: State, view_model: ViewModel) -> State:
    """Draw what there is to say, newest at the bottom of the picture's right corner; on the start page at its top."""
    state = _shader_error(state, view_model)
    viewport, gap = imgui.get_main_viewport(), theme.em(0.4)
    right, bottom, width = viewport.work_pos.x + viewport.work_size.x - theme.em(0.8), 0.0, theme.em(_WIDTH_EM)
    top = viewport.work_pos.y + gap
    picture = imgui.internal.find_window_by_name(layout.VIEWPORT)
    is_over_picture = picture is not None and not state.preferences.panels.start_page
    if picture is not None and is_over_picture:
        right, bottom = picture.pos.x + picture.size.x - gap, picture.pos.y + picture.size.y - theme.em(_BADGES_EM)
        width = min(width, max(picture.size.x - theme.em(_TOOLS_EM + 6.5), theme.em(8.0)))
        card = imgui.internal.find_window_by_name(opened_card.WINDOW)
        if card is not None and card.active:
            bottom = min(bottom, card.pos.y - gap)
    for index in reversed(range(len(view_model.messages))):
        place, pivot = ((right, bottom), (1.0, 1.0)) if is_over_picture else ((right, top), (1.0, 0.0))
        imgui.set_next_window_pos(place, imgui.Cond_.always, imgui.ImVec2(*pivot))
        state, height = _toast(state, view_model.messages[index], index, width)
        bottom, top = bottom - height - gap, top + height + gap
    end_on_start_page["y"] = top
    return state


def _toast(state: State, message: Message, index: int, width: float) -> tuple[State, float]:
    opacity = min(max(message.left_s / _FADE_S, 0.15), 1.0)
    chosen = theme.palette()
    accent = chosen.error if message.is_error else chosen.accent
    imgui.push_style_var(imgui.StyleVar_.alpha, opacity)
    imgui.push_style_color(imgui.Col_.border, accent)
    imgui.push_style_color(imgui.Col_.window_bg, (*chosen.raised[:3], 0.97))
    imgui.begin(f"##message {index}", None, layout.ON_PICTURE | imgui.WindowFlags_.always_auto_resize)
    _put_in_front()
    with theme.coloured(accent):
        imgui.text_unformatted(icons.ICON_FA_TRIANGLE_EXCLAMATION if message.is_error else icons.ICON_FA_CIRCLE_INFO)
    imgui.same_line()
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)  # for names that are wider than that
    imgui.text_unformatted(broken(message.text, width, lambda text: imgui.calc_text_size(text).x))
    imgui.pop_text_wrap_pos()
    if message.is_error:
        imgui.same_line(0, theme.em(0.8))
        if imgui.small_button(f"{icons.ICON_FA_XMARK}##close"):
            state = state.asking(DismissMessage(message.text))
        item_rects.note(f"Close message {index}")
        widgets.tooltip("Close this message.")
    height = imgui.get_window_height()
    imgui.end()
    imgui.pop_style_color(2)
    imgui.pop_style_var()
    return state, height


def _put_in_front() -> None:
    """The message that is being drawn: over the picture, but under floating panels and dialogues."""
    own = imgui.internal.get_current_window()
    imgui.internal.bring_window_to_display_front(own)
    dialogue = imgui.internal.get_top_most_popup_modal()
    floating = [imgui.internal.find_window_by_name(title) for title in layout.floating.values()]
    for other in (dialogue, *floating):
        if other is not None:
            imgui.internal.bring_window_to_display_behind(own, other)


def _shader_error(state: State, view_model: ViewModel) -> State:
    text = view_model.shader_error
    if text is None:
        _closed_shader_error["text"] = ""
        return state
    if text == _closed_shader_error["text"]:
        return state
    imgui.set_next_window_size((theme.em(46), theme.em(16)), imgui.Cond_.appearing)
    centre = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_collapse
    shown, stays = imgui.begin(_SHADER_WINDOW, True, flags)
    if shown:
        widgets.hint("A shader does not compile. The last good one draws on; F5 compiles it again.")
        footer = imgui.get_frame_height_with_spacing()
        imgui.begin_child("##log", imgui.ImVec2(0, -footer), imgui.ChildFlags_.borders)
        imgui.push_text_wrap_pos(0.0)
        with theme.coloured(theme.palette().error):
            imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_child()
        if widgets.button("Compile again", tip="Compile the shaders from disk again (F5)."):
            state = state.asking(ReloadShaders())
        imgui.same_line()
        if widgets.button("Copy text", tip="Put file, line and message on the clipboard."):
            imgui.set_clipboard_text(text)
    imgui.end()
    if not stays:
        _closed_shader_error["text"] = text
    return state
